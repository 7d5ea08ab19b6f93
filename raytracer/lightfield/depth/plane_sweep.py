"""Depth by plane sweep: the plane at which all views, brought over the reference view, agree best.

For planes at many distances all views are shifted over the reference view, as for a photograph focused there: points on
the plane agree in all of them, others differ.  Where something nearer hides a point from some views, those of one side
of the aperture see it: of the four halves of the aperture and the whole, the one that agrees best counts.  The cost
volume is smoothed along what looks alike in the reference view, by the guided filter.

References: Kang, Szeliski, Chai 2001, "Handling Occlusions in Dense Multi-view Stereo"; Wang, Efros, Ramamoorthi 2015,
    "Occlusion-aware Depth Estimation Using Light-field Cameras"; Tao et al. 2013, "Depth from Combining Defocus and
    Correspondence Using Light-Field Cameras"; Hosni et al. 2013, "Fast Cost-Volume Filtering for Visual Correspondence
    and Beyond"; He, Sun, Tang 2010, "Guided Image Filtering".
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.coverage import lit_view
from raytracer.lightfield.depth.estimate import (
    DepthContext,
    Estimate,
    FloatArray,
    ViewIndex,
    median_spacing,
    view_offsets,
)
from raytracer.lightfield.kernels.plane_sweep import ShiftedView, Weights, add_differences, smooth_costs
from raytracer.lightfield.memory import MORE_MEMORY, count_that_fit
from raytracer.lightfield.splines import Spline, seen_part, spline_weights, sqrt_tone

_HALVES = 4
"""Halves of the aperture: left, right, lower and upper; the middle row and column are in both of theirs."""

_PLANE_BYTES, _FIXED_BYTES = 10 * _HALVES + 8, 320
"""Bytes a pixel of a plane: costs, counts and what is made of them; and of a view and all that is kept of planes."""

_THREAD_BYTES = 40
"""Bytes a pixel of a thread's own pictures."""

_INLIER = 0.5
"""Squared differences as large as this share of the reference view's own variance count half.  Larger ones come from
something else that hides the point, and their size is no evidence."""


def sweep_planes(context: DepthContext, others: Sequence[ViewIndex], planes: NDArray[np.float64]) -> Estimate:
    """Find the plane at which views agree best, pixel by pixel, and between planes by a parabola.

    others : views that are compared with the reference view.
    planes : 1 / distance of the planes (1/m), evenly spaced.
    """
    middle = np.ascontiguousarray(np.moveaxis(sqrt_tone(lit_view(context.field, *context.reference)[0]), -1, 0))
    height, width = middle.shape[1:]
    guided = GuidedFilter(middle.mean(axis=0))
    tolerance = max(_INLIER * float(middle.var(axis=(1, 2)).mean()), np.finfo(np.float64).tiny)

    pixels = height * width
    fixed = pixels * (_FIXED_BYTES + _THREAD_BYTES * context.threads)
    most = count_that_fit(fixed, pixels * _PLANE_BYTES, f"depth of {width} x {height} pixels", MORE_MEMORY)
    block = min(len(planes), most)
    context.counter.add_total(len(others) * math.ceil(len(planes) / block))
    best = _RunningMinimum((height, width))
    # Cleared for each block, which is sooner done than to ask for memory anew.
    whole = _CostVolume(
        planes[:block],
        np.empty((block, _HALVES, height, width)),
        np.empty((block, _HALVES, height, width), dtype=np.uint16),
    )
    for first in range(0, len(planes), block):
        volume = whole.emptied(planes[first : first + block])
        for other in others:
            _add_view(context, middle, other, volume, tolerance)
            context.counter.step()
        for values in context.pool.map(guided.least, volume.cost, volume.count):
            best.add(values)
    number, confidence = best.result()
    rival, ratio = best.rival()
    return Estimate(planes[0] + number * (planes[1] - planes[0]), confidence, planes[rival], ratio)


class _CostVolume(NamedTuple):
    """Differences of views from the reference view, by plane and half of the aperture.

    planes : 1 / distance of the planes (1/m).
    cost : sums of the differences, (planes, halves, height, width).
    count : number of the views in these sums, of the same shape.
    """

    planes: NDArray[np.float64]
    cost: FloatArray
    count: NDArray[np.uint16]  # type: ignore[assignment]  # takes the place of tuple.count

    def emptied(self, planes: NDArray[np.float64]) -> "_CostVolume":
        """Return a volume of no more planes, in the same memory, to which nothing was added."""
        volume = _CostVolume(planes, self.cost[: len(planes)], self.count[: len(planes)])
        volume.cost[...] = 0.0
        volume.count[...] = 0
        return volume


def _add_view(
    context: DepthContext, middle: FloatArray, other: ViewIndex, volume: _CostVolume, tolerance: float
) -> None:
    """Add the difference of a view from the reference view, for all planes, to the halves that the view is in."""
    views = context.field.views
    offset = view_offsets(views, context.reference)[other]
    # Places that are equal but for rounding are in both halves.
    exact = float(np.finfo(np.float32).eps) * median_spacing(views)
    right, up = offset
    is_in = np.array([right <= exact, right >= -exact, up <= exact, up >= -exact], dtype=np.uint8)
    view, lit = lit_view(context.field, *other)
    spline = Spline(sqrt_tone(view))
    mask = np.ones(spline.shape, dtype=np.uint8) if lit is None else lit.astype(np.uint8)

    def add_plane(number: int) -> None:
        moved = (views.inverse_focus - volume.planes[number]) / views.plane.pixel
        shift = float(right * moved), float(-up * moved)
        rows, columns = seen_part(spline.shape, *shift)
        (right_whole, right_weights), (down_whole, down_weights) = (_whole_and_weights(along) for along in shift)
        shifted = ShiftedView(
            spline.coefficients,
            mask,
            is_in,
            (right_whole, down_whole),
            (right_weights, down_weights),
            (math.floor(shift[0] + 0.5), math.floor(shift[1] + 0.5)),
            (rows.start, columns.start, rows.stop, columns.stop),
        )
        scratch = np.empty((2, spline.shape[1] + 3))
        add_differences(shifted, middle, tolerance, scratch, volume.cost[number], volume.count[number])

    list(context.pool.map(add_plane, range(len(volume.planes))))


def _whole_and_weights(shift: float) -> tuple[int, Weights]:
    """Split a shift (px) into whole pixels, and the weights of a spline for the rest."""
    whole = math.floor(shift)
    return whole, spline_weights(shift - whole)


class _RunningMinimum:
    """Minimum of a sequence of pictures, with its two neighbours in the sequence, and the mean; pixel by pixel.

    The second lowest of the minima along the sequence is kept, too: ends count as minima.
    """

    def __init__(self, shape: ViewIndex) -> None:
        self._count = 0
        self._sum = np.zeros(shape)
        self._number = np.zeros(shape, dtype=np.int64)
        self._least, self._before, self._after = (np.full(shape, np.inf) for _ in range(3))
        self._last = np.full(shape, np.inf)
        self._is_falling = np.ones(shape, dtype=bool)
        self._lowest, self._rival = np.full(shape, np.inf), np.full(shape, np.inf)
        self._lowest_number, self._rival_number = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)

    def add(self, values: FloatArray) -> None:
        """Take in the next picture."""
        is_next = self._number == self._count - 1
        self._after = np.where(is_next, values, self._after)
        is_better = values < self._least
        self._before = np.where(is_better, self._last, self._before)
        self._least = np.where(is_better, values, self._least)
        self._number = np.where(is_better, self._count, self._number)
        self._after = np.where(is_better, np.inf, self._after)
        is_rising = values > self._last
        if self._count:
            self._add_minima(self._is_falling & is_rising)
            self._is_falling = ~is_rising
        self._last = values
        self._sum += values
        self._count += 1

    def _add_minima(self, is_minimum: NDArray[np.bool_]) -> None:
        """Take in the minima that the last picture turns out to be."""
        values, number = self._last, self._count - 1
        is_lowest = is_minimum & (values < self._lowest)
        is_rival = is_minimum & ~is_lowest & (values < self._rival)
        self._rival = np.where(is_lowest, self._lowest, np.where(is_rival, values, self._rival))
        self._rival_number = np.where(is_lowest, self._lowest_number, np.where(is_rival, number, self._rival_number))
        self._lowest = np.where(is_lowest, values, self._lowest)
        self._lowest_number = np.where(is_lowest, number, self._lowest_number)

    def rival(self) -> tuple[NDArray[np.int64], FloatArray]:
        """Return the index of the second lowest minimum, and its value as a multiple of the lowest; inf for none."""
        self._add_minima(self._is_falling)
        self._is_falling = np.zeros_like(self._is_falling)
        # Nothing is less than rounding, even where views are the same.
        least = np.maximum(self._lowest, np.finfo(np.float64).eps)
        ratio = np.maximum(self._rival, least) / least
        return np.where(np.isfinite(ratio), self._rival_number, self._lowest_number), ratio

    def result(self) -> tuple[FloatArray, FloatArray]:
        """Return the index of the minimum, refined by a parabola, and its confidence: its depth below the mean."""
        has_both = np.isfinite(self._before) & np.isfinite(self._after)
        before = np.where(has_both, self._before, self._least)
        after = np.where(has_both, self._after, self._least)
        curvature = before - 2.0 * self._least + after
        is_curved = curvature > 0.0
        between = np.where(is_curved, 0.5 * (before - after) / np.where(is_curved, curvature, 1.0), 0.0)
        mean = self._sum / self._count
        confidence = np.where(mean > 0.0, 1.0 - self._least / np.where(mean > 0.0, mean, 1.0), 0.0)
        return self._number + np.clip(between, -0.5, 0.5), confidence


_REGULARIZATION = 0.02
"""Squared contrast from which on an edge is kept, as a share of the picture's variance."""


class GuidedFilter:
    """Guided filter, which averages within regions that look alike in its guide, and so preserves edges."""

    def __init__(self, guide: FloatArray) -> None:
        self._guide = guide
        self._mean = _box(guide)
        variance = np.maximum(_box(guide * guide) - self._mean**2, 0.0)
        # Above 0, however flat the picture is.
        self._weight = 1.0 / (variance + max(_REGULARIZATION * float(guide.var()), np.finfo(np.float64).tiny))

    def least(self, cost: FloatArray, count: NDArray[np.uint16]) -> FloatArray:
        """Smooth the mean costs of a plane, of the whole aperture and of each half, and return the least of them."""
        _, height, width = cost.shape
        least = np.empty((height, width))
        scratch, rows = np.empty((3, height, width)), np.empty((2, width))
        smooth_costs(cost, count, self._guide, self._mean, self._weight, scratch, rows, least)
        return least


def _box(picture: FloatArray) -> FloatArray:
    """Average over the square of three pixels a side around each pixel."""
    from scipy import ndimage

    return np.asarray(ndimage.uniform_filter(picture, 3, mode="nearest"))
