"""Rays at tables of primitives, and points on them."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import kernel
from raytracer.core.embree import GEOMETRY, INSTANCE, MISS, PLACEMENT, PRIMITIVE, TFAR, TIME, Accel
from raytracer.core.geometry import Exact, spawn_point
from raytracer.core.instancing import intersect_instance, pdf_instance_point, resolve_instance, sample_instance_point
from raytracer.core.primitives.base.interface import geometry, row_of_any
from tests.vectorised import rows, vectorised

Array = NDArray[np.float64]


class Stage(NamedTuple):
    """The part of a scene that hits need."""

    primitives: tuple[Any, ...]
    accuracy: Any = Exact()
    instances: Any = None


class Hits(NamedTuple):
    """Hits of rays: instance, table, primitive (n,), table -1 for nothing; near, Embree's distance (n,); a Hit of
    arrays, whose fields are fields of this, too; and start, where rays go on along a given direction (n, 3)."""

    instance: NDArray[np.int64]
    table: NDArray[np.int64]
    primitive: NDArray[np.int64]
    near: Array
    hit: Any
    start: Array

    def __getattr__(self, name):
        return getattr(self.hit, name)

    @property
    def uv(self):
        return np.stack([self.hit.u, self.hit.v], axis=1)


class Points(NamedTuple):
    """Points drawn on a primitive: point, normal, local (n, 3); uv (n, 2); pdf, its twin by `pdf_point`, gap (n,)."""

    point: Array
    normal: Array
    local: Array
    uv: Array
    pdf: Array
    twin: Array
    gap: Array


@kernel
def _meet(accel, packet, stage, origin, direction, onward, time):
    embree.set_ray(packet, 0, origin, direction, np.inf)
    embree.store_float(packet, 0, TIME, time)
    embree.intersect(accel, packet, 1)
    table, part, array, placement, near = np.int64(-1), np.int64(0), np.int64(-1), np.int64(0), 1.0
    if embree.load_int(packet, 0, GEOMETRY) != MISS:
        table, part = np.int64(embree.load_int(packet, 0, GEOMETRY)), np.int64(embree.load_int(packet, 0, PRIMITIVE))
        array, placement = embree.load_int(packet, 0, INSTANCE), embree.load_int(packet, 0, PLACEMENT)
        near = np.float64(embree.load_float(packet, 0, TFAR))
    # For a ray that met nothing, any primitive is solved: nobody looks at it.
    solved = max(table, 0)
    row = np.int64(row_of_any(stage.primitives, solved, part))
    instance, primitive = resolve_instance(stage.instances, solved, row, array, placement)
    hit = intersect_instance(stage.instances, stage, instance, solved, primitive, origin, direction, near, time)
    return instance, table, primitive, near, hit, spawn_point(hit, onward)


@kernel
def _is_occluded(accel, packet, origin, direction, far):
    embree.set_ray(packet, 0, origin, direction, far)
    embree.occluded(accel, packet, 1)
    return embree.load_float(packet, 0, TFAR) < 0.0


@kernel
def _point(stage, instance, table, primitive, reference, u1, u2, time):
    on = sample_instance_point(stage.instances, stage, instance, table, primitive, reference, u1, u2, time)
    twin = pdf_instance_point(stage.instances, stage, instance, table, primitive, reference, on.point, on.normal, time)
    return on.point, on.normal, on.local, (on.u, on.v), on.pdf, twin, on.gap


def _all(vectors: Any, count: int, width: int = 3) -> Any:
    return rows(np.broadcast_to(np.asarray(vectors, np.float64), (count, 3) if width == 3 else (count,)))


def trace(
    stage: Stage, accel: Accel, origins: Any, directions: Any, onwards: Any = (0.0, 0.0, 1.0), times: Any = 0.0
) -> Hits:
    """Trace rays (n, 3), each at its time (n,), and solve their hits."""
    count = max(len(np.atleast_2d(vectors)) for vectors in (origins, directions, onwards))
    moments = _all(np.asarray(times, np.float32), count, 1)
    rays = (_all(vectors, count) for vectors in (origins, directions, onwards))
    met = vectorised(_meet)(accel.address, embree.ray_packets(), stage, *rays, moments)
    missed = met[1] < 0

    def blank(values: Array) -> Array:
        return (
            values
            if values.dtype.kind == "i"
            else np.where(missed.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values)
        )

    instance, table, primitive, near, hit, start = met
    hit = type(hit)(*map(blank, hit))
    return Hits(instance, table, primitive, np.where(missed, np.inf, near), hit, blank(start))


def leave(
    shoot: Callable[..., Hits], origins: Any, directions: Any, onwards: Array, times: Any = 0.0
) -> NDArray[np.int64]:
    """Tell if rays that leave a convex body outwards hit it again (n,), 0 or 1; -1 for rays that missed it.

    shoot : `trace` in a scene.  Rays go on along `onwards` or the other way, whichever is to the outside.
    """
    normal = np.nan_to_num(shoot(origins, directions, times=times).normal)
    out = np.where((onwards * normal).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * onwards
    first = shoot(origins, directions, out, times)
    again = shoot(np.nan_to_num(first.start, nan=1e30), out, times=times)
    return np.where(first.table < 0, -1, again.table >= 0)


def built(*tables: Any, robust: bool = True) -> Accel:
    """The Embree scene of some tables."""
    return Accel([geometry(table) for table in tables], robust=robust)


def cast(
    tables: tuple[Any, ...],
    origins: Any,
    directions: Any,
    onwards: Any = (0.0, 0.0, 1.0),
    *,
    exact: bool = True,
    accel: Accel | None = None,
) -> Hits:
    """Trace rays (n, 3) at tables and solve their hits."""
    return trace(Stage(tables, Exact() if exact else None), accel or built(*tables), origins, directions, onwards)


def spawn(tables: tuple[Any, ...], origins: Any, directions: Any, onwards: Any, *, accel: Accel) -> Array:
    """Return the points where rays go on along `onwards` (n, 3) from their hits; NaN where there is none."""
    return cast(tables, origins, directions, onwards, accel=accel).start


def sample_on(
    stage: Stage, reference: Any, u: Any, *, instance: int = -1, table: int = 0, primitive: int = 0, time: float = 0.0
) -> Points:
    """Points on a primitive from numbers u (n, 2)."""
    place = tuple(map(float, reference))
    first, second = map(rows, np.transpose(u))
    return Points(*vectorised(_point)(stage, instance, table, primitive, place, first, second, float(time)))


def sample(tables: tuple[Any, ...], table: int, primitive: int, reference: Any, u: Any) -> Points:
    """Points on a primitive of tables."""
    return sample_on(Stage(tables), reference, u, table=table, primitive=primitive)


def pdf_of(tables: tuple[Any, ...], table: int, primitive: int, reference: Any, point: Any, normal: Any) -> Array:
    """`pdf_point` of points and normals (n, 3)."""
    place = tuple(map(float, reference))
    return vectorised(pdf_instance_point)(
        None, Stage(tables), -1, table, primitive, place, rows(point), rows(normal), 0.0
    )


def occluded(accel: Accel, origins: Any, directions: Any, tfar: Any) -> NDArray[np.bool_]:
    """Tell for rays (n, 3) if they meet anything before `tfar`."""
    count = len(np.atleast_2d(origins))
    rays = _all(origins, count), _all(directions, count), _all(tfar, count, 1)
    return vectorised(_is_occluded)(accel.address, embree.ray_packets(), *rays)


def unit(vectors: Any) -> Array:
    """Vectors (n, 3) scaled to length 1."""
    given = np.atleast_2d(np.asarray(vectors, np.float64))
    return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))


def uniform_directions(count: int, seed: int) -> Array:
    """Unit vectors (count, 3), uniform over the sphere."""
    return unit(np.random.default_rng(seed).normal(size=(count, 3)))
