"""Which way what is seen faces.

On the command line:

    rt render scene.yaml -o out.exr --aov normal,geometric_normal
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.aovs.interface import AovSpec, Identities, measure
from raytracer.vec import neg


class Normal(AovSpec):
    """Shading normal in world space, on the camera's side: with smooth meshes, bump and normal maps.

    A mean of unit vectors, which is shorter than 1 where they differ within a pixel.
    """

    type: Literal["normal"] = "normal"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")

    def quantity(self, identities: Identities) -> "ShadingNormal":
        return ShadingNormal()


class GeometricNormal(AovSpec):
    """Normal of the true surface in world space, on the camera's side: meshes show their facets."""

    type: Literal["geometric_normal"] = "geometric_normal"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")

    def quantity(self, identities: Identities) -> "TrueNormal":
        return TrueNormal()


class ShadingNormal(NamedTuple):
    """Measured as shaded."""


class TrueNormal(NamedTuple):
    """Measured as the surface is."""


@measure.register(ShadingNormal)
def _(quantity, scene, seen):
    return seen.normal


@measure.register(TrueNormal)
def _(quantity, scene, seen):
    return seen.hit.normal if seen.front else neg(seen.hit.normal)
