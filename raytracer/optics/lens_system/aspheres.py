"""Surfaces that are not spheres: conic sections of revolution, even aspheres, and cylinders.

Apart from the polynomial of an asphere, each is u x^2 + v y^2 + w z^2 = 2 z from its vertex: with the curvature c and
the conic constant k a conic has u = v = c and w = (1 + k) c, and a cylinder along x has u = 0 and v = w = c.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import dot, madd, norm, normalize, scale
from raytracer.optics.lens_system.ray_tracing import intersect_shape, intersect_sphere

MAX_STEPS = 64
"""Iterations to a point of an asphere: bisection alone gets from 1 mm to the spacing of float64 numbers in so many."""

ROUNDING = 2.0**-51
"""Four roundings of float64: those of the terms whose difference is the distance of a point from an asphere."""


class SurfaceShapes(NamedTuple):
    """Packed shapes of the surfaces of a lens that are not all spheres.

    quadric (1/mm) : float64 (n, 3), the curvatures of u x^2 + v y^2 + w z^2 = 2 z.
    coefficients : float64 (n, m), of the polynomial a_4 r^4 + a_6 r^6 + ... (mm) that is added to the sag.
    aspheric : bool (n,), whether any of these is not 0.
    plain : bool (n,), whether a surface is a sphere.
    limit (mm) : float64 (n,), radius up to which an asphere reaches.
    min_sag, max_sag (mm) : float64 (n,), bounds of its sag up to there.
    """

    quadric: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    aspheric: NDArray[np.bool_]
    plain: NDArray[np.bool_]
    limit: NDArray[np.float64]
    min_sag: NDArray[np.float64]
    max_sag: NDArray[np.float64]

    def reversed(self) -> "SurfaceShapes":
        """Mirror the surfaces across the axis, from the last to the first."""
        flags = self.aspheric[::-1].copy(), self.plain[::-1].copy()
        limits = self.limit[::-1].copy(), -self.max_sag[::-1], -self.min_sag[::-1]
        return SurfaceShapes(-self.quadric[::-1], -self.coefficients[::-1], *flags, *limits)


@kernel
def _intersect_quadric(quadric, near, direction, side):
    """Intersect a quadric as `intersect_sphere` does, from the ray's closest point to the vertex."""
    u, v, w = quadric
    a = u * direction[0] * direction[0] + v * direction[1] * direction[1] + w * direction[2] * direction[2]
    f = u * near[0] * near[0] + v * near[1] * near[1] + w * near[2] * near[2] - 2.0 * near[2]
    g = direction[2] - (u * near[0] * direction[0] + v * near[1] * direction[1] + w * near[2] * direction[2])
    square = g * g - a * f
    root = side * math.sqrt(max(square, 0.0))
    onward = g * side > 0.0
    distance = (f if onward else g - root) / (g + root if onward else a)
    point = madd(near, distance, direction)
    gradient = (-u * point[0], -v * point[1], 1.0 - w * point[2])
    length = norm(gradient)
    met = square > 0.0 and gradient[2] > 0.0
    return distance, scale(1.0 / length, gradient), root / length if met else 0.0


@kernel
def _sag(shapes, surface, square):
    """Compute the sag of an even asphere at a squared distance from the axis, and its slope over that distance.

    Beyond its end the surface goes on flat.
    """
    s = min(square, shapes.limit[surface] * shapes.limit[surface])
    c, w = shapes.quadric[surface, 0], shapes.quadric[surface, 2]
    root = math.sqrt(max(1.0 - c * w * s, 0.0))
    rest, slope = 0.0, 0.0
    for term in range(shapes.coefficients.shape[1] - 1, -1, -1):
        coefficient = shapes.coefficients[surface, term]
        rest = rest * s + coefficient
        slope = slope * s + (2.0 * term + 4.0) * coefficient
    return c * s / (1.0 + root) + rest * s * s, c / root + slope * s if square == s else 0.0


@kernel
def _intersect_asphere(shapes, surface, near, direction, side, guess):
    """Intersect an even asphere as `_intersect_quadric` does, from where the ray meets its quadric, or a guess of NaN.

    Newton's method, in the part of the ray that is no lower and no higher than any of the surface: there the root is,
    since the surface goes on flat where it ends.  A step out of what is left of that part gives way to its middle, so
    that it ends however the surface is shaped.

    References: Press et al. 2007, "Numerical Recipes", 3rd ed., sec. 9.4.
    """
    if not direction[2] * side > 0.0:
        return 0.0, (0.0, 0.0, 1.0), 0.0
    first = shapes.min_sag[surface] if side > 0.0 else shapes.max_sag[surface]
    last = shapes.max_sag[surface] if side > 0.0 else shapes.min_sag[surface]
    before, behind = (first - near[2]) / direction[2], (last - near[2]) / direction[2]
    distance = guess if before < guess < behind else -near[2] / direction[2]
    slope = 0.0
    point = near
    for _ in range(MAX_STEPS):
        point = madd(near, distance, direction)
        sag, slope = _sag(shapes, surface, point[0] * point[0] + point[1] * point[1])
        off = side * (point[2] - sag)
        # Down to the roundings of its own terms there is nothing left to gain.
        if abs(off) <= ROUNDING * (abs(near[2]) + abs(distance * direction[2]) + abs(sag)):
            break
        if off < 0.0:
            before = distance
        else:
            behind = distance
        rate = side * (direction[2] - slope * (point[0] * direction[0] + point[1] * direction[1]))
        onward = distance - off / rate if rate != 0.0 else before
        distance = onward if before < onward < behind else 0.5 * (before + behind)
    normal = normalize((-slope * point[0], -slope * point[1], 1.0))
    cosine = dot(normal, direction)
    return distance, normal, cosine if cosine * side > 0.0 else 0.0


@intersect_shape.register(SurfaceShapes)
def intersect_shape_surface_shapes(shapes, lens, surface, origin, direction, side):
    if shapes.plain[surface]:
        return intersect_sphere(lens.curvature[surface], lens.vertex[surface], origin, direction, side)
    to = (origin[0], origin[1], origin[2] - lens.vertex[surface])
    before = -dot(to, direction)
    near = madd(to, before, direction)
    quadric = (shapes.quadric[surface, 0], shapes.quadric[surface, 1], shapes.quadric[surface, 2])
    distance, normal, cosine = _intersect_quadric(quadric, near, direction, side)
    if shapes.aspheric[surface]:
        distance, normal, cosine = _intersect_asphere(shapes, surface, near, direction, side, distance)
    return before + distance, normal, cosine
