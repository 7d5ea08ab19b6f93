"""Triangles of meshes: with flat faces or interpolated normals, at rest or with vertices that move by themselves.

Vertices are kept in float32, as Embree sees them: the float64 hit is then solved on the very triangle that was
found, so neighbours share their edges exactly.  Between two time steps a vertex of a deforming mesh goes in a straight
line at a constant speed, in float32 for Embree and on the same float32 ends in float64 for the hit.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, overridable
from raytracer.core.compiler.intrinsics import prefetch
from raytracer.core.geometry import (
    Geometry,
    Hit,
    LightPoint,
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
from raytracer.core.motion.interpolation import segment_of
from raytracer.core.primitives.base import interface
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


class DeformingTriangles(NamedTuple):
    """Triangles of an animated mesh: as `Triangles`, with vertices (steps, n, 3) at equal steps of the shutter's time.

    Texture coordinates do not change.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    uv: TextureCoordinates | None = None


class DeformingSmoothTriangles(NamedTuple):
    """Triangles of an animated mesh with unit vertex normals (steps, n, 3) float32, which shading interpolates."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    material: NDArray[np.int32]
    uv: TextureCoordinates | None
    normals: NDArray[np.float32]


_Static = Triangles | SmoothTriangles
_Deforming = DeformingTriangles | DeformingSmoothTriangles
_Smooth = SmoothTriangles | DeformingSmoothTriangles
_Mesh = _Static | _Deforming


# ---- Tables


@interface.group_key.register(_Deforming)
def group_key_deforming_triangles(table: Any) -> tuple[Any, ...]:
    return (type(table).__name__, len(table.vertices), table.uv is None)


@interface.concatenate.register(_Mesh)
def concatenate_triangles(first: Any, tables: Sequence[Any]) -> Any:
    if len(tables) == 1:
        return first
    # The vertices' axis is the last but one: time steps may stand before it.
    starts = np.cumsum([0] + [table.vertices.shape[-2] for table in tables])
    faces = np.concatenate([table.faces + np.uint32(start) for table, start in zip(tables, starts, strict=False)])
    by_vertex = {
        name: pad_buffer(np.concatenate([getattr(table, name) for table in tables], axis=-2), np.float32)
        for name in ("vertices", "normals")
        if name in first._fields
    }
    material = np.concatenate([table.material for table in tables])
    uv = None if first.uv is None else TextureCoordinates(np.concatenate([table.uv.values for table in tables]))
    return first._replace(faces=pad_buffer(faces, np.uint32), material=material, uv=uv, **by_vertex)


@interface.without_uv.register(_Mesh)
def without_uv_triangles(table: Any) -> Any:
    return table._replace(uv=None)


@interface.slice_rows.register(_Mesh)
def slice_rows_triangles(table: Any, start: int, stop: int) -> Any:
    return table._replace(faces=table.faces[start:stop], material=table.material[start:stop])


@interface.geometry.register(_Mesh)
def geometry_triangles(table: Any) -> Geometry:
    return Geometry(Primitive.TRIANGLE, tuple(_frames(table)), table.faces)


def _frames(table: Any) -> Any:
    """Return the vertices (steps, n, 3), of one step at rest."""
    return table.vertices if table.vertices.ndim == 3 else table.vertices[None]


@interface.has_vertex_normals.register(_Smooth)
def has_vertex_normals_smooth_triangles(table: Any) -> bool:
    """Tell that shading differs from the faces."""
    return True


@interface.areas.register(_Mesh)
def areas_triangles(table: Any) -> NDArray[np.float64]:
    """Compute the means of the areas at the time steps."""
    total = np.zeros(len(table.faces))
    for vertices in _frames(table):
        a, b, c = (vertices[table.faces[:, corner]].astype(np.float64) for corner in range(3))
        total += 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return total / len(_frames(table))


@interface.boxes.register(_Static)
def boxes_triangles(table: Any, rows: NDArray[np.int64]) -> interface.Boxes:
    corners = table.vertices[table.faces[rows]].astype(np.float64)
    return corners.min(axis=1), corners.max(axis=1)


# ---- Hits


@interface.prefetch_primitive.register(_Mesh)
def prefetch_primitive_triangles(table, primitive):
    prefetch(table.material.ctypes.data + table.material.itemsize * primitive)
    for corner in range(3):
        row = np.intp(table.faces[primitive, corner])
        prefetch(table.vertices.ctypes.data + table.vertices.strides[table.vertices.ndim - 2] * row)


@kernel
def _corners(vertices, faces, primitive):
    """Return the first vertex and the two edges from it."""
    a = row3(vertices, faces[primitive, 0])
    return a, sub(row3(vertices, faces[primitive, 1]), a), sub(row3(vertices, faces[primitive, 2]), a)


@kernel
def _at(frames, step, row, fraction):
    """Interpolate row `row` of (steps, n, 3) float32 between two steps; returns it and the step's length (m)."""
    start = (np.float64(frames[step, row, 0]), np.float64(frames[step, row, 1]), np.float64(frames[step, row, 2]))
    step += 1
    end = (np.float64(frames[step, row, 0]), np.float64(frames[step, row, 1]), np.float64(frames[step, row, 2]))
    way = sub(end, start)
    return madd(start, fraction, way), max_abs(way)


@kernel
def _corners_at(table, primitive, time):
    """Return the first vertex and the two edges from it at a time, and the longest displacement between two steps."""
    step, fraction = segment_of(time, len(table.vertices) - 1)
    a, way_a = _at(table.vertices, step, table.faces[primitive, 0], fraction)
    b, way_b = _at(table.vertices, step, table.faces[primitive, 1], fraction)
    c, way_c = _at(table.vertices, step, table.faces[primitive, 2], fraction)
    return a, sub(b, a), sub(c, a), max(way_a, max(way_b, way_c))


@kernel
def _position(table, primitive, u, v, time):
    """Return the position of a point of a deforming triangle at a time."""
    a, edge1, edge2, _ = _corners_at(table, primitive, time)
    return add(a, add(scale(u, edge1), scale(v, edge2)))


@kernel
def _extent(a, edge1, edge2):
    """Bound the coordinates of a triangle."""
    return max_abs(a) + max(max_abs(edge1), max_abs(edge2))


@kernel
def _solve_hit(accuracy, a, edge1, edge2, origin, direction, near):
    """Compute point, normal, barycentric coordinates and spawn offset of a hit."""
    normal = normalize(cross(edge1, edge2))
    point = madd(origin, plane_distance(accuracy, origin, direction, a, normal, near), direction)
    u, v = barycentric(point, a, edge1, edge2)
    offset = hit_offset(accuracy, _extent(a, edge1, edge2), near)
    u, v = clamp_to_triangle(u, v, offset / max(max_abs(edge1), max_abs(edge2)))
    return add(a, add(scale(u, edge1), scale(v, edge2))), normal, u, v, offset


@kernel
def interpolated_normal(n0, n1, n2, u, v, normal):
    """Interpolate the normals of the corners; the face's normal where that is not on its outside.

    So too where they cancel: what is no number is on neither side.
    """
    shading = normalize(add(scale(1.0 - u - v, n0), add(scale(u, n1), scale(v, n2))))
    return shading if dot(shading, normal) > 0.0 else normal


@overridable
def _shading_normal(table, primitive, u, v, normal, time):
    """Return the normal that a triangle is shaded with at barycentric coordinates: its own, or interpolated."""
    return normal


@_shading_normal.register(SmoothTriangles)
def _shading_normal_smooth_triangles(table, primitive, u, v, normal, time):
    n0 = row3(table.normals, table.faces[primitive, 0])
    n1 = row3(table.normals, table.faces[primitive, 1])
    n2 = row3(table.normals, table.faces[primitive, 2])
    return interpolated_normal(n0, n1, n2, u, v, normal)


@_shading_normal.register(DeformingSmoothTriangles)
def _shading_normal_deforming_smooth_triangles(table, primitive, u, v, normal, time):
    step, fraction = segment_of(time, len(table.vertices) - 1)
    n0, _ = _at(table.normals, step, table.faces[primitive, 0], fraction)
    n1, _ = _at(table.normals, step, table.faces[primitive, 1], fraction)
    n2, _ = _at(table.normals, step, table.faces[primitive, 2], fraction)
    return interpolated_normal(n0, n1, n2, u, v, normal)


@kernel
def _parameters(uv, faces, primitive, u, v, edge1, edge2):
    """Compute u, v, dp/du and dp/dv at barycentric coordinates of a triangle; derivatives are zero where undefined."""
    if uv is None:
        return u, v, edge1, edge2
    a, b, c = faces[primitive, 0], faces[primitive, 1], faces[primitive, 2]
    u0, v0 = np.float64(uv.values[a, 0]), np.float64(uv.values[a, 1])
    u1, v1 = uv.values[b, 0] - u0, uv.values[b, 1] - v0
    u2, v2 = uv.values[c, 0] - u0, uv.values[c, 1] - v0
    area = u1 * v2 - v1 * u2
    inverse = 1.0 / area if area != 0.0 else 0.0
    tangent = sub(scale(v2 * inverse, edge1), scale(v1 * inverse, edge2))
    bitangent = sub(scale(u1 * inverse, edge2), scale(u2 * inverse, edge1))
    return u0 + u * u1 + v * u2, v0 + u * v1 + v * v2, tangent, bitangent


@interface.hit.register(_Static)
def hit_triangles(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    point, normal, u, v, offset = _solve_hit(accuracy, a, edge1, edge2, origin, direction, near)
    shading = _shading_normal(table, primitive, u, v, normal, time)
    u, v, tangent, bitangent = _parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, shading, u, v, offset, table.material[primitive], tangent, bitangent, point)


@interface.hit.register(_Deforming)
def hit_deforming_triangles(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2, way = _corners_at(table, primitive, time)
    point, normal, u, v, offset = _solve_hit(accuracy, a, edge1, edge2, origin, direction, near)
    offset += hit_offset(accuracy, way, 0.0)
    local = _position(table, primitive, u, v, 0.0)
    shading = _shading_normal(table, primitive, u, v, normal, time)
    u, v, tangent, bitangent = _parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, shading, u, v, offset, table.material[primitive], tangent, bitangent, local)


@interface.reproject_at_time.register(_Deforming)
def reproject_at_time_deforming_triangles(table, primitive, hit, time):
    a, edge1, edge2, _ = _corners_at(table, primitive, 0.0)
    u, v = barycentric(hit.local, a, edge1, edge2)
    return _position(table, primitive, u, v, time)


# ---- Points of emitters


@interface.sample_point.register(_Static)
def sample_point_triangles(table, primitive, reference, u1, u2, time):
    a, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    across = cross(edge1, edge2)
    normal = normalize(across)
    u, v = sample_triangle(u1, u2)
    point = add(a, add(scale(u, edge1), scale(v, edge2)))
    u, v, _, _ = _parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return area_light_point(reference, point, normal, 0.5 * norm(across), _extent(a, edge1, edge2), u, v)


@interface.sample_point.register(_Deforming)
def sample_point_deforming_triangles(table, primitive, reference, u1, u2, time):
    a, edge1, edge2, way = _corners_at(table, primitive, time)
    across = cross(edge1, edge2)
    u, v = sample_triangle(u1, u2)
    point = add(a, add(scale(u, edge1), scale(v, edge2)))
    area, reach = 0.5 * norm(across), _extent(a, edge1, edge2) + way
    drawn = area_light_point(reference, point, normalize(across), area, reach, u, v)
    local = _position(table, primitive, u, v, 0.0)
    u, v, _, _ = _parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return LightPoint(drawn.point, drawn.normal, drawn.pdf, drawn.gap, u, v, local)


@interface.pdf_point.register(_Static)
def pdf_point_triangles(table, primitive, reference, point, normal, time):
    _, edge1, edge2 = _corners(table.vertices, table.faces, primitive)
    return area_pdf(reference, point, normal, 0.5 * norm(cross(edge1, edge2)))


@interface.pdf_point.register(_Deforming)
def pdf_point_deforming_triangles(table, primitive, reference, point, normal, time):
    _, edge1, edge2, _ = _corners_at(table, primitive, time)
    return area_pdf(reference, point, normal, 0.5 * norm(cross(edge1, edge2)))
