"""What colour what is seen has.

On the command line:

    rt render scene.yaml -o out.exr --aov albedo
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.aovs.interface import AovSpec, Identities, measure
from raytracer.materials.interface import reflectance_at


class Albedo(AovSpec):
    """Fraction of light that the surface reflects or lets through, with its textures; black for emitters."""

    type: Literal["albedo"] = "albedo"
    channels: ClassVar[tuple[str, ...]] = ("R", "G", "B")

    def quantity(self, identities: Identities) -> "Reflectance":
        return Reflectance()


class Reflectance(NamedTuple):
    """Measured of the material."""


@measure.register(Reflectance)
def _(quantity, scene, seen):
    return reflectance_at(scene, seen.material, seen.site)
