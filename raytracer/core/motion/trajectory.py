"""Trajectories: poses at equal steps of a shutter's time, composed, displaced and recentred."""

import math
from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raytracer.core.motion.decomposition import (
    QUATERNION,
    SCALE,
    SHIFT,
    SKEW,
    TRANSLATION,
    Rows,
    compose,
    decompose,
    interpolate_rows,
    make_row,
    triangle_of,
)
from raytracer.core.motion.time_grid import MAX_STEPS
from raytracer.schema.fields import Vector
from raytracer.schema.transform import TRANSFORM_ROUNDING


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
