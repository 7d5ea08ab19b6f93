"""Depth by slopes: the directions of lines in epipolar slices, by the structure tensor.

A point is a line in an epipolar slice, which is steeper the nearer it is.  The structure tensor of the slices through
the row and the column of views of the reference view gives the line's direction, finer than any step between planes.

References: Wanner, Goldluecke 2014, "Variational Light Field Analysis for Disparity Estimation and Super-Resolution";
    Diebold, Goldluecke 2013, "Epipolar Plane Image Refocusing for Improved Depth Estimation and Occlusion Handling".
"""

import functools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import lit_view, within_lens
from raytracer.lightfield.depth.estimate import DepthContext, Estimate, FloatArray, ViewIndex, view_offsets
from raytracer.lightfield.memory import require_memory
from raytracer.lightfield.splines import Spline, sqrt_tone
from raytracer.util.errors import InputError

_DERIVATIVE_SIGMA = 1.0
"""Standard deviation (pixels) of the Gaussian whose derivatives are taken: sampled ones of a narrower one are wrong."""

_TENSOR_SIGMA = 1.5
"""Standard deviation of the Gaussian over which the structure tensor is averaged, pixels and views."""

_NEAR_VIEWS = 2.0 * _TENSOR_SIGMA
"""Distance (views) within which a view's share in the average is more than an eighth of the middle one's."""

_SHEAR, _MAX_SLOPE = 0.5, 0.375
"""Pixels a view: from shear to shear, and the greatest slope taken from one, half of that and a margin.  Differences
between views are derivatives only where slopes are small."""

_OWN_SIGMA, _OWN_SHARE = 0.6, 0.1
"""Standard deviation (pixels) of the Gaussian that measures a pixel's own texture, and the share of the texture around
it that gives a confidence of a half."""

_SLOPE_ERROR = 0.2
"""Error of a slope (pixels a view), by what the line leaves unexplained, that gives a confidence of a half."""

_FEWEST_IN_LINE = 3

_SLOPE_BYTES = 64
"""Bytes a pixel of each view in a line: its spline, and seven pictures while it is sheared."""


class _Slopes(NamedTuple):
    """Directions of lines in epipolar slices, pixel by pixel, (height, width) each.

    value : slope (pixels a view), or 1 / distance (1/m).
    coherence : confidence in 0..1.
    energy : of the gradients along the line: its texture.
    """

    value: FloatArray
    coherence: FloatArray
    energy: FloatArray


def measure_slopes(context: DepthContext, bounds: tuple[float, float]) -> Estimate:
    """Estimate depth from the directions of lines in the epipolar slices through a view, horizontal and vertical.

    bounds : least and greatest 1 / distance (1/m).

    Raises InputError: there are fewer than three views in the row and in the column.
    """
    field, reference = context.field, context.reference
    lines = [line for line in _lines(field.views, reference) if len(line) >= _FEWEST_IN_LINE]
    if not lines:
        raise InputError("slopes need at least three views in a row or a column: use the method focus")
    shape = (field.views.height, field.views.width)
    total, weight, confidence = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for line in lines:
        inverse, coherence, energy = _slopes_along_line(context, line, bounds)
        # The direction across which there is more texture counts more.
        share = coherence * energy
        total += share * inverse
        weight += share
        confidence = np.maximum(confidence, coherence)
    inverse = np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), field.views.inverse_focus)
    return Estimate(inverse, np.where(weight > 0.0, confidence, 0.0))


def _lines(views: Views, reference: ViewIndex) -> Iterator[list[ViewIndex]]:
    """List the lit views of the row and of the column of one of them, from left to right and from top to bottom."""
    grid = within_lens(views)
    row, column = reference
    in_row = [(row, other) for other in range(views.columns) if grid[row, other]]
    in_column = [(other, column) for other in range(views.rows) if grid[other, column]]
    yield sorted(in_row, key=lambda index: float(views.position[index][0]))
    yield sorted(in_column, key=lambda index: -float(views.position[index][1]))


def _slopes_along_line(context: DepthContext, line: list[ViewIndex], bounds: tuple[float, float]) -> _Slopes:
    """Measure 1 / distance in the epipolar slices of a line of views, the best of several shears."""
    field, reference = context.field, context.reference
    views = field.views
    offsets = np.array([view_offsets(views, reference)[index] for index in line])
    is_row = bool(np.ptp(offsets[:, 0]) >= np.ptp(offsets[:, 1]))
    places = offsets[:, 0] if is_row else -offsets[:, 1]
    # Derivatives between two views at one place are not defined.
    keep = np.concatenate([[True], np.diff(places) > 0.0])
    line = [index for index, is_kept in zip(line, keep, strict=True) if is_kept]
    offsets, places = offsets[keep], places[keep]
    spacing = float(places[-1] - places[0]) / (len(places) - 1)

    pixels = views.width * views.height
    size = _SLOPE_BYTES * pixels * len(line)
    require_memory(size, f"slopes in {len(line)} views", "the method focus can do with less")

    # Shears, around each of which slopes are small.
    scale = views.plane.pixel / spacing
    count = max(1, math.ceil((bounds[1] - bounds[0]) / (_SHEAR * scale)))
    shears = bounds[0] + (np.arange(count) + 0.5) * ((bounds[1] - bounds[0]) / count)
    context.counter.add_total(count)
    splines = list(context.pool.map(lambda index: Spline(sqrt_tone(lit_view(field, *index)[0]).mean(axis=-1)), line))
    middle = int(np.abs(places).argmin())

    def slopes_of_shear(shear: float) -> _Slopes:
        shifts = offsets * ((views.inverse_focus - shear) / views.plane.pixel) * (1.0, -1.0)
        volume = np.stack(
            [spline.shifted(float(s[0]), float(s[1]))[0] for spline, s in zip(splines, shifts, strict=True)]
        )
        slope, coherence, energy = _structure_tensor(volume, places / spacing, middle, 2 if is_row else 1)
        coherence = np.where(np.abs(slope) <= _MAX_SLOPE, coherence, 0.0)
        context.counter.step()
        return _Slopes(shear - slope * scale, coherence, energy)

    def better(best: _Slopes, slopes: _Slopes) -> _Slopes:
        is_better = slopes.coherence > best.coherence
        return _Slopes(*(np.where(is_better, new, old) for new, old in zip(slopes, best, strict=True)))

    best = functools.reduce(better, map(slopes_of_shear, shears.tolist()))
    near = np.abs(places / spacing) <= _NEAR_VIEWS
    lit = _lit_in_line(field, [index for index, is_near in zip(line, near, strict=True) if is_near])
    return best if lit is None else best._replace(coherence=np.where(lit, best.coherence, 0.0))


def _lit_in_line(field: LightField, line: Sequence[ViewIndex]) -> FloatArray | None:
    """Find the pixels at which some views, and all that the tensor averages, have light; None for all."""
    from scipy import ndimage

    masks = [lit for index in line if (lit := field.lit(*index)) is not None]
    if not masks:
        return None
    reach = 2 * math.ceil(_TENSOR_SIGMA) + 1
    return np.asarray(ndimage.minimum_filter(np.logical_and.reduce(masks), reach, mode="nearest"))


def _structure_tensor(volume: FloatArray, places: FloatArray, middle: int, axis: int) -> _Slopes:
    """Compute the structure tensor of slices (views, height, width), and the slopes at one view.

    Wanner & Goldluecke 2014, sec. 3; but by least squares along the views, where the noise is: the tensor's own
    direction takes it to be the same along both axes.
    """
    from scipy import ndimage

    # Exact derivatives of smoothed views, and differences from view to view, which move by a fraction of a pixel.
    sigma = [0.0, _DERIVATIVE_SIGMA, _DERIVATIVE_SIGMA]
    orders = [int(axis == other) for other in range(3)]
    smooth = ndimage.gaussian_filter(volume, sigma, mode="nearest")
    along = ndimage.gaussian_filter(volume, sigma, order=orders, mode="nearest")
    across = np.gradient(smooth, places, axis=0)
    weights = np.exp(-0.5 * ((places - places[middle]) / _TENSOR_SIGMA) ** 2)
    weights /= weights.sum()

    def averaged(first: NDArray[np.float64], second: NDArray[np.float64]) -> FloatArray:
        return np.asarray(
            ndimage.gaussian_filter(np.einsum("v,vyx,vyx->yx", weights, first, second), _TENSOR_SIGMA, mode="nearest")
        )

    xx, xu, uu = averaged(along, along), averaged(along, across), averaged(across, across)
    # Least squares, and their residual: noise, and what is no line.
    has_any = xx > 0.0
    safe = np.where(has_any, xx, 1.0)
    slope = np.where(has_any, -xu / safe, 0.0)
    residual = np.maximum(uu - xu * xu / safe, 0.0)
    confidence = np.where(has_any, xx / np.where(has_any, xx + residual / _SLOPE_ERROR**2, 1.0), 0.0)
    # Beside an edge the average is that of the edge, and not of the pixel.
    own = ndimage.gaussian_filter(along[middle] ** 2, _OWN_SIGMA, mode="nearest")
    confidence *= np.where(has_any, own / np.where(has_any, own + _OWN_SHARE * xx, 1.0), 0.0)
    return _Slopes(slope, confidence, xx)
