"""Albedo of the surface that is seen.

On the command line:

    rt render scene.yaml -o out.exr --aov albedo
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import measure
from raytracer.plugins.materials.base.dispatch import reflectance_at


class Albedo(AovSpec):
    """Fraction of light that the surface reflects or lets through, with its textures; black for emitters."""

    type: Literal["albedo"] = "albedo"
    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")

    def quantity(self, identities: SceneIds) -> "AlbedoQuantity":
        return AlbedoQuantity()


class AlbedoQuantity(NamedTuple):
    """The reflectance of the material."""


@measure.register(AlbedoQuantity)
def measure_albedo_quantity(quantity, scene, seen):
    return reflectance_at(scene, seen.material, seen.site)
