"""How bright pictures are before an even sky, against photometry.

Light of the radiance 1 comes from everywhere, so a pixel is the mean weight of its rays: the way from the pupil to the
film.  The weight does not vary behind a corrected lens focused at infinity, and by half of its mean behind the widest
flat pupil here, so that of 200,000 rays the mean is known to 0.1 % at worst.  That pictures are made of these weights,
and exposed as they say, is measured on a few.
"""

import math
from itertools import pairwise

import numpy as np
import pytest

from raytracer.scene.load import build
from tests.camera_truths.measure import LOOK, pixels
from tests.plugins.cameras.kernels import weighted_rays

SKY = """
environment: {type: constant, radiance: 1}
objects:
  - {type: disc, center: [0, 0, 1000], normal: [0, 0, 1], radius: 1, material: {type: emitter, radiance: 1}}
"""
PIXELS, COUNT = 16, 200_000


def irradiance(picture, seconds=1.0, iso=100.0):
    """Irradiance (W/m2) of the film, from the values of an exposed picture: K E t S / 78, ISO 12232, K = 179 lm/W."""
    return float(picture.mean()) / (179.0 * seconds * iso / 78.0)


def weights(camera, places, width, height):
    """Mean weight of rays from film positions (n, 2): irradiance (W/m2) in a field of radiance 1."""
    text = f"camera: {{{LOOK}, {camera}, shutter: 1, iso: 100}}\nfilm: {{width: {width}, height: {height}}}\n"
    packed = build(text, "test.yaml").camera.pack(width, height)
    return float(weighted_rays(packed, *np.transpose(places))[2].mean())


def on_axis(camera, size_mm=0.1):
    """E / (pi L) in the middle of the film, which is small."""
    places = PIXELS * np.random.default_rng(1).random((COUNT, 2))
    sensor = f"sensor: {{width: {size_mm!r}, height: {size_mm!r}}}"
    return weights(f"{camera}, {sensor}", places, PIXELS, PIXELS) / math.pi


def off_axis(camera, slope, focal):
    """E / (pi L) at the right edge of the film, where the middle of the lens is seen at atan(slope) to the axis."""
    size = 2.0 * slope * focal
    sensor = f"sensor: {{width: {size!r}, height: {size / 100!r}}}, sensor_fit: horizontal"
    return weights(f"{camera}, {sensor}", np.tile([400.0, 2.0], (COUNT, 1)), 400, 4) / math.pi


def foote(slope, f_number):
    """E / (pi L) at tan(angle) = slope from the middle of an even disc: Foote 1915, as in the camera truths."""
    t2, p2 = 1.0 / (4.0 * f_number * f_number), slope * slope
    secant4 = (1.0 + p2) ** 2
    return 0.5 * (1.0 - (1.0 + p2 - t2) / math.sqrt(t2 * t2 + 2.0 * t2 * (1.0 - p2) + secant4))


LENS = "type: thin_lens, focal_length: 50, focus_distance: .inf"
FLAT = f"{LENS}, pupil: flat"


# ---- Apertures


@pytest.mark.parametrize("f_number", [0.5, 0.95, 1.4, 2.8, 8.0, 22.0])
def test_a_lens_is_as_bright_as_its_f_number_says(f_number):
    # Corrected, by the sine condition: the cone on the film has sin = 1 / 2N, so E = pi L / (4 N^2) on the axis; a flat
    # pupil gathers pi L sin^2 of the cone's half angle, which is atan(1 / 2N).
    assert on_axis(f"{LENS}, f_number: {f_number}") == pytest.approx(1.0 / (4.0 * f_number**2), rel=2e-3)
    assert on_axis(f"{FLAT}, f_number: {f_number}") == pytest.approx(1.0 / (1.0 + 4.0 * f_number**2), rel=2e-3)


def test_a_longer_lens_of_the_same_f_number_is_as_bright_and_foote_is_the_camera_truths_formula():
    for focal in (17.0, 200.0):
        camera = f"type: thin_lens, focal_length: {focal}, focus_distance: .inf, f_number: 4"
        assert on_axis(camera) == pytest.approx(1.0 / 64.0, rel=2e-3)
    assert foote(math.tan(math.radians(20.0)), 1.4) == pytest.approx(0.092460, abs=1e-6)


@pytest.mark.parametrize("angle", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("f_number", [0.95, 1.4, 4.0])
def test_off_the_axis_flat_pupils_are_as_foote_says(f_number, angle):
    slope = math.tan(math.radians(angle))
    found = off_axis(f"{FLAT}, f_number: {f_number}", slope, 50.0)
    assert found == pytest.approx(foote(slope, f_number), rel=5e-3)


@pytest.mark.parametrize("angle", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("f_number", [0.95, 22.0])
def test_off_the_axis_a_corrected_lens_is_darker_by_cos_4(f_number, angle):
    """What comes from afar in parallel through the pupil is A cos, of the patch's image per solid angle cos^-3."""
    found = off_axis(f"{LENS}, f_number: {f_number}", math.tan(math.radians(angle)), 50.0)
    assert found == pytest.approx(math.cos(math.radians(angle)) ** 4 / (4.0 * f_number**2), rel=5e-3)


@pytest.mark.parametrize(
    "kind", ["pinhole", "thin_lens, focus_distance: .inf", "thin_lens, focus_distance: .inf, pupil: flat"]
)
def test_a_small_pupil_is_darker_at_the_corner_by_cos_4(kind):
    # Camera truths: 17 mm on 36 x 24 mm: 0.1457, which is 2.78 EV.
    camera = f"type: {kind}, focal_length: 17, f_number: 22, sensor: {{width: 36, height: 24}}"
    corner, middle = (weights(camera, np.tile(place, (COUNT, 1)), 36, 24) for place in ((36.0, 0.0), (18.0, 12.0)))
    assert corner / middle == pytest.approx(0.1457, rel=5e-3)
    assert math.log2(corner / middle) == pytest.approx(-2.78, abs=0.01)


@pytest.mark.parametrize(("pupil", "f_number"), [("aplanatic", 2.8), ("flat", 16.0)])
def test_focused_close_a_lens_is_darker_by_its_magnification(pupil, f_number):
    """(1 + m)^2, m = f / (s - f): 1.2346 for 50 mm at 0.5 m.

    A corrected lens that is seen under the angle 2 u from the subject gets cos^2 u of that, 0.03 % less for f/2.8; a
    flat pupil 4 N^2 (1 + m)^2 + 1 over 4 N^2 + 1, 0.02 % less for f/16.
    """
    far, near = (
        on_axis(f"type: thin_lens, pupil: {pupil}, focal_length: 50, f_number: {f_number}, focus_distance: {distance}")
        for distance in (".inf", "0.5")
    )
    assert far / near == pytest.approx(1.2346, rel=5e-3)


def test_a_hole_of_a_size_is_an_aperture_of_its_f_number():
    # 6 mm before film at 150 mm: f/25; as a thin lens of that, and as a pinhole without a size.
    expected = 1.0 / (4.0 * 25.0**2)
    for camera in (
        "type: pinhole, focal_length: 150, diameter: 6",
        "type: pinhole, focal_length: 150, f_number: 25",
        "type: thin_lens, focal_length: 150, focus_distance: .inf, aperture: 6",
    ):
        assert on_axis(camera) == pytest.approx(expected, rel=2e-3)
    # A wide hole bends no ray: it is a flat pupil by itself, here as wide as the film is far, f/1.
    assert on_axis("type: pinhole, focal_length: 150, diameter: 150") == pytest.approx(1.0 / 5.0, rel=2e-3)


# ---- Exposure


def exposed(f_number, seconds, iso=100.0, more=""):
    """Mean value of a picture on axis; the sky has 1 W/(m2 sr)."""
    camera = f"{LENS}, f_number: {f_number!r}, shutter: {seconds!r}, iso: {iso!r}{more}"
    sensor = "sensor: {width: 0.1, height: 0.1}"
    return float(pixels(f"{camera}, {sensor}", SKY, width=PIXELS, height=PIXELS, spp=64).mean())


def test_ten_equal_exposures():
    """N = sqrt(2)^k and t = 2^(k - 10), from f/1.4 at 1/512 s to f/32 at 1 s, have the same t / N^2."""
    row = [exposed(math.sqrt(2.0) ** k, 2.0 ** (k - 10)) for k in range(1, 11)]
    assert max(row) / min(row) < 1.005
    # All of them are what ISO 12232 makes of pi / 4 * 2^-10 J/m2.
    assert np.mean(row) == pytest.approx(179.0 * math.pi / 4.0 / 1024.0 * 100.0 / 78.0, rel=2e-3)


ENGRAVED = dict(zip([1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22, 32], [500, 250, 125, 60, 30, 15, 8, 4, 2, 1], strict=True))


def test_the_engraved_numbers_are_within_an_eighth_of_a_stop():
    exact = 179.0 * math.pi / 4.0 / 1024.0 * 100.0 / 78.0
    stops = [math.log2(exposed(f_number, 1 / part) / exact) for f_number, part in ENGRAVED.items()]
    assert max(map(abs, stops)) < 0.125
    # They do differ, by 8.8 %.
    assert 2.0 ** (max(stops) - min(stops)) == pytest.approx(1.088, abs=2e-3)


def test_a_stop_is_a_factor_of_2():
    """Of the f-number, sqrt(2), of the time, of the speed, and of what compensates them."""
    base = exposed(8.0, 1 / 64, 200.0)
    assert base == pytest.approx(179.0 * math.pi / 256.0 / 64.0 * 200.0 / 78.0, rel=2e-3)
    for other in (
        exposed(8.0, 1 / 32, 200.0),
        exposed(8.0, 1 / 64, 400.0),
        exposed(8.0, 1 / 64, 200.0, ", exposure_compensation: 1"),
    ):
        assert other / base == pytest.approx(2.0, rel=1e-12)
    apertures = [exposed(math.sqrt(2.0) ** k, 1 / 64) for k in range(11)]
    assert [a / b for a, b in pairwise(apertures)] == pytest.approx([2.0] * 10, rel=5e-3)
    # The same brightness by all three together.
    assert exposed(8.0 * math.sqrt(2.0), 1 / 128, 800.0) == pytest.approx(base, rel=5e-3)


# ---- No lens at all


def test_a_bare_sensor_records_the_irradiance_of_its_half_space():
    # pi of an even sky of radiance 1, exactly; with a speed, what it saturates by.
    picture = pixels("type: none", SKY, width=PIXELS, height=PIXELS, spp=16)
    np.testing.assert_allclose(picture, math.pi, rtol=1e-12)
    exposed_picture = pixels("type: none, shutter: 1/1000 s, iso: 50", SKY, width=PIXELS, height=PIXELS, spp=16)
    assert irradiance(exposed_picture, 1e-3, 50.0) == pytest.approx(math.pi, rel=1e-12)


def test_a_bare_sensor_sees_nearly_the_same_everywhere():
    """A disc of the radius R at the distance d from the sensor's middle: E = pi L sin^2(atan(R / d)).

    Off the middle it is darker: at 21.6 mm, the corner of full frame, by cos^4 at most, 0.1 % for d = 1 m.  Half of the
    4096 samples of a pixel meet the disc, so 24 pixels are known to 0.3 %, with independent numbers.
    """
    radius, distance = 1.0, 1.0
    lamp = f"""
environment: {{type: constant, radiance: 1.0e-9}}
objects:
  - {{type: disc, center: [0, 0, {-distance}], normal: [0, 0, 1], radius: {radius},
      material: {{type: emitter, radiance: 1}}}}
"""
    picture = pixels("type: none", lamp, width=24, height=16, spp=4096)
    expected = math.pi * radius**2 / (radius**2 + distance**2)
    assert picture.mean() == pytest.approx(expected, rel=2e-3)
    blocks = picture.reshape(4, 4, 6, 4).mean(axis=(1, 3))
    assert blocks.max() / blocks.min() < 1.02
