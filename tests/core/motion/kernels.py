"""Compiled loops over poses, over rays with a time of their own, and over the rays of a camera that moves."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import GEOMETRY, MISS, PRIMITIVE, TFAR, TIME, Accel
from raytracer.core.geometry import Exact, spawn_point
from raytracer.core.instancing import intersect_instance
from raytracer.core.motion.interpolation import (
    Trajectories,
    apply_normal,
    apply_point,
    apply_vector,
    invert,
    pack_trajectories,
    pose_at,
)
from raytracer.core.motion.trajectory import Rows
from raytracer.core.primitives.base.interface import (
    geometry,
    hit_any,
    pdf_point_any,
    reproject_at_time_any,
    row_of_any,
    sample_point_any,
)
from raytracer.core.sampling import SAMPLERS
from raytracer.core.shutter.table import Shutter
from raytracer.core.vec import dot, neg
from raytracer.kernel.camera_rays import sample_time
from raytracer.kernel.interaction import resolve_hit
from raytracer.plugins.cameras.base.interface import packet_rays, project
from raytracer.plugins.materials.base.interface import Draws
from raytracer.scene.pack.scene import PackedScene
from tests.plugins.cameras.kernels import packet_rows, single_ray

Array = NDArray[np.float64]


@entry
def _poses(trajectories, index, times, out):
    for i in range(len(times)):
        for row, values in enumerate(pose_at(trajectories, index, times[i])):
            for column, value in enumerate(values):
                out[i, row, column] = value


def poses(trajectories: Trajectories | Rows, times: Any, index: int = 0) -> Array:
    """Matrices (n, 3, 4) of a trajectory at times (n,)."""
    table = trajectories if isinstance(trajectories, Trajectories) else pack_trajectories([trajectories])
    moments = np.array(times, np.float64, ndmin=1)
    out = np.empty((len(moments), 3, 4))
    _poses(table, index, moments, out)
    return out


@entry
def _applied(trajectories, time, vector, out):
    pose = pose_at(trajectories, 0, time)
    inverse = invert(pose)
    results = (
        apply_point(pose, vector),
        apply_vector(pose, vector),
        apply_normal(inverse, vector),
        apply_point(inverse, apply_point(pose, vector)),
    )
    for row, values in enumerate(results):
        for column, value in enumerate(values):
            out[row, column] = value


def applied(trajectory: Rows, time: float, vector: Any) -> Array:
    """Rows (4, 3): a vector moved as a point, as a difference and as a normal, and as a point there and back."""
    out = np.empty((4, 3))
    _applied(pack_trajectories([trajectory]), time, tuple(map(float, vector)), out)
    return out


class Hits(NamedTuple):
    """Hits of rays: primitive, -1 for nothing, (n,); near, Embree's distance (n,); point, normal, shading normal and
    local (n, 3); offset (n,); later, where the point is at the end of the shutter's time (n, 3)."""

    primitive: NDArray[np.int64]
    near: Array
    point: Array
    normal: Array
    shading_normal: Array
    local: Array
    offset: Array
    later: Array


@entry
def _cast(accel, packet, tables, origins, directions, times, hits):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        if table == MISS:
            hits.primitive[ray] = -1
            continue
        primitive = np.int64(row_of_any(tables, table, embree.load_int(packet, 0, PRIMITIVE)))
        near = float(embree.load_float(packet, 0, TFAR))
        hit = hit_any(tables, table, primitive, origin, direction, near, times[ray], Exact())
        later = reproject_at_time_any(tables, table, primitive, hit, 1.0)
        hits.primitive[ray], hits.near[ray], hits.offset[ray] = primitive, near, hit.offset
        for axis in range(3):
            hits.point[ray, axis] = hit.point[axis]
            hits.normal[ray, axis] = hit.normal[axis]
            hits.shading_normal[ray, axis] = hit.shading_normal[axis]
            hits.local[ray, axis] = hit.local[axis]
            hits.later[ray, axis] = later[axis]


def cast(tables: tuple[Any, ...], only: int, origins: Any, directions: Any, times: Any) -> Hits:
    """Trace rays (n, 3), each at its time (n,), against one of the tables, and solve their hits in float64.

    The others are there for the type alone, so that one compiled loop serves them all.
    """
    starts = np.ascontiguousarray(np.atleast_2d(np.asarray(origins, np.float64)))
    ways = np.ascontiguousarray(np.broadcast_to(np.asarray(directions, np.float64), starts.shape))
    n = len(starts)
    moments = np.ascontiguousarray(np.broadcast_to(np.asarray(times, np.float32).astype(np.float64), n))
    rows = [np.full((n, 3), np.nan) for _ in range(5)]
    hits = Hits(np.full(n, -1), np.full(n, np.inf), *rows[:4], np.full(n, np.nan), rows[4])
    accel = Accel({only: geometry(tables[only])})
    _cast(accel.address, embree.ray_packets(), tables, starts, ways, moments, hits)
    return hits


@entry
def _self_hits(accel, packet, tables, origins, directions, onwards, times, self_hit):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        onward = (onwards[ray, 0], onwards[ray, 1], onwards[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        if table == MISS:
            self_hit[ray] = -1
            continue
        near = float(embree.load_float(packet, 0, TFAR))
        primitive = row_of_any(tables, table, embree.load_int(packet, 0, PRIMITIVE))
        hit = hit_any(tables, table, primitive, origin, direction, near, times[ray], Exact())
        cosine = onward[0] * hit.normal[0] + onward[1] * hit.normal[1] + onward[2] * hit.normal[2]
        # Away from a convex body: whatever is met is the body itself.
        if cosine < 0.0:
            onward = (-onward[0], -onward[1], -onward[2])
        embree.set_ray(packet, 0, spawn_point(hit, onward), onward, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(accel, packet, 1)
        self_hit[ray] = embree.load_int(packet, 0, GEOMETRY) != MISS


def self_hits(
    tables: tuple[Any, ...], only: int, origins: Any, directions: Any, onwards: Any, times: Any
) -> NDArray[np.int64]:
    """Tell if rays that leave a convex body outwards hit it again (n,), 0 or 1; -1 for rays that missed it."""
    self_hit = np.zeros(len(origins), np.int64)
    accel = Accel({only: geometry(tables[only])})
    moments = np.asarray(times, np.float32).astype(np.float64)
    _self_hits(accel.address, embree.ray_packets(), tables, origins, directions, onwards, moments, self_hit)
    return self_hit


class Points(NamedTuple):
    """Points drawn on a primitive: point, normal, local (n, 3); pdf, its twin by `pdf_point`, and gap (n,)."""

    point: Array
    normal: Array
    local: Array
    pdf: Array
    twin: Array
    gap: Array


@entry
def _sample(tables, table, primitive, reference, u, time, points):
    for index in range(len(u)):
        on = sample_point_any(tables, table, primitive, reference, u[index, 0], u[index, 1], time)
        points.pdf[index], points.gap[index] = on.pdf, on.gap
        points.twin[index] = pdf_point_any(tables, table, primitive, reference, on.point, on.normal, time)
        for axis in range(3):
            points.point[index, axis] = on.point[axis]
            points.normal[index, axis] = on.normal[axis]
            points.local[index, axis] = on.local[axis]


def sample(tables: tuple[Any, ...], only: int, reference: Any, u: Array, time: float) -> Points:
    """Points on the first primitive of one of the tables from numbers u (n, 2)."""
    n = len(u)
    points = Points(*(np.empty((n, 3)) for _ in range(3)), *(np.empty(n) for _ in range(3)))
    _sample(tables, only, 0, tuple(map(float, reference)), u, time, points)
    return points


@entry
def _camera_rays(camera, sampler, rows, x, y, times, origins, directions, seen):
    for index in range(len(x)):
        draws = Draws(sampler, np.uint64(7), index, 0)
        together = packet_rays(camera)
        origin, direction, _ = single_ray(together, camera, rows, x[index], y[index], times[index], draws)
        at = (
            origin[0] + 2.0 * direction[0],
            origin[1] + 2.0 * direction[1],
            origin[2] + 2.0 * direction[2],
        )
        seen[index, 0], seen[index, 1], seen[index, 2] = project(camera, at, times[index])
        for axis in range(3):
            origins[index, axis] = origin[axis]
            directions[index, axis] = direction[axis]


def camera_rays(camera: Any, x: Any, y: Any, times: Any) -> tuple[Array, Array, Array]:
    """Origins and directions (n, 3) at film positions and times (n,), and what `project` makes of points on them."""
    columns = np.array(x, np.float64, ndmin=1)
    rows, moments = (np.array(np.broadcast_to(values, columns.shape), np.float64) for values in (y, times))
    out = [np.empty((len(columns), 3)) for _ in range(3)]
    _camera_rays(camera, SAMPLERS["independent"](0, 1), packet_rows(), columns, rows, moments, *out)
    return out[0], out[1], out[2]


@entry
def _meet(scene, packet, origins, directions, times, points, normals, instances):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(scene.accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        if table == MISS:
            continue
        instance, primitive = resolve_hit(scene, packet, 0)
        near = float(embree.load_float(packet, 0, TFAR))
        hit = intersect_instance(
            scene.instances, scene, instance, table, primitive, origin, direction, near, times[ray]
        )
        instances[ray] = instance
        for axis in range(3):
            points[ray, axis] = hit.point[axis]
            normals[ray, axis] = hit.normal[axis]


def met(packed: PackedScene, origins: Any, directions: Any, times: Any) -> tuple[Array, Array, NDArray[np.int64]]:
    """Points and normals (n, 3) where rays meet a scene, NaN for nothing, and in which instance (n,), -1 for none."""
    accel = packed.build()
    scene = packed.scene._replace(accel=accel.address)
    starts = np.ascontiguousarray(origins, np.float64)
    ways = np.ascontiguousarray(np.broadcast_to(np.asarray(directions, np.float64), starts.shape))
    moments = np.ascontiguousarray(np.broadcast_to(np.asarray(times, np.float32).astype(np.float64), len(starts)))
    points, normals = np.full(starts.shape, np.nan), np.full(starts.shape, np.nan)
    instances = np.full(len(starts), -1)
    _meet(scene, embree.ray_packets(), starts, ways, moments, points, normals, instances)
    return points, normals, instances


@entry
def _times(shutter, sampler, key, x, y, times, weights):
    for index in range(len(times)):
        times[index], weights[index] = sample_time(shutter, x, y, Draws(sampler, key, index, 0))


def drawn_times(
    shutter: Shutter, count: int, x: float = 0.5, y: float = 0.5, *, sampler: str = "sobol"
) -> tuple[Array, Array]:
    """The times (n,) of samples at a place of the film, and their weights."""
    times, weights = np.empty(count), np.empty(count)
    _times(shutter, SAMPLERS[sampler](3, count), np.uint64(5), x, y, times, weights)
    return times, weights


def times_of(sampler: str, count: int, pixel: int = 5) -> Array:
    """The times (n,) of a pixel's samples."""
    times, weights = np.empty(count), np.empty(count)
    _times(Shutter(0.0, 1.0), SAMPLERS[sampler](3, count), np.uint64(pixel), 0.5, 0.5, times, weights)
    assert (weights == 1.0).all()
    return times


@entry
def _leave(scene, packet, origins, directions, onwards, times, self_hit):
    for ray in range(len(origins)):
        origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        onward = (onwards[ray, 0], onwards[ray, 1], onwards[ray, 2])
        embree.set_ray(packet, 0, origin, direction, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(scene.accel, packet, 1)
        table = embree.load_int(packet, 0, GEOMETRY)
        if table == MISS:
            self_hit[ray] = -1
            continue
        instance, primitive = resolve_hit(scene, packet, 0)
        near = float(embree.load_float(packet, 0, TFAR))
        hit = intersect_instance(
            scene.instances, scene, instance, table, primitive, origin, direction, near, times[ray]
        )
        if dot(onward, hit.normal) < 0.0:
            onward = neg(onward)
        embree.set_ray(packet, 0, spawn_point(hit, onward), onward, np.inf)
        embree.store_float(packet, 0, TIME, times[ray])
        embree.intersect(scene.accel, packet, 1)
        self_hit[ray] = embree.load_int(packet, 0, GEOMETRY) != MISS


def leave(packed: PackedScene, origins: Any, directions: Any, onwards: Any, times: Any) -> NDArray[np.int64]:
    """Find self-hits as `self_hits` does, for the convex bodies of a scene."""
    accel = packed.build()
    self_hit = np.zeros(len(origins), np.int64)
    moments = np.asarray(times, np.float32).astype(np.float64)
    scene = packed.scene._replace(accel=accel.address)
    _leave(scene, embree.ray_packets(), origins, directions, onwards, moments, self_hit)
    return self_hit
