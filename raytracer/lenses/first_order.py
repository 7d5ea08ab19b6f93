"""What a lens does to rays near its axis: ray transfer matrices, focal points and principal planes."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lenses.surfaces import LensSurfaces


class CardinalPoints(NamedTuple):
    """Where a lens's focal points and principal planes are on the axis, and its focal length in air (mm)."""

    focal_length: float
    front_focus: float
    front_principal: float
    rear_principal: float
    rear_focus: float


def _in_order(lens: LensSurfaces, towards_film: bool) -> list[tuple[float, float, float, float]]:
    """Of each surface, in the order of a ray: curvature as the ray sees it, way from the one before, and indices."""
    curvature, vertex, ior = lens.curvature, lens.vertex, lens.ior
    if not towards_film:
        curvature, vertex, ior = -curvature[::-1], -vertex[::-1], ior[::-1]
    ways = np.diff(vertex, prepend=vertex[0])
    pairs = pairwise(ior)
    return [(float(c), float(way), float(a), float(b)) for c, way, (a, b) in zip(curvature, ways, pairs, strict=True)]


def heights(lens: LensSurfaces, height: float, slope: float, towards_film: bool) -> list[float]:
    """Heights (mm) at which a ray near the axis meets each surface, from its height and slope at the first."""
    found = []
    for curvature, way, near, far in _in_order(lens, towards_film):
        height += way * slope
        found.append(height)
        slope = (near * slope - height * curvature * (far - near)) / far
    return found


def ray_transfer_matrix(lens: LensSurfaces) -> NDArray[np.float64]:
    """What a lens does to rays near the axis: float64 (2, 2), of (height, index x slope), from front to last vertex.

    References: Gerrard, Burch 1975, "Introduction to Matrix Methods in Optics", ch. II.
    """
    matrix = np.eye(2)
    for curvature, way, near, far in _in_order(lens, towards_film=True):
        passed = np.array([[1.0, way / near], [0.0, 1.0]])
        bent = np.array([[1.0, 0.0], [-curvature * (far - near), 1.0]])
        matrix = bent @ passed @ matrix
    return matrix


def cardinal_points(lens: LensSurfaces) -> CardinalPoints:
    """Focal length, focal points and principal planes.

    Raises
    ------
    ValueError : parallel light leaves the lens parallel, so that it has no focus.
    """
    (a, _), (c, d) = ray_transfer_matrix(lens)
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
