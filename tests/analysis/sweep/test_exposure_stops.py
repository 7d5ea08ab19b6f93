"""Stops: exact factors of light, whatever is engraved."""

import itertools
import math

import pytest

from raytracer.analysis.sweep.exposure_stops import STOP_SCALES
from raytracer.analysis.sweep.parse_values import parse_value_text


@pytest.mark.parametrize(
    ("key", "text", "first", "step", "marks"),
    [
        # Each value is 2 to the power of `first`, `first` + `step` ...
        ("camera.f_number", "1.4..22", 1 / 2, 1 / 2, "1.4 2 2.8 4 5.6 8 11 16 22"),
        ("camera.f_number", "2..5.6/3", 1, 1 / 6, "2 2.2 2.5 2.8 3.2 3.5 4 4.5 5 5.6"),
        ("camera.f_number", "5.6..2/2", 5 / 2, -1 / 4, "5.6 4.8 4 3.3 2.8 2.4 2"),
        # Full stops may start at a third: f/1.8 is 5/3 stops from f/1.
        ("camera.f_number", "1.8..7.1", 5 / 6, 1 / 2, "1.8 2.5 3.5 5 7.1"),
        # Of f/12.7 and f/13.5 the same is engraved.
        ("camera.f_number", "13..16/3", 22 / 6, 1 / 6, "13 14 16"),
        ("camera.f_number", "13..16/2", 15 / 4, 1 / 4, "13 16"),
        ("camera.shutter", "1/1000..1/30", -10, 1, "1/1000s 1/500s 1/250s 1/125s 1/60s 1/30s"),
        ("camera.shutter", "1/250 s..1/60 s", -8, 1, "1/250s 1/125s 1/60s"),
        # One over eight is a time, and not an eighth of a stop.
        ("camera.shutter", "1..1/8", 0, -1, "1s 1/2s 1/4s 1/8s"),
        ("camera.iso", "100..3200", math.log2(100), 1, "100 200 400 800 1600 3200"),
        ("camera.iso", "100..400/3", math.log2(100), 1 / 3, "100 125 160 200 250 320 400"),
        # What is not engraved counts from its start; f/0.95 to f/3.8 are four stops, and a light doubles at each.
        ("camera.f_number", "0.95..3.8", math.log2(0.95), 1 / 2, "0.95 1.344 1.9 2.687 3.8"),
        ("camera.aperture", "2..8", 1, 1 / 2, "2 2.828 4 5.657 8"),
        ("lights[0].intensity", "3..24", math.log2(3), 1, "3 6 12 24"),
    ],
)
def test_stops_are_exact_and_have_the_numbers_that_are_engraved(key, text, first, step, marks):
    axis = parse_value_text(key, text, "").axis
    assert [label.replace(" ", "") for label in axis.labels] == marks.split()
    assert axis.values == pytest.approx([2.0 ** (first + step * k) for k in range(len(axis.values))], rel=4e-15)


def test_values_with_units_keep_them():
    assert parse_value_text("camera.shutter", "8 ms..1 ms", "").axis.values == ("8 ms", "4 ms", "2 ms", "1 ms")
    assert len(parse_value_text("camera.shutter", "1/1000..1/30/3", "").axis.values) == 16


@pytest.mark.parametrize("key", ["f_number", "shutter", "iso"])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_what_is_engraved_is_near_what_it_stands_for(key, parts):
    """Within a seventh of a stop by the standards' roundings, and in rising order: a slip in a table would show."""
    scale = STOP_SCALES[key]
    first, marks = scale.marks[parts]
    numbers = [eval(mark) for mark in marks.split()]
    assert all(a < b for a, b in itertools.pairwise(numbers))
    for i, number in enumerate(numbers):
        exact = scale.value((first + i) / parts)
        off = abs(math.log2(number / exact)) / float(scale.power)
        # 0.3 s is engraved for 0.35 s, 10 s for 11.3 s and 20 s for 22.6 s.
        assert off < (0.25 if key == "shutter" and parts == 2 else 1.0 / 6.0), (number, exact)


@pytest.mark.parametrize(
    ("text", "key", "says"),
    [
        ("1.4..20", "camera.f_number", "7.67 stops, which is not an integer number of full stops; end at 16 or 22"),
        ("1.4..22/5", "camera.f_number", "halves or thirds"),
        ("2..2", "camera.f_number", "ends are equal"),
        ("0..2", "camera.f_number", "greater than 0"),
        ("2..x", "camera.f_number", "'x' is no finite number"),
        ("1..10", "lights[0].intensity", "end at 8 or 16"),
        ("1..8", "objects.ball.radius", "stops, which are known of f_number"),
        ("1.4..22", "camera.f_nmber", "not known of 'f_nmber'; did you mean 'f_number'"),
        ("1.4...22", "camera.f_number", "has three dots"),
    ],
)
def test_ranges_that_are_no_stops(text, key, says):
    with pytest.raises(ValueError, match=says):
        parse_value_text(key, text, "")
