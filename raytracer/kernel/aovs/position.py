"""Position of the surface that is seen.

On the command line:

    rt render scene.yaml -o out.exr --aov position
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.core.world_origin import world_to_authored
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import measure


class Position(AovSpec):
    """Point in world space, when it was seen."""

    type: Literal["position"] = "position"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")
    unit: ClassVar[str] = "m"

    def quantity(self, identities: SceneIds) -> "PositionQuantity":
        return PositionQuantity()


class PositionQuantity(NamedTuple):
    """The position in the world."""


@measure.register(PositionQuantity)
def measure_position_quantity(quantity, scene, seen):
    return world_to_authored(scene.origin, seen.hit.point)
