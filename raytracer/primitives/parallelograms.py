"""Parallelograms: quads and the faces of boxes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.geometry import (
    Geometry,
    Hit,
    Primitive,
    area_light_point,
    area_pdf,
    barycentric,
    hit_offset,
    padded,
    plane_distance,
    row3,
    within_quad,
)
from raytracer.primitives.interface import areas, bounds, geometry, hit, pdf_point, row_of, sample_point
from raytracer.vec import add, cross, madd, max_abs, norm, normalize, scale


class Parallelograms(NamedTuple):
    """corner, edges u and v (n, 3) float64, material (n,) int32; the outside normal is u x v."""

    corner: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    material: NDArray[np.int32]


@geometry.register(Parallelograms)
def _(table: Parallelograms) -> Geometry:
    """Two triangles each: Embree takes 110 ns to follow a ray round the Cornell box, with its own quads 175 ns."""
    corner, u, v = table.corner, table.u, table.v
    vertices = np.stack([corner, corner + u, corner + u + v, corner + v], axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(corner))[:, None]
    indices = np.add(first, [0, 1, 3, 2, 3, 1]).reshape(-1, 3)
    return Geometry(Primitive.TRIANGLE, (padded(vertices, np.float32),), padded(indices, np.uint32))


@row_of.register(Parallelograms)
def _(table, part):
    return np.uint32(part >> 1)


@areas.register(Parallelograms)
def _(table: Parallelograms) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(np.cross(table.u, table.v), axis=1))


@bounds.register(Parallelograms)
def _(table: Parallelograms) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    corner, u, v = table.corner, table.u, table.v
    corners = np.concatenate([corner, corner + u, corner + v, corner + u + v])
    return corners.min(axis=0), corners.max(axis=0)


@hit.register(Parallelograms)
def _(table, primitive, origin, direction, near, time, accuracy):
    corner, u, v = row3(table.corner, primitive), row3(table.u, primitive), row3(table.v, primitive)
    normal = normalize(cross(u, v))
    found = madd(origin, plane_distance(accuracy, origin, direction, corner, normal, near), direction)
    a, b = barycentric(found, corner, u, v)
    offset = hit_offset(accuracy, max_abs(corner) + max_abs(u) + max_abs(v), near)
    a, b = within_quad(a, b, offset / max_abs(u), offset / max_abs(v))
    point = add(corner, add(scale(a, u), scale(b, v)))
    return Hit(point, normal, normal, a, b, offset, table.material[primitive], u, v, point)


@sample_point.register(Parallelograms)
def _(table, primitive, reference, u1, u2, time):
    corner, u, v = row3(table.corner, primitive), row3(table.u, primitive), row3(table.v, primitive)
    across = cross(u, v)
    normal = normalize(across)
    point = add(corner, add(scale(u1, u), scale(u2, v)))
    extent = max_abs(corner) + max_abs(u) + max_abs(v)
    return area_light_point(reference, point, normal, norm(across), extent, u1, u2)


@pdf_point.register(Parallelograms)
def _(table, primitive, reference, point, normal, time):
    area = norm(cross(row3(table.u, primitive), row3(table.v, primitive)))
    return area_pdf(reference, point, normal, area)
