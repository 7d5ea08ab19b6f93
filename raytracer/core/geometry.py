"""Ray intersections in float64, and the offsets that keep a spawned ray off the surface that it leaves.

Embree finds the primitive in float32; these solve the accepted hit again in float64.
"""

import enum
import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.vec import Vec3, cross, dot, madd, norm, sub


class Primitive(enum.Enum):
    """The kinds of primitives that a geometry's buffers may hold."""

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


def pad_buffer(rows: NDArray[Any], dtype: type[_Scalar]) -> NDArray[_Scalar]:
    """Copy `rows` as the given 32-bit dtype, with the readable bytes behind them that Embree requires."""
    buffer = np.zeros(rows.size + _PADDING // 4, dtype)
    out = buffer[: rows.size].reshape(rows.shape)
    out[...] = rows
    return out


class Hit(NamedTuple):
    """The intersection of a ray with a surface.

    Attributes
    ----------
    point : on the surface (m).
    normal, shading_normal : unit vectors to the outside.
    u, v : the surface's parameters.
    offset : distance (m) along the normal at which float32 can no longer mistake the point's side.
    material : the reference that the material table understands.
    tangent, bitangent : dp/du and dp/dv in world space (m), zero where they are not defined.
    local : the point (m) before motion and instancing, at which solid textures are looked up.
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
    """The point of a surface at which textures and materials are evaluated.

    Attributes
    ----------
    point : for solid textures (m).
    u, v : the surface's parameters.
    distance : length (m) of the path's segment that ends at the surface.
    wavelengths : spectra.PathWavelengths of the path, or None where no material needs them.
    """

    point: Vec3
    u: float
    v: float
    distance: float
    wavelengths: Any = None


class Interaction(NamedTuple):
    """The meeting of a path with a surface, and what is seen of the surface there.

    Attributes
    ----------
    instance, table, primitive : numbers of the surface; an instance of -1 is none.
    hit : the Hit.
    site : the Site at which textures and materials are evaluated.
    material : reference of the material, after all selectors.
    front : True if the path comes from the outside.
    normal : the shading normal, on the side that the path comes from.
    previous (m) : the path's vertex before this one, where it scattered last or left the camera.
    direction : of the path, a unit vector.
    distance (m) : from where its ray started, as Embree found it.
    time : fraction of the exposure, or None where nothing moves.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 3.11 (interactions).
    """

    instance: int
    table: int
    primitive: int
    hit: Hit
    site: Site
    material: int
    front: bool
    normal: Vec3
    previous: Vec3
    direction: Vec3
    distance: float
    time: Any


@kernel
def at_wavelengths(surface: Interaction, wavelengths: Any) -> Interaction:
    """Return an Interaction whose materials are evaluated at these wavelengths, a spectra.PathWavelengths."""
    instance, table, primitive, hit, site, material, front, normal, previous, direction, distance, time = surface
    site = Site(site.point, site.u, site.v, site.distance, wavelengths)
    return Interaction(
        instance, table, primitive, hit, site, material, front, normal, previous, direction, distance, time
    )


@kernel
def with_normal(surface: Interaction, normal: Vec3) -> Interaction:
    """Return an Interaction with another shading normal."""
    instance, table, primitive, hit, site, material, front, _, previous, direction, distance, time = surface
    return Interaction(
        instance, table, primitive, hit, site, material, front, normal, previous, direction, distance, time
    )


class LightPoint(NamedTuple):
    """A point drawn on an emitter: point, normal to its outside, pdf in solid angle (1/sr) at the shaded point.

    gap : distance (m) before the point at which a shadow ray ends, lest float32 finds the emitter itself in its way.
    u, v, local : as of a Hit.
    """

    point: Vec3
    normal: Vec3
    pdf: float
    gap: float
    u: float
    v: float
    local: Vec3


class Exact(NamedTuple):
    """The accuracy `exact`: Embree's hits are solved again in float64.  None in its place takes them as they are."""


OFFSET_ULPS = 4.0 * 2.0**-23
"""Float32 hits are wrong by about an ulp of the largest coordinate at play; four hold over seven decades of scale."""


@kernel
def spawn_offset(extent: float) -> float:
    """Compute the spawn distance for a primitive of this `extent` (max |centre| + radius, or max |vertex|).

    The error follows the primitive's own coordinates, not the hit point's: a ground sphere of radius 1000 is wrong
    by 1e-4 near the origin, where offsets scaled by the point fail for 63 % of rays.
    """
    return OFFSET_ULPS * extent


@kernel
def plane_gap(extent: float, distance: float, cosine: float) -> float:
    """Bound the distance from a plane at which float32 may find it, along a ray of this length and cosine.

    Off the plane the error is that of the coordinates at play, which reach `extent`, and of the ray's length; along
    the ray it is larger by 1 / cosine.
    """
    error = spawn_offset(extent + distance)
    return error + error / cosine


@kernel
def sphere_gap(extent: float, distance: float, cosine: float, radius: float) -> float:
    """Bound it for a sphere: near its limb, half the chord h = r cosine is only known as sqrt(h^2 +- 2 r e)."""
    error = spawn_offset(extent + distance)
    half = radius * cosine
    return error + math.sqrt(half * half + 2.0 * radius * error) - half


@optional
def sphere_distance(accuracy, origin, direction, center, radius, near):
    """Return the distance to a sphere along a unit direction, which float32 found to be `near`."""
    return near


@sphere_distance.register(Exact)
def sphere_distance_exact(accuracy, origin, direction, center, radius, near):
    """Solve |o + t d - c| = r for the root that is closest to `near`.

    The discriminant is taken from the closest approach, which cancels nothing for a far or a large sphere.

    References: Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, ch. 7.
    """
    to = sub(origin, center)
    b = -dot(to, direction)
    approach = madd(to, b, direction)
    half = math.sqrt(max(0.0, radius * radius - dot(approach, approach)))
    return b - half if abs(b - half - near) <= abs(b + half - near) else b + half


@optional
def plane_distance(accuracy, origin, direction, point, normal, near):
    """Compute the distance along a ray to the plane of `point` and `normal`, which float32 found to be `near`."""
    return near


@plane_distance.register(Exact)
def plane_distance_exact(accuracy, origin, direction, point, normal, near):
    slope = dot(direction, normal)
    # A ray in the plane has no distance of its own.
    if slope == 0.0:
        return near
    return dot(sub(point, origin), normal) / slope


@kernel
def hit_offset(accuracy, extent, near):
    """Compute the spawn distance for a hit at distance `near` on a primitive whose coordinates reach `extent`."""
    if accuracy is None:
        # The hit point itself is wrong by an ulp of the distance.
        return spawn_offset(extent + near)
    return spawn_offset(extent)


@kernel
def area_pdf(reference: Vec3, point: Vec3, normal: Vec3, area: float) -> float:
    """Compute the density in solid angle, at `reference`, of a point drawn uniformly from `area`; 0 when seen edge on.

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
    """Make the LightPoint of a point drawn uniformly from a flat emitter, whose coordinates reach `extent`."""
    to = sub(point, reference)
    cosine = abs(dot(to, normal))
    distance = norm(to)
    # Seen edge on, or a triangle without area at this time.
    if not cosine > 0.0:
        return LightPoint(point, normal, 0.0, distance, u, v, point)
    pdf = distance * distance * distance / (cosine * area)
    return LightPoint(point, normal, pdf, plane_gap(extent, distance, cosine / distance), u, v, point)


@kernel
def barycentric(point: Vec3, a: Vec3, edge1: Vec3, edge2: Vec3) -> tuple[float, float]:
    """Compute coordinates (u, v) of a point in the plane a + u edge1 + v edge2.

    References: Ericson 2005, "Real-Time Collision Detection", sec. 3.4.
    """
    n = cross(edge1, edge2)
    q = sub(point, a)
    inverse = 1.0 / dot(n, n)
    return dot(cross(q, edge2), n) * inverse, dot(cross(edge1, q), n) * inverse


@kernel
def clamp_to_quad(a: float, b: float, margin_a: float, margin_b: float) -> tuple[float, float]:
    """Clamp coordinates of a point of a parallelogram to a `margin` from its edges.

    A hit within float32 rounding of an edge would else be solved to a point beyond the neighbour that shares it.
    """
    margin_a, margin_b = min(margin_a, 0.5), min(margin_b, 0.5)
    return max(margin_a, min(a, 1.0 - margin_a)), max(margin_b, min(b, 1.0 - margin_b))


@kernel
def clamp_to_triangle(u: float, v: float, margin: float) -> tuple[float, float]:
    """Clamp barycentric coordinates to a margin from a triangle's edges: pull them to the middle as far as needed."""
    least = min(u, min(v, 1.0 - u - v))
    margin = min(margin, 1.0 / 3.0)
    if least >= margin:
        return u, v
    pull = (margin - least) / (1.0 / 3.0 - least)
    return u + pull * (1.0 / 3.0 - u), v + pull * (1.0 / 3.0 - v)


@kernel
def spawn_point(hit, direction):
    """Offset the origin of a ray that leaves a surface along `direction`, to its side by the float32 error bound."""
    return madd(hit.point, hit.offset if dot(direction, hit.normal) > 0.0 else -hit.offset, hit.normal)


@kernel
def is_below_surface(hit, outgoing):
    """Return True if a direction is on different sides of the true and the shading surface: light would leak."""
    return dot(outgoing, hit.normal) * dot(outgoing, hit.shading_normal) <= 0.0


@kernel
def row3(table, index):
    """Read row `index` of an array of shape (n, 3), float32 or float64, as a float64 vector."""
    return (np.float64(table[index, 0]), np.float64(table[index, 1]), np.float64(table[index, 2]))
