"""Motion of cameras of any kind while the shutter is open.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], shutter: 1/30 s, motion: {velocity: [3, 0, 0]}}
    camera: {type: pinhole, look_from: [0, 1, 4], shutter: 1/8 s, shake: {amplitude: 0.1 deg, bandwidth: 10 Hz}}
"""

import math
from typing import Any, NamedTuple

import numpy as np

from raytracer.core.camera_shake import Shake, shake_trajectory
from raytracer.core.motion.interpolation import (
    Trajectories,
    apply_point,
    apply_vector,
    invert,
    pack_trajectories,
    pose_at,
)
from raytracer.core.motion.resolve import Moving, Shift, Static, matrix_at, resolve_motion, trajectory_of
from raytracer.core.motion.trajectory import MAX_STEPS, Rows, compose_trajectories, conjugate_trajectory
from raytracer.core.vec import Vec3, normalize
from raytracer.plugins.cameras.base import interface
from raytracer.plugins.cameras.base.placement import PlacedSpec
from raytracer.schema.transform import Matrix


class MovingCamera(NamedTuple):
    """Packed camera that moves.

    camera : the camera at rest.
    trajectories : its one trajectory, of rotations and translations only.
    """

    camera: Any
    trajectories: Trajectories


def pack_camera(spec: PlacedSpec, width: int, height: int, assets: interface.Assets = interface.NO_ASSETS) -> Any:
    """Pack a camera for a film of width x height pixels: at rest, or moving while its shutter is open.

    Raises
    ------
    ValueError : its motion turns too often while the shutter is open.
    """
    shutter = spec.shutter_interval()
    placed = resolve_motion(spec.motion, np.eye(4), shutter)
    if spec.shake is not None and spec.shake.amplitude > 0.0 and shutter.close > shutter.open:
        return MovingCamera(
            spec.pack(width, height, assets), pack_trajectories([_shake_trajectory(spec, spec.shake, placed)])
        )
    if isinstance(placed, Static):
        return _transform_camera(spec, placed.matrix).pack(width, height, assets)
    return MovingCamera(spec.pack(width, height, assets), pack_trajectories([trajectory_of(placed)]))


def _shake_trajectory(spec: PlacedSpec, shake: Shake, placed: Static | Shift | Moving) -> Rows:
    """Return the trajectory of a camera that shakes while its motion carries it."""
    own = trajectory_of(placed)
    segments = max(1, len(own) - 1)
    # Few steps would leave too little of a motion that turns, where it and the shake are composed.
    segments *= math.ceil((MAX_STEPS - 1) / segments) if isinstance(placed, Moving) else 1
    frame = spec.frame()
    axes = np.array([frame.right, frame.up, frame.forward])
    hand = shake_trajectory(shake, frame.origin, axes, spec.shutter_interval(), segments)
    return compose_trajectories(own, hand, len(hand))


def camera_at_time(spec: PlacedSpec, time: float) -> PlacedSpec:
    """Return the camera at rest in the place where its motion has brought it at a time of the scene (s)."""
    return spec if spec.motion is None else _transform_camera(spec, matrix_at(spec.motion, time))


def _transform_camera(spec: PlacedSpec, matrix: Matrix) -> PlacedSpec:
    """Move the camera by a rotation and translation; itself where that leaves it in its place."""
    if np.array_equal(matrix, np.eye(4)):
        return spec
    moved = {name: matrix[:3, :3] @ getattr(spec, name) + matrix[:3, 3] for name in ("look_from", "look_at")}
    moved["up"] = matrix[:3, :3] @ spec.up
    return spec.model_copy(update={name: tuple(map(float, vector)) for name, vector in moved.items()})


@interface.film_corner.register(MovingCamera)
def film_corner_moving_camera(camera, x, y):
    return interface.film_corner(camera.camera, x, y)


@interface.film_to_view.register(MovingCamera)
def film_to_view_moving_camera(camera, x, y):
    return interface.film_to_view(camera.camera, x, y)


@interface.packet_rays.register(MovingCamera)
def packet_rays_moving_camera(camera):
    return interface.packet_rays(camera.camera)


@interface.set_lane.register(MovingCamera)
def set_lane_moving_camera(camera, rows, lane, x, y, draws):
    interface.set_lane(camera.camera, rows, lane, x, y, draws)


@interface.trace_lanes.register(MovingCamera)
def trace_lanes_moving_camera(camera, rows):
    interface.trace_lanes(camera.camera, rows)


@interface.share_wavelengths.register(MovingCamera)
def share_wavelengths_moving_camera(camera, sharing, rows, others, x, y):
    interface.share_wavelengths(camera.camera, sharing, rows, others, x, y)


@interface.lane_ray.register(MovingCamera)
def lane_ray_moving_camera(camera, rows, lane, x, y, time, draws):
    origin, direction, weight = interface.lane_ray(camera.camera, rows, lane, x, y, time, draws)
    pose = pose_at(camera.trajectories, 0, time)
    return apply_point(pose, origin), normalize(apply_vector(pose, direction)), weight


@interface.camera_ray.register(MovingCamera)
def camera_ray_moving_camera(camera, x, y, time, draws):
    origin, direction, weight = interface.camera_ray(camera.camera, x, y, time, draws)
    pose = pose_at(camera.trajectories, 0, time)
    return apply_point(pose, origin), normalize(apply_vector(pose, direction)), weight


@interface.project.register(MovingCamera)
def project_moving_camera(camera, point, time):
    return interface.project(camera.camera, apply_point(invert(pose_at(camera.trajectories, 0, time)), point), time)


@interface.axial_depth.register(MovingCamera)
def axial_depth_moving_camera(camera, point, start, time):
    back = invert(pose_at(camera.trajectories, 0, time))
    return interface.axial_depth(camera.camera, apply_point(back, point), apply_point(back, start), time)


@interface.camera_defocus.register(MovingCamera)
def camera_defocus_moving_camera(camera: Any) -> Any:
    return interface.camera_defocus(camera.camera)


@interface.camera_parts.register(MovingCamera)
def camera_parts_moving_camera(camera: Any) -> Any:
    return interface.camera_parts(camera.camera)._replace(moves=True)


@interface.translate_camera.register(MovingCamera)
def translate_camera_moving_camera(camera: Any, by: Vec3) -> Any:
    own = camera.trajectories
    return MovingCamera(
        interface.translate_camera(camera.camera, by), own._replace(rows=conjugate_trajectory(own.rows, by))
    )
