"""Interpolation between the pixels of a view that is shifted by part of a pixel.

References: Keys 1981, "Cubic Convolution Interpolation for Digital Image Processing"; Duchon 1979, "Lanczos Filtering
in One and Two Dimensions"; Unser 1999, "Splines: A Perfect Fit for Signal and Image Processing".
"""

import math
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Interpolation: TypeAlias = Literal["linear", "cubic", "lanczos"]

INTERPOLATIONS: tuple[Interpolation, ...] = ("linear", "cubic", "lanczos")

# Parameter of Keys's family of kernels: this one reproduces parabolas.
_KEYS = -0.5

_LANCZOS_LOBES = 3


class Taps(NamedTuple):
    """Weights of neighbouring pixels.

    weights : of the pixels, from the first on.
    first : index of the first, from the place rounded down.
    """

    weights: FloatArray
    first: int


def interpolation_taps(interpolation: Interpolation, fraction: float) -> Taps:
    """Compute the weights of pixels at `fraction` of the way from one to the next, 0 <= fraction < 1; they sum to 1."""
    if fraction == 0.0:
        return Taps(np.ones(1), 0)
    if interpolation == "linear":
        return Taps(np.array([1.0 - fraction, fraction]), 0)
    reach = 2 if interpolation == "cubic" else _LANCZOS_LOBES
    away = np.abs(fraction - np.arange(1 - reach, reach + 1))
    if interpolation == "cubic":
        near = ((_KEYS + 2.0) * away - (_KEYS + 3.0)) * away**2 + 1.0
        far = _KEYS * (((away - 5.0) * away + 8.0) * away - 4.0)
        weights = np.where(away <= 1.0, near, far)
    else:
        weights = np.sinc(away) * np.sinc(away / reach)
    return Taps(weights / weights.sum(), 1 - reach)


class AxisShift(NamedTuple):
    """Shift along one axis of a view: its values at the places begin + shift ... end - 1 + shift.

    low : first pixel that is read; it may be outside of the view.
    high : one after the last pixel that is read.
    weights : of neighbouring pixels.
    seen : (end - begin,) bool, True for places within the view.
    """

    low: int
    high: int
    weights: FloatArray
    seen: NDArray[np.bool_]

    def apply(self, block: FloatArray, start: int, axis: int) -> FloatArray:
        """Interpolate pixels that begin at `start` along an axis; beyond the edge the last pixel is repeated."""
        stop = start + block.shape[axis]
        before, after = max(0, start - self.low), max(0, self.high - stop)
        if before or after:
            pad = [(0, 0)] * block.ndim
            pad[axis] = (before, after)
            block = np.pad(block, pad, mode="edge")
        first, size = self.low - start + before, self.high - self.low - len(self.weights) + 1
        total: FloatArray | None = None
        for number, weight in enumerate(self.weights):
            if weight != 0.0:
                part = block[_along(axis, first + number, first + number + size)]
                total = weight * part if total is None else total + weight * part
        assert total is not None
        return total


def make_shift(shift: float, begin: int, end: int, size: int, interpolation: Interpolation) -> AxisShift:
    """Make the shift of a view of `size` pixels by `shift` pixels, for the places from `begin` to before `end`."""
    whole = math.floor(shift)
    taps = interpolation_taps(interpolation, shift - whole)
    low = begin + whole + taps.first
    places = np.arange(begin, end) + shift
    seen = (places >= -0.5) & (places <= size - 0.5)
    return AxisShift(low, low + (end - begin) + len(taps.weights) - 1, taps.weights, seen)


def _along(axis: int, begin: int, end: int) -> tuple[slice, ...]:
    """Index the range begin <= i < end of one axis."""
    return (*(slice(None),) * axis, slice(begin, end))
