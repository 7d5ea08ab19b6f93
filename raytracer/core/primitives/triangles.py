"""Triangles with flat faces or interpolated normals.

Vertices are kept in float32, as Embree sees them: the float64 hit is then solved on the very triangle that was
found, so neighbours share their edges exactly.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.compiler.intrinsics import prefetch
from raytracer.core.geometry import (
    Geometry,
    Hit,
    Primitive,
    area_light_point,
    area_pdf,
    barycentric,
    clamp_to_triangle,
    hit_offset,
    pad_buffer,
    plane_distance,
    row3,
)
from raytracer.core.primitives.base.interface import (
    Boxes,
    areas,
    bounds,
    boxes,
    concatenate,
    geometry,
    has_vertex_normals,
    hit,
    pdf_point,
    prefetch_primitive,
    sample_point,
    slice_rows,
    without_uv,
)
from raytracer.core.sampling.warp import sample_triangle
from raytracer.core.vec import add, cross, dot, madd, max_abs, norm, normalize, scale, sub


class TextureCoordinates(NamedTuple):
    """Texture coordinates: values (n, 2) float32, the parameters u and v of the vertices."""

    values: NDArray[np.float32]


class Triangles(NamedTuple):
    """Table of triangles: vertices (n, 3) float32, faces (m, 3) uint32 anticlockwise from outside, material (m,) int32.

    uv : TextureCoordinates of the vertices, or None: then u and v are barycentric.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    uv: TextureCoordinates | None = None


class SmoothTriangles(NamedTuple):
    """Table of triangles with unit vertex normals (n, 3) float32, which shading interpolates."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    uv: TextureCoordinates | None
    normals: NDArray[np.float32]


@concatenate.register(Triangles)
@concatenate.register(SmoothTriangles)
def concatenate_triangles(first: Any, tables: Sequence[Any]) -> Any:
    if len(tables) == 1:
        return first
    starts = np.cumsum([0] + [len(table.vertices) for table in tables])
    faces = np.concatenate([table.faces + np.uint32(start) for table, start in zip(tables, starts, strict=False)])
    names = [name for name in first._fields if name not in ("faces", "uv")]
    columns: dict[str, Any] = {name: np.concatenate([getattr(table, name) for table in tables]) for name in names}
    columns["faces"] = pad_buffer(faces, np.uint32)
    columns["vertices"] = pad_buffer(columns["vertices"], np.float32)
    uv = None if first.uv is None else TextureCoordinates(np.concatenate([table.uv.values for table in tables]))
    return type(first)(**columns, uv=uv)


@without_uv.register(Triangles)
@without_uv.register(SmoothTriangles)
def without_uv_triangles(table: Triangles | SmoothTriangles) -> Triangles | SmoothTriangles:
    return table._replace(uv=None)


@slice_rows.register(Triangles)
@slice_rows.register(SmoothTriangles)
def slice_rows_triangles(table: Any, start: int, stop: int) -> Any:
    return table._replace(faces=table.faces[start:stop], material=table.material[start:stop])


@geometry.register(Triangles)
@geometry.register(SmoothTriangles)
def geometry_triangles(table: Triangles | SmoothTriangles) -> Geometry:
    return Geometry(Primitive.TRIANGLE, (table.vertices,), table.faces)


@has_vertex_normals.register(SmoothTriangles)
def has_vertex_normals_smooth_triangles(table: SmoothTriangles) -> bool:
    """Tell that shading differs from the faces."""
    return True


@areas.register(Triangles)
@areas.register(SmoothTriangles)
def areas_triangles(table: Triangles | SmoothTriangles) -> NDArray[np.float64]:
    a, b, c = (table.vertices[table.faces[:, corner]].astype(np.float64) for corner in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


@bounds.register(Triangles)
@bounds.register(SmoothTriangles)
def bounds_triangles(table: Triangles | SmoothTriangles) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # A file may hold vertices that no triangle has.
    corners = table.vertices[table.faces].reshape(-1, 3).astype(np.float64)
    return corners.min(axis=0), corners.max(axis=0)


@boxes.register(Triangles)
@boxes.register(SmoothTriangles)
def boxes_triangles(table: Triangles | SmoothTriangles, rows: NDArray[np.int64]) -> Boxes:
    corners = table.vertices[table.faces[rows]].astype(np.float64)
    return corners.min(axis=1), corners.max(axis=1)


@prefetch_primitive.register(Triangles)
@prefetch_primitive.register(SmoothTriangles)
def prefetch_primitive_triangles(table, primitive):
    prefetch(table.material.ctypes.data + table.material.itemsize * primitive)
    for corner in range(3):
        row = np.intp(table.faces[primitive, corner])
        prefetch(table.vertices.ctypes.data + table.vertices.strides[0] * row)


@kernel
def _corners(vertices, faces, primitive):
    """Return the first vertex and the two edges from it."""
    a = row3(vertices, faces[primitive, 0])
    return a, sub(row3(vertices, faces[primitive, 1]), a), sub(row3(vertices, faces[primitive, 2]), a)


@kernel
def extent(a, edge1, edge2):
    """Bound the coordinates of a triangle."""
    return max_abs(a) + max(max_abs(edge1), max_abs(edge2))


@kernel
def solve_hit(accuracy, a, edge1, edge2, origin, direction, near):
    """Compute point, normal, barycentric coordinates and spawn offset of a hit."""
    normal = normalize(cross(edge1, edge2))
    point = madd(origin, plane_distance(accuracy, origin, direction, a, normal, near), direction)
    u, v = barycentric(point, a, edge1, edge2)
    offset = hit_offset(accuracy, extent(a, edge1, edge2), near)
    u, v = clamp_to_triangle(u, v, offset / max(max_abs(edge1), max_abs(edge2)))
    return add(a, add(scale(u, edge1), scale(v, edge2))), normal, u, v, offset


@kernel
def interpolated_normal(n0, n1, n2, u, v, normal):
    """Interpolate the normals of the corners; the face's normal where that is not on its outside.

    So too where they cancel: what is no number is on neither side.
    """
    shading = normalize(add(scale(1.0 - u - v, n0), add(scale(u, n1), scale(v, n2))))
    return shading if dot(shading, normal) > 0.0 else normal


@optional
def parameters(uv, faces, primitive, u, v, edge1, edge2):
    """Compute u, v, dp/du and dp/dv at barycentric coordinates of a triangle; derivatives are zero where undefined."""
    return u, v, edge1, edge2


@parameters.register(TextureCoordinates)
def parameters_texture_coordinates(uv, faces, primitive, u, v, edge1, edge2):
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
def hit_triangles(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = solve_hit(accuracy, a, edge1, edge2, origin, direction, near)
    u, v, tangent, bitangent = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, normal, u, v, offset, table.material[primitive], tangent, bitangent, point)


@hit.register(SmoothTriangles)
def hit_smooth_triangles(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = solve_hit(accuracy, a, edge1, edge2, origin, direction, near)
    n0 = row3(table.normals, table.faces[primitive, 0])
    n1 = row3(table.normals, table.faces[primitive, 1])
    n2 = row3(table.normals, table.faces[primitive, 2])
    shading = interpolated_normal(n0, n1, n2, u, v, normal)
    u, v, tangent, bitangent = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, shading, u, v, offset, table.material[primitive], tangent, bitangent, point)


@sample_point.register(Triangles)
@sample_point.register(SmoothTriangles)
def sample_point_triangles(table, primitive, reference, u1, u2, time):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    across = cross(edge1, edge2)
    normal = normalize(across)
    u, v = sample_triangle(u1, u2)
    point = add(a, add(scale(u, edge1), scale(v, edge2)))
    u, v, _, _ = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return area_light_point(reference, point, normal, 0.5 * norm(across), extent(a, edge1, edge2), u, v)


@pdf_point.register(Triangles)
@pdf_point.register(SmoothTriangles)
def pdf_point_triangles(table, primitive, reference, point, normal, time):
    _, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    return area_pdf(reference, point, normal, 0.5 * norm(cross(edge1, edge2)))
