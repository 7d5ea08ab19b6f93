"""First guess of a microlens grid: its two shortest frequencies, from peaks of the picture's spectrum."""

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.decoding.subimage_phases import Levels
from raytracer.util.errors import InputError

Floats = NDArray[np.float64]

MIN_MICROLENSES = 8
"""Fewest microlenses a side of a picture: a block, and its neighbours."""

SMALLEST_PITCH, LARGEST_PITCH = 4.0, 64.0
"""Least and greatest distance (pixels) of microlenses."""

SPECTRUM_SIZE = 1536
"""Pixels a side of the part whose spectrum is computed: a hundred microlenses and more, in a fraction of a second."""

_LEAST_LIGHT = 0.1
"""Least light around a pixel that has a part in the spectrum, as a share of that of bright ones."""

_LEAST_LIT = 0.1
"""Least share of lit pixels of a row or a column at the edge of the part whose spectrum is computed."""

_STRIDE = 8
"""Pixels from one to the next of those from which a quantile of local light is computed."""

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


@dataclass(frozen=True)
class SpectrumPart:
    """Part of a picture whose spectrum is computed: the middle of what is lit.

    values : light without its slow changes, in units of these, under a window (rows, columns).
    left, top : of the part in the picture (px).
    """

    values: Floats
    left: int
    top: int

    @property
    def middle(self) -> tuple[float, float]:
        """Middle of the part in the picture (px)."""
        rows, columns = self.values.shape
        return self.left + 0.5 * columns, self.top + 0.5 * rows

    def phases(self, frequencies: Floats) -> Floats:
        """Compute the phases (n,) of waves in the part, counted from the picture's corner (cycles)."""
        rows, columns = self.values.shape
        x, y = self.left + np.arange(columns) + 0.5, self.top + np.arange(rows) + 0.5
        phasors = [
            (self.values @ np.exp(-2j * np.pi * right * x)) @ np.exp(-2j * np.pi * down * y)
            for right, down in frequencies
        ]
        return np.asarray(np.angle(phasors) / (2.0 * np.pi))


def cut_part(picture: NDArray[Any], levels: Levels) -> SpectrumPart:
    """Cut out the middle of what is lit, at most `SPECTRUM_SIZE` pixels a side, and divide it by its local light.

    Steps of the light, at the edge of what is lit, have spectra of their own, in which long pitches would drown.
    """
    from scipy.ndimage import uniform_filter

    light = np.clip(picture.astype(np.float32), levels.bottom, levels.top) - np.float32(levels.bottom)
    around = 2 * round(LARGEST_PITCH) + 1
    mean = uniform_filter(light, around, mode="constant")
    # Pixels outside the picture are none of the mean.
    inside = [uniform_filter(np.ones(size, np.float32), around, mode="constant") for size in light.shape]
    mean /= inside[0][:, None] * inside[1]
    bright = mean > _LEAST_LIGHT * np.quantile(mean[::_STRIDE, ::_STRIDE], 0.9)
    slices = []
    for axis, size in enumerate(picture.shape):
        lit = np.flatnonzero(bright.sum(axis=1 - axis) > _LEAST_LIT * bright.shape[1 - axis])
        first, last = (int(lit[0]), int(lit[-1]) + 1) if len(lit) else (0, size)
        cut = max(0, last - first - SPECTRUM_SIZE) // 2
        slices.append(slice(first + cut, min(last, first + cut + SPECTRUM_SIZE)))
    part, local = light[tuple(slices)], mean[tuple(slices)]
    is_lit = bright[tuple(slices)]
    values = np.where(is_lit, part / np.where(is_lit, local, 1.0) - 1.0, 0.0).astype(np.float64)
    height, width = values.shape
    # Half a pixel in, windows that are 0 just outside the part.
    window = [np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 2 for size in (height, width)]
    values *= window[0][:, None] * window[1]
    return SpectrumPart(values, slices[1].start, slices[0].start)


def find_frequencies(picture: NDArray[Any], levels: Levels, name: str) -> tuple[SpectrumPart, Floats]:
    """Find the two shortest frequencies (2, 2) of a grid, right and down (cycles a pixel), and where they were seen.

    name : of the picture, with which messages begin.

    Raises InputError: the picture is too small, or its spectrum has no peaks of a grid.
    """
    from scipy.fft import fft2, fftshift
    from scipy.ndimage import maximum_filter, uniform_filter

    height, width = picture.shape
    if min(height, width) < MIN_MICROLENSES * SMALLEST_PITCH:
        raise InputError(f"{name}: has {width} x {height} pixels, too few to hold microlenses")
    seen = cut_part(picture, levels)
    height, width = seen.values.shape
    power = np.abs(fftshift(fft2(seen.values)))
    fx = (np.arange(width) - width // 2) / width
    fy = (np.arange(height) - height // 2) / height
    radius = np.hypot(fx, fy[:, None])

    # The rows of hexagons are closer to one another than microlenses, and their frequency is higher for it.
    usable = (radius > 1.0 / LARGEST_PITCH) & (radius < 2.0 / math.sqrt(3.0) / SMALLEST_PITCH)
    if not usable.any():
        raise no_grid_error(name)
    size = (min(height, _NEIGHBOURHOOD), min(width, _NEIGHBOURHOOD))
    # Running sums of squares end below 0 by rounding.
    around = np.sqrt(np.maximum(uniform_filter(power * power, size), 0.0))
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
    return seen, _choose_basis(refined, heights[keep], 2.0 / min(width, height), name)


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
