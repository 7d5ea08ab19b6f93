"""Compiled loops over rays through lenses, and the prescriptions that they go through."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from raytracer.optics.lens_system.ray_tracing import intersect_sphere, trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces
from tests.vectorised import rows, vectorised

DOUBLE_GAUSS = (
    (29.475, 3.76, 1.67, 12.6),
    (84.83, 0.12, 1.0, 12.6),
    (19.275, 4.025, 1.67, 11.5),
    (40.77, 3.275, 1.699, 11.5),
    (12.75, 5.705, 1.0, 9.0),
    (0.0, 4.5, 1.0, 8.55),
    (-14.495, 1.18, 1.603, 8.5),
    (40.77, 6.065, 1.658, 10.0),
    (-20.385, 0.19, 1.0, 10.0),
    (437.065, 3.22, 1.717, 10.0),
    (-39.73, 0.0, 1.0, 10.0),
)
"""Radius (0 for the stop), thickness (mm), index behind, and radius of the clear aperture (mm) of an f/2 lens.

References: Tronnier, US patent 2,673,491, scaled to 50 mm; Smith 1992, "Modern Lens Design", p. 312.
"""

DOUBLET = ((7.3895, 1.05, 1.517, 2.0), (-5.1784, 0.40, 1.649, 2.0), (-16.2225, 0.0, 1.0, 2.0))
"""A cemented doublet, columns as of the double Gauss: Kingslake, Johnson 2010, sec. 2.5."""


class Surface(NamedTuple):
    """A row of a lens: curvature (1/mm), thickness (mm), index behind it, radius (mm) of the clear aperture."""

    curvature: float
    thickness: float
    ior: float
    radius: float
    is_stop: bool = False


def pack_surfaces(surfaces: Sequence[Surface], *, before: float = 1.0) -> LensSurfaces:
    """Pack surfaces behind a medium of the index `before`, with any medium behind them, and with or without a stop."""
    curvature, thickness, ior, radius, is_stop = (np.array(column) for column in zip(*surfaces, strict=True))
    places, stop = np.append(0.0, np.cumsum(thickness[:-1])), int(np.argmax(is_stop)) if is_stop.any() else -1
    return LensSurfaces(curvature.astype(float), places, radius.astype(float), np.append(before, ior), stop)


def lens_of(table: Any, *, stop: float | None = None) -> LensSurfaces:
    """The lens of such a table, whose diaphragm is closed to a radius (mm) if one is given."""
    return pack_surfaces(
        [
            Surface(1.0 / radius, thickness, index, aperture)
            if radius
            else Surface(0.0, thickness, index, stop or aperture, is_stop=True)
            for radius, thickness, index, aperture in table
        ]
    )


traced = trace_rays
"""Weights (n,), last points and directions (n, 3) of rays (n, 3) through a lens."""


def met(curvature: float, origins: Any, directions: Any, *, side: float = 1.0) -> tuple[Any, Any]:
    """Distances (n,) and cosines (n,) at which rays (n, 3) meet a surface with its vertex at 0."""
    starts, ways = (rows(np.array(given, np.float64, ndmin=2)) for given in (origins, directions))
    distances, _, cosines = vectorised(intersect_sphere)(float(curvature), 0.0, starts, ways, side)
    return distances, cosines
