"""The surface that is seen: its position, depth and distance, normals, and albedo.

On the command line:

    rt render scene.yaml -o out.exr --aov position,depth,distance,normal,geometric_normal,albedo
"""

import math
from typing import Any, ClassVar, Literal, NamedTuple

from raytracer.core.vec import neg, norm, sub
from raytracer.core.world_origin import world_to_authored
from raytracer.kernel.aovs.base.interface import AovSpec
from raytracer.kernel.aovs.base.layers import measure
from raytracer.plugins.cameras.base.interface import axial_depth
from raytracer.plugins.materials.base.dispatch import reflectance_at


class PositionQuantity(NamedTuple):
    """The position in the world."""


@measure.register(PositionQuantity)
def measure_position_quantity(quantity, scene, seen):
    return world_to_authored(scene.origin, seen.hit.point)


class Position(AovSpec):
    """Point in world space, when it was seen."""

    type: Literal["position"] = "position"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")
    unit: ClassVar[str] = "m"
    measured: ClassVar[Any] = PositionQuantity


class DepthQuantity(NamedTuple):
    """The distance along the camera's axis."""


@measure.register(DepthQuantity)
def measure_depth_quantity(quantity, scene, seen):
    return axial_depth(scene.camera, seen.hit.point, seen.previous, seen.time), 0.0, 0.0


class Depth(AovSpec):
    """Distance along the camera's axis, from the lens plane: what compositors call Z.

    The same for all of a plane that faces the camera.  Panoramas and fisheyes have negative depths behind them.
    """

    type: Literal["depth"] = "depth"
    channels: ClassVar[tuple[str, ...]] = ("Z",)
    unit: ClassVar[str] = "m"
    empty: ClassVar[float] = math.inf
    measured: ClassVar[Any] = DepthQuantity


class DistanceQuantity(NamedTuple):
    """The distance along the camera ray."""


@measure.register(DistanceQuantity)
def measure_distance_quantity(quantity, scene, seen):
    return norm(sub(seen.hit.point, seen.previous)), 0.0, 0.0


class Distance(AovSpec):
    """Distance along the camera ray, from where it leaves the camera."""

    type: Literal["distance"] = "distance"
    channels: ClassVar[tuple[str, ...]] = ("Z",)
    unit: ClassVar[str] = "m"
    empty: ClassVar[float] = math.inf
    measured: ClassVar[Any] = DistanceQuantity


class ShadingNormalQuantity(NamedTuple):
    """The shading normal."""


@measure.register(ShadingNormalQuantity)
def measure_shading_normal_quantity(quantity, scene, seen):
    return seen.normal


class Normal(AovSpec):
    """Shading normal in world space, on the camera's side: with smooth meshes, bump and normal maps.

    A mean of unit vectors, which is shorter than 1 where they differ within a pixel.
    """

    type: Literal["normal"] = "normal"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")
    measured: ClassVar[Any] = ShadingNormalQuantity


class GeometricNormalQuantity(NamedTuple):
    """The normal of the true surface."""


@measure.register(GeometricNormalQuantity)
def measure_geometric_normal_quantity(quantity, scene, seen):
    return seen.hit.normal if seen.front else neg(seen.hit.normal)


class GeometricNormal(AovSpec):
    """Normal of the true surface in world space, on the camera's side: meshes show their facets."""

    type: Literal["geometric_normal"] = "geometric_normal"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")
    measured: ClassVar[Any] = GeometricNormalQuantity


class AlbedoQuantity(NamedTuple):
    """The reflectance of the material."""


@measure.register(AlbedoQuantity)
def measure_albedo_quantity(quantity, scene, seen):
    return reflectance_at(scene, seen.material, seen.site)


class Albedo(AovSpec):
    """Fraction of light that the surface reflects or lets through, with its textures; black for emitters."""

    type: Literal["albedo"] = "albedo"
    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")
    measured: ClassVar[Any] = AlbedoQuantity
