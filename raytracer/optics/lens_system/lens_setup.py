"""A lens as a camera sets it: wide open or stopped down, and focused."""

import functools
from typing import NamedTuple

from raytracer.lenses.equivalent import ThinEquivalent, thin_equivalent
from raytracer.lenses.first_order import cardinal_points
from raytracer.lenses.focusing import focus_shift
from raytracer.lenses.lens import Lens
from raytracer.lenses.stops import f_number_of, stop_radius_for
from raytracer.lenses.surfaces import LensSurfaces


class Setting(NamedTuple):
    """A lens as a camera has set it (mm): wide open or stopped down, and focused.

    stop_radius, None for wide open; shift, of the group that focuses; surfaces, packed for the d line; film, where it
    is on the axis; thin, the thin lens in place of it; focal_length, f_number, of the lens as it is set.
    """

    stop_radius: float | None
    shift: float
    surfaces: LensSurfaces
    film: float
    thin: ThinEquivalent
    focal_length: float
    f_number: float


@functools.lru_cache(maxsize=64)
def stop_for(lens: Lens, f_number: float) -> float | None:
    """Radius of the stop for an f-number; None for wide open."""
    try:
        return stop_radius_for(lens, f_number)
    except ValueError:
        # What is engraved on a lens is rounded.
        if lens.f_number is not None and f_number >= lens.f_number:
            return None
        raise


@functools.lru_cache(maxsize=64)
def set_lens(lens: Lens, stop_radius: float | None, distance: float, how: str) -> Setting:
    """A lens focused at a distance (mm) from its entrance pupil."""
    shift, film = focus_shift(lens, distance, how, stop_radius=stop_radius)
    surfaces = lens.packed(stop_radius=stop_radius, shift=shift)
    thin = thin_equivalent(surfaces, film, distance)
    return Setting(
        stop_radius, shift, surfaces, film, thin, abs(cardinal_points(surfaces).focal_length), f_number_of(surfaces)
    )
