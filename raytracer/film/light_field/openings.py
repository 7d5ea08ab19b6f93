"""The part of a lens's opening that lies in rectangles: what pixels behind microlenses see of it."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.surfaces import aperture_extent, aperture_transmission

FloatArray = NDArray[np.float64]

_PLACES = 384
"""Places a side, all over an opening, at which its transmission is summed."""

_ROUNDING = float(np.finfo(np.float64).eps) * _PLACES**2
"""Largest rounding of sums over all places, relative to all light."""


class OpeningTable:
    """Light through an opening that is not round, summed over a grid of places: any rectangle's part is a look-up.

    shape : a packed aperture, whose unit of length is the radius of the disc of its area.
    """

    def __init__(self, shape: Any) -> None:
        self._half = aperture_extent(shape)
        middles = ((np.arange(_PLACES) + 0.5) / _PLACES * 2.0 - 1.0) * self._half
        right, up = np.meshgrid(middles, middles)
        passes = np.vectorize(lambda x, y: aperture_transmission(shape, x, y), otypes=[np.float64])(right, up)
        sums = passes.cumsum(axis=0).cumsum(axis=1) * (2.0 * self._half / _PLACES) ** 2
        self._below = np.pad(sums, ((1, 0), (1, 0)))

    def coverage(self, left: Any, bottom: Any, width: float, height: float, radius: float) -> FloatArray:
        """Compute the fraction of rectangles that is open; as `disc_coverage`, with the radius of the disc."""
        left, bottom = np.broadcast_arrays(np.asarray(left, float) / radius, np.asarray(bottom, float) / radius)
        width, height = width / radius, height / radius
        right, top = left + width, bottom + height
        area = self._sum(right, top) - self._sum(left, top) - self._sum(right, bottom) + self._sum(left, bottom)
        # What rounding of the sums leaves where nothing is open is not light.
        area = np.where(area > _ROUNDING * self._below[-1, -1], area, 0.0)
        return np.asarray(np.clip(area / (width * height), 0.0, 1.0))

    def _sum(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Sum the light to the left of x and below y, linearly between places."""
        column, row = (np.clip((a / self._half + 1.0) * (0.5 * _PLACES), 0.0, _PLACES) for a in (x, y))
        i, j = (np.minimum(a.astype(np.intp), _PLACES - 1) for a in (row, column))
        down, across = row - i, column - j
        below = self._below
        low = below[i, j] + across * (below[i, j + 1] - below[i, j])
        high = below[i + 1, j] + across * (below[i + 1, j + 1] - below[i + 1, j])
        return np.asarray(low + down * (high - low))


def disc_coverage(left: Any, bottom: Any, width: float, height: float, radius: float) -> FloatArray:
    """Compute the fraction of rectangles that a disc about 0 covers; left and bottom edges are arrays of any shape."""
    left, bottom = np.broadcast_arrays(np.asarray(left, float), np.asarray(bottom, float))
    x = np.stack([left, left + width]) / radius
    y = np.stack([bottom, bottom + height]) / radius
    area = _disc_below(x[1], y[1]) - _disc_below(x[0], y[1]) - _disc_below(x[1], y[0]) + _disc_below(x[0], y[0])
    return np.asarray(np.clip(area * (radius / width) * (radius / height), 0.0, 1.0))


def _disc_below(x: FloatArray, y: FloatArray) -> FloatArray:
    """Compute the area of the unit disc to the left of x and below y."""
    # Between the places where the chord's ends are at the height y, it is cut; beyond them it is whole, or not there.
    x, y = np.clip(x, -1.0, 1.0), np.clip(y, -1.0, 1.0)
    turn = np.sqrt(1.0 - y * y)

    def half(t: FloatArray) -> FloatArray:
        """Integrate sqrt(1 - t^2) from -1 on."""
        return np.asarray(0.5 * (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) + 0.25 * math.pi)

    inner_end = np.clip(x, -turn, turn)
    cut = half(inner_end) - half(-turn) + y * (inner_end + turn)
    outer = 2.0 * (half(np.minimum(x, -turn)) + np.where(x > turn, half(x) - half(turn), 0.0))
    return np.asarray(cut + np.where(y > 0.0, outer, 0.0))
