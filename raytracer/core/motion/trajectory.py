"""Motion: where an object or a camera is at which time of the scene, and how that is packed for a shutter.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], shutter: {open: 0, close: 1}}
    objects:
      - {type: sphere, center: [0, 1, 0], radius: 1, motion: {velocity: [0, 0.5, 0]}}
      - {type: box, min: [-1, 0, -0.1], max: [1, 0.2, 0.1], motion: {spin: {axis: [0, 0, 1], rate: 20 turn/s}}}
      - {type: sphere, center: [0, 0, 0], radius: 1,
         motion: {keyframes: [{time: 0, transform: []}, {time: 1, transform: [{translate: [2, 0, 0]}]}]}}

    camera: {type: pinhole, shutter: 1/8 s, shake: {amplitude: 0.1 deg, bandwidth: 10 Hz}}

A motion acts in world space, after the object's `transform`.  A spin turns counter-clockwise as seen from the tip of
its axis; its centre goes along with the velocity.  Keyframes are taken apart into translation, rotation and scale with
skew, and each is interpolated by itself, the rotation along the shorter arc: a turn by more than 180 degrees between
two keyframes needs keyframes between them, or a spin.  Before the first and after the last keyframe the pose is held.

References: Shoemake 1985, "Animating Rotation with Quaternion Curves", SIGGRAPH; Embree 4 API reference
(RTCQuaternionDecomposition).
"""

import functools
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.jit import kernel
from raytracer.shutter import Shutter
from raytracer.spec import (
    TRANSFORM_ROUNDING,
    Direction,
    Matrix,
    Point,
    Quantity,
    Spec,
    Time,
    Transform,
    Triple,
    Vector,
    at,
    matrix_of,
    rotation_matrix,
)
from raytracer.vec import dot, normalize

MOST_STEPS = 129
"""Time steps that Embree takes of a moving geometry."""

# Rotation is exact between two steps whatever their angle, but Embree bounds what is swept by boxes, and its float32
# angle is good to 2e-6 rad.  A step more costs 64 bytes.
_DEGREES_PER_SEGMENT = 15.0

# Beyond a half turn the shorter arc goes the other way; this leaves room for Embree's bounds.
_MOST_DEGREES_PER_SEGMENT = 120.0

_ON_GRID = 1e-6
"""How far from a step, in segments, the time of a keyframe may lie and still count as on it.

What moves is then misplaced by a millionth of its way between two steps, as far as by Embree's own angles (1.6e-6).
"""

# Columns of a row of a trajectory, in the order of RTCQuaternionDecomposition.
_SCALE, _SKEW, _SHIFT, _QUATERNION, _TRANSLATION = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 13), slice(13, 16)

Rows: TypeAlias = NDArray[np.float64]


# ---- What a scene writes

Velocity: TypeAlias = Annotated[Vector, Triple(Quantity("speed"), "a velocity")]
AngularRate: TypeAlias = Annotated[float, Quantity("rate")]


class Spin(Spec):
    """Rotation at a constant rate."""

    axis: Direction = Field(description="axis; its length does not matter")
    rate: AngularRate = Field(description="rate (deg/s), counter-clockwise as seen from the tip of the axis")
    center: Point = Field(
        default=(0.0, 0.0, 0.0), description="a point of the axis at time 0 (m); it moves with the velocity"
    )


class Keyframe(Spec):
    """A pose at a time."""

    time: Time = Field(description="time of the scene (s)")
    transform: Transform = Field(description="the pose: what happens to the object after its own transform")


class Motion(Spec):
    """How an object or a camera moves in world space: a velocity, a spin or both, or keyframes."""

    velocity: Velocity | None = Field(default=None, description="velocity (m/s)")
    spin: Spin | None = Field(default=None, description="rotation at a constant rate")
    keyframes: tuple[Keyframe, ...] | None = Field(
        default=None, description="at least two poses in the order of their times; they are held before and after"
    )

    @model_validator(mode="after")
    def _is_one_motion(self) -> "Motion":
        if self.keyframes is None:
            if self.velocity is None and self.spin is None:
                raise ValueError("needs a velocity, a spin or keyframes")
            return self
        if self.velocity is not None or self.spin is not None:
            at("keyframes", "keyframes are the whole motion: give either them, or a velocity and a spin")
        if len(self.keyframes) < 2:
            at("keyframes", "a motion needs at least two keyframes")
        for number, (before, after) in enumerate(pairwise(self.keyframes), start=1):
            if after.time <= before.time:
                at(
                    ("keyframes", number, "time"),
                    f"must be later than the keyframe before, {before.time:g} s, got {after.time:g} s",
                )
            if _is_mirrored(matrix_of(before.transform)) != _is_mirrored(matrix_of(after.transform)):
                at(
                    ("keyframes", number, "transform"),
                    "is a mirror image of the keyframe before, so the object would be flat somewhere between them",
                )
        return self


# ---- Matrices, taken apart


def _is_mirrored(matrix: Matrix) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)


def _quaternion(rotation: Matrix) -> NDArray[np.float64]:
    """The unit quaternion (r, i, j, k) of a rotation matrix (3, 3).

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


def _product(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The quaternion of the rotation q followed by p."""
    real = p[0] * q[0] - np.dot(p[1:], q[1:])
    return np.array([real, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def _orthogonal_triangular(linear: Matrix) -> tuple[Matrix, Matrix]:
    """A rotation and an upper triangular matrix with this product (3, 3); the last diagonal entry has its sign."""
    rotation, triangle = np.linalg.qr(linear)
    signs = np.where(np.diag(triangle) < 0.0, -1.0, 1.0)
    rotation, triangle = rotation * signs, signs[:, None] * triangle
    if np.linalg.det(rotation) < 0.0:
        rotation[:, 2], triangle[2] = -rotation[:, 2], -triangle[2]
    return rotation, triangle


def _row(
    translation: Any, quaternion: NDArray[np.float64], triangle: Matrix, shift: Any = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """The row of a trajectory that is the matrix translation . rotation . (triangle | shift)."""
    skew = triangle[[0, 0, 1], [1, 2, 2]]
    return np.concatenate([np.diag(triangle), skew, shift, quaternion, translation])


def decompose(matrix: Matrix) -> NDArray[np.float64]:
    """The row (16,) of an affine matrix (4, 4): scale, skew, shift, quaternion, translation."""
    rotation, triangle = _orthogonal_triangular(matrix[:3, :3])
    return _row(matrix[:3, 3], _quaternion(rotation), triangle)


def compose(row: NDArray[np.float64]) -> Matrix:
    """The affine matrix (4, 4) of a row of a trajectory."""
    r, (i, j, k) = row[_QUATERNION][0], row[_QUATERNION][1:]
    rotation = np.array(
        [
            [1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - r * k), 2.0 * (i * k + r * j)],
            [2.0 * (i * j + r * k), 1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - r * i)],
            [2.0 * (i * k - r * j), 2.0 * (j * k + r * i), 1.0 - 2.0 * (i * i + j * j)],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = rotation @ _triangle(row)
    result[:3, 3] = rotation @ row[_SHIFT] + row[_TRANSLATION]
    return result


def _between(row: NDArray[np.float64], other: NDArray[np.float64], fraction: float) -> NDArray[np.float64]:
    """The row at a fraction of the way from one to another."""
    result = row + fraction * (other - row)
    p, q = row[_QUATERNION], other[_QUATERNION]
    if np.dot(p, q) < 0.0:
        q = -q
    angle = 2.0 * math.atan2(float(np.linalg.norm(q - p)), float(np.linalg.norm(q + p)))
    if angle > 0.0:
        p = (math.sin((1.0 - fraction) * angle) * p + math.sin(fraction * angle) * q) / math.sin(angle)
    result[_QUATERNION] = p
    return result


# ---- Poses at a time


def matrix_at(motion: Motion, time: float) -> Matrix:
    """The pose at a time of the scene (s): float64 (4, 4), for column vectors, in world space."""
    if motion.keyframes is not None:
        return _keyed(motion.keyframes, time)
    result = np.eye(4)
    if motion.spin is not None:
        spin = motion.spin
        result[:3, :3] = rotation_matrix(spin.axis, spin.rate * time)
        result[:3, 3] = np.subtract(spin.center, result[:3, :3] @ spin.center)
    if motion.velocity is not None:
        result[:3, 3] += np.multiply(time, motion.velocity)
    return result


def _keyed(keyframes: Sequence[Keyframe], time: float) -> Matrix:
    """The pose between two keyframes, or of the first or the last of all."""
    after = next((number for number, key in enumerate(keyframes) if key.time > time), len(keyframes))
    a, b = keyframes[max(after - 1, 0)], keyframes[min(after, len(keyframes) - 1)]
    first, last = matrix_of(a.transform), matrix_of(b.transform)
    if a is b or a.time == time or np.array_equal(first, last):
        return first
    fraction = (time - a.time) / (b.time - a.time)

    # What does not turn needs not be taken apart, and keeps its bits.
    if np.array_equal(first[:3, :3], last[:3, :3]):
        first[:3, 3] += fraction * (last[:3, 3] - first[:3, 3])
        return first
    return compose(_between(_decomposed(a.transform), _decomposed(b.transform), fraction))


@functools.lru_cache(maxsize=64)
def _decomposed(transform: Transform) -> NDArray[np.float64]:
    """The row (16,) of a keyframe's pose, which each step of a trajectory asks for."""
    row = decompose(matrix_of(transform))
    row.setflags(write=False)
    return row


class Static(NamedTuple):
    """Nothing moves while the shutter is open: `matrix` (4, 4) is the pose."""

    matrix: Matrix


class Shift(NamedTuple):
    """Moved in a straight line at a constant speed, by `shift` (3,) (m), from the pose `matrix` (4, 4) on."""

    matrix: Matrix
    shift: NDArray[np.float64]


class Moving(NamedTuple):
    """Any other motion: poses at equal steps of the shutter's time.

    trajectory : float64 (steps, 16), 2 to 129 steps; a row is scale (3), skew xy, xz, yz (3), shift (3), quaternion
        r, i, j, k (4), translation (3): the matrix translation . rotation . (scale and skew | shift).
    """

    trajectory: Rows


def place(motion: Motion | None, transform: Matrix, shutter: Shutter) -> Static | Shift | Moving:
    """What becomes of an object with this motion and transform (4, 4) while the shutter is open.

    Where the motion leaves the object where it is, the transform is handed back with its bits.

    Raises
    ------
    ValueError : a spin with more turns than the steps of a trajectory can tell apart.
    """
    if motion is None:
        return Static(transform)
    times = _breakpoints(motion, shutter)
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
        return Moving(_keyed_trajectory(motion.keyframes, times, transform))
    return Moving(_spun_trajectory(motion, transform, shutter))


def trajectory_of(placed: Static | Shift | Moving) -> Rows:
    """What `place` found as a trajectory, float64 (steps, 16): of one step where nothing moves."""
    if isinstance(placed, Moving):
        return placed.trajectory
    start = decompose(placed.matrix)[None]
    if isinstance(placed, Static):
        return start
    end = start.copy()
    end[0, _TRANSLATION] += placed.shift
    return np.concatenate([start, end])


def composed(outer: Rows, inner: Rows, most: int = MOST_STEPS) -> Rows:
    """The trajectory (steps, 16) of what has the pose outer(t) . inner(t), for trajectories of 1 to `most` steps.

    It is exact where one of the two stands still and the other turns without changing its scale, or the outer is a
    similarity at rest; else it has as many steps as there may be, each of them exact.
    """
    exact = min(len(outer), len(inner)) == 1 and (_is_scaled_alike(outer) if len(inner) == 1 else _is_similar(outer[0]))
    steps = max(len(outer), len(inner)) if exact else most
    rows = []
    for fraction in np.linspace(0.0, 1.0, steps):
        a, b = row_at(outer, float(fraction)), row_at(inner, float(fraction))
        matrix = compose(a)
        product = matrix @ compose(b)
        row = decompose(product)

        # What moves evenly is told apart from what turns about it.
        center = matrix[:3, :3] @ b[_TRANSLATION] + matrix[:3, 3] if len(outer) == 1 else a[_TRANSLATION]
        turn = compose(_row(np.zeros(3), row[_QUATERNION], np.eye(3)))[:3, :3]
        row[_SHIFT] = turn.T @ (product[:3, 3] - center)
        row[_TRANSLATION] = center
        rows.append(row)
    return _continuous(rows)


def shifted(rows: Rows, before: Vector, after: Vector) -> Rows:
    """The trajectory (steps, 16) of what is displaced by `before` (m), then goes along one, and then by `after`."""
    result = rows.copy()
    for row in result:
        row[_SHIFT] += _triangle(row) @ before
        row[_TRANSLATION] += after
    return result


def conjugated(rows: Rows, by: Vector) -> Rows:
    """The trajectory (steps, 16) of the same motion in a world that is moved by a vector (m)."""
    x, y, z = by
    return shifted(rows, (-x, -y, -z), by)


def steadied(rows: Rows, turn: float) -> Rows:
    """The trajectory (steps, 16) of what turns about a point far away, as displacements of what turns in its place.

    A pose T R (U | s) is T + R s with R (U | 0), so that the arm s, by which an error of R is multiplied, is gone.
    What lies between two steps goes straight then and not in an arc of the angle a: by up to s a^2 / 8 beside it, so
    steps are added.  The trajectory is left as it is if that is not better.

    Parameters
    ----------
    turn : by how much rotations may be wrong (rad).
    """
    angle = max((math.radians(_degrees_between(a, b)) for a, b in pairwise(rows)), default=0.0)
    segments = max(1, len(rows) - 1)
    finer = (MOST_STEPS - 1) // segments if angle > 0.0 else 1
    if (angle / finer) ** 2 / 8.0 > turn:
        return rows
    steps = finer * (len(rows) - 1) + 1
    result = []
    for fraction in np.linspace(0.0, 1.0, steps):
        row = row_at(rows, float(fraction))
        rotation = compose(_row(np.zeros(3), row[_QUATERNION], np.eye(3)))[:3, :3]
        row[_TRANSLATION] += rotation @ row[_SHIFT]
        row[_SHIFT] = 0.0
        result.append(row)
    return _continuous(result)


def arm_of(rows: Rows) -> float:
    """The largest distance (m) from the centre of a trajectory's rotation at which what it moves has its origin."""
    return float(np.linalg.norm(rows[:, _SHIFT], axis=1).max())


def _triangle(row: NDArray[np.float64]) -> Matrix:
    """The scale and skew of a row of a trajectory as an upper triangular matrix (3, 3)."""
    triangle = np.diag(row[_SCALE])
    triangle[[0, 0, 1], [1, 2, 2]] = row[_SKEW]
    return triangle


def rotations_about(center: Vector, quaternions: NDArray[np.float64]) -> Rows:
    """The trajectory (steps, 16) of rotations about a point (m), by their unit quaternions (steps, 4)."""
    back = -np.asarray(center, np.float64)
    return _continuous(_row(center, quaternion, np.eye(3), back) for quaternion in quaternions)


def _is_similar(row: NDArray[np.float64]) -> bool:
    """Whether a pose scales by the same factor along all axes, but for a mirror image, and does not skew."""
    size = abs(row[0])
    off = max(np.abs(np.abs(row[_SCALE]) - size).max(), np.abs(row[_SKEW]).max())
    return bool(off <= TRANSFORM_ROUNDING * size)


def _is_scaled_alike(rows: Rows) -> bool:
    """Whether all poses of a trajectory scale and skew by the same."""
    first = rows[0, :6]
    return bool(np.abs(rows[:, :6] - first).max() <= TRANSFORM_ROUNDING * np.abs(first).max())


def row_at(rows: Rows, fraction: float) -> NDArray[np.float64]:
    """The row of a trajectory at a fraction of the shutter's time."""
    segments = len(rows) - 1
    here = min(int(fraction * segments), segments)
    return _between(rows[here], rows[min(here + 1, segments)], fraction * segments - here)


def _breakpoints(motion: Motion, shutter: Shutter) -> list[float]:
    return breakpoints([key.time for key in motion.keyframes or ()], shutter)


def breakpoints(times: Iterable[float], shutter: Shutter) -> list[float]:
    """The shutter's opening and closing, and the times between: what happens between two of these is one law."""
    inner = [time for time in times if shutter.open < time < shutter.close]
    return [shutter.open, *inner, *([shutter.close] if shutter.close > shutter.open else [])]


def uniform_grid(times: Iterable[float], shutter: Shutter) -> list[float]:
    """Equal steps from the shutter's opening to its closing, such that the times between fall on them.

    At most 129, which then may fall beside; one for a shutter that is open for no time.
    """
    found = breakpoints(times, shutter)
    return _grid(found, uniform_segments(found)) if len(found) > 1 else found


def _is_straight(times: Sequence[float], poses: Sequence[Matrix]) -> bool:
    """Whether the poses only differ by a translation that is proportional to time."""
    first, last = poses[0], poses[-1]
    way, duration = last[:3, 3] - first[:3, 3], times[-1] - times[0]
    rounding = 8.0 * np.finfo(np.float64).eps * max(np.abs(pose[:3, 3]).max() for pose in poses)
    return all(
        np.array_equal(pose[:3, :3], first[:3, :3])
        and np.abs(first[:3, 3] + (time - times[0]) / duration * way - pose[:3, 3]).max() <= rounding
        for time, pose in zip(times, poses, strict=True)
    )


def uniform_segments(times: Sequence[float]) -> int:
    """The least number of equal segments of [times[0], times[-1]] that end at each of the sorted times.

    At most 128; that many if there is no such number.
    """
    fractions = (np.asarray(times) - times[0]) / (times[-1] - times[0])
    for segments in range(1, MOST_STEPS):
        steps = segments * fractions
        if np.abs(steps - np.round(steps)).max() <= _ON_GRID:
            return segments
    return MOST_STEPS - 1


def _grid(times: Sequence[float], segments: int) -> list[float]:
    """Equal steps from the first time to the last, those that are one of the times to the bit."""
    grid = np.linspace(times[0], times[-1], segments + 1)
    width = (times[-1] - times[0]) / segments
    for time in times:
        nearest = int(np.argmin(np.abs(grid - time)))
        if abs(grid[nearest] - time) <= _ON_GRID * width:
            grid[nearest] = time
    return [float(time) for time in grid]


def _spun_trajectory(motion: Motion, transform: Matrix, shutter: Shutter) -> Rows:
    """A spin about a centre that moves: with the object's transform A = Q U, T(c + v t) R(t) Q (U | Q^T (a - c))."""
    assert motion.spin is not None
    spin = motion.spin
    degrees = abs(spin.rate) * (shutter.close - shutter.open)
    most = (MOST_STEPS - 1) * _MOST_DEGREES_PER_SEGMENT
    if degrees >= most:
        raise ValueError(
            f"turns {degrees / 360.0:.4g} times while the shutter is open, and fewer than {most / 360.0:.4g} turns "
            "can be told apart: slow the spin, or shorten the shutter"
        )
    segments = max(1, min(MOST_STEPS - 1, math.ceil(degrees / _DEGREES_PER_SEGMENT)))
    rotation, triangle = _orthogonal_triangular(transform[:3, :3])
    turned = _quaternion(rotation)
    shift = rotation.T @ (transform[:3, 3] - spin.center)
    axis = np.array(spin.axis) / max(map(abs, spin.axis))
    axis /= np.linalg.norm(axis)
    velocity = np.array(motion.velocity or (0.0, 0.0, 0.0))
    rows = []
    for time in _grid([shutter.open, shutter.close], segments):
        # Whole turns first, lest a late shutter loses digits.
        half = 0.5 * math.radians(math.fmod(spin.rate * time, 720.0))
        spun = np.array([math.cos(half), *(math.sin(half) * axis)])
        rows.append(_row(spin.center + time * velocity, _product(spun, turned), triangle, shift))
    return _continuous(rows)


def _keyed_trajectory(keyframes: Sequence[Keyframe], times: Sequence[float], transform: Matrix) -> Rows:
    """The poses of keyframes, times an object's transform, on a uniform grid."""
    poses = [decompose(_keyed(keyframes, time)) for time in times]
    turn = max(_degrees_between(a, b) for a, b in pairwise(poses))
    segments = uniform_segments(times)
    segments *= max(1, min((MOST_STEPS - 1) // segments, math.ceil(turn / _DEGREES_PER_SEGMENT)))
    unscaled = np.abs(np.array(poses)[:, :6] - [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).max() <= TRANSFORM_ROUNDING
    if np.array_equal(transform, np.eye(4)):
        return _continuous(decompose(_keyed(keyframes, time)) for time in _grid(times, segments))

    # Between rotations and translations a transform fits: T R A = T (R Q) (U | Q^T a).
    if unscaled:
        rotation, triangle = _orthogonal_triangular(transform[:3, :3])
        turned, shift = _quaternion(rotation), rotation.T @ transform[:3, 3]
        rows = (decompose(_keyed(keyframes, time)) for time in _grid(times, segments))
        return _continuous(_row(row[_TRANSLATION], _product(row[_QUATERNION], turned), triangle, shift) for row in rows)

    # A scale that changes does not commute with it: as many steps as there may be come close.
    segments *= (MOST_STEPS - 1) // segments
    return _continuous(decompose(_keyed(keyframes, time) @ transform) for time in _grid(times, segments))


def _degrees_between(row: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    cosine = abs(float(np.dot(row[_QUATERNION], other[_QUATERNION])))
    return 2.0 * math.degrees(math.acos(min(1.0, cosine)))


def _continuous(rows: Iterable[NDArray[np.float64]]) -> Rows:
    """Rows as a trajectory: each quaternion with the sign that is nearer to the one before."""
    result = np.ascontiguousarray(np.stack(list(rows)), np.float64)
    for before, after in pairwise(result):
        if np.dot(before[_QUATERNION], after[_QUATERNION]) < 0.0:
            after[_QUATERNION] *= -1.0
    return result


# ---- For kernels


class Trajectories(NamedTuple):
    """Packed: first (n + 1,) int32, the row at which each trajectory starts and the last ends; rows (m, 16) float64."""

    first: NDArray[np.int32]
    rows: NDArray[np.float64]


def pack_trajectories(trajectories: Sequence[Rows]) -> Trajectories:
    """Trajectories in one table; one of a single step is a pose that is held."""
    first = np.cumsum([0] + [len(rows) for rows in trajectories]).astype(np.int32)
    return Trajectories(first, np.ascontiguousarray(np.concatenate(trajectories), np.float64))


@kernel
def _lerp(a, b, fraction):
    """Exactly `a` where the two are equal."""
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
    """The rotation between two unit quaternions, along the shorter arc, at constant speed.

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
    """The row at a fraction of the way from one to another, both tuples of 16."""
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
    """Three rows of four numbers, (linear | translation), of a row of a trajectory."""
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
    """The segment of a uniform grid over [0, 1] in which a time lies, and how far in; times outside are clamped."""
    steps = max(0.0, min(1.0, time)) * segments
    segment = min(int(steps), segments - 1)
    return segment, steps - segment


@kernel
def pose_at(trajectories, index, time):
    """The pose of trajectory `index` at a fraction of the shutter's time: three rows (linear | translation).

    Outside [0, 1] the pose is that of the nearer end; Embree would extrapolate.
    """
    first = trajectories.first[index]
    segments = trajectories.first[index + 1] - 1 - first
    if segments == 0:
        return _affine_of(_row_of(trajectories.rows, first))
    segment, fraction = segment_of(time, segments)
    row = _row_of(trajectories.rows, first + segment)
    return _affine_of(_blend(row, _row_of(trajectories.rows, first + segment + 1), fraction))


@kernel
def apply_point(affine, p):
    """A point moved by an affine map (three rows of four)."""
    a, b, c = affine
    return (
        a[0] * p[0] + a[1] * p[1] + a[2] * p[2] + a[3],
        b[0] * p[0] + b[1] * p[1] + b[2] * p[2] + b[3],
        c[0] * p[0] + c[1] * p[1] + c[2] * p[2] + c[3],
    )


@kernel
def apply_vector(affine, v):
    """A difference of points."""
    a, b, c = affine
    return (
        a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
        b[0] * v[0] + b[1] * v[1] + b[2] * v[2],
        c[0] * v[0] + c[1] * v[1] + c[2] * v[2],
    )


@kernel
def apply_normal(inverse, n):
    """A unit normal moved by the map whose inverse is given: it goes by the inverse transpose.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 3.10.3.
    """
    a, b, c = inverse
    return normalize(
        (
            a[0] * n[0] + b[0] * n[1] + c[0] * n[2],
            a[1] * n[0] + b[1] * n[1] + c[1] * n[2],
            a[2] * n[0] + b[2] * n[1] + c[2] * n[2],
        )
    )


@kernel
def invert(affine):
    """The inverse of an affine map, by cofactors."""
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
