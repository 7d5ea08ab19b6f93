"""Rays against primitives in float64, and the offsets that keep a spawned ray off the surface it leaves.

Embree finds the primitive in float32; these solve the accepted hit again in float64.
"""

import enum
import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.jit import generic, kernel
from raytracer.vec import Vec3, cross, dot, madd, norm, sub


class Primitive(enum.Enum):
    """What a geometry's buffers describe."""

    TRIANGLE = "triangle"
    SPHERE = "sphere"
    DISC = "disc"


class Geometry(NamedTuple):
    """Buffers of one shape kind for the ray caster.

    vertices: one array a time step, each float32 (n, 3), or (n, 4) with the radius last for spheres and discs.
    indices: uint32 (m, 3) for triangles, None for spheres and discs.
    normals: float32 (n, 3) for discs, else None.
    """

    primitive: Primitive
    vertices: tuple[NDArray[np.float32], ...]
    indices: NDArray[np.uint32] | None = None
    normals: NDArray[np.float32] | None = None


_Scalar = TypeVar("_Scalar", bound=np.generic)

# Bytes that Embree may read past the last element of a shared buffer (it loads 16 at a time).
_PADDING = 16


def padded(rows: NDArray[Any], dtype: type[_Scalar]) -> NDArray[_Scalar]:
    """A copy of `rows` of the given 32-bit dtype, with the readable bytes behind it that Embree asks for."""
    buffer = np.zeros(rows.size + _PADDING // 4, dtype)
    out = buffer[: rows.size].reshape(rows.shape)
    out[...] = rows
    return out


class Hit(NamedTuple):
    """Where a ray met a surface.

    point, on the surface; normal and shading normal, unit vectors to its outside; u and v, its parameters;
    offset, the distance along the normal at which float32 can no longer mistake the point's side (metres);
    material, the reference that the material table understands; tangent and bitangent, dp/du and dp/dv in world space
    (m), zero where they are not defined; local, where solid textures are looked up: the point as it was before motion
    and instancing moved it.
    """

    point: Vec3
    normal: Vec3
    shading_normal: Vec3
    u: float
    v: float
    offset: float
    material: int
    tangent: Vec3
    bitangent: Vec3
    local: Vec3


class Site(NamedTuple):
    """Where on a surface textures are looked up.

    point, for solid textures (m); u and v, the surface's parameters; distance, that light has come to or goes from
    here through what lies before the surface (m); hue, the spectra.Hue of the light, or None where no material asks
    for it.
    """

    point: Vec3
    u: float
    v: float
    distance: float
    hue: Any = None


class LightPoint(NamedTuple):
    """A point drawn on an emitter: point, normal to its outside, pdf in solid angle (1/sr) at the shaded point.

    gap, how far before the point (metres) a shadow ray must end, lest float32 finds the emitter itself in its way.
    u, v and local, as of a Hit.
    """

    point: Vec3
    normal: Vec3
    pdf: float
    gap: float
    u: float
    v: float
    local: Vec3


class Exact(NamedTuple):
    """The accuracy `exact`: hits that Embree found are solved again in float64.  None takes them as they are."""


OFFSET_ULPS = 4.0 * 2.0**-23
"""Float32 hits are wrong by about an ulp of the largest coordinate at play; four hold over seven decades of scale."""


@kernel
def offset_of(extent: float) -> float:
    """The spawn distance for a primitive whose coordinates reach `extent` (max |centre| + radius, or max |vertex|).

    The error follows the primitive's own coordinates, not the hit point's: a ground sphere of radius 1000 is wrong
    by 1e-4 near the origin, where offsets scaled by the point fail for 63 % of rays.
    """
    return OFFSET_ULPS * extent


@kernel
def plane_gap(extent: float, distance: float, cosine: float) -> float:
    """How far from a plane, along a ray of this length that meets it at this cosine, float32 may find it.

    Off the plane the error is that of the coordinates at play, which reach `extent`, and of the ray's length; along
    the ray it is larger by 1 / cosine.
    """
    error = offset_of(extent + distance)
    return error + error / cosine


@kernel
def sphere_gap(extent: float, distance: float, cosine: float, radius: float) -> float:
    """As `plane_gap`, for a sphere: near its limb, half the chord h = r cosine is only known as sqrt(h^2 +- 2 r e)."""
    error = offset_of(extent + distance)
    half = radius * cosine
    return error + math.sqrt(half * half + 2.0 * radius * error) - half


@generic
def sphere_distance(accuracy, origin, direction, center, radius, near):
    """Distance to a sphere along a unit direction, which float32 found to be `near`."""
    raise NotImplementedError


@sphere_distance.register(Exact)
def _(accuracy, origin, direction, center, radius, near):
    """The root of |o + t d - c| = r that is closest to `near`.

    The discriminant is taken from the closest approach, which cancels nothing for a far or a large sphere.

    References: Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, ch. 7.
    """
    to = sub(origin, center)
    b = -dot(to, direction)
    approach = madd(to, b, direction)
    half = math.sqrt(max(0.0, radius * radius - dot(approach, approach)))
    return b - half if abs(b - half - near) <= abs(b + half - near) else b + half


@generic
def plane_distance(accuracy, origin, direction, point, normal, near):
    """Distance along a ray to the plane of `point` and `normal`, which float32 found to be `near`."""
    raise NotImplementedError


@plane_distance.register(Exact)
def _(accuracy, origin, direction, point, normal, near):
    slope = dot(direction, normal)
    # A ray in the plane has no distance of its own.
    if slope == 0.0:
        return near
    return dot(sub(point, origin), normal) / slope


@generic
def hit_offset(accuracy, extent, near):
    """The spawn distance for a hit at distance `near` on a primitive whose coordinates reach `extent`."""
    raise NotImplementedError


@hit_offset.register(Exact)
def _(accuracy, extent, near):
    return offset_of(extent)


@sphere_distance.register(type(None))
def _(accuracy, origin, direction, center, radius, near):
    return near


@plane_distance.register(type(None))
def _(accuracy, origin, direction, point, normal, near):
    return near


@hit_offset.register(type(None))
def _(accuracy, extent, near):
    # The hit point itself is wrong by an ulp of the distance.
    return offset_of(extent + near)


@kernel
def area_pdf(reference: Vec3, point: Vec3, normal: Vec3, area: float) -> float:
    """Density in solid angle, at `reference`, of a point drawn uniformly from `area`; 0 when seen edge on.

    References: Veach 1997, thesis, eq. 8.2 (dw = dA |cos| / d^2).
    """
    to = sub(point, reference)
    cosine = abs(dot(to, normal))
    distance = norm(to)
    return distance * distance * distance / (cosine * area) if cosine > 0.0 else 0.0


@kernel
def area_light_point(
    reference: Vec3, point: Vec3, normal: Vec3, area: float, extent: float, u: float, v: float
) -> LightPoint:
    """The LightPoint of a point drawn uniformly from a flat emitter of this area, whose coordinates reach `extent`."""
    to = sub(point, reference)
    cosine = abs(dot(to, normal))
    distance = norm(to)
    # Edge on; or a triangle that has no area, nor a normal, at the time.
    if not cosine > 0.0:
        return LightPoint(point, normal, 0.0, distance, u, v, point)
    pdf = distance * distance * distance / (cosine * area)
    return LightPoint(point, normal, pdf, plane_gap(extent, distance, cosine / distance), u, v, point)


@kernel
def barycentric(point: Vec3, a: Vec3, edge1: Vec3, edge2: Vec3) -> tuple[float, float]:
    """Coordinates (u, v) of a point in the plane a + u edge1 + v edge2.

    References: Ericson 2005, "Real-Time Collision Detection", sec. 3.4.
    """
    n = cross(edge1, edge2)
    q = sub(point, a)
    inverse = 1.0 / dot(n, n)
    return dot(cross(q, edge2), n) * inverse, dot(cross(edge1, q), n) * inverse


@kernel
def within_quad(a: float, b: float, margin_a: float, margin_b: float) -> tuple[float, float]:
    """Coordinates of a point of a parallelogram, kept `margin` from its edges.

    A hit within float32 rounding of an edge would else be solved to a point beyond the neighbour that shares it.
    """
    margin_a, margin_b = min(margin_a, 0.5), min(margin_b, 0.5)
    return max(margin_a, min(a, 1.0 - margin_a)), max(margin_b, min(b, 1.0 - margin_b))


@kernel
def within_triangle(u: float, v: float, margin: float) -> tuple[float, float]:
    """As `within_quad`, for barycentric coordinates of a triangle: pulled to the middle until all three suffice."""
    least = min(u, min(v, 1.0 - u - v))
    margin = min(margin, 1.0 / 3.0)
    if least >= margin:
        return u, v
    pull = (margin - least) / (1.0 / 3.0 - least)
    return u + pull * (1.0 / 3.0 - u), v + pull * (1.0 / 3.0 - v)


@kernel
def spawn_point(hit, direction):
    """Where a ray leaves a surface along `direction`: off it by the float32 error bound, to the direction's side."""
    return madd(hit.point, hit.offset if dot(direction, hit.normal) > 0.0 else -hit.offset, hit.normal)


@kernel
def leaks(hit, outgoing):
    """Whether a direction is on different sides of the true and of the shading surface, so that light would leak."""
    return dot(outgoing, hit.normal) * dot(outgoing, hit.shading_normal) <= 0.0


@kernel
def row3(table, index):
    """Row `index` of an array of shape (n, 3), float32 or float64, as a float64 vector."""
    return (np.float64(table[index, 0]), np.float64(table[index, 1]), np.float64(table[index, 2]))
