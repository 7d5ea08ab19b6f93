"""Rays through lenses, and the prescriptions that they go through."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import intersect_sphere, trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces
from tests.vectorised import rows, vectorised

Array = NDArray[np.float64]

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


class Gone(NamedTuple):
    """Rays behind a lens: weights (n,), points on the last surface and directions (n, 3)."""

    weights: Array
    points: Array
    directions: Array


def unit(rows: Any) -> Array:
    """Vectors (n, 3) of length 1."""
    given = np.atleast_2d(np.asarray(rows, np.float64))
    return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))


def crossing(points: Array, directions: Array, axis: int = 1) -> Array:
    """Find where rays in a plane with the axis of the lens meet it (n,)."""
    return np.asarray(points[:, 2] - points[:, axis] * directions[:, 2] / directions[:, axis])


def gone_through(
    lens: Lens | LensSurfaces, origins: Any, directions: Any, *, towards_film: bool = True, wavelength: float = LINE_D
) -> Gone:
    """Rays (n, 3) through a lens, whose glasses have the index of a wavelength (nm)."""
    packed = lens.packed(wavelength) if isinstance(lens, Lens) else lens
    return Gone(*trace_rays(packed, origins, directions, towards_film, None))


def parallel(
    heights: Array, before: float, *, axis: int = 0, towards_film: bool = True
) -> tuple[Array, tuple[float, float, float]]:
    """Rays parallel to the axis at these heights (mm) along x (0) or y (1), from as far before the front vertex.

    Away from the film they start as far behind it.
    """
    origins = np.zeros((len(heights), 3))
    origins[:, axis] = heights
    side = 1.0 if towards_film else -1.0
    origins[:, 2] = -side * before
    return origins, (0.0, 0.0, side)


def backs(lens: Lens, heights: Array, *, wavelength: float = LINE_D) -> Array:
    """Find where parallel light at these heights (mm) crosses the axis, behind the last vertex (mm)."""
    found = gone_through(lens, *parallel(heights, 100.0), wavelength=wavelength)
    assert found.weights.all()
    return np.asarray(crossing(found.points, found.directions, axis=0) - float(lens.packed().vertex[-1]))


def met(curvature: float, origins: Any, directions: Any, *, side: float = 1.0) -> tuple[Any, Any]:
    """Distances (n,) and cosines (n,) at which rays (n, 3) meet a surface with its vertex at 0."""
    starts, ways = (rows(np.array(given, np.float64, ndmin=2)) for given in (origins, directions))
    distances, _, cosines = vectorised(intersect_sphere)(float(curvature), 0.0, starts, ways, side)
    return distances, cosines
