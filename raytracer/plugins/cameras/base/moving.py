"""Cameras of any kind that move while the shutter is open.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], shutter: 1/30 s, motion: {velocity: [3, 0, 0]}}
    camera: {type: pinhole, look_from: [0, 1, 4], shutter: 1/8 s, shake: {amplitude: 0.1 deg, bandwidth: 10 Hz}}
"""

import math
from typing import Any, NamedTuple

import numpy as np

from raytracer.cameras.interface import (
    NO_ASSETS,
    Assets,
    camera_ray,
    film_corner,
    lane_ray,
    moved,
    place_in_view,
    project,
    rays_together,
    set_lane,
    share_lanes,
    trace_lanes,
)
from raytracer.cameras.placement import PlacedSpec
from raytracer.motion import (
    MOST_STEPS,
    Moving,
    Rows,
    Shift,
    Static,
    Trajectories,
    apply_point,
    apply_vector,
    composed,
    conjugated,
    invert,
    matrix_at,
    pack_trajectories,
    place,
    pose_at,
    trajectory_of,
)
from raytracer.shake import Shake, shaken
from raytracer.spec import Matrix
from raytracer.vec import Vec3, normalize


class MovingCamera(NamedTuple):
    """Packed: the camera at rest, and its one trajectory, rotations and translations only."""

    camera: Any
    trajectories: Trajectories


def pack_camera(spec: PlacedSpec, width: int, height: int, assets: Assets = NO_ASSETS) -> Any:
    """The packed camera for a film of width x height pixels: at rest, or moving while its shutter is open.

    Raises
    ------
    ValueError : its motion turns too often while the shutter is open.
    """
    shutter = spec.opening()
    placed = place(spec.motion, np.eye(4), shutter)
    if spec.shake is not None and spec.shake.amplitude > 0.0 and shutter.close > shutter.open:
        return MovingCamera(spec.pack(width, height, assets), pack_trajectories([_shaken(spec, spec.shake, placed)]))
    if isinstance(placed, Static):
        return _posed(spec, placed.matrix).pack(width, height, assets)
    return MovingCamera(spec.pack(width, height, assets), pack_trajectories([trajectory_of(placed)]))


def _shaken(spec: PlacedSpec, shake: Shake, placed: Static | Shift | Moving) -> Rows:
    """The trajectory of a camera that shakes as seen from where its motion carries it."""
    own = trajectory_of(placed)
    segments = max(1, len(own) - 1)
    # Few steps would leave too little of a motion that turns, where it and the shake are composed.
    segments *= math.ceil((MOST_STEPS - 1) / segments) if isinstance(placed, Moving) else 1
    frame = spec.frame()
    axes = np.array([frame.right, frame.up, frame.forward])
    hand = shaken(shake, frame.origin, axes, spec.opening(), segments)
    return composed(own, hand, len(hand))


def camera_at(spec: PlacedSpec, time: float) -> PlacedSpec:
    """The camera where its motion has brought it at a time of the scene (s), at rest."""
    return spec if spec.motion is None else _posed(spec, matrix_at(spec.motion, time))


def _posed(spec: PlacedSpec, matrix: Matrix) -> PlacedSpec:
    """The camera moved by a rotation and translation; itself where that leaves it in its place."""
    if np.array_equal(matrix, np.eye(4)):
        return spec
    moved = {name: matrix[:3, :3] @ getattr(spec, name) + matrix[:3, 3] for name in ("look_from", "look_at")}
    moved["up"] = matrix[:3, :3] @ spec.up
    return spec.model_copy(update={name: tuple(map(float, vector)) for name, vector in moved.items()})


@film_corner.register(MovingCamera)
def _(camera, x, y):
    return film_corner(camera.camera, x, y)


@place_in_view.register(MovingCamera)
def _(camera, x, y):
    return place_in_view(camera.camera, x, y)


@rays_together.register(MovingCamera)
def _(camera):
    return rays_together(camera.camera)


@set_lane.register(MovingCamera)
def _(camera, rows, lane, x, y, draws):
    set_lane(camera.camera, rows, lane, x, y, draws)


@trace_lanes.register(MovingCamera)
def _(camera, rows):
    trace_lanes(camera.camera, rows)


@share_lanes.register(MovingCamera)
def _(camera, sharing, rows, others, x, y):
    share_lanes(camera.camera, sharing, rows, others, x, y)


@lane_ray.register(MovingCamera)
def _(camera, rows, lane, x, y, time, draws):
    origin, direction, weight = lane_ray(camera.camera, rows, lane, x, y, time, draws)
    pose = pose_at(camera.trajectories, 0, time)
    return apply_point(pose, origin), normalize(apply_vector(pose, direction)), weight


@camera_ray.register(MovingCamera)
def _(camera, x, y, time, draws):
    origin, direction, weight = camera_ray(camera.camera, x, y, time, draws)
    pose = pose_at(camera.trajectories, 0, time)
    return apply_point(pose, origin), normalize(apply_vector(pose, direction)), weight


@project.register(MovingCamera)
def _(camera, point, time):
    return project(camera.camera, apply_point(invert(pose_at(camera.trajectories, 0, time)), point), time)


@moved.register(MovingCamera)
def _(camera: Any, by: Vec3) -> Any:
    own = camera.trajectories
    return MovingCamera(moved(camera.camera, by), own._replace(rows=conjugated(own.rows, by)))
