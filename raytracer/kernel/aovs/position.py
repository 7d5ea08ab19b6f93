"""Where in the world what is seen is.

On the command line:

    rt render scene.yaml -o out.exr --aov position
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.aovs.interface import AovSpec, Identities, measure
from raytracer.origin import in_world


class Position(AovSpec):
    """Point in world space, when it was seen."""

    type: Literal["position"] = "position"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y", "Z")
    unit: ClassVar[str] = "m"

    def quantity(self, identities: Identities) -> "Place":
        return Place()


class Place(NamedTuple):
    """Measured in the world."""


@measure.register(Place)
def _(quantity, scene, seen):
    return in_world(scene.origin, seen.hit.point)
