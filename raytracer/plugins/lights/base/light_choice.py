"""Choice of one light of a table: by power alone, from an alias table; `light_tree` registers another way."""

from typing import Any

from raytracer.core.compiler.dispatch import generic, overridable
from raytracer.core.sampling.alias import AliasTable, sample_alias
from raytracer.core.vec import Vec3


@generic
def choose_light(choice, point, u):
    """Choose a light for a point by a number in [0, 1): its row, the probability, and a new number in [0, 1).

    The probability is 0 where no light of the table can reach the point.
    """


@choose_light.register(AliasTable)
def choose_light_by_power(choice, point, u):
    # One light needs no choice.
    if len(choice.pmf) == 1:
        return 0, 1.0, u
    return sample_alias(choice, u)


@generic
def light_probability(choice, point, row):
    """Return the probability with which `choose_light` chooses a row for a point."""


@light_probability.register(AliasTable)
def light_probability_by_power(choice, point, row):
    return choice.pmf[row]


@overridable
def translate_choice(choice: Any, by: Vec3) -> Any:
    """Move the lights by a vector (m); by default, as by power, a choice does not know where they are."""
    return choice


@generic
def count_lights(choice):
    """Return the number of lights that a choice is among."""


@count_lights.register(AliasTable)
def count_lights_alias(choice):
    return len(choice.pmf)
