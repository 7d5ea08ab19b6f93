"""Normals of the surface that is seen.

On the command line:

    rt render scene.yaml -o out.exr --aov normal,geometric_normal
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.core.vec import neg
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import measure


class Normal(AovSpec):
    """Shading normal in world space, on the camera's side: with smooth meshes, bump and normal maps.

    A mean of unit vectors, which is shorter than 1 where they differ within a pixel.
    """

    type: Literal["normal"] = "normal"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")

    def quantity(self, identities: SceneIds) -> "ShadingNormalQuantity":
        return ShadingNormalQuantity()


class GeometricNormal(AovSpec):
    """Normal of the true surface in world space, on the camera's side: meshes show their facets."""

    type: Literal["geometric_normal"] = "geometric_normal"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")

    def quantity(self, identities: SceneIds) -> "GeometricNormalQuantity":
        return GeometricNormalQuantity()


class ShadingNormalQuantity(NamedTuple):
    """The shading normal."""


class GeometricNormalQuantity(NamedTuple):
    """The normal of the true surface."""


@measure.register(ShadingNormalQuantity)
def measure_shading_normal_quantity(quantity, scene, seen):
    return seen.normal


@measure.register(GeometricNormalQuantity)
def measure_geometric_normal_quantity(quantity, scene, seen):
    return seen.hit.normal if seen.front else neg(seen.hit.normal)
