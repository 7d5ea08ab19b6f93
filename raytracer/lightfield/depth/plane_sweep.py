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

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.coverage import lit_at_nearest, lit_view
from raytracer.lightfield.depth.estimate import (
    DepthContext,
    Estimate,
    FloatArray,
    ViewIndex,
    median_spacing,
    view_offsets,
)
from raytracer.lightfield.splines import Spline, sqrt_tone

_BUDGET = 256 * 2**20
"""Bytes for the cost volume of the planes that are worked on at once."""

_HALVES = 4
"""Halves of the aperture: left, right, lower and upper; the middle row and column are in both of theirs."""

_INLIER = 0.5
"""Squared differences as large as this share of the reference view's own variance count half.  Larger ones come from
something else that hides the point, and their size is no evidence."""


def sweep_planes(context: DepthContext, others: Sequence[ViewIndex], planes: NDArray[np.float64]) -> Estimate:
    """Find the plane at which views agree best, pixel by pixel, and between planes by a parabola.

    others : views that are compared with the reference view.
    planes : 1 / distance of the planes (1/m), evenly spaced.
    """
    middle = sqrt_tone(lit_view(context.field, *context.reference)[0])
    height, width = middle.shape[:2]
    guided = GuidedFilter(middle.mean(axis=-1))
    tolerance = max(_INLIER * float(middle.var(axis=(0, 1)).mean()), np.finfo(np.float64).tiny)

    block = max(1, min(len(planes), _BUDGET // (_HALVES * height * width * 10)))
    context.counter.add_total(len(others) * math.ceil(len(planes) / block))
    best = _RunningMinimum((height, width))
    for first in range(0, len(planes), block):
        volume = _CostVolume(planes[first : first + block], height, width)
        for other in others:
            _add_view(context, middle, other, volume, tolerance)
            context.counter.step()

        def smoothed_cost(number: int, volume: _CostVolume = volume) -> FloatArray:
            # Where no view sees a plane, it costs as much as the worst.
            whole = guided(_mean(volume.cost[number].sum(axis=0), volume.count[number].sum(axis=0)))
            for half in range(_HALVES):
                np.minimum(whole, guided(_mean(volume.cost[number, half], volume.count[number, half])), out=whole)
            return whole

        for values in context.pool.map(smoothed_cost, range(len(volume.planes))):
            best.add(values)
    number, confidence = best.result()
    return Estimate(planes[0] + number * (planes[1] - planes[0]), confidence)


def _mean(total: FloatArray, count: NDArray[np.integer]) -> FloatArray:
    """Average the differences of the views that were compared; 1, the greatest that there is, where none was."""
    return np.where(count > 0, total / np.maximum(count, 1), 1.0)


class _CostVolume:
    """Differences of views from the reference view, by plane and half of the aperture.

    planes : 1 / distance of the planes (1/m).
    cost : sums of the differences, (planes, halves, height, width).
    count : number of the views in these sums, of the same shape.
    """

    def __init__(self, planes: NDArray[np.float64], height: int, width: int) -> None:
        self.planes = planes
        self.cost = np.zeros((len(planes), _HALVES, height, width))
        self.count = np.zeros((len(planes), _HALVES, height, width), dtype=np.uint16)


def _add_view(
    context: DepthContext, middle: FloatArray, other: ViewIndex, volume: _CostVolume, tolerance: float
) -> None:
    """Add the difference of a view from the reference view, for all planes, to the halves that the view is in."""
    views = context.field.views
    offset = view_offsets(views, context.reference)[other]
    # Places that are equal but for rounding are in both halves.
    exact = float(np.finfo(np.float32).eps) * median_spacing(views)
    right, up = offset
    halves = np.flatnonzero([right <= exact, right >= -exact, up <= exact, up >= -exact]).tolist()
    view, lit = lit_view(context.field, *other)
    spline = Spline(sqrt_tone(view))

    def add_plane(number: int) -> None:
        right, down = offset * ((views.inverse_focus - volume.planes[number]) / views.plane.pixel) * (1.0, -1.0)
        moved, part = spline.shifted(float(right), float(down))
        difference = ((moved[part] - middle[part]) ** 2).mean(axis=-1)
        # Geman and McClure's robust cost: squares of small differences, 1 for large ones.
        difference /= difference + tolerance
        counted: int | NDArray[np.bool_] = 1
        if lit is not None:
            rows, columns = (np.arange(along.start, along.stop) for along in part)
            counted = lit_at_nearest(lit, (rows + down)[:, None], (columns + right)[None, :])
            difference *= counted
        for half in halves:
            volume.cost[number, half][part] += difference
            volume.count[number, half][part] += counted

    list(context.pool.map(add_plane, range(len(volume.planes))))


class _RunningMinimum:
    """Minimum of a sequence of pictures, with its two neighbours in the sequence, and the mean; pixel by pixel."""

    def __init__(self, shape: ViewIndex) -> None:
        self._count = 0
        self._sum = np.zeros(shape)
        self._number = np.zeros(shape, dtype=np.int64)
        self._least, self._before, self._after = (np.full(shape, np.inf) for _ in range(3))
        self._last = np.full(shape, np.inf)

    def add(self, values: FloatArray) -> None:
        """Take in the next picture."""
        is_next = self._number == self._count - 1
        self._after = np.where(is_next, values, self._after)
        is_better = values < self._least
        self._before = np.where(is_better, self._last, self._before)
        self._least = np.where(is_better, values, self._least)
        self._number = np.where(is_better, self._count, self._number)
        self._after = np.where(is_better, np.inf, self._after)
        self._last = values
        self._sum += values
        self._count += 1

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

_RADIUS = 1
"""Radius of the filter's boxes, in pixels."""


class GuidedFilter:
    """Guided filter, which averages within regions that look alike in its guide, and so preserves edges."""

    def __init__(self, guide: FloatArray) -> None:
        self._guide = guide
        self._mean = self._box(guide)
        self._variance = np.maximum(self._box(guide * guide) - self._mean**2, 0.0)
        # Above 0, however flat the picture is.
        self._regularization = max(_REGULARIZATION * float(guide.var()), np.finfo(np.float64).tiny)

    def __call__(self, picture: FloatArray) -> FloatArray:
        """Filter a picture (height, width)."""
        mean = self._box(picture)
        slope = (self._box(self._guide * picture) - self._mean * mean) / (self._variance + self._regularization)
        return np.asarray(self._box(slope) * self._guide + self._box(mean - slope * self._mean))

    def _box(self, picture: FloatArray) -> FloatArray:
        """Average over boxes around each pixel."""
        from scipy import ndimage

        return np.asarray(ndimage.uniform_filter(picture, 2 * _RADIUS + 1, mode="nearest"))
