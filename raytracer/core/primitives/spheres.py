"""Spheres."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import (
    Geometry,
    Hit,
    LightPoint,
    Primitive,
    area_pdf,
    hit_offset,
    pad_buffer,
    row3,
    spawn_offset,
    sphere_distance,
    sphere_gap,
)
from raytracer.core.primitives.base import interface
from raytracer.core.sampling.warp import pdf_cone, sample_cone, sample_sphere
from raytracer.core.vec import Vec3, basis, dot, madd, max_abs, norm, scale, sub, to_world


class Spheres(NamedTuple):
    """Table of spheres: center (n, 3) and radius (n,) float64 (negative: inward normal), material (n,) int32."""

    center: NDArray[np.float64]
    radius: NDArray[np.float64]
    material: NDArray[np.int32]


@interface.geometry.register(Spheres)
def geometry_spheres(table: Spheres) -> Geometry:
    rows = np.column_stack([table.center, np.abs(table.radius)])
    return Geometry(Primitive.SPHERE, (pad_buffer(rows, np.float32),))


@interface.areas.register(Spheres)
def areas_spheres(table: Spheres) -> NDArray[np.float64]:
    return np.asarray(4.0 * np.pi * table.radius**2)


@interface.boxes.register(Spheres)
def boxes_spheres(table: Spheres, rows: NDArray[np.int64]) -> interface.Boxes:
    center, radius = table.center[rows], np.abs(table.radius[rows])[:, None]
    return center - radius, center + radius


@kernel
def parameters(out: Vec3) -> tuple[float, float]:
    """Compute u, once around from -x through +z, and v, from the south pole to the north, on the unit sphere.

    References: Shirley et al. 2024, "Ray Tracing: The Next Week", sec. 4.4.
    """
    u = 0.5 + math.atan2(-out[2], out[0]) / (2.0 * math.pi)
    return u, math.acos(max(-1.0, min(1.0, -out[1]))) / math.pi


@kernel
def derivatives(out: Vec3, radius: float) -> tuple[Vec3, Vec3]:
    """Compute dp/du and dp/dv for a sphere of this radius at a point of the unit sphere; dp/dv is zero at the poles."""
    sine = math.sqrt(out[0] * out[0] + out[2] * out[2])
    tangent = (2.0 * math.pi * radius * out[2], 0.0, -2.0 * math.pi * radius * out[0])
    if sine == 0.0:
        return tangent, (0.0, 0.0, 0.0)
    along = math.pi * radius
    return tangent, (-along * out[0] * out[1] / sine, along * sine, -along * out[1] * out[2] / sine)


@interface.hit.register(Spheres)
def hit_spheres(table, primitive, origin, direction, near, time, accuracy):
    center, radius = row3(table.center, primitive), table.radius[primitive]
    t = sphere_distance(accuracy, origin, direction, center, radius, near)

    # Project onto the sphere, so that the point is as exact as the sphere itself.
    out = sub(madd(origin, t, direction), center)
    out = scale(1.0 / norm(out), out)
    point = madd(center, abs(radius), out)
    normal = scale(math.copysign(1.0, radius), out)
    u, v = parameters(out)
    tangent, bitangent = derivatives(out, abs(radius))
    offset = hit_offset(accuracy, max_abs(center) + abs(radius), near)
    return Hit(point, normal, normal, u, v, offset, table.material[primitive], tangent, bitangent, point)


@kernel
def _is_cone_sampled(center: Vec3, radius: float, distance2: float) -> bool:
    """Return True if light samples draw from the cone that a sphere fills, seen at this squared distance.

    On the sphere itself that would be half of all directions, and rounding would decide which side is the near one:
    such points count as inside.
    """
    reach = radius + spawn_offset(max_abs(center) + radius)
    return distance2 > reach * reach


@interface.sample_point.register(Spheres)
def sample_point_spheres(table, primitive, reference, u1, u2, time):
    center, radius = row3(table.center, primitive), abs(table.radius[primitive])
    to = sub(center, reference)
    distance2 = dot(to, to)
    if not _is_cone_sampled(center, radius, distance2):
        # From inside, every point of the sphere is visible: sample by area.
        out = sample_sphere(u1, u2)
        point = madd(center, radius, out)
        pdf = area_pdf(reference, point, out, 4.0 * math.pi * radius * radius)
    else:
        # From outside, sample a direction in the cone that the sphere fills, and intersect the near side.
        sin2_max = radius * radius / distance2
        axis = scale(1.0 / math.sqrt(distance2), to)
        s, t = basis(axis)
        direction = to_world(sample_cone(u1, u2, sin2_max), s, t, axis)
        foot = madd(reference, dot(to, direction), direction)
        miss = sub(foot, center)
        out = madd(miss, -math.sqrt(max(0.0, radius * radius - dot(miss, miss))), direction)
        out = scale(1.0 / norm(out), out)
        point = madd(center, radius, out)
        pdf = pdf_cone(sin2_max)
    way = sub(point, reference)
    distance = norm(way)
    gap = sphere_gap(max_abs(center) + radius, distance, abs(dot(way, out)) / distance, radius)
    u, v = parameters(out)
    return LightPoint(point, scale(math.copysign(1.0, table.radius[primitive]), out), pdf, gap, u, v, point)


@interface.pdf_point.register(Spheres)
def pdf_point_spheres(table, primitive, reference, point, normal, time):
    center, radius = row3(table.center, primitive), abs(table.radius[primitive])
    to = sub(center, reference)
    distance2 = dot(to, to)
    if not _is_cone_sampled(center, radius, distance2):
        return area_pdf(reference, point, normal, 4.0 * math.pi * radius * radius)

    # The far side is visible through holes, but is never sampled.
    if dot(sub(point, reference), sub(point, center)) > 0.0:
        return 0.0
    return pdf_cone(radius * radius / distance2)
