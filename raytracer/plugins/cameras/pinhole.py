"""Pinhole camera: everything is sharp, or as sharp as a hole of a real size leaves it.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 40}
    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], diameter: 6 mm, focal_length: 200 mm,
             sensor: {width: 254 mm, height: 203 mm}}
    camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 1, 0], sensor: full_frame, focal_length: 20 mm,
             diameter: 4 mm, aperture_shape: {type: image, file: mask.png}}
"""

from typing import ClassVar, Literal

from pydantic import Field

from raytracer.plugins.cameras.base.exposed import ShapedSpec
from raytracer.plugins.cameras.base.interface import NO_ASSETS, Assets
from raytracer.plugins.cameras.base.perspective import ApertureSize, PerspectiveSpec
from raytracer.plugins.cameras.base.perspective_camera import PerspectiveCamera
from raytracer.plugins.cameras.base.thin_lens_ray import ThinLensPupil
from raytracer.schema.fields import NonNegativeLensLength
from raytracer.schema.rules import exclusive, only
from raytracer.schema.units import METRES_PER_MILLIMETRE


class Pinhole(PerspectiveSpec, ShapedSpec):
    """Rays through one point, or through a hole: perspective without focus.

    A hole of the diameter d, at the focal length f from the film, spreads a point at the distance z to d (1 + f / z).
    Without a `diameter` the hole is a point, which lets in as much light as an `f_number` says.

    With an `aperture_shape` the hole is a mask of the same area, and each point of the scene casts the shadow of the
    mask: a camera of coded aperture, without a lens, whose picture is reconstructed afterwards.

    References: Young 1971, "Pinhole Optics", Applied Optics 10(12); Fenimore and Cannon 1978, "Coded aperture imaging
    with uniformly redundant arrays", Applied Optics 17(3).
    """

    aperture_hint: ClassVar[str] = "give diameter, or a finite f_number"

    type: Literal["pinhole"] = "pinhole"
    diameter: NonNegativeLensLength | None = Field(
        default=None, description="diameter of the hole (mm); its distance from the film is the focal length"
    )

    _one_hole = exclusive("diameter", "f_number", sets="the size of the hole")
    _has_a_film = only(
        "diameter",
        where=lambda camera: camera.diameter == 0.0 or camera.has_scale(),
        message="{key} needs the distance of the film from the hole: give focal_length, or sensor",
    )
    _has_a_hole = only(
        "aperture_shape",
        where=lambda camera: bool(camera.diameter),
        message="{key} is the shape of a hole that has a size: give diameter",
    )

    def aperture_size(self) -> ApertureSize:
        return ApertureSize(METRES_PER_MILLIMETRE * self.diameter) if self.diameter else super().aperture_size()

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Return derived numbers; the blur at infinity is the hole's own size."""
        numbers = super().describe(width, height)
        if self.diameter:
            numbers["blur_at_infinity_px"] = 1e3 * self.diameter / numbers["pixel_pitch_um"]
        return numbers

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> PerspectiveCamera:
        """Pack the camera, without a lens where the hole is a point."""
        image = self.optics(width, height).image_distance
        if not self.diameter or image is None:
            return self.pack_with_lens(width, height, None)
        radius, inverse_film = 0.5 * METRES_PER_MILLIMETRE * self.diameter, 1.0 / (METRES_PER_MILLIMETRE * image)
        hole = ThinLensPupil(radius, -inverse_film, self.pack_shape(assets))
        return self.pack_with_lens(width, height, hole)
