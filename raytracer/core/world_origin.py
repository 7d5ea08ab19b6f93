"""Where the origin of a packed scene lies in the scene as it was written.

A scene far from its origin is packed near another one, since float32 is coarse out there.  What its author wrote in
metres of the world, such as the cells of a checker, is looked up at the points as they were written.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import row3
from raytracer.jit import generic, kernel
from raytracer.vec import Vec3, add


class Origin(NamedTuple):
    """world, the point (m) of the scene as written that is the origin of the packed one.

    groups (n, 3) float64, likewise for the space of each group that instances place; None if all are as written.
    """

    world: Vec3
    groups: NDArray[np.float64] | None


@generic
def as_written(origin: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    """A point of the packed scene, or of the group's space of an instance, -1 for none, in the scene as written."""
    raise NotImplementedError


@as_written.register(type(None))
def _(origin: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    return point


@kernel
def _in_group(groups: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    if groups is None:
        return point
    return add(point, row3(groups, instances.group[instance]))


@as_written.register(Origin)
def _(origin: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    if instance < 0:
        return add(point, origin.world)
    return _in_group(origin.groups, instances, instance, point)


@generic
def in_world(origin: Any, point: Vec3) -> Vec3:
    """A point of the packed scene's world in the scene as written."""
    raise NotImplementedError


@in_world.register(type(None))
def _(origin: Any, point: Vec3) -> Vec3:
    return point


@in_world.register(Origin)
def _(origin: Any, point: Vec3) -> Vec3:
    return add(point, origin.world)
