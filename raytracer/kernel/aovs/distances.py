"""How far away what is seen is.

On the command line:

    rt render scene.yaml -o out.exr --aov depth,distance
"""

import math
from typing import ClassVar, Literal, NamedTuple

from raytracer.aovs.interface import AovSpec, Identities, measure
from raytracer.cameras.interface import project
from raytracer.vec import norm, sub


class Depth(AovSpec):
    """Distance along the camera's axis, from the lens plane: what compositors call Z.

    The same for all of a plane that faces the camera.  Panoramas and fisheyes have negative depths behind them.
    """

    type: Literal["depth"] = "depth"
    channels: ClassVar[tuple[str, ...]] = ("Z",)
    unit: ClassVar[str] = "m"
    empty: ClassVar[float] = math.inf

    def quantity(self, identities: Identities) -> "DepthOf":
        return DepthOf()


class Distance(AovSpec):
    """Distance along the camera ray, from where it leaves the camera."""

    type: Literal["distance"] = "distance"
    channels: ClassVar[tuple[str, ...]] = ("Z",)
    unit: ClassVar[str] = "m"
    empty: ClassVar[float] = math.inf

    def quantity(self, identities: Identities) -> "DistanceOf":
        return DistanceOf()


class DepthOf(NamedTuple):
    """Measured along the axis."""


class DistanceOf(NamedTuple):
    """Measured along the ray."""


@measure.register(DepthOf)
def _(quantity, scene, seen):
    return project(scene.camera, seen.hit.point, seen.time)[2], 0.0, 0.0


@measure.register(DistanceOf)
def _(quantity, scene, seen):
    return norm(sub(seen.hit.point, seen.origin)), 0.0, 0.0
