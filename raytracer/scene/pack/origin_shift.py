"""Scenes that lie far from the origin are packed near it.

Embree works in float32, whose numbers are 0.0625 apart at a million metres.  All that is packed is in float64 first,
and is moved there.  What a group holds far from the group's own origin, as a mesh in the coordinates of a map that is
instanced or spins, is moved in the group, and its poses the other way.
"""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.moving import camera_at
from raytracer.instances import TURN
from raytracer.motion import Rows, Shift, Static, arm_of, compose, shifted, steadied
from raytracer.origin import Origin
from raytracer.scene.objects import Assets, Layout, Part, Placing
from raytracer.scene.spec import SceneSpec

_LEAST_GAIN = 16.0
"""How many times as exact a scene must get to be moved; with less it keeps its kernel and its bits.

Rays then leave surfaces by less than 4 * 2^-23 * 16 = 8e-6 of what is seen, a hundredth of one of a thousand pixels.
"""

_MOST_CANDIDATES = 16
"""Objects that are tried as the middle of the scene, those that fill the largest angles."""

Points = NDArray[np.float64]


class _Things(NamedTuple):
    """What there is in the world, each object or instance by its box.

    middle (n, 3); half (n,), half the largest edge; distance (n,) from the camera to the box (m); group (n,), the
    number of the group that is placed there, or -1; stretch (n,), by how much its pose stretches coordinates of it.
    """

    middle: Points
    half: NDArray[np.float64]
    distance: NDArray[np.float64]
    group: NDArray[np.int64]
    stretch: NDArray[np.float64]

    def reach(self, origin: Points) -> NDArray[np.float64]:
        """How far the coordinates of each, and the rays to it, reach (n,) if the world has another origin (m)."""
        return np.asarray(np.abs(self.middle - origin).max(axis=1) + self.half + self.distance)


def recentred(spec: SceneSpec, layout: Layout, assets: Assets) -> tuple[Layout, Origin | None]:
    """The layout of a scene as it is best packed, and the origin of that; None for one that is left as it is.

    Raises
    ------
    SceneError : a file of an object does not suit it.
    """
    boxes = [_around(_boxes_of(spec, layout, parts, assets)) for parts in layout.groups]
    camera = np.array(_camera(spec))
    things = _things(spec, layout, boxes, assets, camera)
    world = _world_origin(things, camera)
    reach = things.reach(world)
    origins = np.array(
        [_group_origin(box, things.stretch[things.group == n], reach[things.group == n]) for n, box in enumerate(boxes)]
    ).reshape(-1, 3)
    if not world.any() and not origins.any():
        return layout, None
    plain = [_part(part, -world) for part in layout.plain]
    groups = [[_part(part, -origin) for part in parts] for parts, origin in zip(layout.groups, origins, strict=True)]
    placings = [_placing(placing, origins[placing.group], boxes[placing.group], world) for placing in layout.placings]
    x, y, z = world.tolist()
    return layout._replace(plain=plain, groups=groups, placings=placings), Origin(
        (x, y, z), np.ascontiguousarray(origins) if origins.any() else None
    )


# ---- Where things are


def _camera(spec: SceneSpec) -> tuple[float, float, float]:
    """Where the camera is when the shutter opens."""
    return camera_at(spec.camera, spec.camera.opening().open).look_from


def _moved(boxes: Points, matrices: Points) -> Points:
    """The boxes (n, 2, 3) round boxes (n, 2, 3), or one (1, 2, 3), as matrices (n, 4, 4) move them."""
    middle, half = boxes.mean(axis=1), 0.5 * (boxes[:, 1] - boxes[:, 0])
    middles = np.einsum("nij,nj->ni", matrices[:, :3, :3], np.broadcast_to(middle, (len(matrices), 3)))
    middles += matrices[:, :3, 3]
    halves = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), np.broadcast_to(half, (len(matrices), 3)))
    return np.stack([middles - halves, middles + halves], axis=1)


def _around(boxes: Points) -> Points:
    """The box (2, 3) round boxes (n, 2, 3)."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _boxes_of(spec: SceneSpec, layout: Layout, parts: Sequence[Part], assets: Assets) -> Points:
    """The boxes (n, 2, 3) of parts in the space of what they are part of, from the shutter's opening to its closing."""
    own, matrices, shifts = np.empty((len(parts), 2, 3)), np.empty((len(parts), 4, 4)), np.zeros((len(parts), 1, 3))
    for number, part in enumerate(parts):
        item = layout.items[part.item]
        try:
            own[number] = item.spec.box(assets.of(item.spec, item.keys))
        except ValueError as error:
            raise spec.error(str(error), *item.keys) from None
        matrices[number] = part.placed.matrix
        if isinstance(part.placed, Shift):
            shifts[number] = part.placed.shift
    boxes = _moved(own, matrices)
    boxes[:, :1] += np.minimum(shifts, 0.0)
    boxes[:, 1:] += np.maximum(shifts, 0.0)
    return boxes


def _things(spec: SceneSpec, layout: Layout, boxes: Sequence[Points], assets: Assets, camera: Points) -> _Things:
    """The scene's objects, one a part, and one an instance of a group, of which `boxes` has the box."""
    found = [_boxes_of(spec, layout, layout.plain, assets)]
    groups, stretch = [-1], [np.ones(len(layout.plain))]
    for placing in layout.placings:
        box = boxes[placing.group][None]
        found.append(_moved(box, placing.poses))
        stretch.append(_stretch(placing.poses))
        for rows in placing.trajectories:
            poses = np.array([compose(row) for row in rows])
            found.append(_around(_moved(box, poses))[None])
            stretch.append(_stretch(poses).max(keepdims=True))
        groups += [placing.group] * (1 + len(placing.trajectories))
    low, high = np.moveaxis(np.concatenate(found), 1, 0)
    middle, half = low + 0.5 * (high - low), 0.5 * (high - low).max(axis=1)
    distance = np.maximum(0.0, np.abs(middle - camera).max(axis=1) - half)
    group = np.repeat(groups, [len(some) for some in found])
    return _Things(middle, half, distance, group, np.concatenate(stretch))


def _stretch(matrices: Points) -> NDArray[np.float64]:
    """How many times as far from their space's origin, at most, matrices (n, 4, 4) make coordinates reach (n,)."""
    return np.asarray(np.abs(matrices[:, :3, :3]).sum(axis=2).max(axis=1))


# ---- Which origin


def _rounded(point: Points, size: float) -> Points:
    """A point with few digits, near to another at the scale of `size`: what is subtracted so keeps its last bits."""
    step = 2.0 ** math.floor(math.log2(size))
    return np.asarray(step * np.round(point / step))


def _world_origin(things: _Things, camera: Points) -> Points:
    """Where the packed scene has its origin, in the scene as it is; 0 where moving it gains little.

    Float32 hits are wrong in proportion to how far coordinates and rays reach.  For an object of half the size h, d
    away from the camera, and with its middle m away from the origin, that is m + h + d, of which the origin decides m
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
    """The weighted medians of the coordinates (3,) of points (n, 3)."""
    result = []
    for column in points.T:
        order = np.argsort(column, kind="stable")
        sums = np.cumsum(weight[order])
        result.append(column[order][np.searchsorted(sums, 0.5 * sums[-1])])
    return np.array(result)


def _group_origin(box: Points, stretch: NDArray[np.float64], reach: NDArray[np.float64]) -> Points:
    """Where a group's space has its origin, in the space as it is; 0 where moving it gains little.

    Parameters
    ----------
    box : (2, 3), round what the group holds.
    stretch, reach : of each of its instances (n,), the latter in the world (m).
    """
    middle, half = box.mean(axis=0), 0.5 * float((box[1] - box[0]).max())
    if half == 0.0:
        return np.zeros(3)
    # As large as they are in the world, the coordinates in the group add to the reach.
    own = float(np.abs(middle).max()) * stretch
    return _rounded(middle, half) if np.any(own + reach >= _LEAST_GAIN * reach) else np.zeros(3)


# ---- What is moved


def translation(by: Points) -> Points:
    """The matrix (4, 4) that displaces by a vector (3,)."""
    result = np.eye(4)
    result[:3, 3] = by
    return result


def _part(part: Part, by: Points) -> Part:
    """A part whose space is moved; itself, with its bits, if it is not."""
    if not by.any():
        return part
    placed: Static | Shift = part.placed._replace(matrix=translation(by) @ part.placed.matrix)
    return part._replace(placed=placed)


def _placing(placing: Placing, origin: Points, box: Points, world: Points) -> Placing:
    """Instances whose group has another origin, in a world that has one too."""
    if not origin.any() and not world.any():
        return placing
    poses = translation(-world) @ placing.poses @ translation(origin)
    corners = np.array(list(product(*(box - origin).T)))
    size = float(np.linalg.norm(corners, axis=1).max())
    trajectories = [_trajectory(rows, origin, world, size) for rows in placing.trajectories]
    return placing._replace(poses=poses, trajectories=tuple(trajectories))


def _trajectory(rows: Rows, origin: Points, world: Points, size: float) -> Rows:
    before, after = tuple(origin.tolist()), tuple((-world).tolist())
    moved = shifted(rows, before, after)
    # A pivot far away from a small thing is what a float32 angle moves it by.
    return steadied(moved, TURN) if arm_of(moved) > _LEAST_GAIN * size else moved
