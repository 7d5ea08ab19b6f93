"""Origin shift: scenes that lie far from the origin are packed near it.

Embree works in float32, whose numbers are 0.0625 apart at a million metres.  Tables are computed in float64,
and are moved there.  The objects of a group far from the group's own origin, as a mesh in map coordinates that is
instanced or spins, are moved in the group, and its poses the other way.
"""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.instancing import ROTATION_ERROR
from raytracer.core.motion.resolve import Shift, Static
from raytracer.core.motion.trajectory import compose, max_rotation_radius, recentre_rotation, translate_trajectory
from raytracer.core.world_origin import Origin
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.scene.pack.layout import GroupInstances, Layout, Part
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.transform import translation_matrix

_LEAST_GAIN = 16.0
"""Least gain in accuracy for which a scene is moved; with less it keeps its kernel and its bits.

Rays then leave surfaces by less than 4 * 2^-23 * 16 = 8e-6 of what is seen, a hundredth of one of a thousand pixels.
"""

_MOST_CANDIDATES = 16
"""Most objects that are tried as the origin of the scene, those that fill the largest angles."""

Points = NDArray[np.float64]


class _ObjectBoxes(NamedTuple):
    """The boxes of the objects and instances of the world.

    middle (m) : (n, 3).
    half (m) : (n,), half the largest edge.
    distance (m) : (n,), from the camera to the box.
    group : (n,), number of the instance's group, or -1.
    stretch : (n,), largest factor by which its pose stretches coordinates.
    """

    middle: Points
    half: NDArray[np.float64]
    distance: NDArray[np.float64]
    group: NDArray[np.int64]
    stretch: NDArray[np.float64]

    def reach(self, origin: Points) -> NDArray[np.float64]:
        """Compute the largest coordinates of each, and of rays to it (n,) (m), for another origin of the world."""
        return np.asarray(np.abs(self.middle - origin).max(axis=1) + self.half + self.distance)


def shift_origin(spec: SceneSpec, layout: Layout, assets: SceneAssets) -> tuple[Layout, Origin | None]:
    """Move a layout to the origin at which float32 is most accurate, and return both; None if it stays as it is.

    Raises
    ------
    SceneError : a file of an object does not suit it.
    """
    boxes = [_around(_boxes_of(spec, layout, parts, assets)) for parts in layout.groups]
    camera = np.array(camera_at_time(spec.camera, spec.camera.shutter_interval().open).look_from)
    things = _object_boxes(spec, layout, boxes, assets, camera)
    world = _world_origin(things, camera)
    reach = things.reach(world)
    origins = np.array(
        [_group_origin(box, things.stretch[things.group == n], reach[things.group == n]) for n, box in enumerate(boxes)]
    ).reshape(-1, 3)
    if not world.any() and not origins.any():
        return layout, None
    ungrouped = [_part(part, -world) for part in layout.ungrouped]
    groups = [[_part(part, -origin) for part in parts] for parts, origin in zip(layout.groups, origins, strict=True)]
    instances = [
        _placing(instance, origins[instance.group], boxes[instance.group], world) for instance in layout.instances
    ]
    x, y, z = world.tolist()
    return layout._replace(ungrouped=ungrouped, groups=groups, instances=instances), Origin(
        (x, y, z), np.ascontiguousarray(origins) if origins.any() else None
    )


# ---- Boxes of objects


def _moved(boxes: Points, matrices: Points) -> Points:
    """Bound boxes (n, 2, 3), or one (1, 2, 3), as transformed by matrices (n, 4, 4): (n, 2, 3)."""
    middle, half = boxes.mean(axis=1), 0.5 * (boxes[:, 1] - boxes[:, 0])
    middles = np.einsum("nij,nj->ni", matrices[:, :3, :3], np.broadcast_to(middle, (len(matrices), 3)))
    middles += matrices[:, :3, 3]
    halves = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), np.broadcast_to(half, (len(matrices), 3)))
    return np.stack([middles - halves, middles + halves], axis=1)


def _around(boxes: Points) -> Points:
    """Bound boxes (n, 2, 3): (2, 3)."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _boxes_of(spec: SceneSpec, layout: Layout, parts: Sequence[Part], assets: SceneAssets) -> Points:
    """Bound parts (n, 2, 3) in the space of what they are part of, from the shutter's opening to its closing."""
    own, matrices, shifts = np.empty((len(parts), 2, 3)), np.empty((len(parts), 4, 4)), np.zeros((len(parts), 1, 3))
    for number, part in enumerate(parts):
        item = layout.items[part.item]
        with spec.errors_at(*item.keys):
            own[number] = item.spec.bounds(assets.of(item.spec, item.keys))
        matrices[number] = part.placed.matrix
        if isinstance(part.placed, Shift):
            shifts[number] = part.placed.shift
    boxes = _moved(own, matrices)
    boxes[:, :1] += np.minimum(shifts, 0.0)
    boxes[:, 1:] += np.maximum(shifts, 0.0)
    return boxes


def _object_boxes(
    spec: SceneSpec, layout: Layout, boxes: Sequence[Points], assets: SceneAssets, camera: Points
) -> _ObjectBoxes:
    """Bound the scene's parts and its instances of groups, whose boxes are `boxes`."""
    all_boxes = [_boxes_of(spec, layout, layout.ungrouped, assets)]
    groups, stretch = [-1], [np.ones(len(layout.ungrouped))]
    for instance in layout.instances:
        box = boxes[instance.group][None]
        all_boxes.append(_moved(box, instance.poses))
        stretch.append(_stretch(instance.poses))
        for rows in instance.trajectories:
            poses = np.array([compose(row) for row in rows])
            all_boxes.append(_around(_moved(box, poses))[None])
            stretch.append(_stretch(poses).max(keepdims=True))
        groups += [instance.group] * (1 + len(instance.trajectories))
    low, high = np.moveaxis(np.concatenate(all_boxes), 1, 0)
    middle, half = low + 0.5 * (high - low), 0.5 * (high - low).max(axis=1)
    distance = np.maximum(0.0, np.abs(middle - camera).max(axis=1) - half)
    group = np.repeat(groups, [len(some) for some in all_boxes])
    return _ObjectBoxes(middle, half, distance, group, np.concatenate(stretch))


def _stretch(matrices: Points) -> NDArray[np.float64]:
    """Compute the largest factor by which matrices (n, 4, 4) stretch coordinates (n,)."""
    return np.asarray(np.abs(matrices[:, :3, :3]).sum(axis=2).max(axis=1))


# ---- Choice of the origin


def _rounded(point: Points, size: float) -> Points:
    """Round a point at the scale of `size`: differences to a point of few digits keep their last bits."""
    step = 2.0 ** math.floor(math.log2(size))
    return np.asarray(step * np.round(point / step))


def _world_origin(things: _ObjectBoxes, camera: Points) -> Points:
    """Choose the origin of the packed scene, in scene coordinates; 0 if moving it gains little.

    The error of float32 hits is proportional to the extent of coordinates and rays.  For an object of half the size h,
    d away from the camera, and with its middle m away from the origin, that is m + h + d, of which the origin decides m
    alone.  Its mean over the objects is a geometric one, in which a huge ground or a lamp far away count as one among
    others; objects are weighed by h / (h + d), about the angle that they fill.
    """
    seen = things.half + things.distance
    weight = np.divide(things.half, seen, out=np.zeros_like(seen), where=seen > 0.0)
    if not weight.any():
        return np.zeros(3)

    def reach(origin: Points) -> float:
        reaches = things.reach(origin)
        there = weight > 0.0
        return float(np.exp(np.average(np.log(reaches[there]), weights=weight[there])))

    prominent = np.argsort(-weight, kind="stable")[:_MOST_CANDIDATES]
    best = min([camera, _median(things.middle, weight), *things.middle[prominent]], key=reach)
    best = _rounded(best, float(seen[prominent].min()))
    return best if reach(np.zeros(3)) >= _LEAST_GAIN * reach(best) else np.zeros(3)


def _median(points: Points, weight: NDArray[np.float64]) -> Points:
    """Compute the weighted medians of the coordinates (3,) of points (n, 3)."""
    result = []
    for column in points.T:
        order = np.argsort(column, kind="stable")
        sums = np.cumsum(weight[order])
        result.append(column[order][np.searchsorted(sums, 0.5 * sums[-1])])
    return np.array(result)


def _group_origin(box: Points, stretch: NDArray[np.float64], reach: NDArray[np.float64]) -> Points:
    """Choose the origin of a group's space, in its coordinates; 0 if moving it gains little.

    box : (2, 3), round the objects of the group.
    stretch, reach : of each of its instances (n,), the latter in the world (m).
    """
    middle, half = box.mean(axis=0), 0.5 * float((box[1] - box[0]).max())
    if half == 0.0:
        return np.zeros(3)
    # As large as they are in the world, the coordinates in the group add to the reach.
    own = float(np.abs(middle).max()) * stretch
    return _rounded(middle, half) if np.any(own + reach >= _LEAST_GAIN * reach) else np.zeros(3)


# ---- Shifts


def _part(part: Part, by: Points) -> Part:
    """Shift a part; by zero it is itself, to the bit."""
    if not by.any():
        return part
    placed: Static | Shift = part.placed._replace(matrix=translation_matrix(by) @ part.placed.matrix)
    return part._replace(placed=placed)


def _placing(instance: GroupInstances, origin: Points, box: Points, world: Points) -> GroupInstances:
    """Shift instances, for the origins of their group and of the world."""
    if not origin.any() and not world.any():
        return instance
    poses = translation_matrix(-world) @ instance.poses @ translation_matrix(origin)
    corners = np.array(list(product(*(box - origin).T)))
    size = float(np.linalg.norm(corners, axis=1).max())
    before, after = tuple(origin.tolist()), tuple((-world).tolist())
    moved = (translate_trajectory(rows, before, after) for rows in instance.trajectories)
    # An error of a float32 angle moves a small thing by that angle times the distance of its pivot.
    trajectories = tuple(
        recentre_rotation(rows, ROTATION_ERROR) if max_rotation_radius(rows) > _LEAST_GAIN * size else rows
        for rows in moved
    )
    return instance._replace(poses=poses, trajectories=trajectories)
