"""Compiled loops over a camera's rays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import camera_ray, project
from raytracer.jit import entry
from raytracer.materials.interface import Draws
from raytracer.sampling import SAMPLERS, pixel_key

Array = NDArray[np.float64]


@entry
def _camera_rays(camera, sampler, x, y, origins, directions, weights):
    key = pixel_key(sampler, 3, 4)
    for index in range(len(x)):
        origin, direction, weights[index] = camera_ray(camera, x[index], y[index], None, Draws(sampler, key, index, 0))
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
    _camera_rays(camera, SAMPLERS["independent"](seed, 1), columns, rows, origins, directions, weights)
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
