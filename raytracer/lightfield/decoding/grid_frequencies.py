"""First guess of a microlens grid: its two shortest frequencies, from peaks of the picture's spectrum."""

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.util.errors import InputError

Floats = NDArray[np.float64]

MIN_MICROLENSES = 8
"""Fewest microlenses a side of a picture: a block, and its neighbours."""

SMALLEST_PITCH, LARGEST_PITCH = 4.0, 64.0
"""Least and greatest distance (pixels) of microlenses."""

SPECTRUM_SIZE = 1536
"""Pixels a side of the part whose spectrum is computed: a hundred microlenses and more, in a fraction of a second."""

_LEAST_PROMINENCE = 6.0
"""Least ratio of a peak to the root mean square of the spectrum around it: noise reaches it once in 10^15 places."""

_LEAST_HEIGHT = 0.2
"""Least height of a peak, as a share of the strongest one's."""

_PEAKS = 24
"""Most peaks that are compared: a grid has six of the first order, and as many of the second and the third."""

_NEIGHBOURHOOD = 63
"""Frequencies a side of the neighbourhood of a peak: many times its own width, which is a few."""

_LENGTH_RATIO, _SQUARE, _HEXAGONAL = 1.2, 0.15, (0.35, 0.62)
"""Of two frequencies that may span a grid: the largest ratio of their lengths, and bounds of the cosine between them,
of 90 or of 60 degrees.  Exact values are 1, and 0 or 0.5; the bounds allow for the error of a first guess."""

_TIE = 0.02
"""Difference, as a share of the peaks' heights, up to which two pairs explain them equally well."""


def middle_part(picture: NDArray[Any]) -> NDArray[Any]:
    """Cut out the middle of a picture, of at most `SPECTRUM_SIZE` pixels a side."""
    height, width = picture.shape
    rows, columns = min(height, SPECTRUM_SIZE), min(width, SPECTRUM_SIZE)
    top, left = (height - rows) // 2, (width - columns) // 2
    return picture[top : top + rows, left : left + columns]


def find_frequencies(part: NDArray[Any], bottom: float, top: float, name: str) -> Floats:
    """Find the two shortest frequencies (2, 2) of a grid, right and down (cycles a pixel).

    bottom, top : values between which the picture is clipped.
    name : of the picture, with which messages begin.

    Raises InputError: the picture is too small, or its spectrum has no peaks of a grid.
    """
    from scipy.fft import fft2, fftshift
    from scipy.ndimage import maximum_filter, uniform_filter

    height, width = part.shape
    if min(height, width) < MIN_MICROLENSES * SMALLEST_PITCH:
        raise InputError(f"{name}: has {width} x {height} pixels, too few to hold microlenses")
    values = np.clip(part.astype(np.float64), bottom, top)
    values = (values - values.mean()) * np.hanning(height)[:, None] * np.hanning(width)
    power = np.abs(fftshift(fft2(values)))
    fx = (np.arange(width) - width // 2) / width
    fy = (np.arange(height) - height // 2) / height
    radius = np.hypot(fx, fy[:, None])

    # The rows of hexagons are closer to one another than microlenses, and their frequency is higher for it.
    usable = (radius > 1.0 / LARGEST_PITCH) & (radius < 2.0 / math.sqrt(3.0) / SMALLEST_PITCH)
    if not usable.any():
        raise no_grid_error(name)
    around = np.sqrt(uniform_filter(power * power, size=(min(height, _NEIGHBOURHOOD), min(width, _NEIGHBOURHOOD))))
    peaks = (power == maximum_filter(power, size=5)) & usable & (fy[:, None] >= 0.0)
    rows, columns = np.nonzero(peaks)
    order = np.argsort(power[rows, columns])[::-1][:_PEAKS]
    rows, columns = rows[order], columns[order]
    heights = power[rows, columns]
    if not len(heights):
        raise no_grid_error(name)
    keep = (heights > _LEAST_PROMINENCE * around[rows, columns]) & (heights > _LEAST_HEIGHT * heights[0])
    refined = np.array(
        [_refine_peak(power, row, column) for row, column in zip(rows[keep], columns[keep], strict=True)]
    )
    if len(refined) < 2:
        raise no_grid_error(name)
    refined[:, 0] = (refined[:, 0] - width // 2) / width
    refined[:, 1] = (refined[:, 1] - height // 2) / height
    return _choose_basis(refined, heights[keep], 2.0 / min(width, height), name)


def _refine_peak(power: Floats, row: int, column: int) -> tuple[float, float]:
    """Refine column and row of a peak by a parabola through the logarithms of three neighbours each way."""
    rows, columns = power.shape

    def top(before: float, at: float, after: float) -> float:
        a, b, c = (math.log(max(value, np.finfo(float).tiny)) for value in (before, at, after))
        curve = a - 2.0 * b + c
        return 0.0 if curve >= 0.0 else 0.5 * (a - c) / curve

    x = top(power[row, column - 1], power[row, column], power[row, (column + 1) % columns])
    y = top(power[row - 1, column], power[row, column], power[(row + 1) % rows, column])
    return column + x, row + y


def _choose_basis(peaks: Floats, heights: Floats, tolerance: float, name: str) -> Floats:
    """Choose two peaks that span a square or hexagonal grid: the coarsest pair of those that explain most peaks."""
    best: tuple[float, float, Floats] | None = None
    for i, j in itertools.combinations(range(len(peaks)), 2):
        pair = peaks[[i, j]]
        lengths = np.linalg.norm(pair, axis=1)
        cosine = abs(float(pair[0] @ pair[1]) / float(lengths.prod()))
        is_known = cosine < _SQUARE or _HEXAGONAL[0] < cosine < _HEXAGONAL[1]
        if max(lengths) > _LENGTH_RATIO * min(lengths) or not is_known:
            continue
        orders = peaks @ np.linalg.inv(pair)
        away = np.linalg.norm((orders - np.rint(orders)) @ pair, axis=1)
        explained = float(heights[away < tolerance].sum() / heights.sum())
        size = abs(float(np.linalg.det(pair)))
        # A finer grid of frequencies explains all that a coarser one does, and must explain more to be preferred.
        more = math.inf if best is None else explained - best[0]
        if best is None or more > _TIE or (more > -_TIE and size > best[1]):
            best = (explained, size, pair)
    if best is None:
        raise no_grid_error(name)
    return best[2]


def no_grid_error(name: str) -> InputError:
    """Make the error of a picture without a regular grid."""
    return InputError(
        f"{name}: shows no regular grid of microlenses {SMALLEST_PITCH:g} to {LARGEST_PITCH:g} pixels apart; take an "
        "evenly bright picture with the same camera for --white, or give the grid with --grid"
    )
