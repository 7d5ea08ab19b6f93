"""The opening of a lens's stop: its transmission and its extent.

Its unit of length is the radius of the round opening of the same area; x is to the right and y up, as the photographer
sees it from behind the camera.  Shapes are kinds of apertures, which register their cases.
"""

from functools import singledispatch
from typing import Any

from raytracer.core.compiler.dispatch import optional


@optional
def aperture_transmission(diaphragm, x, y):
    """Compute the fraction of the light at (x, y) that an opening lets through, 0 to 1; 0 for NaN.

    `sample_aperture` samples points with this density, over pi.
    """
    return 1.0 if x * x + y * y <= 1.0 else 0.0


@singledispatch
def aperture_extent(diaphragm: Any) -> float:
    """Find the greatest distance from the axis at which an opening lets light through."""
    raise NotImplementedError(type(diaphragm))


@aperture_extent.register
def aperture_extent_none(diaphragm: None) -> float:
    return 1.0
