"""Formats of numbers, intervals and durations."""

import math

import pytest

from raytracer.core.error_estimate.intervals import UNKNOWN, Interval
from raytracer.report import wording

INF, NAN = math.inf, math.nan


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (NAN, "unknown"),
        (INF, "never"),
        (-INF, "unknown"),
        (0.0, "0 s"),
        (0.0713, "71.3 ms"),
        (12.345, "12.3 s"),
        (0.9999, "1.00 s"),
        (119.0, "119 s"),
        (252.0, "4.20 min"),
        (7199.0, "120 min"),
        (7500.0, "2.08 h"),
        (3.2 * 86400.0, "3.20 days"),
        (364.0 * 86400.0, "364 days"),
        (1e9, "over a year"),
        (1e300, "over a year"),
        (2e-8, "2.00e-05 ms"),
    ],
)
def test_durations(seconds, said):
    assert wording.format_duration(seconds) == said


@pytest.mark.parametrize(
    ("interval", "said"),
    [
        (Interval(0.0123, 0.01203, 0.0126), "1.23 % (1.20 .. 1.26)"),
        (Interval(0.09999, 0.098, 0.102), "10.0 % (9.8 .. 10.2)"),
        (Interval(0.0, 0.0, 0.004), "0 % (0 .. 0.400)"),
        (Interval(-0.004, -0.01, 0.002), "-0.400 % (-1.000 .. 0.200)"),
        (Interval(0.02, NAN, NAN), "2.00 %"),
        (Interval(NAN, 0.0, 1.0), "unknown"),
        (Interval(0.02, 0.01, INF), "2.00 % (1.00 .. inf)"),
        (Interval(0.0999, 0.0951, 0.1049), "9.99 % (9.51 .. 10.49)"),
        (Interval(2.0, 1.0, 4.0), "200 % (100 .. 400)"),
        (Interval(0.00012345, 0.00012, 0.00013), "0.0123 % (0.0120 .. 0.0130)"),
        (Interval(0.0, 0.0, 0.0), "0 %"),
    ],
)
def test_percentages_with_intervals(interval, said):
    assert wording.format_percent_interval(interval) == said


@pytest.mark.parametrize(("value", "said"), [(0.09999, "10.0 %"), (0.00000814, "0.000814 %"), (NAN, "unknown")])
def test_percentages(value, said):
    assert wording.format_percent(value) == said


def test_intervals_of_times_are_in_one_unit():
    assert wording.format_duration_interval(Interval(61.2, 58.0, 65.1)) == "61.2 s (58.0 .. 65.1)"
    assert wording.format_duration_interval(Interval(0.9, 0.8, 1.1)) == "900 ms (800 .. 1,100)"
    assert wording.format_duration_interval(Interval(448.8, 325.8, 649.8)) == "7.48 min (5.43 .. 10.83)"
    assert wording.format_duration_interval(Interval(110.0, 90.0, INF)) == "110 s (90.0 .. inf)"
    assert wording.format_duration_interval(Interval(2.0, 2.0, 2.0)) == "2.00 s"
    assert wording.format_duration_interval(UNKNOWN) == "unknown"
    assert wording.format_duration_interval(Interval(INF, INF, INF)) == "never"


@pytest.mark.parametrize(
    ("number", "said"), [(0, "0 points"), (1, "1 point"), (2, "2 points"), (12000, "12000 points")]
)
def test_things_are_counted(number, said):
    assert wording.count(number, "point") == said
    assert said.split()[1] == wording.plural(number, "point")


def test_what_has_no_value_is_said_in_words():
    assert wording.millimetres(float("nan")) == "none"
    assert wording.millimetres(float("-inf")) == "infinite"
    assert wording.millimetres(-1.5) == "−1.50000 mm"
    assert wording.metres(float("inf")) == "infinity"
    assert wording.metres(1500.0) == "1.5 m"
    assert wording.micrometres(787.4) == "787 µm"
    assert wording.micrometres(1351.0) == "1.35 mm"
    assert wording.micrometres(float("nan")) == "none"


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0.0, "0"),
        (100.0, "100"),
        (1234567.0, "1235000"),
        (0.000123456, "0.0001235"),
        (-2.5, "-2.5"),
        (1e7, "1.000e+07"),
        (9.9e-5, "9.900e-05"),
        (INF, "infinity"),
    ],
)
def test_compact_numbers_have_an_exponent_only_where_it_is_shorter(value, said):
    assert wording.compact_number(value) == said


@pytest.mark.parametrize(("seconds", "said"), [(0.008, "1/125 s"), (0.4, "0.4 s"), (0.5, "0.5 s"), (2.0, "2 s")])
def test_short_exposures_are_fractions(seconds, said):
    assert wording.exposure_time(seconds) == said
