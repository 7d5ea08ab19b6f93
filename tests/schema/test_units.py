"""Quantities against the definitions of the units (SI brochure; international yard of 1959)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.schema.units import parse_duration, parse_percentage, parse_quantity

QUANTITIES = """
length: 50 mm = 0.05, 30cm = 0.3, 2 m = 2, 1.5 km = 1500, 550 nm = 550e-9, 1 ft = 0.3048, inf = inf, -.inf = -inf
optic: 50 mm = 50, 50mm = 50, 30cm = 300, 2 m = 2000, 4.3 µm = 4.3e-3, 1 in = 25.4
angle: 20 deg = 20, 20° = 20, 60 arcmin = 1, 0.25 turn = 90
time: 1/125 s = 0.008, 1/125 = 0.008, 8 ms = 0.008, 2 min = 120
frequency: 10 Hz = 10, 2 kHz = 2000
speed: 36 km/h = 10, 1 mph = 0.44704, 1 ft/s = 0.3048
rate: 60 rpm = 360, 0.5 turn/s = 180
number: 1/3 = 0.3333333333333333, -1e-3 = -0.001, .5 = 0.5
"""
QUANTITIES = [line.split(": ") for line in QUANTITIES.split("\n") if line]


@pytest.mark.parametrize(("dimension", "quantities"), QUANTITIES, ids=[name for name, _ in QUANTITIES])
def test_quantity_is_its_definition(dimension, quantities):
    for quantity in quantities.split(", "):
        text, expected = quantity.split(" = ")
        assert parse_quantity(text, dimension) == float(expected), text


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
        ("", "length", "''"),
        ("1:30", "time", "'1:30'"),
        ("1_000", "number", "'1_000'"),
        ("1/0 s", "time", "divides by zero"),
        ("50 mmm", "length", "unknown unit 'mmm'; did you mean 'mm'? (known units: nm,"),
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


def test_shares():
    shares = {"1%": 0.01, " 2.5 % ": 0.025, "0.01": 0.01, "1/4": 0.25, "1e-3": 0.001, "99%": 0.99}
    for text, expected in shares.items():
        assert parse_percentage(text) == pytest.approx(expected, rel=1e-15)


RANGE = "must be greater than 0 and less than 100%"
NONE = "must be a relative error such as 1% or 0.01"


@pytest.mark.parametrize(
    ("predicate", "texts"),
    [
        (RANGE, ("0", "-1%", "100%", "inf")),
        (f"{RANGE}; did you mean 1%?", ("1",)),
        (NONE, ("nan", "", "%", "1%%", "1 m", "abc", "1%x")),
    ],
)
def test_what_is_no_share(predicate, texts):
    for text in texts:
        with pytest.raises(ValueError, match=r".") as caught:
            parse_percentage(text)
        assert str(caught.value) == predicate


def test_durations():
    assert (parse_duration("30s"), parse_duration("5 min")) == (30.0, 300.0)
    for text, predicate in {
        "0 s": "greater than 0",
        "-1": "greater than 0",
        "inf": "finite",
        "1e400": "finite",
    }.items():
        with pytest.raises(ValueError, match=predicate):
            parse_duration(text)
