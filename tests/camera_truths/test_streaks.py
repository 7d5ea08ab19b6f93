"""How long the streaks of moving points are.

A spot that moves evenly by L pixels is spread along its way by L^2 / 12 more than across it.  The spot's 28 pixels hold
n = 14 000 of the 512 samples a pixel, so that a variance v is known to about v / sqrt(n), 0.8 %: the shortest of these
streaks, 1.85 pixels, to 0.07 pixels, and the longest, 30 pixels, to 0.13.  0.2 is more than that, which is for
independent numbers; Sobol's do better.  A smaller spot would do worse, by the grid of the pixels (Sheppard's
corrections to moments hold for what is wider than a few of them).
"""

import math

import pytest

from tests.camera_truths.measure import moments, pixels, spot

ROWS, VFOV, DEPTH, SPEED = 1080, 40.0, 10.0, 3.0
PIXEL = 2.0 * math.tan(math.radians(VFOV / 2.0)) / ROWS * DEPTH
"""Width (m) of a pixel where the point is."""

CAMERA = "type: pinhole, sensor: full_frame, sensor_fit: vertical, f_number: 8, iso: 100"
"""What its picture is exposed to, which is its brightness alone."""

SPOT_PX = 3.0

TRAIL_VFOV = 4.0
TRAIL_PIXEL = 2.0 * math.tan(math.radians(TRAIL_VFOV / 2.0)) / 48.0 * DEPTH
"""The same, in pictures of 48 rows, narrow enough for cos^4 of the angle to the axis to be 1 within 0.2 %."""


def streak(shutter, *, velocity=f"[{SPEED}, 0, 0]", x=0.0, crop_px=48):
    """Moments (px, from the middle of the film) of the picture of a point that moves."""
    left = 960 - crop_px // 2
    picture = pixels(
        f"{CAMERA}, vfov: {VFOV}, shutter: {shutter}",
        spot(x, 0.0, DEPTH, SPOT_PX * PIXEL, f", motion: {{velocity: {velocity}}}"),
        width=1920,
        height=ROWS,
        spp=512,
        crop=(left, 540 - crop_px // 2, left + crop_px, 540 + crop_px // 2),
    )
    found = moments(picture)
    return found._replace(x=found.x - crop_px / 2, y=found.y - crop_px / 2)


def length(found):
    """Length (px) of a streak along x."""
    return math.sqrt(12.0 * (found.variance_x - found.variance_y))


def test_the_streak_of_the_worked_number():
    # Camera truths: (rows / 2 tan(vfov / 2)) v dt / z: 1080 rows, 40 deg, 3 m/s, 10 m, 1/60 s: 7.418 px.
    found = streak("1/60 s")
    assert length(found) == pytest.approx(7.418, abs=0.2)
    # It is at x = 0 when the shutter opens, and half the way is the streak's middle.
    assert found.x == pytest.approx(7.418 / 2.0, abs=0.2)
    assert found.y == pytest.approx(0.0, abs=0.1)


def test_a_streak_is_as_long_as_the_shutter_is_open():
    for number in (240, 120, 60, 30, 15):
        way = 7.418 * 60.0 / number
        found = streak(f"1/{number} s", x=-0.5 * way * PIXEL)
        assert length(found) == pytest.approx(way, abs=0.2), number
        assert found.x == pytest.approx(0.0, abs=0.2)
    # And not where on the scene's clock the shutter opens.
    late = streak("{open: 2, duration: 1/30 s}", x=-SPEED * (2.0 + 1.0 / 60.0))
    assert length(late) == pytest.approx(2.0 * 7.418, abs=0.2)
    assert late.x == pytest.approx(0.0, abs=0.2)


def test_what_moves_towards_the_camera_leaves_no_streak_on_the_axis():
    found = streak("1/60 s", velocity=f"[0, 0, {SPEED}]")
    assert found.variance_x == pytest.approx(found.variance_y, rel=0.05)
    # The spot grows by 1 / (1 - 0.005) in that time: its variance without the pixel's is a^2 / 4.
    assert found.variance_x - 1.0 / 12.0 == pytest.approx(SPOT_PX**2 / 4.0, rel=0.05)


def test_the_energy_of_a_light_trail_grows_with_the_time_and_its_brightness_does_not():
    """A lamp that flies draws a trail as long as the exposure; each place of it is lit for as long as the lamp passes.

    Exposed, as against a mean over the time: what rests is brighter in proportion to the time.
    """

    def trail(seconds, velocity):
        way = velocity * seconds
        return pixels(
            f"{CAMERA}, vfov: {TRAIL_VFOV}, shutter: {seconds!r}",
            spot(-0.5 * way, 0.0, DEPTH, 3.0 * TRAIL_PIXEL, f", motion: {{velocity: [{velocity!r}, 0, 0]}}"),
            width=96,
            height=48,
            spp=256,
        )

    slow, fast = (40.0 * TRAIL_PIXEL / seconds for seconds in (1.0, 0.5))
    once, twice, again = trail(0.5, slow), trail(1.0, slow), trail(0.5, fast)
    # Twice the time is twice the energy, on twice the length; the fast one is as long with half the energy.
    assert twice.sum() / once.sum() == pytest.approx(2.0, rel=0.01)
    assert twice.sum() / again.sum() == pytest.approx(2.0, rel=0.01)
    # In the middle the lamp passes in 6 pixels of way: noise of 6 / 40 of 8 * 256 samples, 6 %.
    middle = slice(20, 28), slice(44, 52)
    assert twice[middle].sum() / once[middle].sum() == pytest.approx(1.0, rel=0.05)
    assert twice[middle].sum() / again[middle].sum() == pytest.approx(2.0, rel=0.05)
    # And by photometry: a lamp of the radiance 1 that covers 9 pi pixels, on film at an f-number of 8.
    value = 179.0 * math.pi / (4.0 * 64.0) * 100.0 / 78.0
    assert once.sum() == pytest.approx(0.5 * value * 9.0 * math.pi, rel=0.01)


# ---- Rolling shutter


def test_the_skew_of_the_worked_number():
    """Camera truths: 1920 px/s, 1/60 s, 1080 rows: 32 px, 1.697 deg.

    A bar of 8 pixels' width, found in rows at the top and at the bottom: by 8 x 64 samples in each of 8 rows its middle
    is known to 8 / sqrt(12 * 4096), 0.04 pixels.
    """
    velocity = 1920.0 * PIXEL

    def middle(top):
        picture = pixels(
            f"{CAMERA}, vfov: {VFOV}, shutter: {{duration: 1 us, readout: 1/60 s, direction: down}}",
            f"objects:\n  - {{type: quad, corner: [{-4.0 * PIXEL!r}, -9, -10], "
            f"edges: [[{8.0 * PIXEL!r}, 0, 0], [0, 18, 0]], "
            f"material: {{type: emitter, radiance: 1}}, motion: {{velocity: [{velocity!r}, 0, 0]}}}}\n",
            width=1920,
            height=ROWS,
            spp=64,
            crop=(950, top, 1010, top + 8),
        )
        return moments(picture).x - 10.0

    first, last = middle(0), middle(ROWS - 8)
    lean = (last - first) * ROWS / (ROWS - 8)
    assert lean == pytest.approx(32.0, abs=0.5)
    assert math.degrees(math.atan(lean / ROWS)) == pytest.approx(1.697, abs=0.027)
    # The first of the rows is read at once, and the others of the eight up to 7 / 1080 of 32 pixels later.
    assert first == pytest.approx(0.5 * 7.0 / ROWS * 32.0, abs=0.2)
