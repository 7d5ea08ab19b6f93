"""Compiled loops over apertures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.optics.lens_system.surfaces import aperture_transmission
from raytracer.plugins.apertures.base.interface import rim_visibility, sample_aperture

Array = NDArray[np.float64]


@entry
def _sample(aperture, numbers, out):
    for i in range(len(numbers)):
        out[i, 0], out[i, 1] = sample_aperture(aperture, numbers[i, 0], numbers[i, 1])


@entry
def _unvignetted(rim, points, right, up, out):
    for i in range(len(points)):
        out[i] = rim_visibility(rim, points[i, 0], points[i, 1], right, up)


@entry
def _covers(diaphragm, points, out):
    for i in range(len(points)):
        out[i] = aperture_transmission(diaphragm, points[i, 0], points[i, 1])


def sampled(aperture: Any, numbers: Any) -> Array:
    """Points (n, 2) of uniform numbers (n, 2)."""
    given = np.ascontiguousarray(numbers, np.float64)
    out = np.empty(given.shape)
    _sample(aperture, given, out)
    return out


def passed(rim: Any, points: Any, right: float, up: float) -> Array:
    """Weights (n,) of rays from points (n, 2) of an aperture, all of one direction."""
    given = np.ascontiguousarray(points, np.float64)
    out = np.empty(len(given))
    _unvignetted(rim, given, right, up, out)
    return out


def covered(diaphragm: Any, points: Any) -> Array:
    """Which part of the light at points (n, 2) an opening lets through (n,)."""
    given = np.ascontiguousarray(points, np.float64)
    out = np.empty(len(given))
    _covers(diaphragm, given, out)
    return out
