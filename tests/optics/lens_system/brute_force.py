"""Light on the film behind a lens by brute force, without bounds of the pupil."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.ray_tracing import trace_rays

Array = NDArray[np.float64]


def by_brute_force(camera: Any, places: Array, points: int = 500) -> Array:
    """E / L of places of a packed lens camera's film (mm from the axis), by points x points of a square.

    It is in the plane of the last vertex, where E / L is the sum of cos^4 / Z^2 dA of what passes, and half as wide
    again as the last surface, since light that leaves its rim may cross that plane outside.  Places are on the x-axis,
    so that the lower half of a round lens takes as much light as the upper one, which alone is followed.
    """
    surfaces, film, edge = camera.surfaces, float(camera.film.z), 1.5 * float(camera.surfaces.radius[-1])
    away, cell = film - surfaces.vertex[-1], 2.0 * (2.0 * edge / points) ** 2
    heights = ((np.arange(points) + 0.5) / points * 2.0 - 1.0) * edge
    x, y = (values.ravel() for values in np.meshgrid(heights, heights[points // 2 :]))
    light = []
    for place in places:
        ways = np.stack([x - place, y, np.full(x.size, -away)], axis=1)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        weights, _, _ = trace_rays(surfaces, [place, 0.0, film], ways, False)
        light.append(float((weights * ways[:, 2] ** 4).sum()) * cell / away**2)
    return np.array(light)
