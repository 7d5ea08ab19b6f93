"""Flat discs."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import (
    Geometry,
    Hit,
    Primitive,
    area_light_point,
    area_pdf,
    hit_offset,
    pad_buffer,
    plane_distance,
    row3,
)
from raytracer.core.primitives.base import interface
from raytracer.core.sampling.warp import sample_disc
from raytracer.core.vec import Vec3, cross, dot, madd, max_abs, norm, scale, sub


class Discs(NamedTuple):
    """Table of discs: center and unit normal (n, 3), radius (n,) float64, material (n,) int32."""

    center: NDArray[np.float64]
    normal: NDArray[np.float64]
    radius: NDArray[np.float64]
    material: NDArray[np.int32]


@interface.geometry.register(Discs)
def geometry_discs(table: Discs) -> Geometry:
    rows = np.column_stack([table.center, table.radius])
    return Geometry(Primitive.DISC, (pad_buffer(rows, np.float32),), None, pad_buffer(table.normal, np.float32))


@interface.areas.register(Discs)
def areas_discs(table: Discs) -> NDArray[np.float64]:
    return np.asarray(np.pi * table.radius**2)


@interface.boxes.register(Discs)
def boxes_discs(table: Discs, rows: NDArray[np.int64]) -> interface.Boxes:
    # The extent of a circle along an axis is its radius times the sine between axis and normal.
    reach = table.radius[rows, None] * np.sqrt(np.maximum(0.0, 1.0 - table.normal[rows] ** 2))
    return table.center[rows] - reach, table.center[rows] + reach


@kernel
def _axes(normal: Vec3) -> tuple[Vec3, Vec3]:
    """Make two unit tangents of a right-handed frame (s, t, normal): u of a disc's parameters begins opposite s.

    A disc has one normal, so this frame need not be continuous as `vec.basis`; it says how pictures lie on discs.

    References: Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1), listing 3.
    """
    sign = math.copysign(1.0, normal[2])
    a = -1.0 / (sign + normal[2])
    b = normal[0] * normal[1] * a
    s = (1.0 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0])
    return s, (b, sign + normal[1] * normal[1] * a, -normal[1])


@kernel
def _parameters(out: Vec3, normal: Vec3, radius: float) -> tuple[float, float]:
    """Compute u, once around the centre, and v, from the centre to the rim, of a point at `out` from the centre."""
    s, t = _axes(normal)
    return 0.5 + math.atan2(dot(out, t), dot(out, s)) / (2.0 * math.pi), norm(out) / radius


@interface.hit.register(Discs)
def hit_discs(table, primitive, origin, direction, near, time, accuracy):
    center, normal = row3(table.center, primitive), row3(table.normal, primitive)
    radius = table.radius[primitive]
    point = madd(origin, plane_distance(accuracy, origin, direction, center, normal, near), direction)
    out = sub(point, center)
    u, v = _parameters(out, normal, radius)
    reach = norm(out)
    offset = hit_offset(accuracy, max_abs(center) + radius, near)
    tangent, bitangent = scale(2.0 * math.pi, cross(normal, out)), scale(radius / reach if reach > 0.0 else 0.0, out)
    return Hit(point, normal, normal, u, v, offset, table.material[primitive], tangent, bitangent, point)


@interface.sample_point.register(Discs)
def sample_point_discs(table, primitive, reference, u1, u2, time):
    center, normal = row3(table.center, primitive), row3(table.normal, primitive)
    radius = table.radius[primitive]
    s, t = _axes(normal)
    x, y = sample_disc(u1, u2)
    point = madd(madd(center, radius * x, s), radius * y, t)
    u, v = _parameters(sub(point, center), normal, radius)
    return area_light_point(reference, point, normal, math.pi * radius * radius, max_abs(center) + radius, u, v)


@interface.pdf_point.register(Discs)
def pdf_point_discs(table, primitive, reference, point, normal, time):
    radius = table.radius[primitive]
    return area_pdf(reference, point, normal, math.pi * radius * radius)
