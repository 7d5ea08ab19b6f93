"""Triangles whose vertices move independently while the shutter is open.

Between two time steps a vertex goes in a straight line at a constant speed, in float32 for Embree and on the same
float32 ends in float64 for the hit.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.compiler.intrinsics import prefetch
from raytracer.core.geometry import (
    Geometry,
    Hit,
    LightPoint,
    Primitive,
    area_light_point,
    area_pdf,
    barycentric,
    hit_offset,
    pad_buffer,
)
from raytracer.core.motion.interpolation import segment_of
from raytracer.core.primitives.base.interface import (
    areas,
    concatenate,
    geometry,
    group_key,
    has_vertex_normals,
    hit,
    pdf_point,
    prefetch_primitive,
    reproject_at_time,
    sample_point,
    slice_rows,
    without_uv,
)
from raytracer.core.primitives.triangles import TextureCoordinates, extent, interpolated_normal, parameters, solve_hit
from raytracer.core.sampling.warp import sample_triangle
from raytracer.core.vec import add, cross, madd, max_abs, norm, normalize, scale, sub


class DeformingTriangles(NamedTuple):
    """Triangles of an animated mesh.

    vertices (steps, n, 3) float32, at equal steps of the shutter's time; faces (m, 3) uint32, anticlockwise from
    outside; material (m,) int32; uv, triangles.Coordinates of the vertices, which do not change, or None.
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


@group_key.register(DeformingTriangles)
@group_key.register(DeformingSmoothTriangles)
def group_key_deforming_triangles(table: Any) -> tuple[Any, ...]:
    return (type(table).__name__, len(table.vertices), table.uv is None)


@concatenate.register(DeformingTriangles)
@concatenate.register(DeformingSmoothTriangles)
def concatenate_deforming_triangles(first: Any, tables: Sequence[Any]) -> Any:
    if len(tables) == 1:
        return first
    starts = np.cumsum([0] + [table.vertices.shape[1] for table in tables])
    faces = np.concatenate([table.faces + np.uint32(start) for table, start in zip(tables, starts, strict=False)])
    by_vertex = {
        name: pad_buffer(np.concatenate([getattr(table, name) for table in tables], axis=1), np.float32)
        for name in ("vertices", "normals")
        if name in first._fields
    }
    material = np.concatenate([table.material for table in tables])
    uv = None if first.uv is None else TextureCoordinates(np.concatenate([table.uv.values for table in tables]))
    return first._replace(faces=pad_buffer(faces, np.uint32), material=material, uv=uv, **by_vertex)


@without_uv.register(DeformingTriangles)
@without_uv.register(DeformingSmoothTriangles)
def without_uv_deforming_triangles(table: Any) -> Any:
    return table._replace(uv=None)


@slice_rows.register(DeformingTriangles)
@slice_rows.register(DeformingSmoothTriangles)
def slice_rows_deforming_triangles(table: Any, start: int, stop: int) -> Any:
    return table._replace(faces=table.faces[start:stop], material=table.material[start:stop])


@geometry.register(DeformingTriangles)
@geometry.register(DeformingSmoothTriangles)
def geometry_deforming_triangles(table: Any) -> Geometry:
    return Geometry(Primitive.TRIANGLE, tuple(table.vertices), table.faces)


@has_vertex_normals.register(DeformingSmoothTriangles)
def has_vertex_normals_deforming_smooth_triangles(table: DeformingSmoothTriangles) -> bool:
    """Tell that shading differs from the faces."""
    return True


@areas.register(DeformingTriangles)
@areas.register(DeformingSmoothTriangles)
def areas_deforming_triangles(table: Any) -> NDArray[np.float64]:
    """Compute the means of the areas at the time steps."""
    total = np.zeros(len(table.faces))
    for vertices in table.vertices:
        a, b, c = (vertices[table.faces[:, corner]].astype(np.float64) for corner in range(3))
        total += 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return total / len(table.vertices)


@prefetch_primitive.register(DeformingTriangles)
@prefetch_primitive.register(DeformingSmoothTriangles)
def prefetch_primitive_deforming_triangles(table, primitive):
    prefetch(table.material.ctypes.data + table.material.itemsize * primitive)
    for corner in range(3):
        row = np.intp(table.faces[primitive, corner])
        prefetch(table.vertices.ctypes.data + table.vertices.strides[1] * row)


@kernel
def _at(frames, step, row, fraction):
    """Interpolate row `row` of (steps, n, 3) float32 between two steps; returns it and the step's length (m)."""
    start = (
        np.float64(frames[step, row, 0]),
        np.float64(frames[step, row, 1]),
        np.float64(frames[step, row, 2]),
    )
    end = (
        np.float64(frames[step + 1, row, 0]),
        np.float64(frames[step + 1, row, 1]),
        np.float64(frames[step + 1, row, 2]),
    )
    way = sub(end, start)
    return madd(start, fraction, way), max_abs(way)


@kernel
def _corners(table, primitive, time):
    """Return the first vertex and the two edges from it at a time, and the longest displacement between two steps."""
    step, fraction = segment_of(time, len(table.vertices) - 1)
    a, way_a = _at(table.vertices, step, table.faces[primitive, 0], fraction)
    b, way_b = _at(table.vertices, step, table.faces[primitive, 1], fraction)
    c, way_c = _at(table.vertices, step, table.faces[primitive, 2], fraction)
    return a, sub(b, a), sub(c, a), max(way_a, max(way_b, way_c))


@kernel
def _rest_position(table, primitive, u, v):
    """Return the position of a point of a triangle when the shutter opened."""
    a, edge1, edge2, _ = _corners(table, primitive, 0.0)
    return add(a, add(scale(u, edge1), scale(v, edge2)))


@hit.register(DeformingTriangles)
def hit_deforming_triangles(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2, way = _corners(table, primitive, time)
    point, normal, u, v, offset = solve_hit(accuracy, a, edge1, edge2, origin, direction, near)
    offset += hit_offset(accuracy, way, 0.0)
    local = _rest_position(table, primitive, u, v)
    u, v, tangent, bitangent = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, normal, u, v, offset, table.material[primitive], tangent, bitangent, local)


@hit.register(DeformingSmoothTriangles)
def hit_deforming_smooth_triangles(table, primitive, origin, direction, near, time, accuracy):
    a, edge1, edge2, way = _corners(table, primitive, time)
    point, normal, u, v, offset = solve_hit(accuracy, a, edge1, edge2, origin, direction, near)
    offset += hit_offset(accuracy, way, 0.0)
    local = _rest_position(table, primitive, u, v)
    step, fraction = segment_of(time, len(table.vertices) - 1)
    n0, _ = _at(table.normals, step, table.faces[primitive, 0], fraction)
    n1, _ = _at(table.normals, step, table.faces[primitive, 1], fraction)
    n2, _ = _at(table.normals, step, table.faces[primitive, 2], fraction)
    shading = interpolated_normal(n0, n1, n2, u, v, normal)
    u, v, tangent, bitangent = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return Hit(point, normal, shading, u, v, offset, table.material[primitive], tangent, bitangent, local)


@sample_point.register(DeformingTriangles)
@sample_point.register(DeformingSmoothTriangles)
def sample_point_deforming_triangles(table, primitive, reference, u1, u2, time):
    a, edge1, edge2, way = _corners(table, primitive, time)
    across = cross(edge1, edge2)
    u, v = sample_triangle(u1, u2)
    point = add(a, add(scale(u, edge1), scale(v, edge2)))
    area, reach = 0.5 * norm(across), extent(a, edge1, edge2) + way
    drawn = area_light_point(reference, point, normalize(across), area, reach, u, v)
    local = _rest_position(table, primitive, u, v)
    u, v, _, _ = parameters(table.uv, table.faces, primitive, u, v, edge1, edge2)
    return LightPoint(drawn.point, drawn.normal, drawn.pdf, drawn.gap, u, v, local)


@pdf_point.register(DeformingTriangles)
@pdf_point.register(DeformingSmoothTriangles)
def pdf_point_deforming_triangles(table, primitive, reference, point, normal, time):
    _, edge1, edge2, _ = _corners(table, primitive, time)
    return area_pdf(reference, point, normal, 0.5 * norm(cross(edge1, edge2)))


@reproject_at_time.register(DeformingTriangles)
@reproject_at_time.register(DeformingSmoothTriangles)
def reproject_at_time_deforming_triangles(table, primitive, hit, time):
    a, edge1, edge2, _ = _corners(table, primitive, 0.0)
    u, v = barycentric(hit.local, a, edge1, edge2)
    a, edge1, edge2, _ = _corners(table, primitive, time)
    return add(a, add(scale(u, edge1), scale(v, edge2)))
