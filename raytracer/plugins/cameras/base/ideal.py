"""What the cameras with an ideal lens share: its size, its focus, and the shape of its opening."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from raytracer.apertures.vignetting import Vignetting
from raytracer.cameras.focused import FocusedSpec
from raytracer.cameras.interface import NO_ASSETS, Assets
from raytracer.cameras.perspective import FlatPupil, Optics, PerspectiveSpec
from raytracer.cameras.pupil import Lens
from raytracer.photography import focal_length_of, image_distance, magnification
from raytracer.plenoptic.layout import Layout
from raytracer.plenoptic.mosaic import Mosaic
from raytracer.plenoptic.views import Plane, Pose, Views
from raytracer.spec import NonNegativeOptic, Quantity, at
from raytracer.units import METRES_PER_MILLIMETRE

_SIZES = ("defocus_angle", "aperture", "f_number")


class IdealLensSpec(FocusedSpec, PerspectiveSpec):
    """A camera behind a thin lens, which is focused at a distance, on an object, or at a place in the frame."""

    defocus_angle: Annotated[float, Quantity("angle", low=0.0, high=180.0, high_open=True)] | None = Field(
        default=None, description="apex angle (deg) of the cone from a point in focus to the lens"
    )
    aperture: NonNegativeOptic | None = Field(default=None, description="diameter of the lens (mm)")
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

    @model_validator(mode="after")
    def _one_aperture(self) -> Any:
        sizes = [key for key in _SIZES if getattr(self, key) is not None]
        if len(sizes) > 1:
            at(sizes[1], f"{sizes[0]} and {sizes[1]} both set the size of the lens: give one of them")
        if not self.focuses_on_something():
            self._check_focus()
        return self

    def _check_focus(self) -> None:
        """Refuse a plane of focus that the lens cannot have."""
        if self.defocus_angle and math.isinf(self.focal_distance()):
            raise ValueError("defocus_angle needs a finite focus_distance: with focus at infinity, give aperture")
        focal_length = self._given_focal_length()
        if focal_length is not None and 1e3 * self.focal_distance() <= focal_length:
            at(
                "focal_length" if self.focus_distance is None else "focus_distance",
                f"the plane of focus, {self.focal_distance():g} m away, must be farther than the focal length, "
                f"{focal_length:g} mm: nearer there is no image",
            )

    def _image_distance(self, focal_length: float) -> float:
        return image_distance(focal_length, 1e3 * self.focal_distance())

    def _focal_length(self, image: float) -> float:
        return focal_length_of(image, 1e3 * self.focal_distance())

    def _pupil(self, optics: Optics) -> float:
        """Diameter of the lens (m): as given, by the f-number, or 2 F tan(defocus_angle / 2)."""
        if self.defocus_angle:
            return 2.0 * self.focal_distance() * math.tan(math.radians(self.defocus_angle) / 2.0)
        if self.aperture is not None:
            return METRES_PER_MILLIMETRE * self.aperture
        return super()._pupil(optics)

    def _lets_light_in(self) -> bool:
        return bool(self.defocus_angle) or bool(self.aperture) or super()._lets_light_in()

    def _openings(self) -> str:
        return "give a finite f_number, or aperture or defocus_angle"

    def _irradiance(self, image: float, area: float) -> Any:
        return FlatPupil(image, area) if self.pupil == "flat" else super()._irradiance(image, area)

    def diameter(self, width: int, height: int) -> float:
        """Diameter of the lens (m), for a film of width x height pixels."""
        return self._pupil(self.optics(width, height))

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers; the blur at infinity is the circle of confusion A |z - F| / z for z to infinity."""
        numbers = super().describe(width, height)
        pixel, pupil = 1e-3 * numbers["pixel_at_1m_mm"], self.diameter(width, height)
        if "image_distance_mm" in numbers:
            numbers["magnification"] = magnification(numbers["image_distance_mm"], 1e3 * self.focal_distance())
        return {
            **numbers,
            "focus_distance_m": self.focal_distance(),
            "aperture_diameter_mm": pupil / METRES_PER_MILLIMETRE,
            "blur_at_infinity_px": pupil / (pixel * self.focal_distance()),
        }

    def layout(self, width: int, height: int) -> Layout | None:
        """The light field of the lens, of which the picture is the only view."""
        optics, diameter = self.optics(width, height), self.diameter(width, height)
        camera = self.camera(width, height, None)
        return Mosaic(
            Views(
                position=np.zeros((1, 1, 2)),
                plane=Plane(*camera.plane),
                width=width,
                height=height,
                inverse_focus=1.0 / self.focal_distance(),
                aperture=diameter if diameter > 0.0 else None,
                focal_length=optics.focal_length,
                pose=Pose(*camera.frame),
            )
        )

    def packed_lens(self, width: int, height: int, assets: Assets = NO_ASSETS) -> Lens | None:
        """The packed lens for a film of width x height pixels; None where the aperture is 0."""
        radius = self.diameter(width, height) / 2.0
        if radius == 0.0:
            return None
        rim = None if self.vignetting is None else self.vignetting.pack()
        return Lens(radius, 1.0 / self.focal_distance(), self._shape(assets), rim)
