"""Light on the film behind a lens by brute force, without bounds of the pupil."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.optics.lens_system.ray_tracing import trace

Array = NDArray[np.float64]


@entry
def _brute(surfaces, film, places, heights, light):
    """E / L by a grid of points on a square in the plane of the last vertex: sum of cos^4 / Z^2 dA of what passes."""
    away = film - surfaces.vertex[-1]
    cell = (heights[1] - heights[0]) ** 2
    for number in range(len(places)):
        total = 0.0
        for i in range(len(heights)):
            for j in range(len(heights)):
                x, y = heights[i] - places[number], heights[j]
                way = math.sqrt(x * x + y * y + away * away)
                origin, direction = (places[number], 0.0, film), (x / way, y / way, -away / way)
                weight, _, _ = trace(surfaces, origin, direction, False, None)
                total += weight * (away / way) ** 4 / (away * away) * cell
        light[number] = total


def by_brute_force(camera: Any, places: Array, points: int = 500) -> Array:
    """E / L of places of a packed lens camera's film (mm from the axis), by points x points of a square.

    It is half as wide again as the last surface, since light that leaves its rim may cross its vertex's plane outside.
    """
    edge = 1.5 * float(camera.surfaces.radius[-1])
    heights = ((np.arange(points) + 0.5) / points * 2.0 - 1.0) * edge
    light = np.empty(len(places))
    _brute(camera.surfaces, float(camera.film.z), np.ascontiguousarray(places, np.float64), heights, light)
    return light
