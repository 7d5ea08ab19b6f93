"""How what is seen moves in the picture.

On the command line:

    rt render scene.yaml -o out.exr --aov motion
"""

from typing import ClassVar, Literal, NamedTuple

from raytracer.aovs.interface import AovSpec, Identities, measure
from raytracer.cameras.interface import project
from raytracer.instances import Instances, pose_of
from raytracer.jit import generic
from raytracer.motion import apply_point
from raytracer.primitives.interface import carry_any
from raytracer.shutter import Shutter


class Motion(AovSpec):
    """Displacement in the picture, while the shutter is open, of the point of the surface that is seen.

    Of a rolling shutter, from where the first line begins to open to where the last is closed.
    X to the right and Y down, as pixels are counted; of the object's motion and of the camera's.  Points that pass
    behind the camera are left out; a panorama's edge is not crossed the short way.
    """

    type: Literal["motion"] = "motion"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y")
    unit: ClassVar[str] = "px"

    def quantity(self, identities: Identities) -> "Displacement":
        return Displacement()


class Displacement(NamedTuple):
    """Measured in the picture."""


@generic
def follow(instances, scene, seen, time):
    """Where in the world the point that is seen is at another time."""
    raise NotImplementedError


@follow.register(type(None))
def _(instances, scene, seen, time):
    return carry_any(scene.primitives, seen.table, seen.primitive, seen.hit, time)


@follow.register(Instances)
def _(instances, scene, seen, time):
    local = carry_any(scene.primitives, seen.table, seen.primitive, seen.hit, time)
    return local if seen.instance < 0 else apply_point(pose_of(instances, seen.instance, time), local)


@generic
def displacement(shutter, scene, seen):
    """Film position at the shutter's closing less that at its opening."""
    raise NotImplementedError


@displacement.register(type(None))
def _(shutter, scene, seen):
    return 0.0, 0.0, 0.0


@displacement.register(Shutter)
def _(shutter, scene, seen):
    x0, y0, _ = project(scene.camera, follow(scene.instances, scene, seen, 0.0), 0.0)
    x1, y1, _ = project(scene.camera, follow(scene.instances, scene, seen, 1.0), 1.0)
    return x1 - x0, y1 - y0, 0.0


@measure.register(Displacement)
def _(quantity, scene, seen):
    return displacement(scene.shutter, scene, seen)
