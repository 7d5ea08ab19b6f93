"""Local planes: what neighbours that lie on one surface know together of its disparity.

Where a surface is flat, its disparity is a linear function of the pixel.  Around each pixel that function is fitted to
the neighbours' estimates, each weighed by its Fisher information, without those beyond an edge in depth.  The variance
of the fit at the pixel is the Cramer-Rao bound of its disparity.

The larger the neighbourhood, the less noise there is, and the more a curved surface is flattened.  So two sizes are
fitted, and the larger one is taken where both agree to within the error of the smaller one.

References: Cleveland 1979, "Robust Locally Weighted Regression and Smoothing Scatterplots"; Katkovnik 1999, "A New
    Method for Varying Adaptive Bandwidth Selection" (intersection of confidence intervals); Kay 1993, "Fundamentals of
    Statistical Signal Processing: Estimation Theory", sec. 3.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from raytracer.lightfield.depth.estimate import FloatArray
from raytracer.lightfield.depth.residuals import Offsets

_SMALL, _LARGE = 1.0, 2.0
"""Standard deviations (pixels) of the Gaussian weights of both neighbourhoods."""

_CUT = 0.02
"""Weight below which neighbours are left out."""

_AGREE = 2.5
"""Standard deviations by which the two sizes may differ where the larger one is taken."""

_SAME = 2.5
"""Differences, in units of both pixels' uncertainty, from which on a neighbour lies on another surface."""

_FLAT = 100.0
"""Information (1 / px^2) that slopes are 0: without texture the plane is level, and it changes nothing elsewhere."""

_MARGIN = 1.3
"""Factor of the information that noise alone gives: it scatters by some ten per cent in a neighbourhood."""


class Planes(NamedTuple):
    """Planes through the disparities around each pixel, (height, width) each.

    value : disparity at the pixel (px from view to view).
    right, down : change from pixel to pixel.
    variance : of the value (px^2).
    """

    value: FloatArray
    right: FloatArray
    down: FloatArray
    variance: FloatArray


def fit_planes(
    before: Planes, offsets: Offsets, uncertainty: FloatArray, *, edge: float, prior: float
) -> tuple[Planes, FloatArray]:
    """Fit planes to the disparities and their offsets; return the jumps at edges in depth (px), too, 0 elsewhere.

    Pixels beside an edge take no part: what they see is of both sides.

    before : planes of the last estimate.
    uncertainty : of their values (px), beyond which neighbours lie on another surface.
    edge : least jump of the disparity to a neighbour (px) that makes an edge.
    prior : information (1 / px^2) that the bounds of the disparity are; it holds the values before where there is
        no other.
    """
    jumps = _jumps(before)
    is_edge = jumps > edge
    information = np.where(is_edge, 0.0, offsets.information)
    total = np.where(is_edge, 0.0, offsets.value) + information * before.value
    of_noise = np.where(is_edge, 0.0, offsets.of_noise)
    from scipy import ndimage

    arrays = np.stack([information, total, of_noise])
    small, large = (_fit(before, arrays, uncertainty, sigma, prior) for sigma in (_SMALL, _LARGE))
    difference = large.value - small.value
    is_large = difference**2 <= _AGREE**2 * small.variance
    # What both differ by beyond noise is what the larger one flattens: of a parabola, as the square of its size.
    beyond = difference**2 - np.maximum(small.variance - large.variance, 0.0)
    flattened = np.maximum(ndimage.uniform_filter(beyond, 5, mode="nearest"), 0.0)
    large = large._replace(variance=large.variance + flattened)
    small = small._replace(variance=small.variance + (_SMALL / _LARGE) ** 4 * flattened)
    return Planes(*(np.where(is_large, one, other) for one, other in zip(large, small, strict=True))), np.where(
        is_edge, jumps, 0.0
    )


def _neighbours(shape: tuple[int, ...], sigma: float) -> Iterator[tuple[int, int, float]]:
    """List the steps right and down to neighbours, with their Gaussian weights."""
    reach = math.floor(sigma * math.sqrt(-2.0 * math.log(_CUT)))
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            weight = math.exp(-0.5 * (down * down + right * right) / sigma**2)
            if weight >= _CUT and abs(down) < shape[0] and abs(right) < shape[1]:
                yield down, right, weight


def _overlap(shape: tuple[int, ...], down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the pixels that have a neighbour at this step, and these neighbours."""
    height, width = shape
    here = slice(max(0, -down), height - max(0, down)), slice(max(0, -right), width - max(0, right))
    there = slice(max(0, down), height + min(0, down)), slice(max(0, right), width + min(0, right))
    return here, there


def _jumps(planes: Planes) -> FloatArray:
    """Compute the largest difference of neighbours' disparities from each pixel's plane."""
    jump = np.zeros(planes.value.shape)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            here, there = _overlap(jump.shape, down, right)
            expected = planes.value[here] + right * planes.right[here] + down * planes.down[here]
            jump[here] = np.maximum(jump[here], np.abs(planes.value[there] - expected))
    return jump


def _fit(before: Planes, arrays: FloatArray, uncertainty: FloatArray, sigma: float, prior: float) -> Planes:
    """Fit planes in neighbourhoods of one size, by their normal equations.

    arrays : information, information times disparity, and information that is of noise alone.
    """
    shape = before.value.shape
    normal, noise = np.zeros((9, *shape)), np.zeros(shape)
    for down, right, near in _neighbours(shape, sigma):
        here, there = _overlap(shape, down, right)
        expected = before.value[here] + right * before.right[here] + down * before.down[here]
        limit = _SAME**2 * (uncertainty[here] ** 2 + uncertainty[there] ** 2)
        # Tukey's biweight.
        weight = near * np.maximum(1.0 - (before.value[there] - expected) ** 2 / limit, 0.0) ** 2
        information, total = weight * arrays[0][there], weight * arrays[1][there]
        noise[here] += weight * arrays[2][there]
        for number, factor in enumerate((1, right, down, right * right, right * down, down * down)):
            if factor:
                normal[number][here] += factor * information
        for number, factor in enumerate((1, right, down)):
            if factor:
                normal[6 + number][here] += factor * total
    return _solve(normal, noise, before, prior)


def _solve(normal: FloatArray, noise: FloatArray, before: Planes, prior: float) -> Planes:
    """Solve symmetric 3 x 3 equations for value and slopes, by cofactors."""
    whole, x, y, xx, xy, yy, total, total_x, total_y = normal
    xx, yy = xx + _FLAT, yy + _FLAT
    # The block of slopes is positive definite; the rest is its Schur complement.
    determinant = xx * yy - xy * xy
    to_right, to_down = (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant
    own = whole - x * to_right - y * to_down
    # It cannot be negative but for rounding.
    own = np.maximum(own, 0.0)
    value = (total - to_right * total_x - to_down * total_y + prior * before.value) / (own + prior)
    rest_x, rest_y = total_x - x * value, total_y - y * value
    right, down = (yy * rest_x - xy * rest_y) / determinant, (xx * rest_y - xy * rest_x) / determinant
    # Noise has slopes, too, which are no texture: what is known is less, and the estimate is drawn to where it began.
    share = np.maximum(1.0 - _MARGIN * noise / np.where(whole > 0.0, whole, 1.0), 0.0)
    return Planes(value, right, down, 1.0 / (own * share**2 + prior))
