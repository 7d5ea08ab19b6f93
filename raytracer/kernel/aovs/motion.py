"""Motion vectors in the picture of the surface that is seen.

On the command line:

    rt render scene.yaml -o out.exr --aov motion
"""

from typing import Any, ClassVar, Literal, NamedTuple

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.instancing import pose_of
from raytracer.core.motion.interpolation import apply_point
from raytracer.core.primitives.base.interface import reproject_at_time_any
from raytracer.core.shutter.table import Shutter
from raytracer.kernel.aovs.base.interface import AovSpec
from raytracer.kernel.aovs.base.layers import measure
from raytracer.plugins.cameras.base.interface import project


class MotionQuantity(NamedTuple):
    """The displacement in the picture."""


@kernel
def point_at_time(instances, scene, seen, time):
    """Return the position in the world of the point that is seen at another time."""
    local = reproject_at_time_any(scene.primitives, seen.table, seen.primitive, seen.hit, time)
    if instances is None:
        return local
    return local if seen.instance < 0 else apply_point(pose_of(instances, seen.instance, time), local)


@optional
def displacement(shutter, scene, seen):
    """Compute the film position at the shutter's closing less that at its opening."""
    return 0.0, 0.0, 0.0


@displacement.register(Shutter)
def displacement_shutter(shutter, scene, seen):
    x0, y0, _ = project(scene.camera, point_at_time(scene.instances, scene, seen, 0.0), 0.0)
    x1, y1, _ = project(scene.camera, point_at_time(scene.instances, scene, seen, 1.0), 1.0)
    return x1 - x0, y1 - y0, 0.0


@measure.register(MotionQuantity)
def measure_motion_quantity(quantity, scene, seen):
    return displacement(scene.shutter, scene, seen)


class Motion(AovSpec):
    """Displacement in the picture, while the shutter is open, of the point of the surface that is seen.

    Of a rolling shutter, from where the first line begins to open to where the last is closed.
    X to the right and Y down, as pixels are counted; of the object's motion and of the camera's.  Points that pass
    behind the camera are left out; a panorama's edge is not crossed the short way.
    """

    type: Literal["motion"] = "motion"
    channels: ClassVar[tuple[str, ...]] = ("X", "Y")
    unit: ClassVar[str] = "px"
    measured: ClassVar[Any] = MotionQuantity
