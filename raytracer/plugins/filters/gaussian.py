"""Gaussian filter: soft, without ringing.

In a scene:

    film: {width: 400, height: 225, filter: {type: gaussian, sigma: 0.5}}
"""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.sampling.warp import sin_cos_turn
from raytracer.plugins.filters.base.interface import FilterSpec, sample_filter
from raytracer.schema.fields import PositiveNumber


class Gaussian(FilterSpec):
    """exp(-r^2 / (2 sigma^2)) up to a radius from the pixel's centre, cut off there and not shifted down to 0.

    Every sample counts the same, so an even surface has no noise from the filter.

    References: Box, Muller 1958, "A Note on the Generation of Random Normal Deviates", up to a radius: r^2 / 2 sigma^2
    is distributed exponentially.
    """

    type: Literal["gaussian"] = "gaussian"
    sigma: PositiveNumber = Field(default=0.5, description="standard deviation (pixels)")
    radius: PositiveNumber = Field(default=1.5, description="distance from the centre at which it ends (pixels)")

    def pack(self) -> "GaussianFilter":
        ratio = self.radius / self.sigma
        return GaussianFilter(self.sigma, -math.expm1(-0.5 * ratio * ratio))

    def support(self) -> float:
        return self.radius


class GaussianFilter(NamedTuple):
    """Packed Gaussian.

    sigma (px) : its standard deviation.
    within : fraction of the whole Gaussian that lies within the radius.
    """

    sigma: float
    within: float


@sample_filter.register(GaussianFilter)
def sample_filter_gaussian_filter(pixel_filter, u1, u2):
    radius = pixel_filter.sigma * math.sqrt(-2.0 * math.log1p(-u1 * pixel_filter.within))
    sine, cosine = sin_cos_turn(u2)
    return radius * cosine, radius * sine, 1.0
