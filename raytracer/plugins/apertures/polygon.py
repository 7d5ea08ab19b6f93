"""Polygonal aperture: the opening that the blades of a diaphragm leave.

In a scene:

    camera: {type: thin_lens, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 30, aperture: 40 mm,
             aperture_shape: {type: polygon, blades: 7, rotation: 10, curvature: 0.3}}
"""

from typing import Annotated, Literal

from pydantic import Field

from raytracer.plugins.apertures.base.interface import ApertureSpec, Assets
from raytracer.plugins.apertures.base.polygon import Polygon, pack_polygon
from raytracer.schema.fields import Angle, Count, Fraction


class PolygonAperture(ApertureSpec):
    """A regular polygon with a corner at the top, whose edges may bulge.

    Each edge is an arc of a circle whose curvature is `curvature` times that of the circle through the corners: a
    straight line for 0, and for 1 that circle itself, so that the opening is round.
    """

    type: Literal["polygon"] = "polygon"
    blades: Annotated[int, Count(3, 1000)] = Field(default=6, description="blades of the diaphragm, one an edge")
    rotation: Angle = Field(default=0.0, description="turn, anticlockwise as seen from behind the camera")
    curvature: Fraction = Field(
        default=0.0, description="how far the edges bulge: 0 straight, 1 along the circle through the corners"
    )

    def shape(self, assets: Assets) -> Polygon | None:
        return None if self.curvature == 1.0 else pack_polygon(self.blades, self.rotation, self.curvature)
