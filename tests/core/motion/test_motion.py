"""Motions against their formulas: poses, what becomes of them in a shutter, and the poses that kernels see."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.motion.interpolation import (
    apply_normal,
    apply_point,
    apply_vector,
    invert,
    pack_trajectories,
    pose_at,
)
from raytracer.core.motion.resolve import Moving, Shift, Static, matrix_at, resolve_motion, trajectory_of
from raytracer.core.motion.spec import Motion
from raytracer.core.motion.trajectory import MAX_STEPS, compose, decompose, uniform_grid
from raytracer.core.shutter.table import Shutter
from raytracer.schema.transform import Rotate, Step, matrix_of
from tests.core.motion.kernels import poses
from tests.vectorised import rows, vectorised

EYE = np.eye(4)


def motion(**keys):
    return Motion.model_validate(keys)


def keyed(*poses):
    return motion(keyframes=[{"time": time, "transform": steps} for time, steps in poses])


def rotation(axis, degrees):
    """Rodrigues' formula, as transforms have it."""
    return Step(rotate=Rotate(axis=tuple(axis), angle=degrees)).matrix()


def translation(*shift):
    result = np.eye(4)
    result[:3, 3] = shift
    return result


def random_affine(seed):
    result = np.eye(4)
    result[:3] = np.random.default_rng(seed).normal(size=(3, 4))
    return result


@pytest.mark.parametrize("seed", range(20))
def test_a_matrix_is_the_product_of_its_parts(seed):
    matrix = random_affine(seed)
    row = decompose(matrix)
    np.testing.assert_allclose(compose(row), matrix, atol=1e-14)
    assert row[9:13] @ row[9:13] == pytest.approx(1.0, abs=1e-15)
    assert np.sign(row[:3].prod()) == np.sign(np.linalg.det(matrix[:3, :3]))


def test_identity_is_taken_apart_to_the_bit():
    np.testing.assert_array_equal(decompose(EYE), [1, 1, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("degrees", [0.0, 90.0, 120.0, 179.0, 180.0, 181.0, 270.0, 359.0])
@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -2, 0.5]])
def test_every_rotation_has_a_quaternion(axis, degrees):
    matrix = rotation(axis, degrees)
    np.testing.assert_allclose(compose(decompose(matrix)), matrix, atol=1e-14)


def test_velocity_and_spin_are_their_formula():
    """x(t) = c + v t + R(w t) (x - c)."""
    center, velocity = np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.2, -1.0])
    moving = motion(velocity=velocity.tolist(), spin={"axis": [1, 1, 0], "rate": "40 deg/s", "center": center.tolist()})
    for time in (-1.0, 0.0, 0.7, 5.0):
        expected = translation(*(center + time * velocity)) @ rotation([1, 1, 0], 40 * time) @ translation(*-center)
        np.testing.assert_allclose(matrix_at(moving, time), expected, atol=1e-14)


def test_poses_are_held_before_and_after_the_keyframes():
    moving = keyed((1.0, [{"translate": [1, 0, 0]}]), (2.0, [{"scale": 2}, {"translate": [3, 1, 0]}]))
    first, last = (matrix_of(key.transform) for key in moving.keyframes or ())
    for time, expected in ((-1.0, first), (1.0, first), (2.0, last), (9.0, last)):
        np.testing.assert_array_equal(matrix_at(moving, time), expected)


def test_keyframes_turn_at_a_constant_rate_and_scale_and_go_in_proportion():
    steps = [{"scale": 3}, {"rotate": {"axis": [0, 2, 0], "angle": 90}}, {"translate": [4, 0, 2]}]
    moving = keyed((0.0, []), (2.0, steps))
    for fraction in (0.25, 0.5, 0.8):
        expected = translation(4 * fraction, 0, 2 * fraction) @ rotation([0, 1, 0], 90 * fraction)
        expected[:3, :3] *= 1 + 2 * fraction
        np.testing.assert_allclose(matrix_at(moving, 2 * fraction), expected, atol=1e-14)


def test_keyframes_turn_along_the_shorter_arc():
    moving = keyed((0.0, []), (1.0, [{"rotate": {"axis": [0, 0, 1], "angle": 270}}]))
    np.testing.assert_allclose(matrix_at(moving, 0.5), rotation([0, 0, 1], -45), atol=1e-14)


# ---- What becomes of a motion in a shutter

TURNED, MIRRORED = random_affine(3), random_affine(4)


def test_a_pose_that_is_held_is_baked():
    moving = keyed((0.0, [{"translate": [1, 0, 0]}]), (1.0, [{"rotate": {"axis": [0, 0, 1], "angle": 90}}]))
    placed = resolve_motion(moving, TURNED, Shutter(1.0, 2.0))
    assert isinstance(placed, Static)
    np.testing.assert_array_equal(placed.matrix, rotation([0, 0, 1], 90) @ TURNED)


def test_a_velocity_is_a_shift_from_where_the_shutter_opens():
    placed = resolve_motion(motion(velocity=[1, 2, 3]), TURNED, Shutter(2.0, 2.5))
    assert isinstance(placed, Shift)
    np.testing.assert_array_equal(placed.matrix, translation(2, 4, 6) @ TURNED)
    np.testing.assert_allclose(placed.shift, [0.5, 1.0, 1.5], rtol=1e-15)


def test_keyframes_on_a_line_at_one_speed_are_a_shift():
    steady = keyed(*((time, [{"translate": [time, 0.5 * time, 0]}]) for time in (0.0, 0.3, 0.7, 1.0)))
    assert isinstance(resolve_motion(steady, TURNED, Shutter(0.1, 0.9)), Shift)
    halting = keyed(*((time, [{"translate": [where, 0, 0]}]) for time, where in ((0.0, 0.0), (0.5, 0.1), (1.0, 1.0))))
    assert isinstance(resolve_motion(halting, TURNED, Shutter(0.0, 1.0)), Moving)
    assert isinstance(resolve_motion(halting, TURNED, Shutter(0.6, 1.0)), Shift)


SPIN = motion(velocity=[0.3, 0.2, -1.0], spin={"axis": [1, 1, 0], "rate": "1 turn/s", "center": [1, -2, 0.5]})
TUMBLE = keyed(
    (0.0, []),
    (0.25, [{"rotate": {"axis": [0, 1, 0], "angle": 100}}, {"translate": [1, 0, 0]}]),
    (1.0, [{"rotate": {"axis": [1, 0, 0], "angle": 60}}, {"translate": [0, 2, 0]}]),
)
GROW = keyed((0.0, [{"scale": [1, 2, 3]}]), (0.5, [{"rotate": {"axis": [1, 2, 0], "angle": 60}}, {"scale": 2}]))
SHUTTER = Shutter(0.0, 1.25)


@pytest.mark.parametrize("transform", [EYE, TURNED, MIRRORED], ids=["plain", "turned", "mirrored"])
@pytest.mark.parametrize("moving", [SPIN, TUMBLE], ids=["spin", "keyframes"])
def test_kernels_see_the_pose_times_the_transform(moving, transform):
    """At any time, not only at the steps: with a transform that scales and skews, too."""
    placed = resolve_motion(moving, transform, SHUTTER)
    assert isinstance(placed, Moving)
    assert 2 <= len(placed.trajectory) <= MAX_STEPS
    times = np.random.default_rng(1).random(40)
    expected = [(matrix_at(moving, 1.25 * time) @ transform)[:3] for time in times]
    np.testing.assert_allclose(poses(placed.trajectory, times), expected, atol=1e-13)


def test_poses_of_a_changing_scale_come_close_to_their_product_with_a_transform():
    placed = resolve_motion(GROW, TURNED, Shutter(0.0, 0.5))
    assert isinstance(placed, Moving)
    times = np.linspace(0, 1, 57)
    expected = [(matrix_at(GROW, 0.5 * time) @ TURNED)[:3] for time in times]
    np.testing.assert_allclose(poses(placed.trajectory, times), expected, atol=2e-4)
    exact = resolve_motion(GROW, EYE, Shutter(0.0, 0.5))
    np.testing.assert_allclose(
        poses(trajectory_of(exact), times), [matrix_at(GROW, 0.5 * time)[:3] for time in times], atol=1e-13
    )


@pytest.mark.parametrize("turns", [42.6, 42.7, 1000.0])
def test_more_turns_than_steps_can_tell_apart_are_refused(turns):
    spinning = motion(spin={"axis": [0, 0, 1], "rate": f"{turns} turn/s"})
    if turns < 128 / 3:
        placed = resolve_motion(spinning, EYE, Shutter(0.0, 1.0))
        angle = 2 * math.pi * turns * 0.123
        pose = poses(trajectory_of(placed), 0.123)[0]
        np.testing.assert_allclose(pose[:2, 0], [math.cos(angle), math.sin(angle)], atol=1e-11)
    else:
        with pytest.raises(ValueError, match=rf"turns {turns:.4g} times .* fewer than 42.67 turns"):
            resolve_motion(spinning, EYE, Shutter(0.0, 1.0))


def test_a_spin_late_in_the_scene_is_as_exact_as_an_early_one():
    spinning = motion(spin={"axis": [0, 0, 1], "rate": "20 turn/s"})
    placed = resolve_motion(spinning, EYE, Shutter(1000.0, 1000.0 + 1 / 64))
    matrix = poses(trajectory_of(placed), 0.0)[0]
    np.testing.assert_allclose(matrix[:, :3], np.eye(3), atol=1e-11)


@pytest.mark.parametrize("rate", [1e-30, 1e-20, 1e20, 1e30])
@pytest.mark.parametrize("time", [1e-30, 1e-20, 1e20, 1e30])
def test_a_spin_of_any_rate_is_a_rotation_at_any_time(rate, time):
    matrix = matrix_at(motion(spin={"axis": [3, -1, 2], "rate": rate}), time)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), rtol=0.0, atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


def test_outside_the_shutter_the_pose_is_that_of_its_nearer_end():
    placed = resolve_motion(SPIN, EYE, SHUTTER)
    matrices = poses(trajectory_of(placed), [-3.0, 0.0, 1.0, 1.5, -math.inf, math.inf])
    np.testing.assert_array_equal(matrices[:2], matrices[[1, 4]])
    np.testing.assert_array_equal(matrices[[2, 5]], matrices[[3, 3]])
    # What is no time has a pose, too: no row outside of the trajectory is read.
    assert np.isfinite(poses(trajectory_of(placed), math.nan)).all()


def test_trajectories_in_a_table_are_the_same_as_alone():
    rows = [trajectory_of(resolve_motion(moving, TURNED, SHUTTER)) for moving in (SPIN, None, TUMBLE)]
    table = pack_trajectories(rows)
    times = np.linspace(0, 1, 9)
    for index, alone in enumerate(rows):
        np.testing.assert_array_equal(poses(table, times, index), poses(alone, times))


@kernel
def _applied(trajectories, time, vector):
    pose = pose_at(trajectories, 0, time)
    inverse = invert(pose)
    back = apply_point(inverse, apply_point(pose, vector))
    return apply_point(pose, vector), apply_vector(pose, vector), apply_normal(inverse, vector), back


def test_normals_stay_perpendicular_and_inverses_lead_back():
    path = trajectory_of(resolve_motion(TUMBLE, TURNED, SHUTTER))
    vector = np.array([0.3, -0.5, 0.8])
    along = np.cross(vector, [1.0, 0.2, 0.0])
    matrix = poses(path, 0.31)[0]
    applied = vectorised(_applied)(pack_trajectories([path]), 0.31, rows([vector]))
    point, difference, normal, back = (values[0] for values in applied)
    np.testing.assert_allclose(point, matrix[:, :3] @ vector + matrix[:, 3], atol=1e-14)
    np.testing.assert_allclose(difference, matrix[:, :3] @ vector, atol=1e-14)
    assert normal @ (matrix[:, :3] @ along) == pytest.approx(0.0, abs=1e-14)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(back, vector, atol=1e-13)


@pytest.mark.parametrize(
    ("times", "steps"),
    [([0.0, 1.0], 2), ([0.25], 5), ([0.5, 1 / 3], 7), ([1 / 24, 5 / 24], 25), ([1 / math.pi], 129), ([-3.0, 7.0], 2)],
)
def test_steps_fall_on_the_keyframes(times, steps):
    grid = uniform_grid(sorted(times), Shutter(0.0, 1.0))
    assert len(grid) == steps
    assert steps == MAX_STEPS or {time for time in times if 0 <= time <= 1} <= set(grid)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "needs a velocity, a spin or keyframes"),
        ({"velocity": [1, 2]}, "a velocity of three numbers"),
        ({"velocity": ["1 s", 0, 0]}, "'s' is a unit of time"),
        ({"spin": {"axis": [0, 0, 0], "rate": 1}}, "zero vector"),
        ({"spin": {"axis": [0, 0, 1], "rate": "3 turns"}}, "known units: deg/s"),
        ({"keyframes": [{"time": 0, "transform": []}]}, "at least two keyframes"),
    ],
)
def test_what_is_no_motion_is_named(keys, words):
    with pytest.raises(ValidationError) as caught:
        Motion.model_validate(keys)
    assert words in str(caught.value)
