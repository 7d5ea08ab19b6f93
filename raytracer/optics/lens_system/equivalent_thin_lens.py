"""The thin lens that shows what a lens of glass does: as large a picture, as much blur, as much light, and no errors.

It stands in the entrance pupil, and is as wide as the light that the lens takes in along its axis.  A point that is
seen from there at the slope u lies on the film where the chief ray of the slope u, near the axis, arrives: at i u, so
that i is the thin lens's image distance.  By Gauss's equation that and the distance of what is in focus give its focal
length.  It is that of the lens where the lens is focused at infinity, or where its pupils are as large as each other.

References: Kingslake 1983, "Optical System Design", ch. 7; Hecht 2017, "Optics", 5th ed., sec. 6.1.
"""

import math
from typing import NamedTuple

import numpy as np

from raytracer.lenses.first_order import cardinal_points, entrance_pupil, ray_transfer_matrix
from raytracer.lenses.stops import f_number_of
from raytracer.lenses.surfaces import LensSurfaces
from raytracer.photography import field_of_view, focal_length_of


class ThinEquivalent(NamedTuple):
    """A thin lens (mm): where it stands in place of a lens, and what it is.

    pupil : its place on the axis, in the lens's frame.
    image_distance, focus_distance : of the film, and of what is in focus, from there; the latter may be infinite.
    aperture : its diameter.
    """

    pupil: float
    image_distance: float
    focus_distance: float
    aperture: float

    @property
    def focal_length(self) -> float:
        """Focal length (mm), by 1/f = 1/i + 1/F."""
        return focal_length_of(self.image_distance, self.focus_distance)

    @property
    def f_number(self) -> float:
        """Focal length over diameter."""
        return self.focal_length / self.aperture

    def vfov(self, height: float) -> float:
        """Vertical field of view (deg) of a film of this height (mm)."""
        return field_of_view(height, self.image_distance)


def thin_equivalent(lens: LensSurfaces, film: float, focus_distance: float, across: str = "y") -> ThinEquivalent:
    """The thin lens in place of a lens as it is packed, focused and stopped down.

    Parameters
    ----------
    film : where the film is on the axis (mm), in the lens's frame.
    focus_distance : distance of what is in focus from the entrance pupil (mm), may be infinite.
    across : "x" or "y", the plane in which a lens with cylinders is looked at.

    Raises
    ------
    ValueError : the entrance pupil is at infinity, so that nothing can stand there; or the image is upright.
    """
    pupil = entrance_pupil(lens, across)
    if math.isinf(pupil.z):
        raise ValueError("the entrance pupil of the lens is at infinity: no thin lens can stand there")
    start = np.array([float(lens.vertex[0]) - pupil.z, float(lens.ior[0])])
    height, slope = ray_transfer_matrix(lens, across) @ start
    aperture = abs(cardinal_points(lens).focal_length) / f_number_of(lens)
    image = float(height + slope / float(lens.ior[-1]) * (film - float(lens.vertex[-1])))
    if image < 0.0:
        raise ValueError("the lens has an image inside it, and so makes an upright one: no thin lens does that")
    return ThinEquivalent(pupil.z, image, focus_distance, aperture)
