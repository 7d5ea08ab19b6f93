"""Cameras with an ideal lens: the keys that give its size, and the packed lens."""

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from raytracer.film.light_field.layout import Layout, Mosaic
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.optics.thin_lens import magnification
from raytracer.plugins.apertures.base.vignetting import Opening, Vignetting
from raytracer.plugins.cameras.base.exposed import FocusedSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets
from raytracer.plugins.cameras.base.perspective import ApertureSize, PerspectiveSpec
from raytracer.plugins.cameras.base.perspective_camera import FlatPupil, Irradiance
from raytracer.plugins.cameras.base.thin_lens_ray import ThinLensPupil
from raytracer.schema.fields import NonNegativeLensLength, Quantity
from raytracer.schema.rules import exclusive
from raytracer.schema.spec import field_error
from raytracer.schema.units import METRES_PER_MILLIMETRE


class IdealLensSpec(FocusedSpec, PerspectiveSpec):
    """Base of the cameras with a thin lens."""

    aperture_hint: ClassVar[str] = "give a finite f_number, or aperture or defocus_angle"

    defocus_angle: Annotated[float, Quantity("angle", low=0.0, high=180.0, high_open=True)] | None = Field(
        default=None, description="apex angle (deg) of the cone from a point in focus to the lens"
    )
    aperture: NonNegativeLensLength | None = Field(default=None, description="diameter of the lens (mm)")
    vignetting: Vignetting | None = Field(
        default=None,
        description="a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side; "
        "without effect where the lens has no opening",
    )

    pupil: Literal["aplanatic", "flat"] = Field(
        default="aplanatic",
        description="how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, "
        "as an even disc of light in its place",
    )

    _one_aperture = exclusive("defocus_angle", "aperture", "f_number", sets="the size of the lens")

    @model_validator(mode="after")
    def _can_be_focused(self) -> Any:
        if not self.has_focus_target():
            self.check_focus()
        return self

    def check_focus(self) -> None:
        if self.defocus_angle and math.isinf(self.plane_of_focus()):
            raise ValueError("defocus_angle needs a finite focus_distance: with focus at infinity, give aperture")
        focal_length = self.given_focal_length()
        if focal_length is not None and 1e3 * self.plane_of_focus() <= focal_length:
            field_error(
                "focal_length" if self.focus_distance is None else "focus_distance",
                f"the plane of focus, {self.plane_of_focus():g} m away, must be farther than the focal length, "
                f"{focal_length:g} mm: nearer there is no image",
            )

    def aperture_size(self) -> ApertureSize:
        """Return the size of the lens as the keys give it, by `defocus_angle` 2 F tan(defocus_angle / 2)."""
        if self.defocus_angle:
            return ApertureSize(2.0 * self.plane_of_focus() * math.tan(math.radians(self.defocus_angle) / 2.0))
        if self.aperture:
            return ApertureSize(METRES_PER_MILLIMETRE * self.aperture)
        return super().aperture_size()

    def film_irradiance(self, image: float, area: float) -> Irradiance | FlatPupil:
        return FlatPupil(image, area) if self.pupil == "flat" else super().film_irradiance(image, area)

    def opening(self) -> Opening:
        return Opening(self.aperture_shape, self.vignetting)

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Return derived numbers; the blur at infinity is the circle of confusion A |z - F| / z for z to infinity."""
        numbers = super().describe(width, height)
        pixel, pupil = 1e-3 * numbers["pixel_at_1m_mm"], self.pupil_diameter(width, height)
        if "image_distance_mm" in numbers:
            numbers["magnification"] = magnification(numbers["image_distance_mm"], 1e3 * self.plane_of_focus())
        return {
            **numbers,
            "focus_distance_m": self.plane_of_focus(),
            "aperture_diameter_mm": pupil / METRES_PER_MILLIMETRE,
            "blur_at_infinity_px": pupil / (pixel * self.plane_of_focus()),
        }

    def layout(self, width: int, height: int) -> Layout | None:
        """Return the light field of the lens, of which the picture is the only view."""
        optics, diameter = self.optics(width, height), self.pupil_diameter(width, height)
        camera = self.pack_with_lens(width, height, None)
        return Mosaic(
            Views(
                position=np.zeros((1, 1, 2)),
                plane=Plane(*camera.plane),
                width=width,
                height=height,
                inverse_focus=1.0 / self.plane_of_focus(),
                aperture=diameter if diameter > 0.0 else None,
                focal_length=optics.focal_length,
                pose=Pose(*camera.frame),
            )
        )

    def pack_lens(self, width: int, height: int, assets: Assets = NO_ASSETS) -> ThinLensPupil | None:
        """Pack the lens for a film of width x height pixels; None where the aperture is 0."""
        radius = self.pupil_diameter(width, height) / 2.0
        if radius == 0.0:
            return None
        rim = None if self.vignetting is None else self.vignetting.pack()
        return ThinLensPupil(radius, 1.0 / self.plane_of_focus(), self.pack_shape(assets), rim)
