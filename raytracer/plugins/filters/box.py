"""Box filter: the mean over the pixel's square.

In a scene:

    film: {width: 400, height: 225, filter: box}
"""

from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.plugins.filters.base.interface import FilterSpec, sample_filter
from raytracer.schema.fields import PositiveNumber


class Box(FilterSpec):
    """The mean over a square around the pixel's centre."""

    type: Literal["box"] = "box"
    width: PositiveNumber = Field(default=1.0, description="edge of the square (pixels)")

    def pack(self) -> "BoxFilter":
        return BoxFilter(self.width)

    def support(self) -> float:
        return 0.5 * self.width

    def box_width(self) -> float:
        return self.width


class BoxFilter(NamedTuple):
    """Packed box."""

    width: float


@sample_filter.register(BoxFilter)
def sample_filter_box_filter(pixel_filter, u1, u2):
    return pixel_filter.width * (u1 - 0.5), pixel_filter.width * (u2 - 0.5), 1.0
