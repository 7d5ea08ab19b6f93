"""Measures of a depth map against the truth, those of the 4D Light Field Benchmark.

Disparities are pixels from view to view, greater if nearer.  All measures leave out a border, pixels without a depth,
and pixels whose true distance is infinite or not known.

References: Honauer, Johannsen, Kondermann, Goldluecke 2016, "A Dataset and Evaluation Methodology for Depth Estimation
    on 4D Light Fields", sec. 4 (mean squared error, bad pixels, and median angle errors on planes and on curved
    surfaces).
"""

from dataclasses import dataclass

import numpy as np

from raytracer.film.light_field.views import Views
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.depth.estimate import FloatArray, ViewIndex, median_spacing

BAD = (0.07, 0.03, 0.01)
"""Errors of the disparity (px) from which on a pixel is bad."""

_BORDER = 15.0 / 512.0
"""Border that is left out, as a share of the shorter side: the benchmark's 15 of 512 pixels."""

_REACH, _FLAT = 4, 1e-3
"""Pixels to both sides, and the second difference of the true disparity over them (px) up to which a surface is a
plane.  One over a plane's distance is linear in the picture; a true depth that was rendered has some noise."""

_SMOOTH = 5e-3
"""Second differences of neighbours (px) within that reach from which on there is an edge."""


@dataclass(frozen=True)
class Measures:
    """Errors of a depth map against the truth.

    Attributes
    ----------
    mse_x100 : 100 times the mean squared error of the disparity (px^2).
    bad : share of the pixels with a larger error of the disparity, for each of `BAD`.
    planes_degrees : median angle between normals, on planes; nan if there are none.
    curved_degrees : the same on curved surfaces.
    share : of the pixels that these are measured on.
    """

    mse_x100: float
    bad: tuple[float, ...]
    planes_degrees: float
    curved_degrees: float
    share: float


def measure_depth(views: Views, depth: Depth, truth: FloatArray) -> Measures:
    """Measure a depth map against true distances (m), float64 (height, width), along the axis.

    Raises ValueError: they are of another size, or nothing is left to compare.
    """
    return measure_inverse(views, (depth.row, depth.column), depth.known(depth.inverse), truth)


def measure_inverse(views: Views, view: ViewIndex, inverse: FloatArray, truth: FloatArray) -> Measures:
    """Measure 1 / distance of a view (1/m), nan where not known, against true distances (m): see `measure_depth`."""
    from scipy import ndimage

    if inverse.shape != truth.shape:
        raise ValueError(f"the truth must be of the depth's size, {inverse.shape}, got {truth.shape}")
    border = round(_BORDER * min(truth.shape))
    inner = np.zeros(truth.shape, dtype=bool)
    inner[border : truth.shape[0] - border, border : truth.shape[1] - border] = True
    is_known = inner & np.isfinite(inverse) & np.isfinite(truth) & (truth > 0.0)
    if not is_known.any():
        raise ValueError("no pixel has both a depth and a true one")
    exact = 1.0 / np.where(is_known, truth, 1.0)
    scale = median_spacing(views) / views.plane.pixel
    error = np.abs(inverse - exact)[is_known] * scale

    bend = _second_differences(exact * scale, _REACH)
    is_smooth = ndimage.maximum_filter(_second_differences(exact * scale, 1), 2 * _REACH + 1) < _SMOOTH
    angle = _angles(_normals(views, view, inverse), _normals(views, view, exact))
    is_measured = ndimage.binary_erosion(is_known, np.ones((3, 3))) & is_smooth & np.isfinite(angle)
    return Measures(
        mse_x100=100.0 * float((error**2).mean()),
        bad=tuple(float((error > limit).mean()) for limit in BAD),
        planes_degrees=_median(angle[is_measured & (bend <= _FLAT)]),
        curved_degrees=_median(angle[is_measured & (bend > _FLAT)]),
        share=float(is_known.mean()),
    )


def _median(values: FloatArray) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _second_differences(values: FloatArray, reach: int) -> FloatArray:
    """Compute the largest second difference over so many pixels to both sides, along rows, columns and diagonals."""
    padded = np.pad(values, reach, mode="edge")
    height, width = values.shape

    def moved(down: int, right: int) -> FloatArray:
        return padded[reach + down : reach + down + height, reach + right : reach + right + width]

    steps = ((0, reach), (reach, 0), (reach, reach), (reach, -reach))
    return np.asarray(np.max([np.abs(moved(*s) + moved(-s[0], -s[1]) - 2.0 * values) for s in steps], axis=0))


def _normals(views: Views, view: ViewIndex, inverse: FloatArray) -> FloatArray:
    """Compute the normals of the surface, not normalised, (height, width, 3); nan where the distance is not finite."""
    with np.errstate(divide="ignore"):
        distance = np.where(inverse > 0.0, 1.0 / inverse, np.nan)
    pixel = views.plane.pixel
    right_of, up_of = views.inverse_focus * views.position[view]
    x = views.plane.left + pixel * (np.arange(views.width) + 0.5) - right_of
    y = views.plane.top - pixel * (np.arange(views.height) + 0.5) - up_of
    points = distance[..., None] * np.stack([*np.broadcast_arrays(x, y[:, None]), np.ones(inverse.shape)], axis=-1)
    down, right = np.gradient(points, axis=(0, 1))
    return np.cross(right, down)


def _angles(first: FloatArray, second: FloatArray) -> FloatArray:
    """Compute the angles between vectors (degrees), exact for small ones, too."""
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, (first * second).sum(axis=-1))))
