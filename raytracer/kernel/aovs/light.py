"""Direct and indirect light: radiance by at most two path segments, and by more.

On the command line:

    rt render scene.yaml -o out.exr --aov direct,indirect
"""

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.vec import sub
from raytracer.film.film import Film
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import LightLayer, light_part


class Direct(NamedTuple):
    """Radiance by at most two path segments."""


class Indirect(NamedTuple):
    """Radiance by three path segments and more."""


@light_part.register(Direct)
def light_part_direct(part, value, direct):
    return direct


@light_part.register(Indirect)
def light_part_indirect(part, value, direct):
    return sub(value, direct)


class _Part(AovSpec):
    """A part of the radiance; `direct` and `indirect` add up to all of it."""

    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")
    unit: ClassVar[str] = "W/(m2 sr)"

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> LightLayer:
        return LightLayer(self.quantity(identities), np.zeros((height, width, 3)))

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return np.asarray(layer.sums / np.maximum(film.count, 1)[..., None])


class DirectLight(_Part):
    """Radiance by at most two path segments, what `max_depth: 2` renders: emitters as seen, and what they light."""

    type: Literal["direct"] = "direct"
    measured: ClassVar[Any] = Direct


class IndirectLight(_Part):
    """Radiance by three path segments and more: what light does after its first bounce."""

    type: Literal["indirect"] = "indirect"
    measured: ClassVar[Any] = Indirect
