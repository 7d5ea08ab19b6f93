"""Linearised residuals of the views: by how much each pixel's disparity is off, and how much is known of it.

All views are brought over the reference view by an estimate of the disparity.  What still moves with the place of the
view is what the estimate is off by: with the mean over all views M, a view at `u` (views to the right and up) sees
M + (u . grad M) e, if the true disparity is e more.  Least squares over all views and channels give e, and the Fisher
information of it: the sum of squares of u . grad M, over the variance of the noise, which is what the views' values
scatter by around the line that is fitted.

Views in which something nearer hides the point are left out by the disparity itself, and others that differ by more
than noise count less.

References: Lucas, Kanade 1981, "An Iterative Image Registration Technique with an Application to Stereo Vision";
    Okutomi, Kanade 1993, "A Multiple-Baseline Stereo"; Kay 1993, "Fundamentals of Statistical Signal Processing:
    Estimation Theory", sec. 3.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.coverage import lit_at_nearest, lit_view
from raytracer.lightfield.depth.estimate import (
    HIDING_PARALLAX,
    DepthContext,
    FloatArray,
    ViewIndex,
    median_spacing,
    view_offsets,
)
from raytracer.lightfield.splines import Spline, sqrt_tone

_OUTLIER = 3.0
"""Standard deviations of the noise at which a difference counts a quarter."""

_CHANNELS = 3

_SLOPE_NOISE = 0.5
"""Variance of the difference of two neighbours but one, halved, over that of a pixel."""


class Offsets(NamedTuple):
    """Corrections of the disparity of each pixel, and what is known of them, (height, width) each.

    value : correction times information.
    information : Fisher information (1 / px^2) of the disparity from view to view.
    of_noise : the part of it that noise alone gives, whose slopes are taken for texture.
    noise : variance of the views' noise, of values after the square root.
    mean : mean of the views, (height, width, 3).
    """

    value: FloatArray
    information: FloatArray
    of_noise: FloatArray
    noise: FloatArray
    mean: FloatArray


class _Sums:
    """Sums over views, by which values are regressed on the places of the views."""

    def __init__(self, shape: ViewIndex) -> None:
        self.weight = np.zeros(shape)
        self.place = np.zeros((2, *shape))
        self.square = np.zeros((3, *shape))
        self.value = np.zeros((*shape, _CHANNELS))
        self.value_square = np.zeros(shape)
        self.product = np.zeros((2, *shape, _CHANNELS))

    def add(self, right: float, up: float, weight: FloatArray, value: FloatArray) -> None:
        """Add a view at a place (views to the right and up)."""
        weighted = weight[..., None] * value
        self.weight += weight
        self.value += weighted
        self.value_square += (weighted * value).sum(axis=-1)
        for number, place in enumerate((right, up)):
            self.place[number] += place * weight
            self.product[number] += place * weighted
        for number, product in enumerate((right * right, right * up, up * up)):
            self.square[number] += product * weight

    def solve(self) -> Offsets:
        """Regress the values on the places, along the slopes of the mean."""
        weight = self.weight
        mean = self.value / weight[..., None]
        place = self.place / weight
        variance = [
            self.square[number] / weight - place[first] * place[second]
            for number, (first, second) in enumerate(((0, 0), (0, 1), (1, 1)))
        ]
        moved = [self.product[axis] / weight[..., None] - place[axis][..., None] * mean for axis in range(2)]
        # A point that is nearer moves left in views on the right, and down in views above.
        down, right = np.gradient(mean, axis=(0, 1))
        slopes = right, -down
        value = sum((slopes[axis] * moved[axis]).sum(axis=-1) for axis in range(2))
        squares = (
            (slopes[0] ** 2).sum(axis=-1) * variance[0]
            + 2.0 * (slopes[0] * slopes[1]).sum(axis=-1) * variance[1]
            + (slopes[1] ** 2).sum(axis=-1) * variance[2]
        )
        squares = np.maximum(squares, 0.0)
        scatter = self.value_square / weight - (mean**2).sum(axis=-1)
        scatter -= np.where(squares > 0.0, value**2 / np.where(squares > 0.0, squares, 1.0), 0.0)
        freedom = np.maximum(_CHANNELS * (weight - 1.0) - 1.0, 1.0)
        noise = _smoothed_noise(np.maximum(scatter, 0.0) * weight / freedom)
        of_noise = _SLOPE_NOISE * _CHANNELS * np.maximum(variance[0] + variance[2], 0.0)
        return Offsets(value * weight / noise, squares * weight / noise, of_noise, noise, mean)


def _smoothed_noise(noise: FloatArray) -> FloatArray:
    """Average the variance over neighbours, and keep it from 0, which a few values may have by chance."""
    from scipy import ndimage

    least = max(_LEAST_NOISE * float(np.median(noise)), np.finfo(np.float64).tiny)
    return np.asarray(np.maximum(ndimage.uniform_filter(noise, _NOISE_WIDTH, mode="nearest"), least))


_NOISE_WIDTH = 5
"""Pixels along the side of the squares over which the variance of noise is averaged."""

_LEAST_NOISE = 0.05
"""Least variance of noise anywhere, as a share of the median."""


def measure_offsets(
    context: DepthContext,
    others: Sequence[ViewIndex],
    disparity: FloatArray,
    before: Offsets | None,
) -> Offsets:
    """Measure by how much the disparity (pixels from view to view, greater if nearer) of each pixel is off.

    others : views that are compared with the reference view.
    before : from an estimate before this one, by which outliers are told; None for none.
    """
    field, reference = context.field, context.reference
    spacing = median_spacing(field.views)
    places = view_offsets(field.views, reference) / spacing
    own = sqrt_tone(lit_view(field, *reference)[0])
    # Without any estimate of the noise: the differences of views themselves, most of which are noise.
    expected = own if before is None else before.mean
    limit = None if before is None else _OUTLIER**2 * before.noise

    def weighted_view(other: ViewIndex) -> tuple[FloatArray, FloatArray]:
        right, up = places[other].tolist()
        view, lit = lit_view(field, *other)
        rows, columns = moved_places(disparity, right, up)
        value, is_seen = Spline(sqrt_tone(view)).at(rows, columns)
        if lit is not None:
            is_seen &= lit_at_nearest(lit, rows, columns)
        is_seen &= ~_is_hidden(disparity, rows, columns, float(np.hypot(right, up)))
        return value, _inlier_weight(value - expected, is_seen, limit)

    sums = _Sums(disparity.shape)
    sums.add(0.0, 0.0, np.ones(disparity.shape), own)
    # No more views are held in memory than threads work on.
    for first in range(0, len(others), context.threads):
        some = others[first : first + context.threads]
        for other, (value, weight) in zip(some, context.pool.map(weighted_view, some), strict=True):
            sums.add(float(places[other][0]), float(places[other][1]), weight, value)
            context.counter.step()
    return sums.solve()


def _inlier_weight(difference: FloatArray, is_seen: NDArray[np.bool_], limit: FloatArray | None) -> FloatArray:
    """Weigh a view by its differences from what is expected, averaged over neighbours (Geman and McClure)."""
    from scipy import ndimage

    square = ndimage.uniform_filter((difference**2).mean(axis=-1), 3, mode="nearest")
    if limit is None:
        limit = np.maximum(_OUTLIER**2 * np.median(square), np.finfo(np.float64).tiny)
    return np.where(is_seen, 1.0 / (1.0 + square / limit) ** 2, 0.0)


def moved_places(disparity: FloatArray, right: float, up: float) -> tuple[FloatArray, FloatArray]:
    """Compute rows and columns of all pixels in a view that is so many views to the right and up."""
    height, width = disparity.shape
    return np.arange(height)[:, None] + up * disparity, np.arange(width)[None, :] - right * disparity


def _is_hidden(disparity: FloatArray, rows: FloatArray, columns: FloatArray, away: float) -> NDArray[np.bool_]:
    """Find the pixels that a nearer one comes to lie on in another view, or on a neighbour of."""
    from scipy import ndimage

    height, width = disparity.shape
    nearest = np.full((height, width), -np.inf)
    r, c = np.clip(rows, 0.0, height - 1.0), np.clip(columns, 0.0, width - 1.0)
    for round_row, round_column in itertools.product((np.floor, np.ceil), repeat=2):
        np.maximum.at(nearest, (round_row(r).astype(np.int64), round_column(c).astype(np.int64)), disparity)
    nearest = ndimage.maximum_filter(nearest, 3, mode="nearest")
    there = nearest[np.rint(r).astype(np.int64), np.rint(c).astype(np.int64)]
    return np.asarray((there - disparity) * away > HIDING_PARALLAX)
