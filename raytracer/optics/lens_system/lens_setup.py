"""Setup of a lens by a camera: stop, focus, and the thin lens that is equivalent to it.

That has the same image size, blur and light, without aberrations.  It stands in the entrance pupil, and is as wide as
the beam that the lens takes in along its axis.  A point that is seen from there at the slope u lies on the film where
the chief ray of the slope u, near the axis, arrives: at i u, so that i is the thin lens's image distance.  By Gauss's
equation that and the distance of what is in focus give its focal length.  It is that of the lens where the lens is
focused at infinity, or where its pupils are as large as each other.

References: Kingslake 1983, "Optical System Design", ch. 7; Hecht 2017, "Optics", 5th ed., sec. 6.1.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil, ray_transfer_matrix
from raytracer.optics.lens_system.focusing import focus_shift
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.stops import f_number_of, stop_radius_for
from raytracer.optics.lens_system.surfaces import LensSurfaces
from raytracer.optics.thin_lens import field_of_view, focal_length_from_distances


class EquivalentThinLens(NamedTuple):
    """A thin lens in place of a lens of glass.

    pupil (mm) : its place on the axis, in the lens's frame.
    image_distance (mm) : of the film from there.
    focus_distance (mm) : of the plane of focus from there; may be infinite.
    aperture (mm) : its diameter.
    """

    pupil: float
    image_distance: float
    focus_distance: float
    aperture: float

    @property
    def focal_length(self) -> float:
        """Focal length (mm), by 1/f = 1/i + 1/F."""
        return focal_length_from_distances(self.image_distance, self.focus_distance)

    @property
    def f_number(self) -> float:
        """Focal length over diameter."""
        return self.focal_length / self.aperture

    def vfov(self, height: float) -> float:
        """Vertical field of view (deg) of a film of this height (mm)."""
        return field_of_view(height, self.image_distance)


def equivalent_thin_lens(lens: LensSurfaces, film: float, focus_distance: float) -> EquivalentThinLens:
    """Find the thin lens that is equivalent to a lens as it is packed, focused and stopped down.

    film (mm) : place of the film on the axis, in the lens's frame.
    focus_distance (mm) : of the plane of focus from the entrance pupil; may be infinite.

    Raises
    ------
    ValueError : the entrance pupil is at infinity, so that nothing can stand there; or the image is upright.
    """
    pupil = entrance_pupil(lens)
    if math.isinf(pupil.z):
        raise ValueError("the entrance pupil of the lens is at infinity: no thin lens can stand there")
    start = np.array([float(lens.vertex[0]) - pupil.z, float(lens.ior[0])])
    height, slope = ray_transfer_matrix(lens) @ start
    aperture = abs(cardinal_points(lens).focal_length) / f_number_of(lens)
    image = float(height + slope / float(lens.ior[-1]) * (film - float(lens.vertex[-1])))
    if image < 0.0:
        raise ValueError("the lens has an image inside it, and so makes an upright one: no thin lens does that")
    return EquivalentThinLens(pupil.z, image, focus_distance, aperture)


class LensSetup(NamedTuple):
    """A lens with its stop and its focus set.

    stop_radius (mm) : None for wide open.
    shift (mm) : of the group that focuses, towards the scene.
    surfaces : packed for the d line.
    film (mm) : place of the film on the axis.
    thin : the equivalent thin lens.
    focal_length (mm), f_number : of the lens with this setup.
    """

    stop_radius: float | None
    shift: float
    surfaces: LensSurfaces
    film: float
    thin: EquivalentThinLens
    focal_length: float
    f_number: float


@functools.lru_cache(maxsize=64)
def stop_radius_or_none(lens: Lens, f_number: float) -> float | None:
    """Find the radius of the stop (mm) for an f-number; None for wide open."""
    try:
        return stop_radius_for(lens, f_number)
    except ValueError:
        # The f-number engraved on a lens is rounded.
        if lens.f_number is not None and f_number >= lens.f_number:
            return None
        raise


@functools.lru_cache(maxsize=64)
def set_up_lens(lens: Lens, stop_radius: float | None, distance: float, how: str) -> LensSetup:
    """Set up a lens that is focused at a distance (mm) from its entrance pupil."""
    shift, film = focus_shift(lens, distance, how, stop_radius=stop_radius)
    surfaces = lens.packed(stop_radius=stop_radius, shift=shift)
    thin = equivalent_thin_lens(surfaces, film, distance)
    return LensSetup(
        stop_radius, shift, surfaces, film, thin, abs(cardinal_points(surfaces).focal_length), f_number_of(surfaces)
    )
