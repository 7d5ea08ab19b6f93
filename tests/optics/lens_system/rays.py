"""Bundles of rays through lenses for tests."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces

Array = NDArray[np.float64]


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
