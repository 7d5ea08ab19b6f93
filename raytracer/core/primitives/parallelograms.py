"""Parallelograms: quads and the faces of boxes."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import (
    Geometry,
    Hit,
    LightPoint,
    Primitive,
    area_light_point,
    area_pdf,
    barycentric,
    clamp_to_quad,
    hit_offset,
    pad_buffer,
    plane_distance,
    plane_gap,
    row3,
)
from raytracer.core.primitives.base import interface
from raytracer.core.sampling.spherical_rectangle import (
    SMALLEST,
    SphericalRectangle,
    pdf_spherical_rectangle,
    sample_spherical_rectangle,
    spherical_rectangle,
)
from raytracer.core.vec import add, cross, dot, madd, max_abs, norm, normalize, scale, sub


class Parallelograms(NamedTuple):
    """Table of parallelograms: corner, edges u and v (n, 3) float64, material (n,) int32; outside normal u x v."""

    corner: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    material: NDArray[np.int32]


@interface.geometry.register(Parallelograms)
def geometry_parallelograms(table: Parallelograms) -> Geometry:
    """Make two triangles of each: Embree traces a ray in the Cornell box in 110 ns, in 175 ns with its own quads."""
    corner, u, v = table.corner, table.u, table.v
    vertices = np.stack([corner, corner + u, corner + u + v, corner + v], axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(corner))[:, None]
    indices = np.add(first, [0, 1, 3, 2, 3, 1]).reshape(-1, 3)
    return Geometry(Primitive.TRIANGLE, (pad_buffer(vertices, np.float32),), pad_buffer(indices, np.uint32))


@interface.row_of.register(Parallelograms)
def row_of_parallelograms(table, part):
    return np.uint32(part >> 1)


@interface.areas.register(Parallelograms)
def areas_parallelograms(table: Parallelograms) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(np.cross(table.u, table.v), axis=1))


@interface.boxes.register(Parallelograms)
def boxes_parallelograms(table: Parallelograms, rows: NDArray[np.int64]) -> interface.Boxes:
    corner, u, v = table.corner[rows], table.u[rows], table.v[rows]
    corners = np.stack([corner, corner + u, corner + v, corner + u + v])
    return corners.min(axis=0), corners.max(axis=0)


# ---- Subdivision

_COARSE = 2.0**13
"""Ratio of a parallelogram's extent to the eye's distance from which it is subdivided.

Rays are offset by 4 * 2^-23 of its extent: 1/256 of the distance then, a quarter of a degree seen from the eye.
"""

_EXACT = 2.0**-50
"""Fraction of the extent that corners of parts are multiples of: sums of three such numbers are exact in float64."""

_FINEST = 2.0**-20
"""Size of the smallest parts as a fraction of the extent: float32 then has 3 bits left to tell points in a part."""


def extents(table: Parallelograms) -> NDArray[np.float64]:
    """Bound the coordinates of each (n,) (m), in proportion to which rays are offset."""
    return np.asarray(sum(np.abs(rows).max(axis=1) for rows in (table.corner, table.u, table.v)))


def _nearest(table: Parallelograms, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Approximate coordinates (n, 2) along u and v of the point on each that is nearest to a point."""
    edges = np.stack([table.u, table.v], axis=2)
    at = np.einsum("nij,nj->ni", np.linalg.pinv(edges), point - table.corner)
    return np.asarray(np.clip(at, 0.0, 1.0))


@interface.subdivide_large.register(Parallelograms)
def subdivide_large_parallelograms(table: Parallelograms, eye: NDArray[np.float64]) -> Parallelograms:
    """Subdivide parallelograms that reach far across an axis, the more finely the nearer to the origin.

    A plane of 1000 km is met to 0.1 m by float32, wherever that is, and rays must leave it at 0.5 m.  Parts that are
    as large as they are far away are met as exactly as what else is there.  Parts share corners to the last bit, so no
    ray passes between them.  Across an axis all corners are equally high in float32 too; rounded, those of a tilted
    plane would tilt its long and narrow parts by far more than the plane is uncertain.
    """
    reach, away = extents(table), float(np.abs(eye).max())
    huge = (np.abs(table.u) + np.abs(table.v)).min(axis=1) <= _EXACT * reach
    huge &= reach > _COARSE * away
    # The eye's distance from the origin alone excludes nearly all; the distance to each takes longer.
    if not huge.any():
        return table
    at = _nearest(table, eye)
    place = table.corner + at[:, :1] * table.u + at[:, 1:] * table.v
    seen = away + np.linalg.norm(place - eye, axis=1)
    huge &= (seen > 0.0) & (reach > _COARSE * seen)
    if not huge.any():
        return table
    parts = [interface.slice_rows(table, row, row + 1) for row in range(len(huge))]
    for row in np.flatnonzero(huge):
        parts[row] = _subdivide(parts[row], float(reach[row]), float(seen[row]))
    joined: Parallelograms = interface.concatenate(table, parts)
    return joined


def _subdivide(one: Parallelograms, reach: float, seen: float) -> Parallelograms:
    """Divide a parallelogram, a table of one row, into parts."""
    # All parts that have a corner add up the same numbers for it, and get the same sum.
    quantum = _EXACT * 2.0 ** math.ceil(math.log2(reach))
    start = _nearest(one, np.zeros(3))[0]
    center = one.corner[0] + start[0] * one.u[0] + start[1] * one.v[0]
    least = max(seen, _FINEST * reach)
    lines = []
    for edge, place in zip((one.u[0], one.v[0]), start, strict=True):
        # Each part is twice as large as that before it, so that its error is within the offset of its neighbour.
        size = np.abs(edge).max()
        steps = least / size * 2.0 ** np.arange(math.ceil(math.log2(max(2.0, size / least))))
        ends = np.concatenate([[0.0], place - steps, place + steps, [1.0]])
        fractions = np.unique(ends[(ends >= 0.0) & (ends <= 1.0)])
        lines.append(quantum * np.round((fractions - place)[:, None] * edge / quantum))
    first, second = lines
    center = quantum * np.round(center / quantum)
    corner = center + first[:-1, None] + second[None, :-1]
    shape = corner.shape
    u = np.broadcast_to(np.diff(first, axis=0)[:, None], shape)
    v = np.broadcast_to(np.diff(second, axis=0)[None], shape)
    count = shape[0] * shape[1]
    return Parallelograms(corner.reshape(-1, 3), u.reshape(-1, 3), v.reshape(-1, 3), np.repeat(one.material, count))


# ---- Hits


@interface.hit.register(Parallelograms)
def hit_parallelograms(table, primitive, origin, direction, near, time, accuracy):
    corner, u, v = row3(table.corner, primitive), row3(table.u, primitive), row3(table.v, primitive)
    normal = normalize(cross(u, v))
    point = madd(origin, plane_distance(accuracy, origin, direction, corner, normal, near), direction)
    a, b = barycentric(point, corner, u, v)
    offset = hit_offset(accuracy, max_abs(corner) + max_abs(u) + max_abs(v), near)
    a, b = clamp_to_quad(a, b, offset / max_abs(u), offset / max_abs(v))
    point = add(corner, add(scale(a, u), scale(b, v)))
    return Hit(point, normal, normal, a, b, offset, table.material[primitive], u, v, point)


# ---- Points of emitters

_SKEW = 2.0**-40
"""Cosine between the edges up to which they make a rectangle: what transforms leave is 2^-50, what rays tell 2^-24."""

_NEAR = 2.0
"""Square of the distance over the longer edge up to which directions are drawn evenly; points beyond.

Near by, points that are even by area leave noise as large as cos / d^2 varies: without bound for a surface that touches
the lamp.  Far away little is left of that, and an even direction costs 70 ns where a point costs 10: with 2, 8 and 32
here the squared error of scenes/cornell.yaml is 1, 0.97 and 0.96 of what it is by area, and its time 1, 1.1 and 1.3.
"""


@kernel
def _seen_rectangle(table, primitive, reference):
    """Return a row as a SphericalRectangle seen from a point, which is of no solid angle if it is no rectangle."""
    corner, u, v = row3(table.corner, primitive), row3(table.u, primitive), row3(table.v, primitive)
    width, height = norm(u), norm(v)
    to = sub(corner, reference)
    middle = madd(madd(to, 0.5, u), 0.5, v)
    is_near = dot(middle, middle) <= _NEAR * max(width, height) ** 2
    if not (is_near and abs(dot(u, v)) <= _SKEW * width * height):
        return SphericalRectangle(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    x0, y0 = dot(to, u) / width, dot(to, v) / height
    z = abs(dot(to, cross(u, v))) / (width * height)
    return spherical_rectangle(x0, x0 + width, y0, y0 + height, z)


@interface.sample_point.register(Parallelograms)
def sample_point_parallelograms(table, primitive, reference, u1, u2, time):
    corner, u, v = row3(table.corner, primitive), row3(table.u, primitive), row3(table.v, primitive)
    across = cross(u, v)
    normal = normalize(across)
    extent = max_abs(corner) + max_abs(u) + max_abs(v)
    seen = _seen_rectangle(table, primitive, reference)
    if seen.solid_angle < SMALLEST:
        point = add(corner, add(scale(u1, u), scale(u2, v)))
        return area_light_point(reference, point, normal, norm(across), extent, u1, u2)
    x, y = sample_spherical_rectangle(seen, u1, u2)
    a, b = (x - seen.x0) / norm(u), (y - seen.y0) / norm(v)
    point = add(corner, add(scale(a, u), scale(b, v)))
    distance = math.sqrt(x * x + y * y + seen.z * seen.z)
    gap = plane_gap(extent, distance, seen.z / distance)
    return LightPoint(point, normal, pdf_spherical_rectangle(seen), gap, a, b, point)


@interface.pdf_point.register(Parallelograms)
def pdf_point_parallelograms(table, primitive, reference, point, normal, time):
    seen = _seen_rectangle(table, primitive, reference)
    if seen.solid_angle < SMALLEST:
        area = norm(cross(row3(table.u, primitive), row3(table.v, primitive)))
        return area_pdf(reference, point, normal, area)
    return pdf_spherical_rectangle(seen)
