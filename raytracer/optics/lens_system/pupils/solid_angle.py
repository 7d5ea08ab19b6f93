"""The solid angle of a pupil, weighted as light on the film is."""

import math

import numpy as np

from raytracer.optics.lens_system.pupils.search import PupilSampler, WorkCounter
from raytracer.optics.lens_system.pupils.transmission import exit_pupil_plane, transmitted_fraction
from raytracer.optics.lens_system.surfaces import LensSurfaces

# Points along an edge of the grid by which the light of a pupil of any shape is integrated.
_GRID_POINTS = 512


def on_axis_solid_angle(lens: LensSurfaces, film_z: float, wavelength: float, *, is_round: bool) -> float:
    """Compute the irradiance on the axis from a scene of radiance 1: the integral of cos^4 / Z^2 over the pupil (sr).

    Of a round pupil it is pi sin^2, with the angle at which the film sees its edge.

    Raises
    ------
    ValueError : no light gets through the lens.
    """
    plane = exit_pupil_plane(lens, film_z)
    behind = film_z - plane
    pupil = PupilSampler(lens, film_z, [wavelength], WorkCounter())
    edge = pupil.hull(0.0, 0.0)
    if not len(edge):
        raise ValueError("no light gets through the lens to the middle of the film")
    if is_round and lens.diaphragm is None:
        square = float((edge**2).sum(axis=1).min())
        return math.pi * square / (square + behind * behind)
    low, high = edge.min(axis=0), edge.max(axis=0)
    x, y = (low[axis] + (high[axis] - low[axis]) * (np.arange(_GRID_POINTS) + 0.5) / _GRID_POINTS for axis in (0, 1))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    weights = transmitted_fraction(lens, (0.0, 0.0, film_z), points, wavelength, plane)
    cosine2 = behind * behind / (behind * behind + (points**2).sum(axis=1))
    return float((weights * cosine2**2).sum() / behind**2 * np.prod((high - low) / _GRID_POINTS))
