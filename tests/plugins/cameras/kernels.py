"""Rays and projections of cameras, for rows of film positions and points."""

import numpy as np

from raytracer.core.compiler.dispatch import kernel, optional
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
from tests.vectorised import random_draws, rows, vectorised


@optional
def single_ray(together, camera, packet, x, y, time, draws):
    """`camera_ray` of any camera, also of those that make the rays of a packet together: then the first lane's."""
    return camera_ray(camera, x, y, time, draws)


@single_ray.register(PacketRays)
def single_ray_packet_rays(together, camera, packet, x, y, time, draws):
    set_lane(camera, packet, 0, x, y, draws)
    trace_lanes(camera, packet)
    return lane_ray(camera, packet, 0, x, y, time, draws)


@kernel
def _ray(camera, packet, x, y, draws):
    return single_ray(packet_rays(camera), camera, packet, x, y, None, draws)


def packet_rows():
    """Make the rows of the packet of `single_ray`."""
    return np.zeros((16, WIDTH))


def weighted_rays(camera, x, y, *, seed=0):
    """Origins and directions (n, 3) and weights (n,) of film positions x, y (n,)."""
    x = np.array(x, np.float64, ndmin=1)
    y = np.asarray(y, np.float64) + np.zeros(len(x))
    draws = random_draws(len(x), seed=seed, dimension=0)
    return vectorised(_ray)(camera, packet_rows(), rows(x), rows(y), draws)


def camera_rays(camera, x, y, *, seed=0):
    """Origins and directions (n, 3) of film positions x, y (n,)."""
    return weighted_rays(camera, x, y, seed=seed)[:2]


def projected(camera, points):
    """Film positions and depths (n, 3) of points (n, 3)."""
    return vectorised(project)(camera, rows(np.atleast_2d(np.asarray(points, np.float64))), None)
