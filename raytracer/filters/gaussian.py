"""Gaussian filter: soft, without ringing.

    film: {width: 400, height: 225, filter: {type: gaussian, sigma: 0.5}}
"""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.filters.interface import sample_filter
from raytracer.spec import PositiveNumber, Spec


class Gaussian(Spec):
    """exp(-r^2 / (2 sigma^2)) up to a radius from the pixel's centre, and nothing beyond.

    References: Box and Muller 1958, "A Note on the Generation of Random Normal Deviates", cut off at a radius.
    """

    type: Literal["gaussian"] = "gaussian"
    sigma: PositiveNumber = Field(default=0.5, description="standard deviation (pixels)")
    radius: PositiveNumber = Field(default=1.5, description="distance from the centre at which it ends (pixels)")

    def pack(self) -> "GaussianFilter":
        return GaussianFilter(self.sigma, -math.expm1(-0.5 * (self.radius / self.sigma) ** 2))


class GaussianFilter(NamedTuple):
    """Packed: sigma, and the fraction of the whole Gaussian that lies within the radius."""

    sigma: float
    within: float


@sample_filter.register(GaussianFilter)
def _(filter, u1, u2):  # type: ignore[no-untyped-def]
    radius = filter.sigma * math.sqrt(-2.0 * math.log1p(-u1 * filter.within))
    angle = 2.0 * math.pi * u2
    return radius * math.cos(angle), radius * math.sin(angle), 1.0
