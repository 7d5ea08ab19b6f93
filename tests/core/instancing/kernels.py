"""Compiled loops over rays and instances."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import GEOMETRY, INSTANCE, MISS, PLACEMENT, PRIMITIVE, TFAR, TIME, Accel, InstanceArray
from raytracer.core.geometry import Exact, spawn_point
from raytracer.core.instancing import (
    Instances,
    intersect_instance,
    pdf_instance_point,
    resolve_instance,
    sample_instance_point,
)
from raytracer.core.motion.interpolation import pack_trajectories
from raytracer.core.primitives.base.interface import geometry, row_of_any
from tests.plugins.shapes.kernels import Points

Array = NDArray[np.float64]


class Stage(NamedTuple):
    """The part of a scene that hits need."""

    primitives: tuple[Any, ...]
    accuracy: Any
    instances: Any


class Hits(NamedTuple):
    """Hits of rays: instance, -1 for none, table, -1 for nothing, and primitive (n,); near, Embree's distance; point,
    normal, shading normal, tangent, bitangent and local (n, 3); offset, material (n,); and where a ray goes on that
    leaves along a given direction (n, 3)."""

    instance: NDArray[np.int64]
    table: NDArray[np.int64]
    primitive: NDArray[np.int64]
    near: Array
    point: Array
    normal: Array
    shading_normal: Array
    tangent: Array
    bitangent: Array
    local: Array
    offset: Array
    material: NDArray[np.int64]
    start: Array


@entry
def _cast(accel, packet, stage, origins, directions, onwards, times, hits):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        hits.table[ray] = -1
        if table == MISS:
            continue
        row = row_of_any(stage.primitives, table, embree.load_int(packet, 0, PRIMITIVE))
        array, placement = embree.load_int(packet, 0, INSTANCE), embree.load_int(packet, 0, PLACEMENT)
        instance, primitive = resolve_instance(stage.instances, table, row, array, placement)
        near = float(embree.load_float(packet, 0, TFAR))
        hit = intersect_instance(
            stage.instances, stage, instance, table, primitive, origin, direction, near, times[ray]
        )
        hits.instance[ray] = instance
        hits.table[ray] = table
        hits.primitive[ray] = primitive
        hits.near[ray] = near
        hits.offset[ray] = hit.offset
        hits.material[ray] = hit.material
        start = spawn_point(hit, (onwards[ray, 0], onwards[ray, 1], onwards[ray, 2]))
        for axis in range(3):
            hits.point[ray, axis] = hit.point[axis]
            hits.normal[ray, axis] = hit.normal[axis]
            hits.shading_normal[ray, axis] = hit.shading_normal[axis]
            hits.tangent[ray, axis] = hit.tangent[axis]
            hits.bitangent[ray, axis] = hit.bitangent[axis]
            hits.local[ray, axis] = hit.local[axis]
            hits.start[ray, axis] = start[axis]


@entry
def _sample(stage, instance, table, primitive, reference, time, u, points):
    for index in range(len(u)):
        drawn = sample_instance_point(
            stage.instances, stage, instance, table, primitive, reference, u[index, 0], u[index, 1], time
        )
        points.pdf[index] = drawn.pdf
        points.gap[index] = drawn.gap
        points.twin[index] = pdf_instance_point(
            stage.instances, stage, instance, table, primitive, reference, drawn.point, drawn.normal, time
        )
        for axis in range(3):
            points.point[index, axis] = drawn.point[axis]
            points.normal[index, axis] = drawn.normal[axis]


class Scenery(NamedTuple):
    """Tables placed by matrices: what kernels and Embree need of them."""

    stage: Stage
    accel: Accel


def _instances(tables: int, pose: Array, trajectories: Any, arrays: list[int], material: Any) -> Instances:
    count = len(pose) + (len(trajectories.first) - 1 if trajectories is not None else 0)
    return Instances(
        group=np.zeros(count, np.int32),
        pose=pose,
        trajectories=trajectories,
        material=material,
        rows=np.zeros((1, tables), np.int32),
        arrays=np.array(arrays, np.int32),
        base=tables,
        emissive=None,
    )


def placed(tables: tuple[Any, ...], matrices: Any, *, material: Any = None, exact: bool = True) -> Scenery:
    """A group of tables, placed by matrices (n, 4, 4)."""
    poses = np.ascontiguousarray(np.atleast_3d(np.asarray(matrices, np.float64)).reshape(-1, 4, 4)[:, :3])
    instances = _instances(len(tables), poses, None, [0], material)
    accel = Accel(
        {},
        [{number: geometry(table) for number, table in enumerate(tables)}],
        [InstanceArray(np.zeros(len(poses), np.uint32), (np.float32(poses.reshape(-1, 12)),))],
        first_instance=len(tables),
    )
    return Scenery(Stage(tables, Exact() if exact else None, instances), accel)


def moving(tables: tuple[Any, ...], trajectories: Sequence[Array]) -> Scenery:
    """A group of tables, moved along trajectories (steps, 16) of as many steps each."""
    packed = pack_trajectories(trajectories)
    instances = _instances(len(tables), np.empty((0, 3, 4)), packed, [0], None)
    steps = tuple(np.ascontiguousarray(step, np.float32) for step in np.stack(list(trajectories), axis=1))
    accel = Accel(
        {},
        [{number: geometry(table) for number, table in enumerate(tables)}],
        [InstanceArray(np.zeros(len(trajectories), np.uint32), steps)],
        first_instance=len(tables),
    )
    return Scenery(Stage(tables, Exact(), instances), accel)


def _rows(vectors: Any, count: int) -> Array:
    # A copy: whether an array may be written is part of its type, and each type would be compiled.
    return np.array(np.broadcast_to(vectors, (count, 3)), np.float64, order="C")


def cast(scenery: Scenery, origins: Any, directions: Any, onwards: Any = (0.0, 0.0, 0.0), times: Any = 0.0) -> Hits:
    """Trace rays (n, 3) and solve their hits."""
    n = max(len(np.atleast_2d(rows)) for rows in (origins, directions, onwards))
    ids, vectors = (lambda: np.full(n, -2, np.int64)), (lambda: np.full((n, 3), np.nan))
    hits = Hits(
        ids(), ids(), ids(), np.full(n, np.nan), vectors(), vectors(), vectors(), vectors(), vectors(), vectors(),
        np.full(n, np.nan), ids(), vectors(),
    )  # fmt: skip
    rays = _rows(origins, n), _rows(directions, n), _rows(onwards, n)
    moments = np.ascontiguousarray(np.broadcast_to(np.asarray(times, np.float32), n)).astype(np.float64)
    _cast(scenery.accel.address, embree.ray_packets(), scenery.stage, *rays, moments, hits)
    return hits


def sample(
    scenery: Scenery, instance: int, reference: Any, u: Array, *, table: int = 0, primitive: int = 0, time: float = 0.0
) -> Points:
    """Points on a primitive of an instance from numbers u (n, 2)."""
    n = len(u)
    points = Points(np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n))
    _sample(scenery.stage, instance, table, primitive, tuple(map(float, reference)), time, u, points)
    return points
