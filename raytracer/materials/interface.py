"""What every material kind gives to kernels.

A kind's file holds its YAML spec, its packed table (one row a material), the record that one row makes for a hit,
and its cases of the functions below.  Directions are unit vectors; `normal` is turned against the incoming
`direction`; `front` says whether the ray came from the outside of the surface.
"""

import math
from typing import Any, NamedTuple

from raytracer.jit import generic, kernel, switch
from raytracer.spec import Spec
from raytracer.vec import Vec3

BLACK = (0.0, 0.0, 0.0)


class MaterialSpec(Spec):
    """Base of the materials: what packing asks of each."""

    type: str

    @staticmethod
    def pack(specs: Any) -> Any:
        """The table of materials of this kind, one row a spec."""
        raise NotImplementedError

    def is_lit(self) -> bool:
        """Whether light that arrives from a chosen direction can leave in another (not so for mirrors and glass)."""
        return False

    def exitance(self) -> float:
        """What a square metre radiates, in any unit that is the same for all materials: how often to aim at it."""
        return 0.0


class Scatter(NamedTuple):
    """A direction drawn by a material.

    direction, unit; weight = f |cos| / pdf by channel, zero where the path ends; pdf (1/sr), infinite for a
    direction without choice (mirror, glass), which no light sample could have found.
    """

    direction: Vec3
    weight: Vec3
    pdf: float


class Draws(NamedTuple):
    """Where a material takes its random numbers from: see sampling.interface."""

    sampler: Any
    key: int
    index: int  # type: ignore[assignment]  # takes the place of tuple.index
    dimension: int


# Slots of random numbers within one bounce, each a dimension of its own (or two); a slot not drawn costs nothing.
LOBE, DIRECTION, LIGHT, LIGHT_POINT, ROULETTE, SLOTS = 0, 1, 2, 3, 4, 8


@generic
def row(table, index):
    """The parameters of material `index` as a record of scalars (a table of arrays handed on compiles 60x slower)."""
    raise NotImplementedError


@generic
def scatter(material, direction, normal, front, draws):
    """Draw where light goes that arrives along `direction`: a Scatter."""
    raise NotImplementedError


@generic
def evaluate(material, direction, normal, front, outgoing):
    """f |cos| by channel toward `outgoing`, and the pdf (1/sr) with which `scatter` draws it; zero without choice."""
    raise NotImplementedError


@generic
def emission(material, front):
    """Radiance that leaves the surface on the side named by `front`."""
    raise NotImplementedError


def _scatter_row(table, index, direction, normal, front, draws):
    return scatter(row(table, index), direction, normal, front, draws)


def _evaluate_row(table, index, direction, normal, front, outgoing):
    return evaluate(row(table, index), direction, normal, front, outgoing)


def _emission_row(table, index, front):
    return emission(row(table, index), front)


_scatter_any = switch(kernel(_scatter_row))
_evaluate_any = switch(kernel(_evaluate_row))
_emission_any = switch(kernel(_emission_row))


# A primitive names its material by one number, row * kinds + kind: the kinds are a constant of the compiled scene.


@kernel
def scatter_at(materials, reference, direction, normal, front, draws):
    """`scatter` of the material that a primitive refers to."""
    kinds = len(materials)
    return _scatter_any(materials, reference % kinds, reference // kinds, direction, normal, front, draws)


@kernel
def evaluate_at(materials, reference, direction, normal, front, outgoing):
    """`evaluate` of the material that a primitive refers to."""
    kinds = len(materials)
    return _evaluate_any(materials, reference % kinds, reference // kinds, direction, normal, front, outgoing)


@kernel
def emission_at(materials, reference, front):
    """`emission` of the material that a primitive refers to."""
    kinds = len(materials)
    return _emission_any(materials, reference % kinds, reference // kinds, front)


@kernel
def absorbed(direction: Vec3) -> Scatter:
    """The end of a path."""
    return Scatter(direction, BLACK, math.inf)
