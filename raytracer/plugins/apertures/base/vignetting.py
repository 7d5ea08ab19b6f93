"""Optical vignetting: the rim of a lens's front, which cuts what comes in from the side to a cat's eye."""

from typing import NamedTuple

from pydantic import Field

from raytracer.plugins.apertures.base.interface import ApertureSpec, rim_visibility
from raytracer.schema.fields import PositiveLensLength
from raytracer.schema.spec import Spec
from raytracer.schema.units import METRES_PER_MILLIMETRE


class Vignetting(Spec):
    """A round rim in front of the lens, centred on the axis, that every ray has to pass.

    Seen from far off the axis, rim and aperture overlap in part only: the picture darkens to its corners, where lights
    out of focus have the shape of a cat's eye.  A rim smaller than the aperture takes light from the middle too.

    References: Asada, Amano, Baba 1996, "Photometric Calibration of Zoom Lens Systems", ICPR.
    """

    diameter: PositiveLensLength = Field(description="diameter of the rim (mm)")
    distance: PositiveLensLength = Field(description="how far in front of the aperture it is (mm)")

    def pack(self) -> "Rim":
        """Pack the rim."""
        return Rim(0.5 * METRES_PER_MILLIMETRE * self.diameter, METRES_PER_MILLIMETRE * self.distance)


class Rim(NamedTuple):
    """Packed rim.

    radius (m) : of the rim.
    distance (m) : of the rim in front of the aperture.
    """

    radius: float
    distance: float


@rim_visibility.register(Rim)
def rim_visibility_rim(rim, x, y, right, up):
    across, above = x + rim.distance * right, y + rim.distance * up
    return 1.0 if across * across + above * above <= rim.radius * rim.radius else 0.0


class Opening(NamedTuple):
    """Specs that shape a lens's opening, each None where there is none.

    shape : of the opening, which is round without it.
    rim : in front of the lens, which vignettes.
    """

    shape: ApertureSpec | None = None
    rim: Vignetting | None = None
