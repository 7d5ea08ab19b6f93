"""Compiled loops over primitives and rays."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import GEOMETRY, MISS, PRIMITIVE, TFAR, Accel
from raytracer.core.geometry import Exact, spawn_point
from raytracer.core.primitives.base.interface import geometry, hit_any, pdf_point_any, row_of_any, sample_point_any


class Hits(NamedTuple):
    """Hits of rays: table, -1 for nothing, and primitive (n,); near, Embree's distance; point, normal and shading
    normal (n, 3); uv (n, 2); offset (n,); material (n,)."""

    table: NDArray[np.int64]
    primitive: NDArray[np.int64]
    near: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    shading_normal: NDArray[np.float64]
    uv: NDArray[np.float64]
    offset: NDArray[np.float64]
    material: NDArray[np.int64]


class Points(NamedTuple):
    """Points drawn on a primitive: point and normal (n, 3); pdf, its twin by `pdf_point`, and gap (n,)."""

    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    pdf: NDArray[np.float64]
    twin: NDArray[np.float64]
    gap: NDArray[np.float64]


@entry
def _cast(accel, packet, tables, accuracy, origins, directions, hits):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.intersect(accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        if table == MISS:
            hits.table[ray] = -1
            continue
        primitive = row_of_any(tables, table, embree.load_int(packet, 0, PRIMITIVE))
        near = float(embree.load_float(packet, 0, TFAR))
        hit = hit_any(tables, table, primitive, origin, direction, near, None, accuracy)
        hits.table[ray] = table
        hits.primitive[ray] = primitive
        hits.near[ray] = near
        hits.uv[ray, 0] = hit.u
        hits.uv[ray, 1] = hit.v
        hits.offset[ray] = hit.offset
        hits.material[ray] = hit.material
        for axis in range(3):
            hits.point[ray, axis] = hit.point[axis]
            hits.normal[ray, axis] = hit.normal[axis]
            hits.shading_normal[ray, axis] = hit.shading_normal[axis]


@entry
def _spawn(accel, packet, tables, accuracy, origins, directions, onwards, starts):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.intersect(accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        for axis in range(3):
            starts[ray, axis] = np.nan
        if table == MISS:
            continue
        near = float(embree.load_float(packet, 0, TFAR))
        primitive = row_of_any(tables, table, embree.load_int(packet, 0, PRIMITIVE))
        hit = hit_any(tables, table, primitive, origin, direction, near, None, accuracy)
        start = spawn_point(hit, (onwards[ray, 0], onwards[ray, 1], onwards[ray, 2]))
        for axis in range(3):
            starts[ray, axis] = start[axis]


@entry
def _sample(tables, table, primitive, reference, u, points):
    for index in range(len(u)):
        drawn = sample_point_any(tables, table, primitive, reference, u[index, 0], u[index, 1], None)
        points.pdf[index] = drawn.pdf
        points.gap[index] = drawn.gap
        points.twin[index] = pdf_point_any(tables, table, primitive, reference, drawn.point, drawn.normal, None)
        for axis in range(3):
            points.point[index, axis] = drawn.point[axis]
            points.normal[index, axis] = drawn.normal[axis]


@entry
def _pdf(tables, table, primitive, reference, point, normal, pdf):
    for index in range(len(pdf)):
        at = (point[index, 0], point[index, 1], point[index, 2])
        outside = (normal[index, 0], normal[index, 1], normal[index, 2])
        pdf[index] = pdf_point_any(tables, table, primitive, reference, at, outside, None)


@entry
def _occluded(accel, packet, origins, directions, tfar, result):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        embree.set_ray(packet, 0, origin, direction, tfar[ray])
        embree.occluded(accel, packet, 1)
        result[ray] = embree.load_float(packet, 0, TFAR) < 0.0


def built(*tables: Any, robust: bool = True) -> Accel:
    """The Embree scene of some tables."""
    return Accel([geometry(table) for table in tables], robust=robust)


def _rows(vectors: Any) -> NDArray[np.float64]:
    return np.ascontiguousarray(np.atleast_2d(np.asarray(vectors, np.float64)))


def cast(
    tables: tuple[Any, ...], origins: Any, directions: Any, *, exact: bool = True, accel: Accel | None = None
) -> Hits:
    """Trace rays (n, 3) and solve their hits."""
    starts, ways = _rows(origins), _rows(directions)
    n = len(starts)
    hits = Hits(
        np.full(n, -1), np.zeros(n, np.int64), np.full(n, np.inf), *(np.full((n, 3), np.nan) for _ in range(3)),
        np.full((n, 2), np.nan), np.full(n, np.nan), np.zeros(n, np.int64),
    )  # fmt: skip
    accel = accel or built(*tables)
    _cast(accel.address, embree.ray_packets(), tables, Exact() if exact else None, starts, ways, hits)
    return hits


def spawn(tables: tuple[Any, ...], origins: Any, directions: Any, onwards: Any, *, accel: Accel) -> NDArray[np.float64]:
    """Return the points where rays go on along `onwards` (n, 3) from their hits; NaN where there is none."""
    starts = np.empty((len(origins), 3))
    rays = _rows(origins), _rows(directions), _rows(onwards)
    _spawn(accel.address, embree.ray_packets(), tables, Exact(), *rays, starts)
    return starts


def sample(tables: tuple[Any, ...], table: int, primitive: int, reference: Any, u: NDArray[np.float64]) -> Points:
    """Points on a primitive from numbers u (n, 2)."""
    n = len(u)
    points = Points(np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n))
    _sample(tables, table, primitive, tuple(map(float, reference)), u, points)
    return points


def pdf_of(
    tables: tuple[Any, ...], table: int, primitive: int, reference: Any, point: Any, normal: Any
) -> NDArray[np.float64]:
    """`pdf_point` of points and normals (n, 3)."""
    pdf = np.empty(len(point))
    _pdf(tables, table, primitive, tuple(map(float, reference)), _rows(point), _rows(normal), pdf)
    return pdf


def occluded(accel: Accel, origins: Any, directions: Any, tfar: Any) -> NDArray[np.bool_]:
    """Tell for rays (n, 3) if they meet anything before `tfar`."""
    starts = _rows(origins)
    result = np.zeros(len(starts), np.bool_)
    far = np.ascontiguousarray(np.broadcast_to(np.asarray(tfar, np.float64), len(starts)))
    _occluded(accel.address, embree.ray_packets(), starts, _rows(directions), far, result)
    return result


def unit(vectors: Any) -> NDArray[np.float64]:
    """Vectors (n, 3) scaled to length 1."""
    rows = np.atleast_2d(np.asarray(vectors, np.float64))
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def uniform_directions(count: int, seed: int) -> NDArray[np.float64]:
    """Unit vectors (count, 3), uniform over the sphere."""
    return unit(np.random.default_rng(seed).normal(size=(count, 3)))
