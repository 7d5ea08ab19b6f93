"""Pinhole cameras anywhere in the scene of a light field, and their paths: round a point, and through given poses."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Plane, Pose
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]
Point = tuple[float, float, float]

_UP: Point = (0.0, 1.0, 0.0)
_FEWEST = 2


class FreeCamera(NamedTuple):
    """A pinhole camera.

    pose : in the scene.
    plane : the image plane at a distance of 1.
    width, height (px) : of its picture.
    """

    pose: Pose
    plane: Plane
    width: int
    height: int

    def row(self) -> FloatArray:
        """Return the numbers that kernels take, float64 (15,)."""
        return np.concatenate([np.ravel(np.array(self.pose)), np.array(self.plane)])

    def finer(self, times: int) -> "FreeCamera":
        """Return the camera with `times` as many pixels a side."""
        plane = self.plane._replace(pixel=self.plane.pixel / times)
        return self._replace(plane=plane, width=self.width * times, height=self.height * times)


def free_camera(
    look_from: Point,
    look_at: Point,
    views: PosedViews,
    *,
    up: Point = _UP,
    vfov: float | None = None,
    size: tuple[int, int] | None = None,
) -> FreeCamera:
    """Make the camera at a place that has another place in the middle of its picture.

    Parameters
    ----------
    look_from, look_at (m) : the two places.
    views : those of the light field, whose size and field of view are the defaults.
    up : direction that is up in the picture.
    vfov (deg) : vertical field of view.
    size (px) : width and height of the picture.

    Raises
    ------
    InputError : the places are the same, `up` is along the view, or the field of view is none.
    """
    forward = np.subtract(look_at, look_from)
    right = np.cross(forward, up)
    distance, across = float(np.linalg.norm(forward)), float(np.linalg.norm(right))
    if not (math.isfinite(distance) and distance > 0.0):
        raise InputError("a camera looks from one place towards another, and both are the same")
    if not across > np.finfo(np.float64).eps * distance * float(np.linalg.norm(up)):
        raise InputError("up is along the view, so that no direction is up in the picture: give another")
    right /= across
    forward /= distance
    width, height = (views.width, views.height) if size is None else size
    top = 0.5 * views.height * float(np.median(views.plane[..., 0]))
    if vfov is not None:
        if not 0.0 < vfov < 180.0:
            raise InputError(f"the vertical field of view must be between 0 and 180 deg, got {vfov:g}")
        top = math.tan(0.5 * math.radians(vfov))
    pixel = 2.0 * top / height
    pose = Pose.of([look_from, right, np.cross(right, forward), forward])
    return FreeCamera(pose, Plane(pixel, -0.5 * pixel * width, top), width, height)


def orbit(look_from: Point, look_at: Point, *, up: Point = _UP, frames: int = 24) -> FloatArray:
    """Sample a circle round the axis through a place, from another place on: places (frames, 3).

    Raises
    ------
    InputError : there are too few frames, or the start is on the axis.
    """
    _check_frames(frames)
    axis = np.array(up) / np.linalg.norm(up)
    start = np.subtract(look_from, look_at)
    along = (start @ axis) * axis
    out = start - along
    if not np.linalg.norm(out) > np.finfo(np.float64).eps * np.linalg.norm(start):
        raise InputError("an orbit goes round the axis `up` through the place looked at, and begins on it")
    angle = 2.0 * math.pi * np.arange(frames)[:, None] / frames
    return np.asarray(look_at + along + np.cos(angle) * out + np.sin(angle) * np.cross(axis, out))


def path_through(places: Sequence[Point], *, frames: int = 24) -> FloatArray:
    """Sample a smooth path through places, the first and the last included: (frames, 3).

    Each part between two places takes as many frames as the next; a natural cubic spline.

    Raises
    ------
    InputError : there are too few places or frames.
    """
    from scipy.interpolate import CubicSpline

    _check_frames(frames)
    if len(places) < _FEWEST:
        raise InputError(f"a path needs at least {_FEWEST} places, got {len(places)}")
    spline = CubicSpline(np.arange(len(places)), np.array(places), bc_type="natural")
    return np.asarray(spline(np.linspace(0.0, len(places) - 1.0, frames)))


def _check_frames(frames: int) -> None:
    if frames < _FEWEST:
        raise InputError(f"a path needs at least {_FEWEST} frames, got {frames}")
