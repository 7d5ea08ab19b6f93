"""Formats of numbers, intervals, durations and tables."""

import math

from raytracer.core.error_estimate.intervals import UNKNOWN, Interval
from raytracer.report import wording
from raytracer.report.table import align_columns

INF, NAN = math.inf, math.nan


def same(work, table):
    """Each value of a table is said as the text beside it."""
    for value, said in table.items():
        assert work(value) == said


def test_durations():
    days = 86400.0
    same(
        wording.format_duration,
        {NAN: "unknown", INF: "never", -INF: "unknown", 0.0: "0 s", 2e-8: "2.00e-05 ms", 0.0713: "71.3 ms"}
        | {0.9999: "1.00 s", 12.345: "12.3 s", 119.0: "119 s", 252.0: "4.20 min", 7199.0: "120 min", 7500.0: "2.08 h"}
        | {3.2 * days: "3.20 days", 364.0 * days: "364 days", 1e9: "over a year", 1e300: "over a year"},
    )


def test_percentages():
    same(wording.format_percent, {0.09999: "10.0 %", 0.00000814: "0.000814 %", NAN: "unknown"})
    same(
        wording.format_percent_interval,
        {
            Interval(0.0123, 0.01203, 0.0126): "1.23 % (1.20 .. 1.26)",
            Interval(0.09999, 0.098, 0.102): "10.0 % (9.8 .. 10.2)",
            Interval(0.0, 0.0, 0.004): "0 % (0 .. 0.400)",
            Interval(-0.004, -0.01, 0.002): "-0.400 % (-1.000 .. 0.200)",
            Interval(0.02, NAN, NAN): "2.00 %",
            Interval(NAN, 0.0, 1.0): "unknown",
            Interval(0.02, 0.01, INF): "2.00 % (1.00 .. inf)",
            Interval(0.0999, 0.0951, 0.1049): "9.99 % (9.51 .. 10.49)",
            Interval(2.0, 1.0, 4.0): "200 % (100 .. 400)",
            Interval(0.00012345, 0.00012, 0.00013): "0.0123 % (0.0120 .. 0.0130)",
            Interval(0.0, 0.0, 0.0): "0 %",
        },
    )


def test_intervals_of_times_are_in_one_unit():
    same(
        wording.format_duration_interval,
        {
            Interval(61.2, 58.0, 65.1): "61.2 s (58.0 .. 65.1)",
            Interval(0.9, 0.8, 1.1): "900 ms (800 .. 1,100)",
            Interval(448.8, 325.8, 649.8): "7.48 min (5.43 .. 10.83)",
            Interval(110.0, 90.0, INF): "110 s (90.0 .. inf)",
            Interval(2.0, 2.0, 2.0): "2.00 s",
            UNKNOWN: "unknown",
            Interval(INF, INF, INF): "never",
        },
    )


def test_things_are_counted():
    points = {0: "0 points", 1: "1 point", 2: "2 points", 12000: "12000 points"}
    same(lambda number: wording.count(number, "point"), points)
    same(lambda number: f"{number} {wording.plural(number, 'point')}", points)


def test_what_has_no_value_is_said_in_words():
    same(wording.millimetres, {NAN: "none", -INF: "infinite", -1.5: "−1.50000 mm"})
    same(wording.metres, {INF: "infinity", 1500.0: "1.5 m"})
    same(wording.micrometres, {787.4: "787 µm", 1351.0: "1.35 mm", NAN: "none"})


def test_compact_numbers_have_an_exponent_only_where_it_is_shorter():
    same(
        wording.compact_number,
        {0.0: "0", 100.0: "100", 1234567.0: "1235000", 0.000123456: "0.0001235", -2.5: "-2.5", INF: "infinity"}
        | {1e7: "1.000e+07", 9.9e-5: "9.900e-05"},
    )


def test_short_exposures_are_fractions():
    same(wording.exposure_time, {0.008: "1/125 s", 0.4: "0.4 s", 0.5: "0.5 s", 2.0: "2 s"})


def test_columns_have_one_width_and_rows_may_be_short():
    assert align_columns([["name", "m"], ["a", "1.25"]]) == ["name     m", "a     1.25"]
    assert align_columns([["name", "m"], ["a", "1.25"]], left=0) == ["name     m", "   a  1.25"]
    assert align_columns([["a", "b", "c"], ["ab"]], gap=" ") == ["a  b c", "ab"]
    assert align_columns([]) == []
