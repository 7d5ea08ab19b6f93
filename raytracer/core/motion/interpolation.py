"""Kernels of moving and placed things: trajectories at the time of a ray, and affine maps of points and vectors.

An affine map is three rows of (linear | translation).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.motion.trajectory import Rows
from raytracer.core.vec import dot, normalize


class Trajectories(NamedTuple):
    """Packed: first (n + 1,) int32, the row at which each trajectory starts and the last ends; rows (m, 16) float64."""

    first: NDArray[np.int32]
    rows: NDArray[np.float64]


def pack_trajectories(trajectories: Sequence[Rows]) -> Trajectories:
    """Pack trajectories in one table; one of a single step is a pose that is held."""
    first = np.cumsum([0] + [len(rows) for rows in trajectories]).astype(np.int32)
    return Trajectories(first, np.ascontiguousarray(np.concatenate(trajectories), np.float64))


@kernel
def _lerp(a, b, fraction):
    """Interpolate linearly; exactly `a` where the two are equal."""
    return a + fraction * (b - a)


@kernel
def _lerp3(row, other, start, fraction):
    return (
        _lerp(row[start], other[start], fraction),
        _lerp(row[start + 1], other[start + 1], fraction),
        _lerp(row[start + 2], other[start + 2], fraction),
    )


@kernel
def _slerp(p, q, fraction):
    """Interpolate between two unit quaternions, along the shorter arc, at constant speed.

    References: Shoemake 1985, sec. 3.3; Kahan 2006, "How Futile are Mindless Assessments of Roundoff", sec. 12 (the
    angle between vectors without cancellation).
    """
    sign = -1.0 if p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0.0 else 1.0
    apart, along = 0.0, 0.0
    for i in range(4):
        apart += (sign * q[i] - p[i]) ** 2
        along += (sign * q[i] + p[i]) ** 2
    if apart == 0.0:
        return p
    angle = 2.0 * math.atan2(math.sqrt(apart), math.sqrt(along))
    scale = 1.0 / math.sin(angle)
    a, b = scale * math.sin((1.0 - fraction) * angle), sign * scale * math.sin(fraction * angle)
    return (a * p[0] + b * q[0], a * p[1] + b * q[1], a * p[2] + b * q[2], a * p[3] + b * q[3])


@kernel
def _blend(row, other, fraction):
    """Interpolate between two rows, both tuples of 16."""
    turn = _slerp((row[9], row[10], row[11], row[12]), (other[9], other[10], other[11], other[12]), fraction)
    return (
        *_lerp3(row, other, 0, fraction),
        *_lerp3(row, other, 3, fraction),
        *_lerp3(row, other, 6, fraction),
        *turn,
        *_lerp3(row, other, 13, fraction),
    )


@kernel
def _affine_of(row):
    """Compute the affine map, three rows (linear | translation), of a row of a trajectory."""
    sx, sy, sz, xy, xz, yz, hx, hy, hz, r, i, j, k, tx, ty, tz = row
    rows = (
        (1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - r * k), 2.0 * (i * k + r * j)),
        (2.0 * (i * j + r * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - r * i)),
        (2.0 * (i * k - r * j), 2.0 * (j * k + r * i), 1.0 - 2.0 * (i * i + j * j)),
    )
    a, b, c = rows
    return (
        (sx * a[0], xy * a[0] + sy * a[1], xz * a[0] + yz * a[1] + sz * a[2], dot(a, (hx, hy, hz)) + tx),
        (sx * b[0], xy * b[0] + sy * b[1], xz * b[0] + yz * b[1] + sz * b[2], dot(b, (hx, hy, hz)) + ty),
        (sx * c[0], xy * c[0] + sy * c[1], xz * c[0] + yz * c[1] + sz * c[2], dot(c, (hx, hy, hz)) + tz),
    )


@kernel
def _row_of(rows, index):
    return (
        rows[index, 0], rows[index, 1], rows[index, 2], rows[index, 3], rows[index, 4], rows[index, 5],
        rows[index, 6], rows[index, 7], rows[index, 8], rows[index, 9], rows[index, 10], rows[index, 11],
        rows[index, 12], rows[index, 13], rows[index, 14], rows[index, 15],
    )  # fmt: skip


@kernel
def segment_of(time, segments):
    """Find the segment of a uniform grid over [0, 1] in which a time, clamped, lies, and the fraction in it."""
    steps = max(0.0, min(1.0, time)) * segments
    segment = min(int(steps), segments - 1)
    return segment, steps - segment


@kernel
def pose_at(trajectories, index, time):
    """Compute the pose of trajectory `index` at a fraction of the exposure: three rows (linear | translation).

    Outside [0, 1] the pose is that of the nearer end; Embree would extrapolate.
    """
    first = trajectories.first[index]
    segments = trajectories.first[index + 1] - 1 - first
    if segments == 0:
        return _affine_of(_row_of(trajectories.rows, first))
    segment, fraction = segment_of(time, segments)
    row = _row_of(trajectories.rows, first + segment)
    return _affine_of(_blend(row, _row_of(trajectories.rows, first + segment + 1), fraction))


# ---- Affine maps


@kernel
def apply_point(affine, p):
    """Transform a point by an affine map (three rows of four)."""
    a, b, c = affine
    return dot(a, p) + a[3], dot(b, p) + b[3], dot(c, p) + c[3]


@kernel
def apply_vector(affine, v):
    """Transform a vector, a difference of points, by an affine map."""
    a, b, c = affine
    return dot(a, v), dot(b, v), dot(c, v)


@kernel
def apply_transpose(affine, v):
    """Transform a vector by the transpose of an affine map's linear part."""
    a, b, c = affine
    return (
        a[0] * v[0] + b[0] * v[1] + c[0] * v[2],
        a[1] * v[0] + b[1] * v[1] + c[1] * v[2],
        a[2] * v[0] + b[2] * v[1] + c[2] * v[2],
    )


@kernel
def apply_normal(inverse, n):
    """Transform a unit normal by the map whose inverse is given: by the inverse transpose.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 3.10.3.
    """
    return normalize(apply_transpose(inverse, n))


@kernel
def invert(affine):
    """Compute the inverse of an affine map, by cofactors."""
    a, b, c = affine
    xx, xy, xz = b[1] * c[2] - b[2] * c[1], a[2] * c[1] - a[1] * c[2], a[1] * b[2] - a[2] * b[1]
    yx, yy, yz = b[2] * c[0] - b[0] * c[2], a[0] * c[2] - a[2] * c[0], a[2] * b[0] - a[0] * b[2]
    zx, zy, zz = b[0] * c[1] - b[1] * c[0], a[1] * c[0] - a[0] * c[1], a[0] * b[1] - a[1] * b[0]
    scale = 1.0 / (a[0] * xx + a[1] * yx + a[2] * zx)
    shift = (a[3], b[3], c[3])
    x, y, z = (
        (scale * xx, scale * xy, scale * xz),
        (scale * yx, scale * yy, scale * yz),
        (scale * zx, scale * zy, scale * zz),
    )
    return (*x, -dot(x, shift)), (*y, -dot(y, shift)), (*z, -dot(z, shift))
