"""Cameras of any kind that move while the shutter is open.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], shutter: 1/30 s, motion: {velocity: [3, 0, 0]}}
"""

from typing import Any, NamedTuple

import numpy as np

from raytracer.cameras.interface import CameraSpec, camera_ray, project
from raytracer.motion import (
    Static,
    Trajectories,
    apply_point,
    apply_vector,
    invert,
    pack_trajectories,
    place,
    pose_at,
    trajectory_of,
)
from raytracer.spec import Matrix
from raytracer.vec import normalize


class MovingCamera(NamedTuple):
    """Packed: the camera at rest, and its one trajectory, rotations and translations only."""

    camera: Any
    trajectories: Trajectories


def pack_camera(spec: CameraSpec, width: int, height: int) -> Any:
    """The packed camera for a film of width x height pixels: at rest, or moving while its shutter is open.

    Raises
    ------
    ValueError : its motion turns too often while the shutter is open.
    """
    placed = place(spec.motion, np.eye(4), spec.opening())
    if isinstance(placed, Static):
        return _posed(spec, placed.matrix).pack(width, height)
    return MovingCamera(spec.pack(width, height), pack_trajectories([trajectory_of(placed)]))


def _posed(spec: CameraSpec, matrix: Matrix) -> CameraSpec:
    """The camera moved by a rotation and translation; itself where that leaves it in its place."""
    if np.array_equal(matrix, np.eye(4)):
        return spec
    moved = {name: matrix[:3, :3] @ getattr(spec, name) + matrix[:3, 3] for name in ("look_from", "look_at")}
    moved["up"] = matrix[:3, :3] @ getattr(spec, "up")  # noqa: B009
    return spec.model_copy(update={name: tuple(map(float, vector)) for name, vector in moved.items()})


@camera_ray.register(MovingCamera)
def _(camera, x, y, time, draws):
    origin, direction, weight = camera_ray(camera.camera, x, y, time, draws)
    pose = pose_at(camera.trajectories, 0, time)
    return apply_point(pose, origin), normalize(apply_vector(pose, direction)), weight


@project.register(MovingCamera)
def _(camera, point, time):
    return project(camera.camera, apply_point(invert(pose_at(camera.trajectories, 0, time)), point), time)
