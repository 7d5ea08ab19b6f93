"""Record of an effect, and the words that all effects are described with."""

from typing import NamedTuple


class Effect(NamedTuple):
    """Effect of a scene.

    active : it is simulated.
    why : the reason, in words.
    """

    active: bool
    why: str
