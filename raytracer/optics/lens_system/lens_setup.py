"""Setup of a lens by a camera: its stop, by f-number, its focus, and the thin lens that is equivalent to it.

The f-number is the focal length over twice the height at which the ray that grazes the stop comes in, parallel to the
axis: that of the light which a lens gathers, also where its glass bends the outer rays by more than the inner ones.

The equivalent thin lens has the same image size, blur and light, without aberrations.  It stands in the entrance pupil,
and is as wide as the beam that the lens takes in along its axis.  A point that is seen from there at the slope u lies
on the film where the chief ray of the slope u, near the axis, arrives: at i u, so that i is the thin lens's image
distance.  By Gauss's equation that and the distance of what is in focus give its focal length.  It is that of the lens
where the lens is focused at infinity, or where its pupils are as large as each other.

References: Smith 2008, "Modern Optical Engineering", 4th ed., sec. 9.6 (f-number); Kingslake 1983, "Optical System
Design", ch. 7; Hecht 2017, "Optics", 5th ed., sec. 6.1.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil, ray_transfer_matrix
from raytracer.optics.lens_system.focusing import focus_shift
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces, slice_surfaces
from raytracer.optics.thin_lens import field_of_view, focal_length_from_distances

# ---- Stop

_RAYS = 1025
_ROUNDS = 5


def _start(lens: LensSurfaces, heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place points on rays of light parallel to the axis, at these heights along y."""
    return np.stack([0.0 * heights, heights, np.full(len(heights), lens.vertex[0])], axis=1)


def _max_passing_height(lens: LensSurfaces) -> float:
    """Find the greatest height (mm) up to which all light parallel to the axis gets through.

    Raises
    ------
    ValueError : not even light near the axis does.
    """
    pupil = entrance_pupil(lens).radius
    low, high = 0.0, 2.0 * min(pupil, float(lens.radius.max()))
    # Each round leaves a thousandth of the interval, and five leave less than the spacing of float64 numbers.
    for _ in range(_ROUNDS):
        heights = np.linspace(low, high, _RAYS)
        weights, _, _ = trace_rays(lens, _start(lens, heights), (0.0, 0.0, 1.0))
        blocked = np.flatnonzero(weights == 0.0)
        if not len(blocked):
            return high
        if blocked[0] == 0:
            break
        low, high = float(heights[blocked[0] - 1]), float(heights[blocked[0]])
    if low == 0.0:
        raise ValueError("no light that comes in along the axis gets through the lens")
    return low


def f_number_of(lens: LensSurfaces) -> float:
    """Compute the f-number of a lens as it is packed.

    Raises
    ------
    ValueError : it has no focal length, or no light gets through.
    """
    return abs(cardinal_points(lens).focal_length) / (2.0 * _max_passing_height(lens))


def widest_f_number(lens: Lens) -> float:
    """Compute the f-number of a lens with its stop wide open; see `f_number_of`."""
    return f_number_of(lens.packed())


def stop_radius_for(lens: Lens, f_number: float) -> float:
    """Find the radius (mm) to which the stop closes for an f-number.

    Raises
    ------
    ValueError : the lens does not open so far, or has no focal length.
    """
    packed = lens.packed()
    length, widest = abs(cardinal_points(packed).focal_length), _max_passing_height(packed)
    opens_to = length / (2.0 * widest)
    if not opens_to <= f_number < math.inf:
        raise ValueError(f"the lens opens to f/{opens_to:.4g}, and cannot be set to f/{f_number:g}")
    # At the smallest f-number itself rounding could leave a height beyond the rim.
    return _height_at_stop(packed, min(length / (2.0 * f_number), widest))


def _height_at_stop(lens: LensSurfaces, height: float) -> float:
    """Trace a ray that comes in parallel to the axis, at a height, to the stop: its height there (mm), rim at most."""
    _, points, _ = trace_rays(slice_surfaces(lens, 0, lens.stop + 1), _start(lens, np.array([height])), (0.0, 0.0, 1.0))
    return min(float(abs(points[0, 1])), float(lens.radius[lens.stop]))


def filled_stop_fraction(lens: LensSurfaces) -> float:
    """Measure the part of the stop's diameter that light parallel to the axis fills: 1 unless rims cut it.

    Raises
    ------
    ValueError : no light gets through.
    """
    return _height_at_stop(lens, _max_passing_height(lens)) / float(lens.radius[lens.stop])


# ---- Equivalent thin lens


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
