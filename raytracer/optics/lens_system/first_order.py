"""First-order optics of a lens: ray transfer matrices, focal points, principal planes and pupils.

A lens with cylinders acts differently on rays in the plane of x and z and on those in the plane of y and z: `across`
chooses.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.surfaces import LensSurfaces, slice_surfaces


class CardinalPoints(NamedTuple):
    """Places on the axis of a lens's focal points and principal planes, and its focal length in air: all in mm."""

    focal_length: float
    front_focus: float
    front_principal: float
    rear_principal: float
    rear_focus: float


class Pupil(NamedTuple):
    """The image of the stop as seen from outside: its place on the axis, and its radius (mm)."""

    z: float
    radius: float


def _ordered_surfaces(lens: LensSurfaces, towards_film: bool, across: str) -> list[tuple[float, float, float, float]]:
    """List the surfaces in the order of a ray: curvature as the ray sees it, way from the one before, and indices."""
    curvature, vertex, ior = lens.curvature, lens.vertex, lens.ior
    if lens.shapes is not None:
        curvature = lens.shapes.quadric[:, "xy".index(across)]
    if not towards_film:
        curvature, vertex, ior = -curvature[::-1], -vertex[::-1], ior[::-1]
    ways = np.diff(vertex, prepend=vertex[:1])
    pairs = pairwise(ior)
    return [(float(c), float(way), float(a), float(b)) for c, way, (a, b) in zip(curvature, ways, pairs, strict=True)]


def paraxial_heights(
    lens: LensSurfaces, height: float, slope: float, towards_film: bool, across: str = "y"
) -> list[float]:
    """Trace a paraxial ray, from its height (mm) and slope at the first surface: its heights at all surfaces."""
    heights = []
    for curvature, way, near, far in _ordered_surfaces(lens, towards_film, across):
        height += way * slope
        heights.append(height)
        slope = (near * slope - height * curvature * (far - near)) / far
    return heights


def ray_transfer_matrix(lens: LensSurfaces, across: str = "y") -> NDArray[np.float64]:
    """Compute the matrix of a lens, float64 (2, 2), for (height, index x slope) from the first to the last vertex.

    References: Gerrard, Burch 1975, "Introduction to Matrix Methods in Optics", ch. II.
    """
    matrix = np.eye(2)
    for curvature, way, near, far in _ordered_surfaces(lens, towards_film=True, across=across):
        passed = np.array([[1.0, way / near], [0.0, 1.0]])
        bent = np.array([[1.0, 0.0], [-curvature * (far - near), 1.0]])
        matrix = bent @ passed @ matrix
    return matrix


def cardinal_points(lens: LensSurfaces, across: str = "y") -> CardinalPoints:
    """Compute focal length, focal points and principal planes.

    Raises
    ------
    ValueError : parallel light leaves the lens parallel, so that it has no focus.
    """
    (a, _), (c, d) = ray_transfer_matrix(lens, across)
    if c == 0.0:
        raise ValueError("the lens has no power: it makes no image")
    before, behind, last = float(lens.ior[0]), float(lens.ior[-1]), float(lens.vertex[-1])
    return CardinalPoints(
        focal_length=float(-1.0 / c),
        front_focus=float(before * d / c),
        front_principal=float(before * (d - 1.0) / c),
        rear_principal=float(last - behind * (a - 1.0) / c),
        rear_focus=float(last - behind * a / c),
    )


def entrance_pupil(lens: LensSurfaces, across: str = "y") -> Pupil:
    """Image the stop by the surfaces before it; at infinity, and infinitely large, if these are telecentric.

    lens : with a stop, as `Lens.packed` always has.
    """
    stop, z = lens.stop, float(lens.vertex[0])
    matrix = np.eye(2)
    if stop > 0:
        way = float(lens.vertex[stop] - lens.vertex[stop - 1])
        passed = np.array([[1.0, way / float(lens.ior[stop])], [0.0, 1.0]])
        matrix = passed @ ray_transfer_matrix(slice_surfaces(lens, 0, stop), across)
    (a, b), _ = matrix
    if a == 0.0:
        return Pupil(float("inf"), float("inf"))
    return Pupil(z + float(lens.ior[0] * b / a), float(lens.radius[stop] / abs(a)))


def exit_pupil(lens: LensSurfaces, across: str = "y") -> Pupil:
    """Image the stop by the surfaces behind it; at infinity, and infinitely large, if these are telecentric.

    lens : with a stop, as `Lens.packed` always has.
    """
    # A stop on a surface is its own image by that surface.
    (_, b), (_, d) = ray_transfer_matrix(slice_surfaces(lens, lens.stop, len(lens.vertex)), across)
    if d == 0.0:
        return Pupil(float("inf"), float("inf"))
    return Pupil(float(lens.vertex[-1] - lens.ior[-1] * b / d), float(lens.radius[lens.stop] / abs(d)))
