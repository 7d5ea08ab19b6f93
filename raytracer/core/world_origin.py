"""Origin shift: a scene far from its origin is packed about another one, since float32 is coarse far away.

What its author wrote in metres of the world, such as the cells of a checker, is looked up at the points of the scene as
it was written.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.geometry import row3
from raytracer.core.vec import Vec3, add


class Origin(NamedTuple):
    """The origin of a packed scene.

    Attributes
    ----------
    world : the point (m) of the scene as written that is the origin of the packed one.
    groups : float64 (n, 3), likewise for the space of each group that instances place; None if all are as written.
    """

    world: Vec3
    groups: NDArray[np.float64] | None


@optional
def to_authored_space(origin: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    """Transform a point of the packed scene, or of an instance's group (-1 for none), to the scene as written."""
    return point


@kernel
def _in_group(groups: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    if groups is None:
        return point
    return add(point, row3(groups, instances.group[instance]))


@to_authored_space.register(Origin)
def to_authored_space_origin(origin: Any, instances: Any, instance: int, point: Vec3) -> Vec3:
    if instance < 0:
        return add(point, origin.world)
    return _in_group(origin.groups, instances, instance, point)


@optional
def world_to_authored(origin: Any, point: Vec3) -> Vec3:
    """Transform a point of the packed scene's world to the scene as written."""
    return point


@world_to_authored.register(Origin)
def world_to_authored_origin(origin: Any, point: Vec3) -> Vec3:
    return add(point, origin.world)
