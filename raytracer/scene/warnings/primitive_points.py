"""Where the primitives of a table are, at the opening of the shutter, as points."""

from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.primitives.deforming import DeformingSmoothTriangles, DeformingTriangles
from raytracer.primitives.discs import Discs
from raytracer.primitives.parallelograms import Parallelograms
from raytracer.primitives.spheres import Spheres
from raytracer.primitives.translated import Translated
from raytracer.primitives.triangles import SmoothTriangles, Triangles

Points = NDArray[np.float64]

_SIDES = 16
"""Sides of the polygon that stands for a disc."""


@singledispatch
def outline(table: Any, start: int, stop: int) -> Points:
    """Points (n, k, 3) of the rows from `start` on and before `stop`, which span the boxes round them.

    They are the corners of flat primitives in order, and the ends of a sphere's diameters along the axes.
    """
    raise NotImplementedError(type(table))


@outline.register
def _(table: Spheres, start: int, stop: int) -> Points:
    ends = np.concatenate([np.eye(3), -np.eye(3)])
    return np.asarray(table.center[start:stop, None, :] + np.abs(table.radius[start:stop, None, None]) * ends)


@outline.register
def _(table: Parallelograms, start: int, stop: int) -> Points:
    corner, u, v = (column[start:stop] for column in (table.corner, table.u, table.v))
    return np.stack([corner, corner + u, corner + u + v, corner + v], axis=1)


@outline.register
def _(table: Discs, start: int, stop: int) -> Points:
    center, normal, radius = (column[start:stop] for column in (table.center, table.normal, table.radius))
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    along = np.cross(normal, across)
    circle = np.cos(angles)[:, None] * across[:, None, :] + np.sin(angles)[:, None] * along[:, None, :]
    return np.asarray(center[:, None, :] + radius[:, None, None] * circle)


@outline.register(Triangles)
@outline.register(SmoothTriangles)
def _(table: Any, start: int, stop: int) -> Points:
    return np.asarray(table.vertices[table.faces[start:stop]], np.float64)


@outline.register(DeformingTriangles)
@outline.register(DeformingSmoothTriangles)
def _(table: Any, start: int, stop: int) -> Points:
    return np.asarray(table.vertices[0][table.faces[start:stop]], np.float64)


@outline.register
def _(table: Translated, start: int, stop: int) -> Points:
    return outline(table.base, start, stop)


def reaches(table: Any, start: int, stop: int) -> Points:
    """How far the coordinates of each row reach (n,) (m), by which its spawn offset goes (`geometry.offset_of`)."""
    base = resting(table)
    points = outline(table, start, stop)
    if isinstance(base, Spheres | Discs):
        return np.asarray(np.abs(base.center[start:stop]).max(axis=1) + np.abs(base.radius[start:stop]))
    edges = np.abs(points[:, [1, -1]] - points[:, :1]).max(axis=2)
    way = edges.sum(axis=1) if isinstance(base, Parallelograms) else edges.max(axis=1)
    return np.asarray(np.abs(points[:, 0]).max(axis=1) + way)


def normals(points: Points) -> Points:
    """Unit normals (n, 3) of flat faces with the corners (n, k, 3), to the outside; NaN of those without an area."""
    across = np.cross(*edges(points)[:2])
    with np.errstate(invalid="ignore"):
        return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def edges(points: Points) -> tuple[Points, Points, Points]:
    """Edges (n, 3) of a triangle of three corners of each face, the first two from one corner."""
    corners = points.shape[1]
    a, b, c = (points[:, place] for place in (0, corners // 3, 2 * corners // 3))
    return b - a, c - a, c - b


def squared(vectors: Points) -> Points:
    """Square the lengths of vectors (n, 3): (n,)."""
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors))


def resting(table: Any) -> Any:
    """The table without a motion that moves all of it."""
    return table.base if isinstance(table, Translated) else table


def has_edges(table: Any) -> bool:
    """Whether its primitives are polygons."""
    return not isinstance(resting(table), Spheres | Discs)


def is_flat(table: Any) -> bool:
    """Whether its primitives lie in planes."""
    return not isinstance(resting(table), Spheres)
