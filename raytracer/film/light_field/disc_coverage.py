"""Area of a disc within rectangles, such as an aperture within a pixel."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
