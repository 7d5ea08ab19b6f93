"""A slab of light: all rays from a rectangle of one plane to a rectangle of another, by where they meet both.

In a scene, from 9 x 9 places of a square of 20 cm to a picture's pixels on 3 m x 2 m, 4 m away:

    camera: {type: light_slab, uv: 0.2, rows: 9, columns: 9, st: [3, 2], separation: 4, look_from: [0, 1, 4],
             look_at: [0, 1, 0]}
    film: {width: 300, height: 200}
"""

import math
from typing import Annotated, Literal

from pydantic import Field

from raytracer.film.light_field.layout import Mosaic
from raytracer.optics.thin_lens import field_of_view
from raytracer.plugins.apertures.base.polygon import pack_rectangle
from raytracer.plugins.cameras.base import views
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets
from raytracer.plugins.cameras.base.perspective_camera import ImagePlane, PerspectiveCamera
from raytracer.plugins.cameras.base.placement import PlacedSpec
from raytracer.plugins.cameras.base.thin_lens_ray import ThinLensPupil
from raytracer.schema.fields import Count, Extent, PositiveLength


class LightSlab(PlacedSpec):
    """The two-plane light field by itself: L(u, v, s, t), without cameras.

    The plane of u and v stands at `look_from`, that of s and t before it at `separation`, both across the view.  The
    first is cut into rows x columns cells, the second into the film's pixels.  The picture holds the cells side by
    side, the highest row at the top, each of the film's width x height, which shows what passes from the cell's middle,
    or with `fill` from all of the cell, through each pixel of the second plane.

    References: Levoy and Hanrahan 1996, "Light Field Rendering", sec. 2; Gortler et al. 1996, "The Lumigraph".
    """

    type: Literal["light_slab"] = "light_slab"
    rows: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="rows of cells of the plane of u and v")
    columns: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="cells in a row")
    uv: Extent = Field(description="width and height of the rectangle of the first plane (m), or one length for both")
    st: Extent = Field(
        description="width and height of the rectangle of the second plane (m), or one length for both; of one that is "
        "not of the film's shape, the largest part that is"
    )
    separation: PositiveLength | None = Field(
        default=None, description="from the first plane to the second (m); default: |look_at - look_from|"
    )
    fill: bool = Field(default=False, description="takes the rays of all of a cell, in place of those of its middle")

    def picture(self, width: int, height: int) -> tuple[int, int]:
        return self.columns * width, self.rows * height

    def film_margin(self, width: int, height: int) -> float:
        return views.view_margin(width, height)

    def _separation(self) -> float:
        """Return the distance from the first plane to the second (m)."""
        return self.distance() if self.separation is None else self.separation

    def _spacing(self) -> tuple[float, float]:
        """Return the width and height of a cell (m)."""
        return self.uv[0] / self.columns, self.uv[1] / self.rows

    def _pixel(self, width: int, height: int) -> float:
        """Return the edge of a pixel on the second plane (m)."""
        right, up = self.st
        return min(right / width, up / height)

    def _plane(self, width: int, height: int) -> ImagePlane:
        """Return the second plane, at a distance of 1."""
        pixel = self._pixel(width, height) / self._separation()
        return ImagePlane(pixel, -0.5 * pixel * width, 0.5 * pixel * height)

    def _grid(self, width: int, height: int) -> views.ViewGrid:
        return views.make_view_grid(self.rows, self.columns, self._spacing(), width, height, 1.0 / self._separation())

    def layout(self, width: int, height: int) -> Mosaic:
        cell = self._spacing() if self.fill else None
        grid, plane = self._grid(width, height), self._plane(width, height)
        return views.make_mosaic(self.frame(), plane, grid, self.rows, self.columns, cell)

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Return derived numbers: angles of the second plane from the middle of the first, and those of the views."""
        edge, separation = self._pixel(width, height), self._separation()
        right, up = edge * width, edge * height
        return {
            "vfov_deg": field_of_view(up, separation),
            "hfov_deg": field_of_view(right, separation),
            "dfov_deg": field_of_view(math.hypot(right, up), separation),
            "pixel_at_1m_mm": 1e3 * edge / separation,
            **views.describe_views(self.layout(width, height).views),
        }

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> views.ViewsCamera:
        lens = None
        if self.fill:
            right, up = self._spacing()
            lens = ThinLensPupil(math.sqrt(right * up / math.pi), 1.0 / self._separation(), pack_rectangle(right, up))
        camera = PerspectiveCamera(self.frame(), self._plane(width, height), lens, None)
        return views.replicate_camera(camera, self._grid(width, height))
