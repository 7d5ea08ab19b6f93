"""Mitchell filter: sharp, with a little ringing.

    film: {width: 400, height: 225, filter: mitchell}
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.filters.interface import sample_filter
from raytracer.jit import kernel
from raytracer.spec import Number, Spec

_RADIUS = 2.0
_CELLS = 1024
_QUADRATURE = 64


class Mitchell(Spec):
    """A cubic, separable filter of radius 2 with negative lobes, drawn by its magnitude and weighted by its sign.

    References: Mitchell and Netravali 1988, "Reconstruction Filters in Computer Graphics", eq. 8.
    """

    type: Literal["mitchell"] = "mitchell"
    b: Number = Field(default=1.0 / 3.0, description="blur: Mitchell and Netravali's B")
    c: Number = Field(default=1.0 / 3.0, description="ringing: Mitchell and Netravali's C; B + 2 C = 1 suits best")

    def pack(self) -> "MitchellFilter":
        # Positions between which the integral of |f| grows by equal steps.
        fine = np.linspace(-_RADIUS, _RADIUS, _CELLS * _QUADRATURE + 1)
        middle = 0.5 * (fine[1:] + fine[:-1])
        magnitude = np.abs([mitchell(x, self.b, self.c) for x in middle])
        growth = np.concatenate([[0.0], np.cumsum(magnitude)])
        return MitchellFilter(self.b, self.c, np.interp(np.linspace(0.0, growth[-1], _CELLS + 1), growth, fine))


class MitchellFilter(NamedTuple):
    """Packed: B, C, and the quantiles (n + 1,) float64 of |f|, between which positions are drawn evenly."""

    b: float
    c: float
    quantiles: NDArray[np.float64]


@kernel
def mitchell(x: float, b: float, c: float) -> float:
    """The filter's value at a distance in pixels along one axis; its integral is 1."""
    x = abs(x)
    if x < 1.0:
        return ((12.0 - 9.0 * b - 6.0 * c) * x**3 + (-18.0 + 12.0 * b + 6.0 * c) * x**2 + (6.0 - 2.0 * b)) / 6.0
    if x < 2.0:
        return (
            (-b - 6.0 * c) * x**3 + (6.0 * b + 30.0 * c) * x**2 + (-12.0 * b - 48.0 * c) * x + (8.0 * b + 24.0 * c)
        ) / 6.0
    return 0.0


@kernel
def _sample_axis(filter, u):  # type: ignore[no-untyped-def]
    """A position along one axis, and f over the density that it was drawn with."""
    cells = len(filter.quantiles) - 1
    cell = min(int(u * cells), cells - 1)
    low, high = filter.quantiles[cell], filter.quantiles[cell + 1]
    x = low + (u * cells - cell) * (high - low)
    return x, mitchell(x, filter.b, filter.c) * (high - low) * cells


@sample_filter.register(MitchellFilter)
def _(filter, u1, u2):  # type: ignore[no-untyped-def]
    dx, weight_x = _sample_axis(filter, u1)
    dy, weight_y = _sample_axis(filter, u2)
    return dx, dy, weight_x * weight_y
