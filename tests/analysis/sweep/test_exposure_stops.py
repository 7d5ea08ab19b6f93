"""Stops: exact factors of light, whatever is engraved."""

import itertools
import math

import pytest

from raytracer.analysis.sweep.exposure_stops import STOP_SCALES, stops
from raytracer.analysis.sweep.parse_values import parse_value_text


def _axis(text, key):
    axis = parse_value_text(key, text, "").axis
    return axis.values, axis.labels


def test_full_stops_of_aperture_are_powers_of_the_square_root_of_two():
    values, labels = _axis("1.4..22", "camera.f_number")
    assert labels == ("1.4", "2", "2.8", "4", "5.6", "8", "11", "16", "22")
    assert values == pytest.approx([math.sqrt(2.0) ** k for k in range(1, 10)], rel=1e-15)
    assert values[1::2] == (2, 4, 8, 16)


def test_thirds_of_a_stop_have_the_numbers_of_lenses():
    values, labels = _axis("2..5.6/3", "camera.f_number")
    assert labels == ("2", "2.2", "2.5", "2.8", "3.2", "3.5", "4", "4.5", "5", "5.6")
    assert values == pytest.approx([2.0 ** (1.0 + k / 6.0) for k in range(10)], rel=1e-15)


def test_halves_backwards():
    values, labels = _axis("5.6..2/2", "camera.f_number")
    assert labels == ("5.6", "4.8", "4", "3.3", "2.8", "2.4", "2")
    assert values == pytest.approx([2.0 ** (2.5 - k / 4.0) for k in range(7)], rel=1e-15)


def test_full_stops_may_start_at_a_third():
    """f/1.8 is 5/3 stops from f/1."""
    values, labels = _axis("1.8..7.1", "camera.f_number")
    assert labels == ("1.8", "2.5", "3.5", "5", "7.1")
    assert values == pytest.approx([2.0 ** (5.0 / 6.0 + k / 2.0) for k in range(5)], rel=1e-15)


def test_13_is_a_third_or_a_half():
    """Of f/12.7 and f/13.5 the same is engraved."""
    assert _axis("13..16/3", "camera.f_number")[0] == pytest.approx([2.0 ** (k / 6.0) for k in (22, 23, 24)])
    assert _axis("13..16/2", "camera.f_number")[0] == pytest.approx([2.0 ** (k / 4.0) for k in (15, 16)])


def test_shutter_speeds_double_exactly():
    values, labels = _axis("1/1000..1/30", "camera.shutter")
    assert labels == ("1/1000 s", "1/500 s", "1/250 s", "1/125 s", "1/60 s", "1/30 s")
    assert values == tuple(2.0**k for k in range(-10, -4))


def test_one_over_three_is_a_time_and_not_a_third():
    assert _axis("1..1/8", "camera.shutter")[0] == (1, 0.5, 0.25, 0.125)
    assert len(_axis("1/1000..1/30/3", "camera.shutter")[0]) == 16


def test_units_of_times():
    assert _axis("1/250 s..1/60 s", "camera.shutter") == _axis("1/250..1/60", "camera.shutter")
    assert _axis("8 ms..1 ms", "camera.shutter")[0] == ("8 ms", "4 ms", "2 ms", "1 ms")


def test_iso_doubles():
    assert _axis("100..3200", "camera.iso")[0] == (100, 200, 400, 800, 1600, 3200)
    values, labels = _axis("100..400/3", "camera.iso")
    assert labels == ("100", "125", "160", "200", "250", "320", "400")
    assert values == pytest.approx([100.0 * 2.0 ** (k / 3.0) for k in range(7)], rel=1e-15)


def test_what_is_not_engraved_counts_from_its_start():
    """f/0.95 to f/3.8 are four stops, since 3.8 / 0.95 = 4 = 2^(4/2); a light doubles at each."""
    assert _axis("0.95..3.8", "camera.f_number")[0] == pytest.approx([0.95 * 2.0 ** (k / 2.0) for k in range(5)])
    assert _axis("3..24", "lights[0].intensity")[0] == (3, 6, 12, 24)
    assert _axis("2..8", "camera.aperture")[0] == pytest.approx([2.0, math.sqrt(8.0), 4.0, math.sqrt(32.0), 8.0])


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
        ("2..3", "camera.f_number", "end at 2.8 or 4"),
        ("1.4..22/5", "camera.f_number", "halves or thirds"),
        ("2..2", "camera.f_number", "ends are equal"),
        ("0..2", "camera.f_number", "greater than 0"),
        ("2..x", "camera.f_number", "'x' is no finite number"),
        ("1..10", "lights[0].intensity", "end at 8 or 16"),
        ("20..40", "camera.vfov", "stops, which are known of f_number"),
        ("1..8", "objects.ball.radius", "stops, which are known of f_number"),
        ("1.4..22", "camera.f_nmber", "not known of 'f_nmber'; did you mean 'f_number'"),
        ("1.4...22", "camera.f_number", "has three dots"),
    ],
)
def test_ranges_that_are_no_stops(text, key, says):
    with pytest.raises(ValueError, match=says):
        parse_value_text(key, text, "")


def test_neighbours_are_half_the_light():
    found = stops(STOP_SCALES["f_number"], 1.4, 22.0, 1)
    light = [1.0 / value**2 for value in found.values]
    assert [a / b for a, b in itertools.pairwise(light)] == pytest.approx([2.0] * 8, rel=1e-14)
