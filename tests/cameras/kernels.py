"""Compiled loops over a camera's rays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import camera_ray
from raytracer.jit import entry
from raytracer.materials.interface import Draws
from raytracer.sampling import SAMPLERS, pixel_key

Array = NDArray[np.float64]


@entry
def _camera_rays(camera, sampler, x, y, origins, directions):
    key = pixel_key(sampler, 3, 4)
    for index in range(len(x)):
        origin, direction, _ = camera_ray(camera, x[index], y[index], None, Draws(sampler, key, index, 0))
        for axis in range(3):
            origins[index, axis] = origin[axis]
            directions[index, axis] = direction[axis]


def camera_rays(camera: Any, x: Any, y: Any, *, seed: int = 0) -> tuple[Array, Array]:
    """Origins and directions (n, 3) of film positions x, y (n,)."""
    columns = np.array(x, np.float64, ndmin=1)
    rows = np.full(columns.shape, y, np.float64)
    origins, directions = np.empty((len(columns), 3)), np.empty((len(columns), 3))
    _camera_rays(camera, SAMPLERS["independent"](seed, 1), columns, rows, origins, directions)
    return origins, directions
