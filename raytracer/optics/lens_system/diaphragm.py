"""The opening of a lens's stop: what of the light there gets through.

Its unit of length is the radius of the round opening of the same area; x is to the right and y up, as the photographer
sees it from behind the camera.  Shapes are the apertures' own, and add their cases.
"""

from functools import singledispatch
from typing import Any

from raytracer.jit import generic


@generic
def covers(diaphragm, x, y):
    """Which part of the light at (x, y) an opening lets through, 0 to 1; a place that is no number lets none through.

    `sample_aperture` draws points with this density, over pi.
    """
    raise NotImplementedError


@covers.register(type(None))
def _(diaphragm, x, y):
    return 1.0 if x * x + y * y <= 1.0 else 0.0


@singledispatch
def reach(diaphragm: Any) -> float:
    """How far from the axis an opening lets light through, at most."""
    raise NotImplementedError(type(diaphragm))


@reach.register
def _(diaphragm: None) -> float:
    return 1.0
