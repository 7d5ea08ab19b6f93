"""How light came: straight from what emits it and by one bounce, or by more.

On the command line:

    rt render scene.yaml -o out.exr --aov direct,indirect
"""

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.aovs.interface import AovSpec, Identities, Light, share
from raytracer.film.film import Film
from raytracer.vec import sub


class _Part(AovSpec):
    """A part of the radiance; `direct` and `indirect` add up to all of it."""

    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")
    unit: ClassVar[str] = "W/(m2 sr)"

    def pack(self, height: int, width: int, column: int, identities: Identities) -> Light:
        return Light(self.quantity(identities), np.zeros((height, width, 3)), column)

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return np.asarray(layer.sums / np.maximum(film.count, 1)[..., None])


class DirectLight(_Part):
    """Radiance by at most two path segments, what `max_depth: 2` renders: emitters as seen, and what they light."""

    type: Literal["direct"] = "direct"

    def quantity(self, identities: Identities) -> "Direct":
        return Direct()


class IndirectLight(_Part):
    """Radiance by three path segments and more: what light does after its first bounce."""

    type: Literal["indirect"] = "indirect"

    def quantity(self, identities: Identities) -> "Indirect":
        return Indirect()


class Direct(NamedTuple):
    """What came by at most two segments."""


class Indirect(NamedTuple):
    """What came by more."""


@share.register(Direct)
def _(part, value, direct):
    return direct


@share.register(Indirect)
def _(part, value, direct):
    return sub(value, direct)
