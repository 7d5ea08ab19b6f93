"""Trajectories: poses at equal steps of a shutter's time, composed, displaced and recentred.

A pose is a row of scale, skew, shift, rotation and translation, which interpolate part by part.

References: Shoemake 1985, "Animating Rotation with Quaternion Curves", SIGGRAPH; Embree 4 API reference
(RTCQuaternionDecomposition).
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.shutter.table import Shutter
from raytracer.schema.fields import Vector
from raytracer.schema.transform import TRANSFORM_ROUNDING, Matrix

# Columns of a row of a trajectory, in the order of RTCQuaternionDecomposition.
SCALE, SKEW, SHIFT, QUATERNION, TRANSLATION = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 13), slice(13, 16)

Rows: TypeAlias = NDArray[np.float64]


def quaternion_of(rotation: Matrix) -> NDArray[np.float64]:
    """Compute the unit quaternion (r, i, j, k) of a rotation matrix (3, 3).

    References: Shepperd 1978, "Quaternion from Rotation Matrix", J. Guidance and Control 1(3).
    """
    x, y, z = np.diag(rotation)
    squares = np.array([1.0 + x + y + z, 1.0 + x - y - z, 1.0 - x + y - z, 1.0 - x - y + z])
    largest = int(np.argmax(squares))
    m = rotation
    products = {
        0: (squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]),
        1: (m[2, 1] - m[1, 2], squares[1], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]),
        2: (m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], squares[2], m[1, 2] + m[2, 1]),
        3: (m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[3]),
    }
    q = np.array(products[largest])
    return np.asarray(q / np.linalg.norm(q))


def quaternion_product(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the quaternion of the rotation q followed by p."""
    real = p[0] * q[0] - np.dot(p[1:], q[1:])
    return np.array([real, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def orthogonal_triangular(linear: Matrix) -> tuple[Matrix, Matrix]:
    """Factor a matrix (3, 3) into a rotation and an upper triangular one, whose last diagonal entry has its sign."""
    rotation, triangle = np.linalg.qr(linear)
    signs = np.where(np.diag(triangle) < 0.0, -1.0, 1.0)
    rotation, triangle = rotation * signs, signs[:, None] * triangle
    if np.linalg.det(rotation) < 0.0:
        rotation[:, 2], triangle[2] = -rotation[:, 2], -triangle[2]
    return rotation, triangle


def make_row(
    translation: Any, quaternion: NDArray[np.float64], triangle: Matrix, shift: Any = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """Make the row of a trajectory that is the matrix translation . rotation . (triangle | shift)."""
    skew = triangle[[0, 0, 1], [1, 2, 2]]
    return np.concatenate([np.diag(triangle), skew, shift, quaternion, translation])


def decompose(matrix: Matrix) -> NDArray[np.float64]:
    """Decompose an affine matrix (4, 4) into a row (16,): scale, skew, shift, quaternion, translation."""
    rotation, triangle = orthogonal_triangular(matrix[:3, :3])
    return make_row(matrix[:3, 3], quaternion_of(rotation), triangle)


def compose(row: NDArray[np.float64]) -> Matrix:
    """Compute the affine matrix (4, 4) of a row of a trajectory."""
    r, (i, j, k) = row[QUATERNION][0], row[QUATERNION][1:]
    rotation = np.array(
        [
            [1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - r * k), 2.0 * (i * k + r * j)],
            [2.0 * (i * j + r * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - r * i)],
            [2.0 * (i * k - r * j), 2.0 * (j * k + r * i), 1.0 - 2.0 * (i * i + j * j)],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = rotation @ triangle_of(row)
    result[:3, 3] = rotation @ row[SHIFT] + row[TRANSLATION]
    return result


def interpolate_rows(row: NDArray[np.float64], other: NDArray[np.float64], fraction: float) -> NDArray[np.float64]:
    """Interpolate between two rows of a trajectory."""
    result = row + fraction * (other - row)
    p, q = row[QUATERNION], other[QUATERNION]
    if np.dot(p, q) < 0.0:
        q = -q
    angle = 2.0 * math.atan2(float(np.linalg.norm(q - p)), float(np.linalg.norm(q + p)))
    if angle > 0.0:
        p = (math.sin((1.0 - fraction) * angle) * p + math.sin(fraction * angle) * q) / math.sin(angle)
    result[QUATERNION] = p
    return result


def triangle_of(row: NDArray[np.float64]) -> Matrix:
    """Return the scale and skew of a row of a trajectory as an upper triangular matrix (3, 3)."""
    triangle = np.diag(row[SCALE])
    triangle[[0, 0, 1], [1, 2, 2]] = row[SKEW]
    return triangle


# ---- Time steps

MAX_STEPS = 129
"""The largest number of time steps that Embree takes for a moving geometry."""


_GRID_TOLERANCE = 1e-6
"""Distance from a step, in segments, at which the time of a keyframe still counts as on it.

Objects are then misplaced by a millionth of their displacement between two steps, as much as by Embree's own angles
(1.6e-6).
"""


def breakpoints(times: Iterable[float], shutter: Shutter) -> list[float]:
    """List the shutter's opening and closing, and the given times between: motion is smooth between two of these."""
    inner = [time for time in times if shutter.open < time < shutter.close]
    return [shutter.open, *inner, *([shutter.close] if shutter.close > shutter.open else [])]


def uniform_grid(times: Iterable[float], shutter: Shutter) -> list[float]:
    """Divide the time from the shutter's opening to its closing into equal steps on which the times between fall.

    At most 129, of which times may then lie beside; one for a shutter that is open for no time.
    """
    points = breakpoints(times, shutter)
    return grid(points, uniform_segments(points)) if len(points) > 1 else points


def uniform_segments(times: Sequence[float]) -> int:
    """Find the least number of equal segments of [times[0], times[-1]] that end at each of the sorted times.

    At most 128; that many if there is no such number.
    """
    fractions = (np.asarray(times) - times[0]) / (times[-1] - times[0])
    for segments in range(1, MAX_STEPS):
        steps = segments * fractions
        if np.abs(steps - np.round(steps)).max() <= _GRID_TOLERANCE:
            return segments
    return MAX_STEPS - 1


def grid(times: Sequence[float], segments: int) -> list[float]:
    """Make equal steps from the first time to the last; steps on one of the times have its bits."""
    grid = np.linspace(times[0], times[-1], segments + 1)
    width = (times[-1] - times[0]) / segments
    for time in times:
        nearest = int(np.argmin(np.abs(grid - time)))
        if abs(grid[nearest] - time) <= _GRID_TOLERANCE * width:
            grid[nearest] = time
    return [float(time) for time in grid]


# ---- Trajectories


def compose_trajectories(outer: Rows, inner: Rows, most: int = MAX_STEPS) -> Rows:
    """Compose the trajectory (steps, 16) of the poses outer(t) . inner(t), for trajectories of 1 to `most` steps.

    It is exact if one of the two is at rest and the other turns without changing its scale, or the outer is a
    similarity at rest; else it has `most` steps, each of them exact.
    """
    exact = min(len(outer), len(inner)) == 1 and (_is_scaled_alike(outer) if len(inner) == 1 else _is_similar(outer[0]))
    steps = max(len(outer), len(inner)) if exact else most
    rows = []
    for fraction in np.linspace(0.0, 1.0, steps):
        a, b = row_at(outer, float(fraction)), row_at(inner, float(fraction))
        matrix = compose(a)
        product = matrix @ compose(b)
        row = decompose(product)

        # Separate the even motion of the centre from the rotation about it.
        center = matrix[:3, :3] @ b[TRANSLATION] + matrix[:3, 3] if len(outer) == 1 else a[TRANSLATION]
        turn = compose(make_row(np.zeros(3), row[QUATERNION], np.eye(3)))[:3, :3]
        row[SHIFT] = turn.T @ (product[:3, 3] - center)
        row[TRANSLATION] = center
        rows.append(row)
    return continuous(rows)


def translate_trajectory(rows: Rows, before: Vector, after: Vector) -> Rows:
    """Make the trajectory (steps, 16) of a displacement by `before` (m), then a trajectory, then one by `after`."""
    result = rows.copy()
    for row in result:
        row[SHIFT] += triangle_of(row) @ before
        row[TRANSLATION] += after
    return result


def conjugate_trajectory(rows: Rows, by: Vector) -> Rows:
    """Make the trajectory (steps, 16) of the same motion in a world that is displaced by a vector (m)."""
    x, y, z = by
    return translate_trajectory(rows, (-x, -y, -z), by)


def recentre_rotation(rows: Rows, turn: float) -> Rows:
    """Convert a trajectory (steps, 16) of rotations about a far point to rotations about the object and displacements.

    A pose T R (U | s) is T + R s with R (U | 0), so that the radius s, by which an error of R is multiplied, is gone.
    Between two steps the path is then straight, not an arc of the angle a, from which it deviates by up to s a^2 / 8:
    steps are added.  The trajectory is left as it is if that is not better.

    Parameters
    ----------
    turn : error of rotations (rad).
    """
    angle = max((math.radians(degrees_between(a, b)) for a, b in pairwise(rows)), default=0.0)
    segments = max(1, len(rows) - 1)
    finer = (MAX_STEPS - 1) // segments if angle > 0.0 else 1
    if (angle / finer) ** 2 / 8.0 > turn:
        return rows
    steps = finer * (len(rows) - 1) + 1
    result = []
    for fraction in np.linspace(0.0, 1.0, steps):
        row = row_at(rows, float(fraction))
        rotation = compose(make_row(np.zeros(3), row[QUATERNION], np.eye(3)))[:3, :3]
        row[TRANSLATION] += rotation @ row[SHIFT]
        row[SHIFT] = 0.0
        result.append(row)
    return continuous(result)


def max_rotation_radius(rows: Rows) -> float:
    """Return the largest distance (m) of the moved object's origin from the centre of a trajectory's rotation."""
    return float(np.linalg.norm(rows[:, SHIFT], axis=1).max())


def rotation_trajectory(center: Vector, quaternions: NDArray[np.float64]) -> Rows:
    """Make the trajectory (steps, 16) of rotations about a point (m), by their unit quaternions (steps, 4)."""
    back = -np.asarray(center, np.float64)
    return continuous(make_row(center, quaternion, np.eye(3), back) for quaternion in quaternions)


def _is_similar(row: NDArray[np.float64]) -> bool:
    """Return True if a pose scales by the same factor along all axes, up to a mirror image, and does not skew."""
    size = abs(row[0])
    off = max(np.abs(np.abs(row[SCALE]) - size).max(), np.abs(row[SKEW]).max())
    return bool(off <= TRANSFORM_ROUNDING * size)


def _is_scaled_alike(rows: Rows) -> bool:
    """Return True if all poses of a trajectory have the same scale and skew."""
    first = rows[0, :6]
    return bool(np.abs(rows[:, :6] - first).max() <= TRANSFORM_ROUNDING * np.abs(first).max())


def row_at(rows: Rows, fraction: float) -> NDArray[np.float64]:
    """Interpolate the row of a trajectory at a fraction of the exposure."""
    segments = len(rows) - 1
    here = min(int(fraction * segments), segments)
    return interpolate_rows(rows[here], rows[min(here + 1, segments)], fraction * segments - here)


def degrees_between(row: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Compute the angle (deg) between the rotations of two rows."""
    cosine = abs(float(np.dot(row[QUATERNION], other[QUATERNION])))
    return 2.0 * math.degrees(math.acos(min(1.0, cosine)))


def continuous(rows: Iterable[NDArray[np.float64]]) -> Rows:
    """Stack rows to a trajectory, each quaternion with the sign that is nearer to the one before."""
    result = np.ascontiguousarray(np.stack(list(rows)), np.float64)
    for before, after in pairwise(result):
        if np.dot(before[QUATERNION], after[QUATERNION]) < 0.0:
            after[QUATERNION] *= -1.0
    return result
