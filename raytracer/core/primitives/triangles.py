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
from raytracer.jit import generic, kernel, prefetch
from raytracer.primitives.interface import (
    areas,
    bounds,
    concatenate,
    expect,
    geometry,
    has_vertex_normals,
    hit,
    pdf_point,
    sample_point,
    section,
    unmapped,
)
from raytracer.sampling.warp import sample_triangle
from raytracer.vec import add, cross, dot, madd, max_abs, norm, normalize, scale, sub


class Coordinates(NamedTuple):
    """values (n, 2) float32, the parameters u and v of the vertices."""

    values: NDArray[np.float32]


class Triangles(NamedTuple):
    """vertices (n, 3) float32, faces (m, 3) uint32, anticlockwise from outside, material (m,) int32.

    uv, Coordinates of the vertices, or None: then u and v are barycentric.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    uv: Coordinates | None = None


class SmoothTriangles(NamedTuple):
    """As Triangles, with unit vertex normals (n, 3) float32 that shading interpolates."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    uv: Coordinates | None
    normals: NDArray[np.float32]


@concatenate.register(Triangles)
@concatenate.register(SmoothTriangles)
def _(first: Any, tables: Sequence[Any]) -> Any:
    if len(tables) == 1:
        return first
    starts = np.cumsum([0] + [len(table.vertices) for table in tables])
    faces = np.concatenate([table.faces + np.uint32(start) for table, start in zip(tables, starts, strict=False)])
    names = [name for name in first._fields if name not in ("faces", "uv")]
    columns: dict[str, Any] = {name: np.concatenate([getattr(table, name) for table in tables]) for name in names}
    columns["faces"] = padded(faces, np.uint32)
    columns["vertices"] = padded(columns["vertices"], np.float32)
    uv = None if first.uv is None else Coordinates(np.concatenate([table.uv.values for table in tables]))
    return type(first)(**columns, uv=uv)


@unmapped.register(Triangles)
@unmapped.register(SmoothTriangles)
def _(table: Triangles | SmoothTriangles) -> Triangles | SmoothTriangles:
    return table._replace(uv=None)


@section.register(Triangles)
@section.register(SmoothTriangles)
def _(table: Any, start: int, stop: int) -> Any:
    return table._replace(faces=table.faces[start:stop], material=table.material[start:stop])


@geometry.register(Triangles)
@geometry.register(SmoothTriangles)
def _(table: Triangles | SmoothTriangles) -> Geometry:
    return Geometry(Primitive.TRIANGLE, (table.vertices,), table.faces)


@has_vertex_normals.register(SmoothTriangles)
def has_vertex_normals_smooth_triangles(table: SmoothTriangles) -> bool:
    """Tell that shading differs from the faces."""
    return True


@areas.register(Triangles)
@areas.register(SmoothTriangles)
def _(table: Triangles | SmoothTriangles) -> NDArray[np.float64]:
    a, b, c = (table.vertices[table.faces[:, corner]].astype(np.float64) for corner in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


@bounds.register(Triangles)
@bounds.register(SmoothTriangles)
def _(table: Triangles | SmoothTriangles) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # A file may hold vertices that no triangle has.
    corners = table.vertices[table.faces].reshape(-1, 3).astype(np.float64)
    return corners.min(axis=0), corners.max(axis=0)


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
def extent(a, edge1, edge2):
    """How far the coordinates of a triangle reach."""
    return max_abs(a) + max(max_abs(edge1), max_abs(edge2))


@kernel
def solve(accuracy, a, edge1, edge2, origin, direction, near):
    """Point, normal, barycentric coordinates and spawn offset of a hit."""
    normal = normalize(cross(edge1, edge2))
    found = madd(origin, plane_distance(accuracy, origin, direction, a, normal, near), direction)
    u, v = barycentric(found, a, edge1, edge2)
    offset = hit_offset(accuracy, extent(a, edge1, edge2), near)
    u, v = within_triangle(u, v, offset / max(max_abs(edge1), max_abs(edge2)))
    return add(a, add(scale(u, edge1), scale(v, edge2))), normal, u, v, offset


@kernel
def interpolated_normal(n0, n1, n2, u, v, normal):
    """Interpolate the normals of the corners; the face's normal where that is not on its outside.

    So too where they cancel: what is no number is on neither side.
    """
    shading = normalize(add(scale(1.0 - u - v, n0), add(scale(u, n1), scale(v, n2))))
    return shading if dot(shading, normal) > 0.0 else normal


@generic
def parameters(uv, faces, primitive, u, v, edge1, edge2):
    """u and v at barycentric coordinates of a triangle, and dp/du and dp/dv, zero where they are not defined."""
    raise NotImplementedError


@parameters.register(type(None))
def _(uv, faces, primitive, u, v, edge1, edge2):
    return u, v, edge1, edge2


@parameters.register(Coordinates)
def _(uv, faces, primitive, u, v, edge1, edge2):
    a, b, c = faces[primitive, 0], faces[primitive, 1], faces[primitive, 2]
    u0, v0 = np.float64(uv.values[a, 0]), np.float64(uv.values[a, 1])
    u1, v1 = uv.values[b, 0] - u0, uv.values[b, 1] - v0
    u2, v2 = uv.values[c, 0] - u0, uv.values[c, 1] - v0
    area = u1 * v2 - v1 * u2
    inverse = 1.0 / area if area != 0.0 else 0.0
    tangent = sub(scale(v2 * inverse, edge1), scale(v1 * inverse, edge2))
    bitangent = sub(scale(u1 * inverse, edge2), scale(u2 * inverse, edge1))
    return u0 + u * u1 + v * u2, v0 + u * v1 + v * v2, tangent, bitangent


@hit.register(Triangles)
def _(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = solve(accuracy, a, edge1, edge2, origin, direction, near)
    u, v, tangent, bitangent = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, normal, u, v, offset, table.material[primitive], tangent, bitangent, point)


@hit.register(SmoothTriangles)
def _(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = solve(accuracy, a, edge1, edge2, origin, direction, near)
    n0 = row3(table.normals, table.faces[primitive, 0])
    n1 = row3(table.normals, table.faces[primitive, 1])
    n2 = row3(table.normals, table.faces[primitive, 2])
    shading = interpolated_normal(n0, n1, n2, u, v, normal)
    u, v, tangent, bitangent = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, shading, u, v, offset, table.material[primitive], tangent, bitangent, point)


@sample_point.register(Triangles)
@sample_point.register(SmoothTriangles)
def _(table, primitive, reference, u1, u2, time):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    across = cross(edge1, edge2)
    normal = normalize(across)
    u, v = sample_triangle(u1, u2)
    point = add(a, add(scale(u, edge1), scale(v, edge2)))
    u, v, _, _ = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return area_light_point(reference, point, normal, 0.5 * norm(across), extent(a, edge1, edge2), u, v)


@pdf_point.register(Triangles)
@pdf_point.register(SmoothTriangles)
def _(table, primitive, reference, point, normal, time):
    _, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    return area_pdf(reference, point, normal, 0.5 * norm(cross(edge1, edge2)))
