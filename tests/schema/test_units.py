"""Quantities against the definitions of the units (SI brochure; international yard of 1959)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.schema.units import parse_duration, parse_percentage, parse_quantity


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        ("50 mm", "length", 0.05),
        ("50 mm", "optic", 50.0),
        ("50mm", "optic", 50.0),
        ("30cm", "length", 0.3),
        ("30cm", "optic", 300.0),
        ("2 m", "length", 2.0),
        ("2 m", "optic", 2000.0),
        ("1.5 km", "length", 1500.0),
        ("550 nm", "length", 550e-9),
        ("4.3 µm", "optic", 4.3e-3),
        ("1 in", "optic", 25.4),
        ("1 ft", "length", 0.3048),
        ("20 deg", "angle", 20.0),
        ("20°", "angle", 20.0),
        ("60 arcmin", "angle", 1.0),
        ("0.25 turn", "angle", 90.0),
        ("1/125 s", "time", 0.008),
        ("1/125", "time", 0.008),
        ("8 ms", "time", 0.008),
        ("10 Hz", "frequency", 10.0),
        ("2 kHz", "frequency", 2000.0),
        ("36 km/h", "speed", 10.0),
        ("1 mph", "speed", 0.44704),
        ("1 ft/s", "speed", 0.3048),
        ("60 rpm", "rate", 360.0),
        ("0.5 turn/s", "rate", 180.0),
        ("0.5 kHz", "frequency", 500.0),
        ("2 min", "time", 120.0),
        ("1/3", "number", 1 / 3),
        ("-1e-3", "number", -0.001),
        (".5", "number", 0.5),
        ("inf", "length", math.inf),
        ("-.inf", "length", -math.inf),
        (3, "length", 3.0),
        (2.5, "optic", 2.5),
    ],
)
def test_quantity_is_its_definition(text, dimension, expected):
    assert parse_quantity(text, dimension) == expected


def test_radian_is_180_over_pi_degrees():
    assert parse_quantity("0.3 rad", "angle") == pytest.approx(math.degrees(0.3), rel=4e-16)
    assert parse_quantity("300 mrad", "angle") == pytest.approx(math.degrees(0.3), rel=4e-16)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_plain_number_stays_itself(number):
    assert parse_quantity(repr(number), "number") == number
    assert parse_quantity(number, "length") == number


@given(st.floats(min_value=1e-300, max_value=1e300), st.sampled_from(["nm", "um", "mm", "cm", "m", "km", "in", "ft"]))
def test_optic_lengths_are_a_thousand_times_world_lengths(number, unit):
    metres = parse_quantity(f"{number!r} {unit}", "length")
    assert parse_quantity(f"{number!r} {unit}", "optic") == pytest.approx(1000.0 * metres, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "dimension", "words"),
    [
        (True, "number", "got true"),
        (None, "number", "got nothing"),
        ([1], "length", "got a list of 1"),
        (math.nan, "length", "nan"),
        ("nan", "length", "'nan'"),
        ("", "length", "''"),
        ("two", "length", "'two'"),
        ("1:30", "time", "'1:30'"),
        ("1_000", "number", "'1_000'"),
        ("1/0 s", "time", "divides by zero"),
        ("1 2 m", "length", "'1 2 m'"),
        ("50 mmm", "length", "unknown unit 'mmm'; did you mean 'mm'? (known units: nm,"),
        ("50 parsecs", "length", "known units: nm, um"),
        ("50 mm", "angle", "'mm' is a unit of length"),
        ("50 deg", "optic", "'deg' is a unit of angle"),
        ("2 m", "number", "without a unit"),
        (10**400, "number", "401 digits"),
    ],
)
def test_what_is_no_quantity_is_named(value, dimension, words):
    with pytest.raises(ValueError, match=r".") as caught:
        parse_quantity(value, dimension)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1%", 0.01), (" 2.5 % ", 0.025), ("0.01", 0.01), ("1/4", 0.25), ("1e-3", 0.001), ("99%", 0.99)],
)
def test_shares(text, expected):
    assert parse_percentage(text) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "predicate"),
    [
        ("0", "must be greater than 0 and less than 100%"),
        ("-1%", "must be greater than 0 and less than 100%"),
        ("1", "must be greater than 0 and less than 100%; did you mean 1%?"),
        ("100%", "must be greater than 0 and less than 100%"),
        ("inf", "must be greater than 0 and less than 100%"),
        ("nan", "must be a relative error such as 1% or 0.01"),
        ("", "must be a relative error such as 1% or 0.01"),
        ("%", "must be a relative error such as 1% or 0.01"),
        ("1%%", "must be a relative error such as 1% or 0.01"),
        ("1 m", "must be a relative error such as 1% or 0.01"),
    ],
)
def test_what_is_no_share(text, predicate):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        parse_percentage(text)
    assert str(caught.value) == predicate


def test_durations():
    assert parse_duration("30s") == 30.0
    assert parse_duration("5 min") == 300.0
    for text, predicate in (
        ("0 s", "greater than 0"),
        ("-1", "greater than 0"),
        ("inf", "finite"),
        ("1e400", "finite"),
    ):
        with pytest.raises(ValueError, match=predicate):
            parse_duration(text)
