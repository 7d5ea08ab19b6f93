"""Triangles with flat faces or interpolated normals.

Vertices are kept in float32, as Embree sees them: the float64 hit is then solved on the very triangle that was
found, so neighbours share their edges exactly.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

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
    within_triangle,
)
from raytracer.jit import kernel, prefetch
from raytracer.primitives.interface import areas, concatenate, expect, geometry, hit, pdf_point, sample_point
from raytracer.sampling.warp import sample_triangle
from raytracer.vec import add, cross, dot, madd, max_abs, norm, normalize, scale, sub


class Triangles(NamedTuple):
    """vertices (n, 3) float32, faces (m, 3) uint32, anticlockwise from outside, material (m,) int32."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]


class SmoothTriangles(NamedTuple):
    """As Triangles, with unit vertex normals (n, 3) float32 that shading interpolates."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    normals: NDArray[np.float32]


@concatenate.register(Triangles)
@concatenate.register(SmoothTriangles)
def _(first: Any, tables: Sequence[Any]) -> Any:
    if len(tables) == 1:
        return first
    starts = np.cumsum([0] + [len(table.vertices) for table in tables])
    faces = np.concatenate([table.faces + np.uint32(start) for table, start in zip(tables, starts, strict=False)])
    columns = {name: np.concatenate([getattr(table, name) for table in tables]) for name in first._fields}
    columns["faces"] = padded(faces, np.uint32)
    columns["vertices"] = padded(columns["vertices"], np.float32)
    return type(first)(**columns)


@geometry.register(Triangles)
@geometry.register(SmoothTriangles)
def _(table: Triangles | SmoothTriangles) -> Geometry:
    return Geometry(Primitive.TRIANGLE, (table.vertices,), table.faces)


@areas.register(Triangles)
@areas.register(SmoothTriangles)
def _(table: Triangles | SmoothTriangles) -> NDArray[np.float64]:
    a, b, c = (table.vertices[table.faces[:, corner]].astype(np.float64) for corner in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


@expect.register(Triangles)
@expect.register(SmoothTriangles)
def _(table, primitive):
    prefetch(table.material.ctypes.data + table.material.itemsize * primitive)
    for corner in range(3):
        row = np.intp(table.faces[primitive, corner])
        prefetch(table.vertices.ctypes.data + table.vertices.strides[0] * row)


@kernel
def _corners(vertices, faces, primitive):
    """First vertex and the two edges from it."""
    a = row3(vertices, faces[primitive, 0])
    return a, sub(row3(vertices, faces[primitive, 1]), a), sub(row3(vertices, faces[primitive, 2]), a)


@kernel
def _extent(a, edge1, edge2):
    return max_abs(a) + max(max_abs(edge1), max_abs(edge2))


@kernel
def _solve(accuracy, a, edge1, edge2, origin, direction, near):
    """Point, normal, barycentric coordinates and spawn offset of a hit."""
    normal = normalize(cross(edge1, edge2))
    found = madd(origin, plane_distance(accuracy, origin, direction, a, normal, near), direction)
    u, v = barycentric(found, a, edge1, edge2)
    offset = hit_offset(accuracy, _extent(a, edge1, edge2), near)
    u, v = within_triangle(u, v, offset / max(max_abs(edge1), max_abs(edge2)))
    return add(a, add(scale(u, edge1), scale(v, edge2))), normal, u, v, offset


@hit.register(Triangles)
def _(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = _solve(accuracy, a, edge1, edge2, origin, direction, near)
    return Hit(point, normal, normal, u, v, offset, table.material[primitive], edge1, edge2, point)


@hit.register(SmoothTriangles)
def _(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = _solve(accuracy, a, edge1, edge2, origin, direction, near)

    # Interpolate the vertex normals, and keep to the side of the face that the ray came from.
    n0 = row3(table.normals, table.faces[primitive, 0])
    n1 = row3(table.normals, table.faces[primitive, 1])
    n2 = row3(table.normals, table.faces[primitive, 2])
    shading = normalize(add(scale(1.0 - u - v, n0), add(scale(u, n1), scale(v, n2))))
    if dot(shading, direction) * dot(normal, direction) <= 0.0:
        shading = normal
    return Hit(point, normal, shading, u, v, offset, table.material[primitive], edge1, edge2, point)


@sample_point.register(Triangles)
@sample_point.register(SmoothTriangles)
def _(table, primitive, reference, u1, u2, time):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    across = cross(edge1, edge2)
    normal = normalize(across)
    u, v = sample_triangle(u1, u2)
    point = add(a, add(scale(u, edge1), scale(v, edge2)))
    return area_light_point(reference, point, normal, 0.5 * norm(across), _extent(a, edge1, edge2), u, v)


@pdf_point.register(Triangles)
@pdf_point.register(SmoothTriangles)
def _(table, primitive, reference, point, normal, time):
    _, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    return area_pdf(reference, point, normal, 0.5 * norm(cross(edge1, edge2)))
