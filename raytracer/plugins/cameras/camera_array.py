"""An array of cameras in one plane, which all photograph the scene at once.

In a scene, 17 x 17 pinholes 2 cm apart, and 9 x 9 square lenses without gaps, which together are one lens of 45 mm:

    camera: {type: camera_array, rows: 17, columns: 17, spacing: 20 mm, look_from: [0, 1, 4], look_at: [0, 1, 0],
             vfov: 40, focus_distance: 3}
    camera: {type: camera_array, rows: 9, columns: 9, spacing: 5 mm, fill: true, look_from: [0, 1, 4],
             look_at: [0, 1, 0], vfov: 40, focus_distance: 3}
"""

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from raytracer.film.light_field.layout import Mosaic
from raytracer.plugins.apertures.base.polygon import pack_rectangle
from raytracer.plugins.cameras.base import views
from raytracer.plugins.cameras.base.ideal import IdealLensSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets
from raytracer.plugins.cameras.base.perspective import ApertureSize
from raytracer.schema.fields import Count, Extent, PositiveLengthOrInf
from raytracer.schema.rules import never


class CameraArray(IdealLensSpec):
    """Rows and columns of equal cameras that look along parallel axes, their middle at `look_from`.

    The film of each is shifted so that all of them see the plane at `convergence_distance` alike: a point of it is at
    the same pixel of all views, as at the focal plane of one large lens of which each camera is a part.  The picture
    holds the views side by side, the highest row at the top and the leftmost column at the left, each of the film's
    width x height; `--crop` and `--pixel` count its pixels, the shutter's rows and columns are those of each view.

    Views are pinholes, or thin lenses of their own with an opening, focused at `focus_distance`.  With `fill` the
    opening of each is the rectangle around it that is `spacing` wide and high: together they are one lens without gaps,
    and the mean of all views is its photograph, focused at `convergence_distance`.

    References: Wilburn et al. 2005, "High Performance Imaging Using Large Camera Arrays"; Levoy and Hanrahan 1996,
    "Light Field Rendering", sec. 3 (sheared frustums); Isaksen, McMillan and Gortler 2000.
    """

    aperture_hint: ClassVar[str] = f"{IdealLensSpec.aperture_hint}, or fill"

    type: Literal["camera_array"] = "camera_array"
    rows: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="rows of cameras")
    columns: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="cameras in a row")
    spacing: Extent = Field(
        description="from one camera to the next (m), such as 20 mm; or two, to the right and upwards: [20 mm, 30 mm]"
    )
    convergence_distance: PositiveLengthOrInf | None = Field(
        default=None,
        description="distance of the plane that is at the same place in all views (m), inf for views that are not "
        "shifted; default: that of the plane of focus",
    )
    fill: bool = Field(
        default=False,
        description="gives each camera an opening as wide and high as `spacing`, so that together they are one lens",
    )

    _one_opening = never(
        *("defocus_angle", "aperture", "f_number", "aperture_shape"),
        where={"fill": True},
        message="{key} and fill both say what the openings are: give one of them",
    )

    @model_validator(mode="after")
    def _is_developed_view_by_view(self) -> Any:
        views.refuse_bayer(self.simulated_sensor())
        return self

    def convergence(self) -> float:
        """Return the distance (m) of the plane that all views see alike."""
        return self.plane_of_focus() if self.convergence_distance is None else self.convergence_distance

    def aperture_size(self) -> ApertureSize:
        if not self.fill:
            return super().aperture_size()
        # A disc as large as the rectangle.
        return ApertureSize(2.0 * math.sqrt(self.spacing[0] * self.spacing[1] / math.pi))

    def pack_shape(self, assets: Assets) -> Any:
        return pack_rectangle(*self.spacing) if self.fill else super().pack_shape(assets)

    def picture(self, width: int, height: int) -> tuple[int, int]:
        return self.columns * width, self.rows * height

    def film_margin(self, width: int, height: int) -> float:
        return views.view_margin(width, height)

    def _grid(self, width: int, height: int) -> views.ViewGrid:
        return views.make_view_grid(self.rows, self.columns, self.spacing, width, height, 1.0 / self.convergence())

    def layout(self, width: int, height: int) -> Mosaic:
        camera, grid = self.pack_with_lens(width, height, None), self._grid(width, height)
        focal_length = self.optics(width, height).focal_length
        # What light a round opening gathers comes from a square of its area.
        side = 0.5 * math.sqrt(math.pi) * self.pupil_diameter(width, height)
        cell = None if side <= 0.0 else self.spacing if self.fill else (side, side)
        return views.make_mosaic(camera.frame, camera.plane, grid, self.rows, self.columns, cell, focal_length)

    def describe(self, width: int, height: int) -> dict[str, float]:
        return super().describe(width, height) | views.describe_views(self.layout(width, height).views)

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> views.ViewsCamera:
        camera = self.pack_with_lens(width, height, self.pack_lens(width, height, assets))
        return views.replicate_camera(camera, self._grid(width, height))
