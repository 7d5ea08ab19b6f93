"""The fields that kinds are built of: ranges, triples, and transforms against their textbook matrices."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from raytracer.plugins.shapes.base.interface import ObjectSpec
from raytracer.schema.fields import Albedo, Direction, Length, Point, PositiveLength, PositiveLengthOrInf, Radiance
from raytracer.schema.spec import field_error
from raytracer.schema.transform import Transform, matrix_of
from raytracer.schema.validation_errors import error_sentence
from raytracer.util import srgb

ANGLES = st.floats(-720.0, 720.0).filter(lambda angle: angle == 0.0 or abs(angle) >= 1e-30)
COMPONENTS = st.floats(-1e3, 1e3)


def checked(field, value):
    return TypeAdapter(field).validate_python(value)


def complaint(field, value):
    with pytest.raises(ValidationError) as caught:
        checked(field, value)
    first = caught.value.errors()[0]
    return first["loc"], error_sentence(first)


def transform(*steps):
    return matrix_of(checked(Transform, list(steps)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_numbers_are_0_or_within_sixty_decades(sign):
    for number in (1e-30, 1.0, 1e30):
        assert checked(Length, sign * number) == sign * number
        assert checked(Point, [0, sign * number, 0]) == (0.0, sign * number, 0.0)
    assert checked(Length, -0.0) == 0.0
    words = "must be 0, or of a magnitude between 1e-30 and 1e+30"
    for number in (5e-324, 9e-31, 2e30, 1e300):
        assert words in complaint(Length, sign * number)[1]
        assert words in complaint(Point, [sign * number, 0, 0])[1]
    # In base units, whatever it is written in.
    assert checked(Length, "1e32 mm") == pytest.approx(1e29)
    assert words in complaint(Length, "1e-25 nm")[1]


def test_zeros_that_rounding_left_are_taken_next_to_larger_numbers():
    # cos(90 deg) is 6e-17 in float64, and its square 4e-33.
    residue = math.cos(math.radians(90.0)) ** 2
    assert 0.0 < residue < 1e-30
    assert checked(Point, [residue, 1, 0]) == (residue, 1.0, 0.0)
    assert checked(Direction, [0, -residue, 1]) == (0.0, -residue, 1.0)
    turned = [[1, residue, 0, 0], [0, 1, 0, residue], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert np.array_equal(matrix_of(checked(Transform, turned)), np.array(turned))
    # But not where each number counts for itself.
    assert complaint(Transform, [{"scale": [1, residue, 1]}])[0] == (0, "scale", 1)
    assert "flattens" in complaint(Transform, [[residue, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])[1]


def test_triples():
    assert checked(PositiveLengthOrInf, "inf") == math.inf
    assert checked(Point, [1, "20 mm", 3.0]) == (1.0, 0.02, 3.0)
    assert checked(Radiance, 2) == (2.0, 2.0, 2.0)
    assert checked(Albedo, [0, 0.5, 1]) == (0.0, 0.5, 1.0)


@pytest.mark.parametrize(
    ("field", "value", "place", "words"),
    [
        (Point, [1, 2], (), "three numbers, got a list of 2"),
        (Point, "abc", (), "three numbers, got 'abc'"),
        (Point, [0, math.nan, 0], (1,), "nan"),
        (Direction, [0, -0.0, 0], (), "zero vector"),
        (Albedo, [0.5, 0.5, 1.01], (2,), "must be at most 1, got 1.01"),
        (Albedo, -0.1, (), "must be at least 0"),
        (
            Albedo,
            [1, 1],
            (),
            "an albedo of three numbers (or one for all three, or '#rrggbb' in sRGB), got a list of 2",
        ),
        (Radiance, [1, True, 1], (1,), "got true"),
    ],
)
def test_wrong_triple_is_told_by_component(field, value, place, words):
    found, message = complaint(field, value)
    assert found == place
    assert words in message


@pytest.mark.parametrize("field", [Albedo, Radiance])
def test_colours_of_html_are_srgb(field):
    # IEC 61966-2-1: half of the encoded range is a fifth of the light.
    assert checked(field, "#ffffff") == checked(field, "#fff") == (1.0, 1.0, 1.0)
    assert checked(field, "#bc0a00") == pytest.approx((0.50289, 0.0030353, 0.0), rel=1e-4)
    assert np.array_equal(checked(field, "#b46450"), srgb.decode(np.array([180, 100, 80]) / 255))
    for wrong in ("#12345", "#gggggg", "ffffff", "#"):
        with pytest.raises(ValidationError):
            checked(field, wrong)
    with pytest.raises(ValidationError):
        checked(Point, "#ffffff")


def test_steps_happen_in_the_order_written():
    # (1, 0, 0) doubled is (2, 0, 0); turned by 90 degrees about +y it is (0, 0, -2); raised it is (0, 5, -2).
    matrix = transform({"scale": 2}, {"rotate": {"axis": [0, 1, 0], "angle": 90}}, {"translate": [0, 5, 0]})
    assert (matrix @ [1.0, 0.0, 0.0, 1.0]).tolist() == [0.0, 5.0, -2.0, 1.0]


def test_quarter_turns_are_exact():
    for quarters in range(-8, 9):
        matrix = transform({"rotate": {"axis": [0, 0, 3], "angle": 90 * quarters}})
        expected = np.linalg.matrix_power(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), quarters % 4)
        assert np.array_equal(matrix[:3, :3], expected)


@given(st.tuples(COMPONENTS, COMPONENTS, COMPONENTS).filter(lambda axis: max(map(abs, axis)) >= 1e-30), ANGLES)
def test_rotation_is_orthonormal_keeps_its_axis_and_turns_by_its_angle(axis, angle):
    rotation = transform({"rotate": {"axis": list(axis), "angle": angle}})[:3, :3]
    unit = np.array(axis) / max(map(abs, axis))
    unit /= np.linalg.norm(unit)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=4e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=4e-15)
    np.testing.assert_allclose(rotation @ unit, unit, atol=4e-15)
    assert np.trace(rotation) == pytest.approx(1.0 + 2.0 * math.cos(math.radians(angle)), abs=4e-15)


def test_scale_by_axis_identity_and_matrices():
    assert np.array_equal(transform({"scale": [1, 2, -3]}), np.diag([1.0, 2.0, -3.0, 1.0]))
    assert np.array_equal(matrix_of(None), np.eye(4))
    assert np.array_equal(transform(), np.eye(4))
    assert transform({"scale": [1e-30, 1, 1e30]})[0, 0] == 1e-30
    rows = [[1, 2, 0, 4], [0, 1, 0, 5], [0, 0, 2, 6], [0, 0, 0, 1]]
    for written in (rows, {"matrix": rows}):
        assert np.array_equal(matrix_of(checked(Transform, written)), np.array(rows, float))


@pytest.mark.parametrize(
    ("value", "place", "words"),
    [
        ([{"scale": 0}], (0, "scale"), "must not be zero"),
        ([{"scale": [1, 0, 1]}], (0, "scale", 1), "must not be zero"),
        ([{"scale": 1, "translate": [0, 0, 1]}], (0,), "exactly one"),
        ([{}], (0,), "exactly one"),
        ([{"rotat": {}}], (0, "rotat"), "did you mean 'rotate'?"),
        ([{"rotate": {"axis": [0, 0, 0], "angle": 1}}], (0, "rotate", "axis"), "zero vector"),
        ([{"scale": 1e20}, {"scale": 1e20}], (), "by more than 1e+30"),
        ([{"scale": 1e-20}, {"scale": 1e-20}], (), "flattens"),
        ({"scale": 2}, (), "must be a list of steps"),
        ({"matrix": [[1]]}, (), "4x4"),
        ({"matrix": [[1, 0, 0, 0]] * 4}, (), "last row"),
        ([[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], (), "flattens"),
        ([[1, 0, 0, math.nan], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], (0, 3), "nan"),
    ],
)
def test_wrong_transform_is_told_by_step(value, place, words):
    found, message = complaint(Transform, value)
    assert found == place
    assert words in message


class Ball(ObjectSpec):
    """A shape for these tests."""

    size: PositiveLength
    pair: tuple[Length, Length] = (0.0, 0.0)
    solid: bool = False


def test_spec_is_frozen_and_hashable():
    ball = Ball(size=1.0)
    with pytest.raises(ValidationError):
        ball.size = 2.0
    assert hash(ball) == hash(Ball(size=1.0))


@pytest.mark.parametrize(
    ("value", "place", "words"),
    [
        ({"siz": 1}, ("siz",), "unknown key 'siz' of ball; did you mean 'size'?"),
        ({"size": 1, "xyzzy": 1}, ("xyzzy",), "known keys: size, pair, solid, name, material, medium"),
        ({}, ("size",), "is missing"),
        ({"size": 1, "pair": [1]}, ("pair", 1), "is missing; the list needs at least 2 values"),
        ([], (), "must be a mapping"),
    ],
)
def test_wrong_mapping_is_told_by_key(value, place, words):
    found, message = complaint(Ball, value)
    assert found == place
    assert words in message


def test_an_unknown_key_does_not_hide_other_errors():
    with pytest.raises(ValidationError) as caught:
        Ball.model_validate({"siz": 1, "solid": 1})
    assert [error["loc"] for error in caught.value.errors()] == [("siz",), ("solid",)]


def test_at_points_below_a_mapping():
    with pytest.raises(ValidationError) as caught:
        field_error(("rotate", "axis"), "must {not} be zero")
    assert caught.value.errors()[0]["loc"] == ("rotate", "axis")
    assert error_sentence(caught.value.errors()[0]) == "must {not} be zero"
