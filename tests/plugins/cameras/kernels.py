"""Compiled loops over a camera's rays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry, optional
from raytracer.core.sampling import SAMPLERS, pixel_key
from raytracer.core.simd import WIDTH
from raytracer.plugins.cameras.base.interface import (
    PacketRays,
    camera_ray,
    lane_ray,
    packet_rays,
    project,
    set_lane,
    trace_lanes,
)
from raytracer.plugins.materials.base.interface import Draws

Array = NDArray[np.float64]


@optional
def single_ray(together, camera, rows, x, y, time, draws):
    """`camera_ray` of any camera, also of those that make the rays of a packet together: then the first lane's."""
    return camera_ray(camera, x, y, time, draws)


@single_ray.register(PacketRays)
def single_ray_packet_rays(together, camera, rows, x, y, time, draws):
    set_lane(camera, rows, 0, x, y, draws)
    trace_lanes(camera, rows)
    return lane_ray(camera, rows, 0, x, y, time, draws)


def packet_rows() -> Array:
    """Make the rows of the packet of `single_ray`."""
    return np.zeros((16, WIDTH))


@entry
def _camera_rays(camera, sampler, rows, x, y, origins, directions, weights):
    key = pixel_key(sampler, 3, 4)
    for index in range(len(x)):
        draws = Draws(sampler, key, index, 0)
        origin, direction, weights[index] = single_ray(
            packet_rays(camera), camera, rows, x[index], y[index], None, draws
        )
        for axis in range(3):
            origins[index, axis] = origin[axis]
            directions[index, axis] = direction[axis]


@entry
def _project(camera, points, out):
    for index in range(len(points)):
        point = (points[index, 0], points[index, 1], points[index, 2])
        out[index, 0], out[index, 1], out[index, 2] = project(camera, point, None)


def weighted_rays(camera: Any, x: Any, y: Any, *, seed: int = 0) -> tuple[Array, Array, Array]:
    """Origins and directions (n, 3) and weights (n,) of film positions x, y (n,)."""
    columns = np.array(x, np.float64, ndmin=1)
    rows = np.array(np.broadcast_to(y, columns.shape), np.float64)
    origins, directions, weights = np.empty((len(columns), 3)), np.empty((len(columns), 3)), np.empty(len(columns))
    _camera_rays(camera, SAMPLERS["independent"](seed, 1), packet_rows(), columns, rows, origins, directions, weights)
    return origins, directions, weights


def camera_rays(camera: Any, x: Any, y: Any, *, seed: int = 0) -> tuple[Array, Array]:
    """Origins and directions (n, 3) of film positions x, y (n,)."""
    origins, directions, _ = weighted_rays(camera, x, y, seed=seed)
    return origins, directions


def projected(camera: Any, points: Any) -> Array:
    """Film positions and depths (n, 3) of points (n, 3)."""
    given = np.array(points, np.float64, ndmin=2)
    out = np.empty(given.shape)
    _project(camera, given, out)
    return out
