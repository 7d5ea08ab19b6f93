"""Shutters against their formulas: exposure times, the times that are drawn, and pictures of what moves meanwhile."""

import math

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from pydantic import TypeAdapter

from raytracer.core.shutter.spec import ShutterField, exposure_timing
from raytracer.core.shutter.table import Pulses, Shutter, pulse_interval
from raytracer.core.shutter.timing import pack_shutter
from raytracer.rendering.render import render
from tests.core.motion.kernels import drawn_times
from tests.small_scenes import scene

Array = NDArray[np.float64]

SHUTTER = TypeAdapter(ShutterField)
CURVES = {
    "instant": {"duration": 0.5},
    "trapezoid": {"duration": 0.5, "opening": "trapezoid", "ramp": 0.2},
    "triangle": {"duration": 0.5, "opening": "trapezoid", "ramp": 0.5},
    "custom": {"opening": [[0, 0], ["100 ms", 1], [0.3, 0.25], [0.6, 0.25], [0.7, 0]]},
    "late": {"opening": [[0.1, 0.5], [0.4, 1]]},
    "gap": {"opening": [[0, 1], [0.1, 0], [0.3, 0], [0.4, 1]]},
}


def timing(keys, time=None):
    return exposure_timing(SHUTTER.validate_python(keys), time)


def transmission(profile, times):
    """A piecewise linear curve, closed outside of its points."""
    points = np.array(profile)
    return np.interp(times, points[:, 0], points[:, 1], left=0.0, right=0.0)


# ---- What is written


@pytest.mark.parametrize(
    ("keys", "seconds", "span", "full"),
    [
        ("1/125 s", 0.008, (2.0, 2.008), (2.0, 2.008)),
        (CURVES["instant"], 0.5, (2.0, 2.5), (2.0, 2.5)),
        # Opens within the ramp, begins to close after the duration, and is closed a ramp later.
        (CURVES["trapezoid"], 0.5, (2.0, 2.7), (2.2, 2.5)),
        (CURVES["triangle"], 0.5, (2.0, 3.0), (2.5, 2.5)),
        (CURVES["custom"], 0.05 + 0.2 * 0.625 + 0.3 * 0.25 + 0.0125, (2.0, 2.7), (2.1, 2.1)),
        (CURVES["late"], 0.3 * 0.75, (2.0, 2.4), (2.4, 2.4)),
        ({"duration": 0.5, "readout": 0.25}, 0.5, (2.0, 2.75), (2.0, 2.5)),
        ({**CURVES["trapezoid"], "readout": 1}, 0.5, (2.0, 3.7), (2.2, 2.5)),
    ],
)
def test_exposure_time_is_the_integral_of_the_opening(keys, seconds, span, full):
    exposure = timing(keys, time=2.0)
    assert exposure.seconds() == pytest.approx(seconds, rel=1e-13)
    np.testing.assert_allclose(exposure.span()[:2], span, rtol=1e-15)
    np.testing.assert_allclose(exposure.full(), full, rtol=1e-15)


@pytest.mark.parametrize("name", CURVES)
def test_what_is_transmitted_between_two_times_is_the_integral(name):
    exposure = timing(CURVES[name], time=3.0)
    profile = exposure.profile or ((0.0, 1.0), (0.5, 1.0))
    for begin, end in ((2.0, 3.05), (3.05, 3.33), (3.25, 9.0), (3.3, 3.3), (5.0, 6.0), (1.0, 2.0), (3.2, 3.1)):
        midpoints = begin + max(0.0, end - begin) * (np.arange(200_000) + 0.5) / 200_000
        expected = transmission(profile, midpoints - 3.0).mean() * max(0.0, end - begin)
        assert exposure.transmitted(begin, end) == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize(
    ("keys", "time", "words"),
    [
        ({"duration": 1, "close": 1}, None, "duration and close both say"),
        ({"duration": 1, "opening": "trapezoid"}, None, "ramp: is missing|is missing: a trapezoid needs"),
        ({"duration": 1, "opening": "trapezoid", "ramp": 2}, None, "must be at most the duration, 1 s, got 2 s"),
        ({"duration": 1, "ramp": 0.1}, None, "belongs to `opening: trapezoid`"),
        ({"duration": 1, "opening": [[0, 1], [1, 1]]}, None, "leave this out"),
        ({"opening": [[0, 1], [0, 1]]}, None, "must be later than the point before"),
        ({"opening": [[0, 0], [1, 0]]}, None, "lets no light through"),
        ({"opening": [[0, 0], [1, 2]]}, None, "must be at most 1"),
        ({"opening": [[0, 0], [1]]}, None, "must be a time and a transmission"),
        ({"opening": "slow", "duration": 1}, None, "must be instant or trapezoid"),
        ({"duration": 0.5, "open": 1.5}, 2.0, "give one"),
        # Too late for how short it opens.
        ("1 ns", 1e9, "is open for 1e-09 s, too short to be told from none at a time of 1e[+]09 s"),
        ({"open": 1e30, "duration": 1}, None, "is open for 1 s"),
        ({"opening": [[0, 0], [1e-9, 1]]}, 1e9, "is open for 1e-09 s"),
        ({"duration": 0, "readout": 1e-9}, 1e9, "is read out for 1e-09 s"),
    ],
)
def test_what_is_no_shutter_is_named(keys, time, words):
    with pytest.raises(ValueError, match=words):
        timing(keys, time)


def test_a_duration_opens_at_the_cameras_time_or_at_its_own():
    assert timing({"duration": 0.5}, time=2.0).span() == Shutter(2.0, 2.5)
    assert timing({"duration": 0.5, "open": 1.5}).span() == Shutter(1.5, 2.0)
    # What is open for no time is not too late for it, nor what ends before anybody could tell.
    assert timing({"open": 1e9, "close": 1e9}).span() == Shutter(1e9, 1e9)
    assert timing({"duration": 1, "readout": 1e-20}).span() == Shutter(0.0, 1.0)


# ---- Times that are drawn

COUNT = 4096


def cumulative(profile, times):
    """The share of a profile's integral up to times, by the trapezoid rule on a fine grid."""
    fine = np.linspace(0.0, profile[-1][0], 400_001)
    values = transmission(profile, fine)
    integral = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2.0)])
    return np.interp(times, fine, integral / integral[-1])


@pytest.mark.parametrize("name", CURVES)
def test_times_are_drawn_in_proportion_to_the_transmission(name):
    exposure = timing(CURVES[name])
    times, weights = drawn_times(pack_shutter(exposure, 4, 3), COUNT)
    assert (weights == 1.0).all()
    profile = exposure.profile or ((0.0, 1.0), (0.5, 1.0))
    share = np.sort(cumulative(profile, exposure.closes * times))
    # Stratified: one of n samples in each n-th of the light.
    np.testing.assert_allclose(share, (np.arange(COUNT) + 0.5) / COUNT, atol=0.6 / COUNT + 1e-5)


@pytest.mark.parametrize("curtain", ["electronic", "focal_plane"])
@pytest.mark.parametrize(
    ("direction", "place", "line"),
    [
        ("down", (3.2, 0.4), 0.4 / 3),
        ("down", (0.1, 2.9), 2.9 / 3),
        ("down", (0.1, 3.4), 3.0 / 3),
        ("up", (0.1, 2.9), 0.1 / 3),
        ("right", (2.6, 0.4), 2.6 / 4),
        ("left", (2.6, 0.4), 1.4 / 4),
        ("left", (-0.7, 0.4), 4.0 / 4),
    ],
)
def test_lines_are_exposed_one_after_another(curtain, direction, place, line):
    # Line k of n starts at readout k / n; with a slit the place itself counts, clamped to the film.
    keys = {"duration": 0.5, "readout": 1.5, "direction": direction, "curtain": curtain}
    exposure = timing(keys)
    times, _ = drawn_times(pack_shutter(exposure, 4, 3), COUNT, *place)
    lines = 4 if direction in ("left", "right") else 3
    start = line if curtain == "focal_plane" else min(math.floor(line * lines + 1e-9), lines - 1) / lines
    seconds = np.sort(2.0 * times)
    np.testing.assert_allclose(seconds, 1.5 * start + 0.5 * (np.arange(COUNT) + 0.5) / COUNT, atol=0.3 / COUNT + 1e-6)


def test_a_scanned_curve_is_the_curve_of_every_line():
    exposure = timing({**CURVES["trapezoid"], "readout": 0.3, "curtain": "focal_plane"})
    assert exposure.profile is not None
    times, _ = drawn_times(pack_shutter(exposure, 4, 3), COUNT, 1.0, 1.5)
    share = np.sort(cumulative(exposure.profile, times - 0.15))
    np.testing.assert_allclose(share, (np.arange(COUNT) + 0.5) / COUNT, atol=0.6 / COUNT + 1e-5)


# ---- Times that are drawn for a flash


def with_pulses(keys, *pulses):
    """A shutter that opens at 0, and flashes (s)."""
    exposure = timing(keys)
    rows = np.array([pulse_interval(exposure.span(), *pulse) for pulse in pulses])
    return exposure, pack_shutter(exposure, 4, 3, [Pulses(rows[:, 0].copy(), rows[:, 1].copy())])


@pytest.mark.parametrize("pulses", [[(0.3, 0.3001)], [(0.21, 0.24), (0.22, 0.5)], [(-0.1, 0.05)], [(0.0, 2.0)]])
@pytest.mark.parametrize("name", ["instant", "custom"])
def test_times_for_flashes_are_weighted_to_the_same_mean(name, pulses):
    exposure, shutter = with_pulses(CURVES[name], *pulses)
    times, weights = drawn_times(shutter, 65536)
    profile = exposure.profile or ((0.0, 1.0), (0.5, 1.0))
    assert weights.max() <= 2.0 + 1e-12

    # Of a smooth function of time, and of what shines in a pulse alone.
    fine = exposure.closes * (np.arange(400_000) + 0.5) / 400_000
    density = transmission(profile, fine)
    expected = (density * np.cos(7.0 * fine)).sum() / density.sum()
    assert (weights * np.cos(7.0 * exposure.closes * times)).mean() == pytest.approx(expected, abs=1e-3)
    span = exposure.span()
    for begin, end in pulses:
        first, last = pulse_interval(span, begin, end)
        lit = (first <= times) & (times <= last)
        share = exposure.transmitted(first * span.close, last * span.close) / exposure.seconds()
        assert (weights * lit).mean() == pytest.approx(share, rel=1e-3)


def test_a_short_pulse_takes_half_of_the_samples_of_the_lines_that_see_it():
    """1/10000 s of 2 s, seen by the lines that are open at 1.2 s: those that began to open between 0.2 s and 1.2 s."""
    keys = {"duration": 1.0, "readout": 3.0, "curtain": "focal_plane"}
    exposure, shutter = with_pulses(keys, (1.2, 1.2001))
    for y, sees in ((0.1, False), (0.3, True), (1.1, True), (1.3, False)):
        times, weights = drawn_times(shutter, COUNT, 0.5, y)
        first, last = pulse_interval(exposure.span(), 1.2, 1.2001)
        lit = (first <= times) & (times <= last)
        assert lit.mean() == pytest.approx(0.5 if sees else 0.0, abs=1e-3)
        assert (weights * lit).mean() == pytest.approx(1e-4 if sees else 0.0, rel=2e-3)
        if not sees:
            assert (weights == 1.0).all()


def test_a_pulse_shorter_than_times_are_apart_keeps_its_place():
    first, last = pulse_interval(Shutter(0.0, 30.0), 20.0, 20.0 + 1e-7)
    assert first < last
    assert first == np.float32(2 / 3)
    _, shutter = with_pulses({"duration": 30.0}, (20.0, 20.0 + 1e-7))
    times, weights = drawn_times(shutter, COUNT)
    lit = (first <= times) & (times <= last)
    assert (weights * lit).mean() == pytest.approx(last - first, rel=0.01)


@pytest.mark.parametrize("duration", [0.0, 1e-30, 1e-8])
@pytest.mark.parametrize("curtain", ["electronic", "focal_plane"])
def test_lines_that_are_open_for_no_time_see_a_flash_or_not(duration, curtain):
    """Lines that open between 0.2 s and 0.3 s, of 16 in 1 s, have a single time each, so all weights are 1."""
    flash = Pulses(np.array([0.2]), np.array([0.3]))
    shutter = pack_shutter(timing({"duration": duration, "readout": 1.0, "curtain": curtain}), 16, 16, [flash])
    for y in (3.1, 3.9, 4.1, 4.9):
        times, weights = drawn_times(shutter, 64, 0.5, y)
        place = y if curtain == "focal_plane" else math.floor(y)
        np.testing.assert_allclose(times, place / 16, rtol=0.0, atol=1e-7)
        assert (weights == 1.0).all()


# ---- Pictures

WINDOW = "camera: {type: orthographic, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 32"
LAMP = "material: {type: emitter, radiance: 1}"


def picture(shutter, speed, *, height=32, spp=64):
    """The first channel of a picture, 1 m a pixel from the left and from the bottom, of a lamp.

    It is six metres wide, goes to the right (m/s), and is 8 m from the left edge of 32 m at time 0.
    """
    quad = f"{{type: quad, corner: [-8, -99, 0], edges: [[6, 0, 0], [0, 198, 0]], {LAMP}"
    text = f"{WINDOW.replace('32', str(height))}, shutter: {shutter}}}\nobjects:\n"
    text += f"  - {quad}, motion: {{velocity: [{speed}, 0, 0]}}}}\n"
    spec = scene(text, filled=False, width=32, height=height, spp=spp, max_depth=1, sampler="sobol")
    return render(spec, threads=2).image.radiance[..., 0]


def swept(profile):
    """Coverage of 32 pixels by that lamp at 10 m/s, weighted by a profile."""
    times = profile[-1][0] * (np.arange(4000) + 0.5) / 4000
    weights = transmission(profile, times)
    edges = np.arange(33.0)[:, None]
    left, right = 8.0 + 10.0 * times, 14.0 + 10.0 * times
    covered = np.clip(edges[1:], left, right) - np.clip(edges[:-1], left, right)
    return (covered * weights).sum(axis=1) / weights.sum()


# All have a curve and a readout, be they ever so short, so that they share a kernel.
@pytest.mark.parametrize(
    "keys", ["duration: 0.8, opening: trapezoid, ramp: 0.4", "opening: [[0, 1], [0.4, 1], [0.8, 0], [1.2, 0.5]]"]
)
def test_the_streak_of_a_box_is_its_convolution_with_the_shutters_curve(keys):
    rows = picture(f"{{{keys}, readout: 1.0e-6}}", 10, height=8, spp=2048).mean(axis=0)
    np.testing.assert_allclose(rows, swept(timing(yaml.safe_load(f"{{{keys}}}")).profile), atol=0.01)
    # The energy of a streak is that of the thing at rest.
    assert rows.sum() == pytest.approx(6.0, rel=2e-3)


@pytest.mark.parametrize(
    ("direction", "curtain"), [("down", "electronic"), ("up", "electronic"), ("down", "focal_plane")]
)
def test_a_rolling_shutter_skews_what_moves_across(direction, curtain):
    """A bar at 16 px/s through a readout of 1/2 s leans by v T = 8 px from top to bottom."""
    keys = f"duration: 0.01, opening: trapezoid, ramp: 1.0e-6, direction: {direction}, curtain: {curtain}"
    pixels = picture(f"{{{keys}, readout: 0.5}}", 16)
    middles = (pixels * (np.arange(32) + 0.5)).sum(axis=1) / pixels.sum(axis=1)
    lean = np.polyfit(np.arange(32), middles, 1)[0] * 32
    assert lean == pytest.approx(8.0 if direction == "down" else -8.0, abs=0.1)
    # The first row starts at time 0 (by whole rows) with the bar's middle at 11 m, and its mean is half a streak later.
    first = middles[0] if direction == "down" else middles[-1]
    begin = 0.0 if curtain == "electronic" else 0.5 * 8.0 / 32
    assert first == pytest.approx(11.0 + 0.08 + begin, abs=0.1)
    # A line of pixels is exposed for 1/100 s: 0.16 px of blur on either side.
    np.testing.assert_allclose(pixels.sum(axis=1), 6.0, rtol=0.02)


@pytest.mark.parametrize(("direction", "length"), [("right", 6 / (1 - 8 / 32)), ("left", 6 / (1 + 8 / 32))])
def test_a_rolling_shutter_along_the_motion_stretches_or_squeezes(direction, length):
    """Read along the motion, an edge at x is met when x0 + v t = x with t = T x / n: x0 / (1 - v T / n)."""
    pixels = picture(
        f"{{duration: 1.0e-4, opening: trapezoid, ramp: 1.0e-6, readout: 0.5, direction: {direction}}}", 16
    )
    assert pixels.sum(axis=1).mean() == pytest.approx(length, abs=0.4)
