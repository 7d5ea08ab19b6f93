"""Functions of apertures, for rows of numbers and points."""

import numpy as np

from raytracer.optics.lens_system.surfaces import aperture_transmission
from raytracer.plugins.apertures.base.interface import rim_visibility, sample_aperture
from tests.vectorised import rows, vectorised


def _columns(pairs):
    return map(rows, np.asarray(pairs, np.float64).T)


def sampled(aperture, numbers):
    """Points (n, 2) of uniform numbers (n, 2)."""
    return vectorised(sample_aperture)(aperture, *_columns(numbers))


def passed(rim, points, right, up):
    """Weights (n,) of rays from points (n, 2) of an aperture, all of one direction."""
    return vectorised(rim_visibility)(rim, *_columns(points), float(right), float(up))


def covered(diaphragm, points):
    """Which part of the light at points (n, 2) an opening lets through (n,)."""
    return vectorised(aperture_transmission)(diaphragm, *_columns(points))
