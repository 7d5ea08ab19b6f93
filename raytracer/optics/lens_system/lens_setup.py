"""Setup of a lens by a camera: stop and focus."""

import functools
from typing import NamedTuple

from raytracer.optics.lens_system.equivalent_thin_lens import EquivalentThinLens, equivalent_thin_lens
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.focusing import focus_shift
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.stops import f_number_of, stop_radius_for
from raytracer.optics.lens_system.surfaces import LensSurfaces


class LensSetup(NamedTuple):
    """A lens with its stop and its focus set.

    Attributes
    ----------
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
