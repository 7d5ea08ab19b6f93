"""Points of a table's primitives at the opening of the shutter."""

from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import Translated
from raytracer.core.primitives.triangles import DeformingSmoothTriangles, DeformingTriangles, SmoothTriangles, Triangles

Points = NDArray[np.float64]

_SIDES = 16
"""Sides of the polygon that approximates a disc."""


@singledispatch
def outline(table: Any, start: int, stop: int) -> Points:
    """Compute points (n, k, 3) of the rows from `start` to before `stop` that span the boxes round them.

    They are the corners of flat primitives in order, and the ends of a sphere's diameters along the axes.
    """
    raise NotImplementedError(type(table))


@outline.register
def outline_spheres(table: Spheres, start: int, stop: int) -> Points:
    ends = np.concatenate([np.eye(3), -np.eye(3)])
    return np.asarray(table.center[start:stop, None, :] + np.abs(table.radius[start:stop, None, None]) * ends)


@outline.register
def outline_parallelograms(table: Parallelograms, start: int, stop: int) -> Points:
    corner, u, v = (column[start:stop] for column in (table.corner, table.u, table.v))
    return np.stack([corner, corner + u, corner + u + v, corner + v], axis=1)


@outline.register
def outline_discs(table: Discs, start: int, stop: int) -> Points:
    center, normal, radius = (column[start:stop] for column in (table.center, table.normal, table.radius))
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    along = np.cross(normal, across)
    circle = np.cos(angles)[:, None] * across[:, None, :] + np.sin(angles)[:, None] * along[:, None, :]
    return np.asarray(center[:, None, :] + radius[:, None, None] * circle)


@outline.register(Triangles)
@outline.register(SmoothTriangles)
def outline_triangles(table: Any, start: int, stop: int) -> Points:
    return np.asarray(table.vertices[table.faces[start:stop]], np.float64)


@outline.register(DeformingTriangles)
@outline.register(DeformingSmoothTriangles)
def outline_deforming_triangles(table: Any, start: int, stop: int) -> Points:
    return np.asarray(table.vertices[0][table.faces[start:stop]], np.float64)


@outline.register
def outline_translated(table: Translated, start: int, stop: int) -> Points:
    return outline(table.base, start, stop)


def coordinate_extents(table: Any, start: int, stop: int) -> Points:
    """Compute the largest coordinate of each row (n,) (m), which its spawn offset depends on (`spawn_offset`)."""
    base = without_motion(table)
    points = outline(table, start, stop)
    if isinstance(base, Spheres | Discs):
        return np.asarray(np.abs(base.center[start:stop]).max(axis=1) + np.abs(base.radius[start:stop]))
    edges = np.abs(points[:, [1, -1]] - points[:, :1]).max(axis=2)
    way = edges.sum(axis=1) if isinstance(base, Parallelograms) else edges.max(axis=1)
    return np.asarray(np.abs(points[:, 0]).max(axis=1) + way)


def normals(points: Points) -> Points:
    """Compute unit normals (n, 3) of flat faces with corners (n, k, 3), to the outside; NaN without an area."""
    across = np.cross(*edges(points)[:2])
    with np.errstate(invalid="ignore"):
        return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def edges(points: Points) -> tuple[Points, Points, Points]:
    """Compute the edges (n, 3) of a triangle of three corners of each face, the first two from one corner."""
    corners = points.shape[1]
    a, b, c = (points[:, place] for place in (0, corners // 3, 2 * corners // 3))
    return b - a, c - a, c - b


def squared(vectors: Points) -> Points:
    """Square the lengths of vectors (n, 3): (n,)."""
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors))


def without_motion(table: Any) -> Any:
    """Strip a table of a motion that moves all of it."""
    return table.base if isinstance(table, Translated) else table


def has_edges(table: Any) -> bool:
    """Return True if a table's primitives are polygons."""
    return not isinstance(without_motion(table), Spheres | Discs)


def is_flat(table: Any) -> bool:
    """Return True if a table's primitives are flat."""
    return not isinstance(without_motion(table), Spheres)
