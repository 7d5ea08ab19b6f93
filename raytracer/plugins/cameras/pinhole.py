"""Pinhole camera: everything is sharp, or as sharp as a hole of a real size leaves it.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 40}
    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], diameter: 6 mm, focal_length: 200 mm,
             sensor: {width: 254 mm, height: 203 mm}}
"""

from typing import Literal

from pydantic import Field, model_validator

from raytracer.cameras.interface import NO_ASSETS, Assets
from raytracer.cameras.perspective import Optics, PerspectiveCamera, PerspectiveSpec
from raytracer.cameras.pupil import Lens
from raytracer.spec import NonNegativeOptic, at
from raytracer.units import METRES_PER_MILLIMETRE


class Pinhole(PerspectiveSpec):
    """Rays through one point, or through a hole: perspective without focus.

    A hole of the diameter d, at the focal length f from the film, spreads a point at the distance z to d (1 + f / z).
    Without a `diameter` the hole is a point, which lets in as much light as an `f_number` says.

    References: Young 1971, "Pinhole Optics", Applied Optics 10(12).
    """

    type: Literal["pinhole"] = "pinhole"
    diameter: NonNegativeOptic | None = Field(
        default=None, description="diameter of the hole (mm); its distance from the film is the focal length"
    )

    @model_validator(mode="after")
    def _one_hole(self) -> "Pinhole":
        if self.diameter is not None and self.f_number is not None:
            at("f_number", "diameter and f_number both set the size of the hole: give one of them")
        if self.diameter and not self._has_scale():
            at("diameter", "diameter needs the distance of the film from the hole: give focal_length, or sensor")
        return self

    def _pupil(self, optics: Optics) -> float:
        return METRES_PER_MILLIMETRE * self.diameter if self.diameter else super()._pupil(optics)

    def _lets_light_in(self) -> bool:
        return bool(self.diameter) or super()._lets_light_in()

    def _openings(self) -> str:
        return "give diameter, or a finite f_number"

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers; the blur at infinity is the hole's own size."""
        numbers = super().describe(width, height)
        if self.diameter:
            numbers["blur_at_infinity_px"] = 1e3 * self.diameter / numbers["pixel_pitch_um"]
        return numbers

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> PerspectiveCamera:
        """The camera, without a lens where the hole is a point."""
        image = self.optics(width, height).image_distance
        if not self.diameter or image is None:
            return self.camera(width, height, None)
        lens = Lens(0.5 * METRES_PER_MILLIMETRE * self.diameter, -1.0 / (METRES_PER_MILLIMETRE * image))
        return self.camera(width, height, lens)
