"""Three-vectors as tuples of three float64 scalars: they live in registers and never allocate."""

import math
import sys
from typing import Any

from raytracer.core.compiler.dispatch import kernel

Vec3 = tuple[float, float, float]


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def mul(a: Vec3, b: Vec3) -> Vec3:
    """Multiply by components."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@kernel
def scale(s: float, a: Vec3) -> Vec3:
    return (s * a[0], s * a[1], s * a[2])


@kernel
def madd(a: Vec3, s: float, b: Vec3) -> Vec3:
    """Compute a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@kernel
def neg(a: Vec3) -> Vec3:
    return (-a[0], -a[1], -a[2])


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def norm(a: Vec3) -> float:
    return math.sqrt(dot(a, a))


@kernel
def normalize(a: Vec3) -> Vec3:
    """Compute a / |a|; the zero vector gives NaN components, which the film counts."""
    return scale(1.0 / norm(a), a)


@kernel
def renormalize(a: Vec3) -> Vec3:
    """Bring a vector of a length near 1 to it by a step of Newton's for 1 / |a|: an error e becomes 1.5 e^2."""
    return scale(1.5 - 0.5 * dot(a, a), a)


@kernel
def max_component(a: Vec3) -> float:
    return max(a[0], max(a[1], a[2]))


@kernel
def max_abs(a: Vec3) -> float:
    return max(abs(a[0]), max(abs(a[1]), abs(a[2])))


@kernel
def is_black(a: Vec3) -> bool:
    return a[0] == 0.0 and a[1] == 0.0 and a[2] == 0.0


_SMALLEST_NORMAL = sys.float_info.min
"""Sums of squares below this have lost digits to underflow."""


@kernel
def basis(n: Vec3) -> tuple[Vec3, Vec3]:
    """Make two unit tangents of a right-handed frame (s, t, n) with the unit normal n, continuous in n except at -y.

    The frame is (z, x, y), turned from y to n the shortest way, so that near normals have near tangents:
    |ds| <= |dn| / cos(angle / 2), at an angle from y.  Points that are stratified over a pixel thereby stay so where
    the normal varies within it; a frame that flips at a plane mixes two sets of strata there, which showed as a line of
    noise.  A continuous frame fails in one direction at least.  Down is the one that samples need least: a lamp stands
    above its floor, and under a sky that is alike all round, turning the frame about the vertical changes nothing.

    Its Gram matrix is the identity to |n . n - 1| and a few roundings for all n: where y < 0, 1 / (1 + y) would cancel,
    and is taken as (1 - y) / (x^2 + z^2), its equal for a unit vector.

    References: Frisvad 2012, "Building an Orthonormal Basis from a 3D Unit Vector Without Normalization", JGT 16(3),
    with y for z; Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1), on what that loses to
    cancellation (their remedy is the frame that flips, at z = 0).
    """
    x, y, z = n
    h = x * x + z * z
    # Within 1.5e-154 of the axis.
    if h < _SMALLEST_NORMAL:
        return (0.0, 0.0, 1.0), (math.copysign(1.0, y), 0.0, 0.0)
    # Selected, not branched on: normals of a ball mispredict half of the branches (8.0 ns a frame with, 3.4 without).
    k = (1.0 if y > 0.0 else 1.0 - y) / (1.0 + y if y > 0.0 else h)
    b = -x * z * k
    return (b, -z, 1.0 - z * z * k), (1.0 - x * x * k, -x, b)


@kernel
def to_world(local: Vec3, s: Vec3, t: Vec3, n: Vec3) -> Vec3:
    """Transform coordinates `local` in the frame (s, t, n) to a vector."""
    return (
        local[0] * s[0] + local[1] * t[0] + local[2] * n[0],
        local[0] * s[1] + local[1] * t[1] + local[2] * n[1],
        local[0] * s[2] + local[1] * t[2] + local[2] * n[2],
    )


@kernel
def to_local(v: Vec3, s: Vec3, t: Vec3, n: Vec3) -> Vec3:
    """Compute the coordinates of a vector in the orthonormal frame (s, t, n)."""
    return (dot(v, s), dot(v, t), dot(v, n))


@kernel
def reflect(d: Vec3, n: Vec3) -> Vec3:
    """Mirror the direction of travel `d` at a surface with unit normal `n`."""
    return madd(d, -2.0 * dot(d, n), n)


@kernel
def load_vector(field: Any) -> Vec3:
    """Read the three numbers of an array, such as a field of a record."""
    return (field[0], field[1], field[2])


@kernel
def store_vector(field: Any, value: Vec3) -> None:
    """Write a vector into the three numbers of an array, such as a field of a record."""
    field[0], field[1], field[2] = value
