"""Intrinsics of a light-field camera: where a point of space is seen in each of its views.

A point P = (X, Y, Z), right, down and forward, is seen by the view at u at the slope

    x = (X, Y) / Z - u (1 / Z - w0),

as `film.light_field.views` has it, and after the distortion of the main lens, which acts on the plane of the
microlenses, at x (1 + k1 r2 + k2 r2^2) with r2 = |x|^2.  Views are `spacing` apart, and pixels `pixel` (a tangent).

As a matrix from indices to rays this is the H of Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and
Rectification for Lenselet-Based Plenoptic Cameras", eq. 9, on the plane of the views, where its H13 and H24 are 0.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats.geometry import regular_grid
from raytracer.util.errors import InputError
from raytracer.util.safe_open import read_json

Floats = NDArray[np.float64]

_LARGEST_FILE, _LARGEST_NUMBER, _MOST_VIEWS, _MOST_PIXELS = 1 << 20, 1e9, 1 << 10, 1 << 15
"""Most bytes of a file, its largest number, and most views and pixels a side: far above those of any camera."""


@dataclass(frozen=True)
class CameraModel:
    """Intrinsics of a light-field camera.

    Attributes
    ----------
    rows, columns : of its views.
    width, height (px) : of a view.
    pixel : edge of a pixel (tangent).
    centre (px) : where the axis is, right and down from a view's top left corner.
    spacing (m) : from view to view, right and down.
    inverse_focus (1/m) : one over the distance of the plane in which all views see the same.
    distortion : k1 and k2 of the main lens.
    """

    rows: int
    columns: int
    width: int
    height: int
    pixel: float
    centre: tuple[float, float]
    spacing: tuple[float, float]
    inverse_focus: float
    distortion: tuple[float, float] = (0.0, 0.0)

    @property
    def matrix(self) -> Floats:
        """Matrix (5, 5) from column and row of a view, and column and row of a pixel, to the ray.

        The ray is where it crosses the plane of the views, right and down (m), and its slope.
        """
        h = np.zeros((5, 5))
        counts, pixels = (self.columns, self.rows), self.centre
        for axis in (0, 1):
            h[axis, axis] = self.spacing[axis]
            h[axis, 4] = -0.5 * (counts[axis] - 1) * self.spacing[axis]
            h[2 + axis, axis] = -self.inverse_focus * self.spacing[axis]
            h[2 + axis, 2 + axis] = self.pixel
            h[2 + axis, 4] = -self.inverse_focus * h[axis, 4] + self.pixel * (0.5 - pixels[axis])
        h[4, 4] = 1.0
        return h

    def check_views(self, views: Views, name: str) -> None:
        """Raise an InputError, which begins with `name`, if this is the camera of other views."""
        own, others = (
            (self.columns, self.rows, self.width, self.height),
            (views.columns, views.rows, views.width, views.height),
        )
        if own != others:
            told = ["{} x {} views of {} x {} pixels".format(*each) for each in (own, others)]
            raise InputError(f"{name}: is of a camera with {told[0]}, and these are {told[1]}")

    def views(self, aperture: float | None = None) -> Views:
        """Make the geometry of rectified views; `aperture` is the diameter of sub-images in steps of one view."""
        return Views(
            regular_grid(self.rows, self.columns) * self.spacing,
            Plane(self.pixel, -self.centre[0] * self.pixel, self.centre[1] * self.pixel),
            self.width,
            self.height,
            inverse_focus=self.inverse_focus,
            cell=self.spacing,
            aperture=None if aperture is None else aperture * math.sqrt(math.prod(self.spacing)),
        )

    def project(self, points: Floats, steps: Floats) -> Floats:
        """Find where views at `steps` (v, 2), right and down from the middle one, see points (n, 3): (v, n, 2) (px)."""
        inverse = 1.0 / points[:, 2:]
        u = steps[:, None] * self.spacing
        return self.to_pixels(points[:, :2] * inverse - u * (inverse - self.inverse_focus))

    def to_pixels(self, slopes: Floats) -> Floats:
        """Find the pixels (..., 2) at which the lens shows undistorted slopes, from the top left corner."""
        squared = (slopes**2).sum(axis=-1, keepdims=True)
        k1, k2 = self.distortion
        return np.asarray(self.centre + slopes * (1.0 + squared * (k1 + squared * k2)) / self.pixel)

    @property
    def is_distorted(self) -> bool:
        """True if views need rectification."""
        return self.distortion != (0.0, 0.0)

    def rectify(self, picture: NDArray[Any], order: int = 3) -> Floats:
        """Undo the distortion of a view (height, width) or (height, width, channels), by splines of some order."""
        from scipy.ndimage import map_coordinates

        x, y = np.arange(self.width) + 0.5, np.arange(self.height) + 0.5
        slopes = (np.stack(np.meshgrid(x, y), axis=-1) - self.centre) * self.pixel
        places = np.moveaxis(self.to_pixels(slopes) - 0.5, -1, 0)[::-1]
        channels = picture.reshape(*picture.shape[:2], -1).astype(np.float64)
        moved = [
            map_coordinates(channels[..., i], places, order=order, mode="nearest") for i in range(channels.shape[2])
        ]
        return np.stack(moved, axis=-1).reshape(picture.shape)

    def as_dict(self) -> dict[str, Any]:
        """Convert to JSON values."""
        focus = None if self.inverse_focus == 0.0 else 1.0 / self.inverse_focus
        return {**asdict(self), "focus_distance": focus, "matrix": self.matrix.tolist()}


def camera_from_dict(values: Any, name: str) -> CameraModel:
    """Read a camera from the values of `CameraModel.as_dict`; an InputError, with `name` first, says what is wrong."""

    def number(key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST_NUMBER:
            raise InputError(f"{name}: {key}: must be a number, of at most {_LARGEST_NUMBER:g}")
        return float(value)

    def pair(key: str) -> tuple[float, float]:
        value = values[key]
        if not (isinstance(value, list | tuple) and len(value) == 2):
            raise InputError(f"{name}: {key}: must be two numbers")
        return number(key, value[0]), number(key, value[1])

    def count(key: str, most: int) -> int:
        value = number(key, values[key])
        if not (value.is_integer() and 1 <= value <= most):
            raise InputError(f"{name}: {key}: must be a whole number from 1 to {most}")
        return int(value)

    needed = ("rows", "columns", "width", "height", "pixel", "centre", "spacing", "inverse_focus", "distortion")
    if not isinstance(values, Mapping) or (missing := [key for key in needed if key not in values]):
        what = "is no JSON object" if not isinstance(values, Mapping) else f"{missing[0]} is missing"
        raise InputError(f"{name}: {what}: a calibration has {', '.join(needed)}, as rt lightfield calibrate writes it")
    camera = CameraModel(
        count("rows", _MOST_VIEWS),
        count("columns", _MOST_VIEWS),
        count("width", _MOST_PIXELS),
        count("height", _MOST_PIXELS),
        number("pixel", values["pixel"]),
        pair("centre"),
        pair("spacing"),
        number("inverse_focus", values["inverse_focus"]),
        pair("distortion"),
    )
    if not (camera.pixel > 0.0 and min(camera.spacing) > 0.0):
        raise InputError(f"{name}: pixel, spacing: must be greater than 0")
    return camera


def read_camera(path: str | Path) -> CameraModel:
    """Read a camera from a JSON file that `rt lightfield calibrate` has written.

    Raises
    ------
    InputError : the file is missing, or holds no calibration.
    """
    return camera_from_dict(read_json(Path(path), _LARGEST_FILE), str(path))
