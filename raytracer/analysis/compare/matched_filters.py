"""Filters that match a shift or a blur of an image, for images (height, width, 3) with a halo around them.

Weights and filters of a pixel must not depend on its own difference, whose noise they are to be projected on: those of
two unlike images are made of the pixels around it alone.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Standard deviations that Gaussians reach.
_TRUNCATE = 3.0

HALO = 13
"""Pixels around an image that its filters reach: those of the widest Gaussian, and one for the neighbours."""

# Binomial and central difference, along an axis; the central weight of the binomial of both axes.
_SMOOTH, _SLOPE = (0.25, 0.5, 0.25), (-0.5, 0.0, 0.5)
_CENTRE = 0.25

# Standard deviations of the Gaussians that bound the bands of blur (px); the first is the binomial, of 0.5 px^2.
_WIDER = (2.0, 4.0)
_BINOMIAL_VARIANCE = 0.5


def nearby(values: Array) -> Array:
    """Average the eight pixels around each, all but the outermost of which are right."""
    result = np.zeros_like(values)
    columns = values[:-2] + values[1:-1] + values[2:]
    beside = values[:-2, 1:-1] + values[2:, 1:-1]
    # Without the pixel itself from the start: taken away later, one that is bright would leave its rounding.
    result[1:-1, 1:-1] = (columns[:, :-2] + columns[:, 2:] + beside) / 8.0
    return result


def _along(values: Array, weights: tuple[float, float, float], axis: int) -> Array:
    from scipy.ndimage import correlate1d

    return np.asarray(correlate1d(values, weights, axis=axis, mode="nearest"))


def fine_filters(values: Array, *, alike: bool) -> Iterator[tuple[Array, Array]]:
    """Filter an image by the filters that match shifts to the right and downwards, and the finest blur.

    Yields
    ------
    matched filter ; the change of the image by one unit of the pattern.
    """
    for axis in (1, 0):
        # An image that moves to the right becomes darker by its slope to the right.
        moved = -_along(values, _SLOPE, axis)
        yield _along(moved, _SMOOTH, 1 - axis), moved
    finer = _smooth(values) - values
    yield finer + (_CENTRE - 1.0) * _own(values, alike=alike), finer / _BINOMIAL_VARIANCE


def wide_filters(values: Array, *, alike: bool) -> Iterator[Array]:
    """Filter an image by the filters that match wider blurs: bands between Gaussians."""
    from scipy.ndimage import gaussian_filter

    smooth, centre = _smooth(values), _CENTRE
    own = _own(values, alike=alike)
    for width in _WIDER:
        wider = np.asarray(gaussian_filter(values, width, mode="nearest", truncate=_TRUNCATE, axes=(0, 1)))
        next_centre = _centre_of_gaussian(width)
        yield wider - smooth + (next_centre - centre) * own
        smooth, centre = wider, next_centre


def _own(values: Array, *, alike: bool) -> Array | float:
    """Estimate a pixel's own value for its filter from its neighbours, less that value; 0 for like images.

    Of unlike images the noisier one would seem the sharper: a pixel's own mean, which would tell, is replaced by what a
    parabola through its neighbours along both axes has there.
    """
    return 0.0 if alike else (4.0 * _adjacent(values, 1) - _adjacent(values, 2)) / 3.0 - values


def _smooth(values: Array) -> Array:
    return _along(_along(values, _SMOOTH, 0), _SMOOTH, 1)


def _adjacent(values: Array, distance: int) -> Array:
    """Average the four pixels at a distance along the axes, all but the outermost of which are right."""
    result, n = np.zeros_like(values), distance
    across = values[n:-n, : -2 * n] + values[n:-n, 2 * n :]
    result[n:-n, n:-n] = 0.25 * (values[: -2 * n, n:-n] + values[2 * n :, n:-n] + across)
    return result


def _centre_of_gaussian(width: float) -> float:
    """Compute the weight that a pixel has in its own mean, of the filter that `gaussian_filter` makes."""
    radius = int(_TRUNCATE * width + 0.5)
    return float(1.0 / np.exp(-0.5 * (np.arange(-radius, radius + 1) / width) ** 2).sum() ** 2)
