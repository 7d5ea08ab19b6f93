"""Between the pixels of a view: what it holds at places that are shifted by part of a pixel.

References: Keys 1981, "Cubic Convolution Interpolation for Digital Image Processing"; Duchon 1979, "Lanczos Filtering
in One and Two Dimensions"; Unser 1999, "Splines: A Perfect Fit for Signal and Image Processing".
"""

import math
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Interpolation: TypeAlias = Literal["linear", "cubic", "lanczos"]

INTERPOLATIONS: tuple[Interpolation, ...] = ("linear", "cubic", "lanczos")

# Of Keys's family, that which reproduces parabolas.
_KEYS = -0.5

_LOBES = 3


class Taps(NamedTuple):
    """Weights of pixels next to each other, and how far the first is from where one looks, rounded down."""

    weights: Array
    first: int


def taps(interpolation: Interpolation, fraction: float) -> Taps:
    """What pixels count for at `fraction` of the way from one to the next, 0 <= fraction < 1; they sum to 1."""
    if fraction == 0.0:
        return Taps(np.ones(1), 0)
    if interpolation == "linear":
        return Taps(np.array([1.0 - fraction, fraction]), 0)
    reach = 2 if interpolation == "cubic" else _LOBES
    away = np.abs(fraction - np.arange(1 - reach, reach + 1))
    if interpolation == "cubic":
        near = ((_KEYS + 2.0) * away - (_KEYS + 3.0)) * away**2 + 1.0
        far = _KEYS * (((away - 5.0) * away + 8.0) * away - 4.0)
        weights = np.where(away <= 1.0, near, far)
    else:
        weights = np.sinc(away) * np.sinc(away / reach)
    return Taps(weights / weights.sum(), 1 - reach)


class Shift(NamedTuple):
    """Along one axis of a view of `size` pixels: what is at the places begin + shift ... end - 1 + shift.

    low, the first pixel that counts there (it may be outside of the view), and high, the one after the last; weights,
    of pixels next to each other; seen (end - begin,) bool, which places are within the view.
    """

    low: int
    high: int
    weights: Array
    seen: NDArray[np.bool_]

    def of(self, block: Array, start: int, axis: int) -> Array:
        """The values there, of pixels from `start` on along an axis; beyond the edge the last pixel goes on."""
        stop = start + block.shape[axis]
        before, after = max(0, start - self.low), max(0, self.high - stop)
        if before or after:
            pad = [(0, 0)] * block.ndim
            pad[axis] = (before, after)
            block = np.pad(block, pad, mode="edge")
        first, size = self.low - start + before, self.high - self.low - len(self.weights) + 1
        found: Array | None = None
        for number, weight in enumerate(self.weights):
            if weight != 0.0:
                part = block[_along(axis, first + number, first + number + size)]
                found = weight * part if found is None else found + weight * part
        assert found is not None
        return found


def shift_by(shift: float, begin: int, end: int, size: int, interpolation: Interpolation) -> Shift:
    """See `Shift`."""
    whole = math.floor(shift)
    found = taps(interpolation, shift - whole)
    low = begin + whole + found.first
    places = np.arange(begin, end) + shift
    seen = (places >= -0.5) & (places <= size - 0.5)
    return Shift(low, low + (end - begin) + len(found.weights) - 1, found.weights, seen)


def _along(axis: int, begin: int, end: int) -> tuple[slice, ...]:
    return (*(slice(None),) * axis, slice(begin, end))
