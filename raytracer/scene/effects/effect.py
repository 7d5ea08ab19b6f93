"""Record of an effect, and the words that all effects are described with."""

from typing import NamedTuple


class Effect(NamedTuple):
    """Effect of a scene.

    active : it is simulated.
    why : the reason, in words.
    """

    active: bool
    why: str


def count(number: int, noun: str) -> str:
    """Say a number of things, in the plural where it has to be."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
