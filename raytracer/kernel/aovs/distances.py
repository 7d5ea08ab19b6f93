"""Depth and distance of the surface that is seen.

On the command line:

    rt render scene.yaml -o out.exr --aov depth,distance
"""

import math
from typing import ClassVar, Literal, NamedTuple

from raytracer.core.vec import norm, sub
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import measure
from raytracer.plugins.cameras.base.interface import project


class Depth(AovSpec):
    """Distance along the camera's axis, from the lens plane: what compositors call Z.

    The same for all of a plane that faces the camera.  Panoramas and fisheyes have negative depths behind them.
    """

    type: Literal["depth"] = "depth"
    channels: ClassVar[tuple[str, ...]] = ("Z",)
    unit: ClassVar[str] = "m"
    empty: ClassVar[float] = math.inf

    def quantity(self, identities: SceneIds) -> "DepthQuantity":
        return DepthQuantity()


class Distance(AovSpec):
    """Distance along the camera ray, from where it leaves the camera."""

    type: Literal["distance"] = "distance"
    channels: ClassVar[tuple[str, ...]] = ("Z",)
    unit: ClassVar[str] = "m"
    empty: ClassVar[float] = math.inf

    def quantity(self, identities: SceneIds) -> "DistanceQuantity":
        return DistanceQuantity()


class DepthQuantity(NamedTuple):
    """The distance along the camera's axis."""


class DistanceQuantity(NamedTuple):
    """The distance along the camera ray."""


@measure.register(DepthQuantity)
def measure_depth_quantity(quantity, scene, seen):
    return project(scene.camera, seen.hit.point, seen.time)[2], 0.0, 0.0


@measure.register(DistanceQuantity)
def measure_distance_quantity(quantity, scene, seen):
    return norm(sub(seen.hit.point, seen.previous)), 0.0, 0.0
