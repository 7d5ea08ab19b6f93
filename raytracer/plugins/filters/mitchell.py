"""Mitchell filter: sharp, with a little ringing.

In a scene:

    film: {width: 400, height: 225, filter: mitchell}
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.compiler.dispatch import kernel
from raytracer.plugins.filters.base.interface import FilterSpec, sample_filter
from raytracer.schema.fields import Fraction

_CELLS = 1024
_STEPS_A_CELL = 64


class Mitchell(FilterSpec):
    """A cubic, separable filter of radius 2 with negative lobes, drawn by its magnitude and weighted by its sign.

    Pixels beside bright edges may thereby be below zero, of which renders tell the number.

    References: Mitchell, Netravali 1988, "Reconstruction Filters in Computer Graphics", eq. 8.
    """

    type: Literal["mitchell"] = "mitchell"
    b: Fraction = Field(default=1.0 / 3.0, description="blur: Mitchell and Netravali's B")
    c: Fraction = Field(default=1.0 / 3.0, description="ringing: Mitchell and Netravali's C; B + 2 C = 1 suits best")

    def pack(self) -> "MitchellFilter":
        b, c = self.b, self.c
        inner = [12.0 - 9.0 * b - 6.0 * c, -18.0 + 12.0 * b + 6.0 * c, 0.0, 6.0 - 2.0 * b]
        outer = [-b - 6.0 * c, 6.0 * b + 30.0 * c, -12.0 * b - 48.0 * c, 8.0 * b + 24.0 * c]
        cubics = np.array([inner, outer]) / 6.0

        # Positions between which the integral of |f| grows by equal steps.
        edges = np.linspace(-2.0, 2.0, _CELLS * _STEPS_A_CELL + 1)
        middle = np.abs(0.5 * (edges[1:] + edges[:-1]))
        values = np.where(middle < 1.0, np.polyval(cubics[0], middle), np.polyval(cubics[1], middle))
        growth = np.concatenate([[0.0], np.cumsum(np.abs(values))])
        return MitchellFilter(cubics, np.interp(np.linspace(0.0, growth[-1], _CELLS + 1), growth, edges))

    def support(self) -> float:
        return 2.0

    def has_negative_lobes(self) -> bool:
        # At the distance 2 - t, f is t^2 (t (B + 6 C) - 6 C) / 6, below zero near t = 0 for any C above 0; for C = 0 it
        # is so nowhere.
        return self.c > 0.0


class MitchellFilter(NamedTuple):
    """Packed filter for one axis.

    Positions are drawn evenly between the quantiles.  Weights divide f by the density that this makes, so their mean is
    1 however fine the table is.

    cubics (2, 4) float64 : f at distances 0 .. 1 and 1 .. 2, highest power first.
    quantiles (n + 1,) float64 : of |f|.
    """

    cubics: NDArray[np.float64]
    quantiles: NDArray[np.float64]


@kernel
def _sample_axis(pixel_filter, u):
    """Draw a position along one axis, and f over the density that it was drawn with."""
    cells = len(pixel_filter.quantiles) - 1
    cell = min(int(u * cells), cells - 1)
    low, high = pixel_filter.quantiles[cell], pixel_filter.quantiles[cell + 1]
    x = low + (u * cells - cell) * (high - low)
    distance = abs(x)
    piece = 0 if distance < 1.0 else 1
    value = 0.0
    for power in range(4):
        value = value * distance + pixel_filter.cubics[piece, power]
    return x, value * (high - low) * cells


@sample_filter.register(MitchellFilter)
def sample_filter_mitchell_filter(pixel_filter, u1, u2):
    dx, weight_x = _sample_axis(pixel_filter, u1)
    dy, weight_y = _sample_axis(pixel_filter, u2)
    return dx, dy, weight_x * weight_y
