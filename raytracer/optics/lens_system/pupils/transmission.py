"""Light from places of the film through a lens: which rays get through."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.simd import WIDTH
from raytracer.optics.lens_system.first_order import cardinal_points, exit_pupil
from raytracer.optics.lens_system.packets import DIRECTION, ORIGIN, ROWS, WAVELENGTH, WEIGHT, trace_packet
from raytracer.optics.lens_system.surfaces import LensSurfaces

Points = NDArray[np.float64]


@entry
def _trace_to_plane(lens, film, plane, wavelength, targets, packet, weights):
    """Trace rays from a place of the film to points (n, 2) of a plane across the axis, with n a multiple of WIDTH."""
    for first in range(0, len(targets), WIDTH):
        for lane in range(WIDTH):
            x, y = targets[first + lane, 0] - film[0], targets[first + lane, 1] - film[1]
            z = plane - film[2]
            length = math.sqrt(x * x + y * y + z * z)
            for axis in range(3):
                packet[ORIGIN + axis, lane] = film[axis]
            packet[DIRECTION, lane] = x / length
            packet[DIRECTION + 1, lane] = y / length
            packet[DIRECTION + 2, lane] = z / length
            packet[WAVELENGTH, lane] = wavelength
            packet[WEIGHT, lane] = 1.0
        trace_packet(lens, packet)
        for lane in range(WIDTH):
            weights[first + lane] = packet[WEIGHT, lane]


# Greatest distance of the plane of the pupils from the film, in focal lengths.
_MAX_FOCAL_LENGTHS = 20.0


def exit_pupil_plane(lens: LensSurfaces, film_z: float) -> float:
    """Find the place on the axis (mm) of the plane of the pupils: at the exit pupil, if that is before the film.

    There the pupil is nearly the same for all places; its distance from the film does not matter otherwise.
    """
    nearest = film_z - float(lens.vertex[-1])
    size = max(nearest, abs(cardinal_points(lens).focal_length))
    away = film_z - exit_pupil(lens).z
    if not away > 0.0:
        return film_z - size
    return film_z - min(max(away, nearest), _MAX_FOCAL_LENGTHS * size)


def transmitted_fraction(
    lens: LensSurfaces, film: Sequence[float], targets: Points, wavelength: float, plane: float | None = None
) -> Points:
    """Compute the fraction of the light that gets from the scene to a place of the film, 0 to 1.

    Parameters
    ----------
    film (mm) : the place, (3,) in the lens's frame.
    targets (mm) : (n, 2), points of a plane across the axis that the rays go through.
    plane (mm) : its place on the axis; `exit_pupil_plane` by default.
    wavelength (nm) : in air; without effect for a lens without a table of indices.

    Returns
    -------
    float64 (n,), from 0 to 1.
    """
    count = len(targets)
    padded = np.zeros((-(-count // WIDTH) * WIDTH, 2))
    padded[:count] = targets
    weights = np.empty(len(padded))
    if plane is None:
        plane = exit_pupil_plane(lens, film[2])
    _trace_to_plane(
        lens, np.array(film, np.float64), plane, float(wavelength), padded, np.zeros((ROWS, WIDTH)), weights
    )
    return weights[:count]


def rear_plane_radius(lens: LensSurfaces, film_z: float, film_radius: float) -> float:
    """Find the greatest radius (mm) at which rays from a film to the last surface cross the plane of its vertex."""
    radius, behind = float(lens.radius[-1]), film_z - float(lens.vertex[-1])
    bend = float(lens.curvature[-1])
    sag = bend * radius**2 / (1.0 + math.sqrt(max(0.0, 1.0 - (bend * radius) ** 2)))
    crossing = film_radius + (radius + film_radius) * behind / (behind - sag) - 2.0 * film_radius
    other = film_radius + (radius - film_radius) * behind / (behind - sag)
    return max(radius, abs(crossing), abs(other))
