"""Directions to a rectangle, uniform by solid angle.

The rectangle is given by the axes x and y along its edges and its distance z > 0: it spans x0 .. x1 and y0 .. y1 in the
frame of the point that it is seen from.  The solid angle of its part up to x is F(x) - F(x0), where

    F(x) = a(x, y1) - a(x, y0),    a(x, y) = atan(x y / (z r)),    r = |(x, y, z)|,

and x is drawn by solving that for x in closed form; then y, uniform in the sine of its angle, as on any zone of a
sphere.  Angles are held by cosine and sine, which add up without an arc tangent each, and cancel nothing near 0 or pi.

References: Urena, Fajardo, King 2013, "An Area-Preserving Parametrization for Spherical Rectangles", EGSR, sec. 3.
"""

import math
from typing import NamedTuple

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.warp import sin_cos_turn

SMALLEST = 2.0**-26
"""Solid angle (sr) from which on it is sampled.

It is the angle of a cosine and a sine that are known to some 2^-52, so this one is known to 2^-26, and so are places on
the rectangle, relative to its edges.  Rays are float32, of 2^-24.
"""

_EDGE_ON = 2.0**-52
"""Height over the edges' length below which it is rounding."""


class SphericalRectangle(NamedTuple):
    """A rectangle as seen from a point.

    x0, x1, y0, y1, z (m) : where it is, z > 0.
    cosine, sine : of F(x0).
    solid_angle (sr) : 0 .. 2 pi.
    """

    x0: float
    x1: float
    y0: float
    y1: float
    z: float
    cosine: float
    sine: float
    solid_angle: float


@kernel
def _area_up_to(x, y0, y1, z):
    """Compute cosine and sine of F(x), the solid angle between 0 and x."""
    x2, z2 = x * x, z * z
    top, bottom = math.sqrt(y1 * y1 + z2), math.sqrt(y0 * y0 + z2)
    far, near = math.sqrt(x2 + y1 * y1 + z2), math.sqrt(x2 + y0 * y0 + z2)
    norm = 1.0 / ((x2 + z2) * top * bottom)
    return (z2 * far * near + x2 * y0 * y1) * norm, z * x * (y1 * near - y0 * far) * norm


@kernel
def spherical_rectangle(x0, x1, y0, y1, z):
    """Compute what is drawn from; its solid angle is 0 where it is seen edge on, as far as float64 can tell."""
    if not z > _EDGE_ON * (x1 - x0 + y1 - y0):
        return SphericalRectangle(x0, x1, y0, y1, z, 1.0, 0.0, 0.0)
    cos0, sin0 = _area_up_to(x0, y0, y1, z)
    cos1, sin1 = _area_up_to(x1, y0, y1, z)
    angle = math.atan2(sin1 * cos0 - cos1 * sin0, cos1 * cos0 + sin1 * sin0)
    # Above pi it can only be over the rectangle itself; elsewhere a negative one is 0, rounded.
    if angle < 0.0 and x0 < 0.0 < x1 and y0 < 0.0 < y1:
        angle += 2.0 * math.pi
    return SphericalRectangle(x0, x1, y0, y1, z, cos0, sin0, angle)


@kernel
def sample_spherical_rectangle(rectangle, u1, u2):
    """Sample a point of a rectangle: its x and y (m)."""
    x0, x1, y0, y1, z, cosine, sine, solid_angle = rectangle
    z2 = z * z

    # F(x) = F(x0) + u1 times the solid angle
    step_sin, step_cos = sin_cos_turn(u1 * (solid_angle / (2.0 * math.pi)))
    sin_f, cos_f = sine * step_cos + cosine * step_sin, cosine * step_cos - sine * step_sin
    lower2 = y0 * y0 + z2
    height = y1 / math.sqrt(y1 * y1 + z2) - y0 / math.sqrt(lower2) * cos_f
    rest = height * height - z2 / lower2 * (sin_f * sin_f)
    x = z * sin_f / math.sqrt(rest) if rest > 0.0 else math.copysign(math.inf, sin_f)
    x = max(x0, min(x, x1))

    # The sine of the angle of y, seen along the line x
    d2 = x * x + z2
    sin0, sin1 = y0 / math.sqrt(d2 + y0 * y0), y1 / math.sqrt(d2 + y1 * y1)
    at = sin0 + u2 * (sin1 - sin0)
    cos2 = (1.0 - at) * (1.0 + at)
    y = at * math.sqrt(d2 / cos2) if cos2 > 0.0 else math.copysign(math.inf, at)
    return x, max(y0, min(y, y1))


@kernel
def pdf_spherical_rectangle(rectangle):
    """Return the density in solid angle (1/sr)."""
    return 1.0 / rectangle.solid_angle
