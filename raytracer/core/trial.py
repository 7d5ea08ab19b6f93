"""Try what every render does: trace a ray by Embree, from Python and from a kernel that Numba compiles."""

import numpy as np

from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import TFAR, Accel, intersect, load_float, ray_packets, set_ray
from raytracer.core.geometry import Geometry, Primitive, pad_buffer

DISTANCE = 2.0
"""Distance (m) of the triangle along the ray of the trials."""

_ORIGIN, _DIRECTION = (0.25, 0.25, DISTANCE), (0.0, 0.0, -1.0)


def triangle() -> Accel:
    """Build Embree's structure of one triangle in the plane z = 0."""
    corners = pad_buffer(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.float32)
    return Accel([Geometry(Primitive.TRIANGLE, (corners,), pad_buffer(np.array([[0, 1, 2]]), np.uint32))])


def cast_ray() -> float:
    """Return the distance (m) at which Embree finds the triangle; nan if it finds nothing."""
    hit = triangle().cast(_ORIGIN, _DIRECTION)
    return np.nan if hit is None else hit.distance


def cast_ray_in_kernel() -> float:
    """Return the distance (m) at which a compiled kernel finds the triangle, through Embree."""
    accel = triangle()
    return float(_trace(accel.address, ray_packets(), _ORIGIN, _DIRECTION))


def is_exact(distance: float) -> bool:
    """Return True for the triangle's distance, to Embree's rounding (float32), which depends on the processor."""
    return abs(distance - DISTANCE) <= 4.0 * float(np.spacing(np.float32(DISTANCE)))


def kernel_source() -> str:
    """Tell where the kernel came from: "compiled", or "loaded from the cache"."""
    return "compiled" if _trace.counts["compiled"] else "loaded from the cache"


@entry
def _trace(accel, rays, origin, direction):
    set_ray(rays, 0, origin, direction, np.inf)
    intersect(accel, rays, 1)
    return load_float(rays, 0, TFAR)
