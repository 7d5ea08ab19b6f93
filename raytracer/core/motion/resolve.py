"""Resolve a motion for a shutter: to a pose at rest, a straight shift, or a trajectory."""

import functools
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.motion.spec import Keyframe, Motion
from raytracer.core.motion.trajectory import (
    MAX_STEPS,
    QUATERNION,
    TRANSLATION,
    Rows,
    breakpoints,
    compose,
    continuous,
    decompose,
    degrees_between,
    grid,
    interpolate_rows,
    make_row,
    orthogonal_triangular,
    quaternion_of,
    quaternion_product,
    uniform_segments,
)
from raytracer.core.shutter.table import Shutter
from raytracer.schema.transform import TRANSFORM_ROUNDING, Matrix, Transform, matrix_of, rotation_matrix

# Rotation is exact between two steps whatever their angle, but Embree bounds what is swept by boxes, and its float32
# angle is good to 2e-6 rad.  A step more costs 64 bytes.
_DEGREES_PER_SEGMENT = 15.0

# Beyond a half turn the shorter arc goes the other way; this leaves room for Embree's bounds.
_MAX_DEGREES_PER_SEGMENT = 120.0


def matrix_at(motion: Motion, time: float) -> Matrix:
    """Compute the pose at a time of the scene (s): float64 (4, 4), for column vectors, in world space."""
    if motion.keyframes is not None:
        return _keyframe_pose(motion.keyframes, time)
    result = np.eye(4)
    if motion.spin is not None:
        spin = motion.spin
        result[:3, :3] = rotation_matrix(spin.axis, spin.rate * time)
        result[:3, 3] = np.subtract(spin.center, result[:3, :3] @ spin.center)
    if motion.velocity is not None:
        result[:3, 3] += np.multiply(time, motion.velocity)
    return result


def _keyframe_pose(keyframes: Sequence[Keyframe], time: float) -> Matrix:
    """Compute the pose between two keyframes; before the first and after the last theirs is held."""
    after = next((number for number, key in enumerate(keyframes) if key.time > time), len(keyframes))
    a, b = keyframes[max(after - 1, 0)], keyframes[min(after, len(keyframes) - 1)]
    first, last = matrix_of(a.transform), matrix_of(b.transform)
    if a is b or a.time == time or np.array_equal(first, last):
        return first
    fraction = (time - a.time) / (b.time - a.time)

    # A motion without rotation needs no decomposition, and keeps its bits.
    if np.array_equal(first[:3, :3], last[:3, :3]):
        first[:3, 3] += fraction * (last[:3, 3] - first[:3, 3])
        return first
    return compose(interpolate_rows(_decomposed(a.transform), _decomposed(b.transform), fraction))


@functools.lru_cache(maxsize=64)
def _decomposed(transform: Transform) -> NDArray[np.float64]:
    """Decompose a keyframe's pose into a row (16,); each step of a trajectory asks for it."""
    row = decompose(matrix_of(transform))
    row.setflags(write=False)
    return row


class Static(NamedTuple):
    """An object at rest while the shutter is open: `matrix` (4, 4) is the pose."""

    matrix: Matrix


class Shift(NamedTuple):
    """A motion in a straight line at constant speed, by `shift` (3,) (m), from the pose `matrix` (4, 4) on."""

    matrix: Matrix
    shift: NDArray[np.float64]


class Moving(NamedTuple):
    """Any other motion: poses at equal steps of the shutter's time.

    trajectory : float64 (steps, 16), 2 to 129 steps; a row is scale (3), skew xy, xz, yz (3), shift (3), quaternion
        r, i, j, k (4), translation (3): the matrix translation . rotation . (scale and skew | shift).
    """

    trajectory: Rows


def resolve_motion(motion: Motion | None, transform: Matrix, shutter: Shutter) -> Static | Shift | Moving:
    """Resolve a motion, after the object's transform (4, 4), for the time in which the shutter is open.

    An object that does not move keeps the bits of its transform.

    Raises
    ------
    ValueError : a spin with more turns than the steps of a trajectory can tell apart.
    """
    if motion is None:
        return Static(transform)
    times = breakpoints([key.time for key in motion.keyframes or ()], shutter)
    poses = [matrix_at(motion, time) for time in times]
    first, last = poses[0], poses[-1]
    start = transform if np.array_equal(first, np.eye(4)) else first @ transform
    turns = motion.spin is not None and motion.spin.rate != 0.0 and shutter.close > shutter.open
    if not turns:
        if all(np.array_equal(pose, first) for pose in poses):
            return Static(start)
        if _is_straight(times, poses):
            return Shift(start, last[:3, 3] - first[:3, 3])
    if motion.keyframes is not None:
        return Moving(_keyframe_trajectory(motion.keyframes, times, transform))
    return Moving(_spin_trajectory(motion, transform, shutter))


def trajectory_of(placed: Static | Shift | Moving) -> Rows:
    """Convert what `resolve_motion` returns to a trajectory, float64 (steps, 16): of one step where nothing moves."""
    if isinstance(placed, Moving):
        return placed.trajectory
    start = decompose(placed.matrix)[None]
    if isinstance(placed, Static):
        return start
    end = start.copy()
    end[0, TRANSLATION] += placed.shift
    return np.concatenate([start, end])


def _is_straight(times: Sequence[float], poses: Sequence[Matrix]) -> bool:
    """Return True if the poses only differ by a translation that is proportional to time."""
    first, last = poses[0], poses[-1]
    way, duration = last[:3, 3] - first[:3, 3], times[-1] - times[0]
    rounding = 8.0 * np.finfo(np.float64).eps * max(np.abs(pose[:3, 3]).max() for pose in poses)
    return all(
        np.array_equal(pose[:3, :3], first[:3, :3])
        and np.abs(first[:3, 3] + (time - times[0]) / duration * way - pose[:3, 3]).max() <= rounding
        for time, pose in zip(times, poses, strict=True)
    )


def _spin_trajectory(motion: Motion, transform: Matrix, shutter: Shutter) -> Rows:
    """Make the trajectory of a spin about a moving centre: with A = Q U, T(c + v t) R(t) Q (U | Q^T (a - c))."""
    assert motion.spin is not None
    spin = motion.spin
    degrees = abs(spin.rate) * (shutter.close - shutter.open)
    most = (MAX_STEPS - 1) * _MAX_DEGREES_PER_SEGMENT
    if degrees >= most:
        raise ValueError(
            f"turns {degrees / 360.0:.4g} times while the shutter is open, and fewer than {most / 360.0:.4g} turns "
            "can be told apart: slow the spin, or shorten the shutter"
        )
    segments = max(1, min(MAX_STEPS - 1, math.ceil(degrees / _DEGREES_PER_SEGMENT)))
    rotation, triangle = orthogonal_triangular(transform[:3, :3])
    turned = quaternion_of(rotation)
    shift = rotation.T @ (transform[:3, 3] - spin.center)
    axis = np.array(spin.axis) / max(map(abs, spin.axis))
    axis /= np.linalg.norm(axis)
    velocity = np.array(motion.velocity or (0.0, 0.0, 0.0))
    rows = []
    for time in grid([shutter.open, shutter.close], segments):
        # Remove whole turns first, lest a late shutter loses digits.
        half = 0.5 * math.radians(math.fmod(spin.rate * time, 720.0))
        spun = np.array([math.cos(half), *(math.sin(half) * axis)])
        rows.append(make_row(spin.center + time * velocity, quaternion_product(spun, turned), triangle, shift))
    return continuous(rows)


def _keyframe_trajectory(keyframes: Sequence[Keyframe], times: Sequence[float], transform: Matrix) -> Rows:
    """Make the trajectory of keyframes, times an object's transform, on a uniform grid."""
    poses = [decompose(_keyframe_pose(keyframes, time)) for time in times]
    turn = max(degrees_between(a, b) for a, b in pairwise(poses))
    segments = uniform_segments(times)
    segments *= max(1, min((MAX_STEPS - 1) // segments, math.ceil(turn / _DEGREES_PER_SEGMENT)))
    unscaled = np.abs(np.array(poses)[:, :6] - [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).max() <= TRANSFORM_ROUNDING
    if np.array_equal(transform, np.eye(4)):
        return continuous(decompose(_keyframe_pose(keyframes, time)) for time in grid(times, segments))

    # A transform combines with rotations and translations: T R A = T (R Q) (U | Q^T a).
    if unscaled:
        rotation, triangle = orthogonal_triangular(transform[:3, :3])
        turned, shift = quaternion_of(rotation), rotation.T @ transform[:3, 3]
        rows = (decompose(_keyframe_pose(keyframes, time)) for time in grid(times, segments))
        return continuous(
            make_row(row[TRANSLATION], quaternion_product(row[QUATERNION], turned), triangle, shift) for row in rows
        )

    # A changing scale does not commute with it: approximate by as many steps as possible.
    segments *= (MAX_STEPS - 1) // segments
    return continuous(decompose(_keyframe_pose(keyframes, time) @ transform) for time in grid(times, segments))
