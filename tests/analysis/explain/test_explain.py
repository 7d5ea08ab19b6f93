"""`rt explain`: the camera in numbers, each against a formula or a worked number that others have published."""

import json
import math
import re
from pathlib import Path

import pytest

from docs.scene_tables import nested_mappings
from raytracer.analysis.explain import Circle, explain, parse_circle
from raytracer.cli.base.app import main
from raytracer.core.motion.trajectory import row_at
from raytracer.kernel.path_tracer import render_tile
from raytracer.plugins.cameras.pinhole import Pinhole
from raytracer.scene.json_schema import properties_of, scene_schema
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import InputError
from tests.small_scenes import scene

ROOT = Path(__file__).parents[3]
SCENES = ROOT / "scenes"

FULL_FRAME = "sensor: {width: 36 mm, height: 24 mm}"
PINHOLE = f"type: pinhole, {FULL_FRAME}, "
THIN = f"type: thin_lens, {FULL_FRAME}, "
HERE = "look_from: [0, 0, 0], look_at: [0, 0, -1]"


def explained(camera, *objects, lights="", width=1500, height=1000, **asked):
    items = objects or ("type: sphere, center: [0, 0, -2], radius: 0.1",)
    head = f"camera: {{{HERE}, {camera}}}\nenvironment: {{type: constant, radiance: 1}}\nlights: [{lights}]\nobjects:\n"
    text = head + "".join(f"  - {{{item}}}\n" for item in items)
    return explain(scene(text, width=width, height=height, filled=False), **asked)


def ball(name, distance, more=""):
    return f"type: sphere, name: {name}, center: [0, 0, {-distance!r}], radius: 0.01{more}"


# ---- The lens and its depth of field


def of_sensor(width, height):
    return f"type: pinhole, sensor: {{width: {width} mm, height: {height} mm}}, focal_length: 25 mm"


def near(value, error):
    return pytest.approx(value, abs=error)


C = math.hypot(36.0, 24.0) / 1500.0
"""The circle (mm) that counts as sharp."""
X = 1.4 * C * 1950.0

LONG = f"{PINHOLE}focal_length: 200 mm, diameter: 6 mm"
FAST = f"{THIN}focal_length: 50 mm, f_number: 1.4, focus_distance: 2"
MACRO = f"{THIN}focal_length: 50 mm, f_number: 2, focus_distance: 0.5"
WEEKEND = "type: thin_lens, vfov: 20, focus_distance: 10, defocus_angle: 0.6"


@pytest.mark.parametrize(
    ("camera", "key", "value"),
    [
        (f"{PINHOLE}focal_length: 50 mm", "dfov_deg", near(46.79, 0.005)),
        (f"{PINHOLE}focal_length: 50 mm", "hfov_deg", near(math.degrees(2.0 * math.atan(0.36)), 1e-10)),
        (f"{PINHOLE}focal_length: 50 mm", "vfov_deg", near(math.degrees(2.0 * math.atan(0.24)), 1e-10)),
        (of_sensor(23.6, 15.73), "crop_factor", near(1.5255, 5e-4)),
        (of_sensor(13.2, 8.8), "crop_factor", near(2.727, 5e-4)),
        (of_sensor(13.2, 8.8), "equivalent_focal_length_mm", near(25.0 * 2.727, 0.02)),
        # The darkening by (1 + m)^2, m = f / (s - f), of 50 mm at 0.5 m is 1.2346.
        (MACRO, "magnification", near(math.sqrt(1.2346) - 1.0, 3e-5)),
        (MACRO, "image_distance_mm", near(1.0 / (1.0 / 50.0 - 1.0 / 500.0), 1e-10)),
        # A hole blurs infinity by its own size, and has no focus; a pixel is 24 um wide.
        (LONG, "blur_at_infinity_px", near(6.0 / 0.024, 1e-9)),
        (LONG, "magnification", None),
        (f"{PINHOLE}focal_length: 200 mm", "blur_at_infinity_px", None),
        (f"{PINHOLE}focal_length: 200 mm", "near_limit_m", None),
        # s f^2 / (f^2 -+ N c (s - f)) and f^2 / (N c) + f, in mm.
        (FAST, "circle_mm", near(C, 1e-12)),
        (FAST, "circle_px", near(math.hypot(1500.0, 1000.0) / 1500.0, 1e-12)),
        (FAST, "depth_of_field_m", near(1e4 * X / (2500.0**2 - X**2), 1e-9)),
        (FAST, "near_limit_m", near(2.0 * 2500.0 / (2500.0 + X), 1e-9)),
        (FAST, "far_limit_m", near(2.0 * 2500.0 / (2500.0 - X), 1e-9)),
        (FAST, "hyperfocal_m", near(1e-3 * (2500.0 / (1.4 * C) + 50.0), 1e-9)),
        (f"{THIN}focal_length: 28 mm, f_number: 11, focus_distance: 2.5", "far_limit_m", math.inf),
        (WEEKEND, "aperture_diameter_mm", near(104.720, 1e-3)),
        (f"{THIN}focal_length: 50 mm, f_number: 1, shutter: 1 s, iso: 100", "ev100", near(0.0, 1e-12)),
        (f"{THIN}focal_length: 50 mm, f_number: 16, shutter: 1/128 s, iso: 100", "ev100", near(15.0, 1e-12)),
        (f"{THIN}focal_length: 50 mm, f_number: 2, shutter: 1/64 s, iso: 400", "ev100", near(6.0, 1e-12)),
    ],
)
def test_numbers_of_cameras(camera, key, value):
    assert explained(camera).camera.get(key) == value


@pytest.mark.parametrize(
    ("camera", "distance", "unit", "circle"),
    [
        # 1500 pixels on 36 mm.
        (FAST, 4.0, "mm", near(0.45788, 5e-6)),
        (FAST, 2.0, "mm", near(0.0, 1e-15)),
        (FAST, 4.0, "px", near(0.45788 / 0.024, 2e-4)),
        # The camera of Ray Tracing in One Weekend, whose 675 rows are 1000 here.
        (WEEKEND, 5.0, "px", near(20.044 / 0.675, 1e-3)),
        (WEEKEND, 20.0, "px", near(10.022 / 0.675, 1e-3)),
        (WEEKEND, 5.0, "mm", None),
        # d (1 + f / z), by similar triangles.
        (LONG, 0.5, "mm", near(6.0 * (1.0 + 0.2 / 0.5), 1e-9)),
        (LONG, 20.0, "mm", near(6.0 * (1.0 + 0.2 / 20.0), 1e-9)),
        ("type: pinhole, vfov: 40", 5.0, "px", 0.0),
    ],
)
def test_circles_of_confusion_of_objects(camera, distance, unit, circle):
    found = explained(camera, ball("ball", distance)).objects["ball"]
    assert found["distance_m"] == pytest.approx(distance)
    assert found.get(f"circle_of_confusion_{unit}") == circle


def test_limits_for_a_stated_circle():
    lens = f"{THIN}focal_length: 50 mm, f_number: 2.8, focus_distance: 3"
    limits = explained(lens, circle=parse_circle("0.03 mm")).camera
    assert limits["near_limit_m"] == pytest.approx(2.7295, abs=5e-5)
    assert limits["far_limit_m"] == pytest.approx(3.3301, abs=5e-5)
    assert limits["hyperfocal_m"] == pytest.approx(0.05 * 0.05 / (2.8 * 0.03e-3) + 0.05)
    edges = explained(lens, ball("near", limits["near_limit_m"]), ball("far", limits["far_limit_m"])).objects
    assert edges["near"]["circle_of_confusion_mm"] == pytest.approx(0.03)
    assert edges["far"]["circle_of_confusion_mm"] == pytest.approx(0.03)
    # A pixel is 24 um wide.
    by_length, by_pixels = (explained(lens, circle=parse_circle(text)).camera for text in ("48 um", "2px"))
    assert by_length["far_limit_m"] == pytest.approx(by_pixels["far_limit_m"], rel=1e-12)


def test_limits_need_no_sensor():
    # Limits follow from angles: the same lens and angle of view with a sensor has the same.
    lens = "type: thin_lens, vfov: 30, focus_distance: 3, aperture: 20 mm"
    plain, sized = explained(lens), explained(f"{lens}, {FULL_FRAME}")
    for name in ("near_limit_m", "far_limit_m", "circle_px"):
        assert plain.camera[name] == pytest.approx(sized.camera[name], rel=1e-12)
    assert "circle_mm" not in plain.camera
    # The circle is told once.
    for found, words in ((plain, " 1.202 px"), (sized, " 1.202 px, 0.02884 mm")):
        (line,) = [line for line in found.text().splitlines() if "circle of" in line and "sharp" in line]
        assert line.endswith(words)
    with pytest.raises(InputError, match="give pixels"):
        explained(lens, circle=Circle(0.03, "mm"))


@pytest.mark.parametrize("text", ["", "0 mm", "-1 px", "inf", "2 px px", "3 s", "nan px", "px"])
def test_what_is_no_circle_is_refused(text):
    with pytest.raises(InputError, match="--circle"):
        parse_circle(text)


# ---- Warnings

SHUTTER = f"{THIN}focal_length: 50 mm, f_number: 2, shutter: "
NOISY = (
    "type: thin_lens, sensor: {width: 36 mm, height: 24 mm, noise: true, base_iso: 100}, focal_length: 50 mm, "
    "f_number: 2, shutter: 1/60 s, iso: "
)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (f"{SHUTTER}125, iso: 100", ("was 1/125 s meant",)),
        (f"{SHUTTER}125, exposure: auto", ("was 1/125 s meant",)),
        (f"{SHUTTER}30, iso: 100", ()),
        (f"{SHUTTER}125", ()),
        (f"{SHUTTER}1/125 s, exposure: auto", ()),
        (f"{PINHOLE}focal_length: 0.05", ("focal_length is 0.05 mm", "was 0.05 m meant")),
        (f"{PINHOLE}equivalent_focal_length: 0.05", ("equivalent_focal_length is 0.05 mm", "was 0.05 m meant")),
        (f"{PINHOLE}focal_length: 0.05 m", ()),
        (f"{THIN}focal_length: 50 mm, f_number: 0.4", ("f/0.4 is faster than f/0.5",)),
        (f"{THIN}focal_length: 50 mm, f_number: 0.5", ()),
        (f"{PINHOLE}focal_length: 50 mm, f_number: 8", ("blurs nothing",)),
        # Highlights that end below white, of a sensor that is simulated.
        (f"{NOISY}200, exposure_compensation: -3", ("ISO 25,", "at 0.25 of white")),
        (f"{NOISY}200, exposure_compensation: -1", ()),
        (f"{NOISY}100, exposure_compensation: 1", ()),
        (f"{NOISY.replace('noise: true, base_iso: 100', '')}200, exposure_compensation: -3", ()),
    ],
)
def test_what_looks_like_a_mistake_is_a_warning(camera, words):
    found = explained(camera).warnings
    assert len(found) == bool(words)
    assert all(part in found[0] for part in words)


def test_diffraction_that_would_show_is_a_warning():
    # 2.44 x 0.55 um x 22 = 29.5 um, at infinity; and at life size of f/11, twice the focal length away.
    lens = f"{THIN}focal_length: 50 mm, "
    for more in ("focus_distance: inf, f_number: 22", "focus_distance: 0.1, f_number: 11"):
        small = explained(lens + more, width=6000, height=4000)
        assert small.camera["airy_disc_um"] == pytest.approx(29.52, abs=0.01)
        (sentence,) = small.warnings
        assert sentence.startswith("diffraction is ")
        assert "f/22 " in sentence
        assert not explained(lens + more, width=1200, height=800).warnings
    assert not explained(f"{lens}focus_distance: inf, f_number: 4", width=6000, height=4000).warnings


# ---- Flashes


def flash_warnings(shutter, *flashes):
    lights = ", ".join(f"{{type: flash, energy: 1, {keys}}}" for keys in flashes)
    return explained(f"type: pinhole, vfov: 40, shutter: {shutter}", lights=lights).warnings


RAMPED = "{duration: 20 ms, opening: trapezoid, ramp: "
SLIT = "{duration: 2 ms, readout: "
LONGER = "fully open for 0.004001 s or longer"


@pytest.mark.parametrize(
    ("shutter", "flash", "words"),
    [
        ("1/60 s", "duration: 1 ms", None),
        ("1/60 s", "duration: 1/60 s", None),
        ("1/60 s", "duration: 1/60 s, curtain: second", None),
        ("{open: 12.3, close: 12.4}", "duration: 1 ms, curtain: second", None),
        (f"{RAMPED}5 ms}}", "duration: 15 ms", None),
        ("{duration: 20 ms, readout: 10 ms}", "duration: 10 ms", None),
        ("{duration: 20 ms, readout: 10 ms, curtain: focal_plane}", "duration: 10 ms, curtain: second", None),
        ("1/125 s", "duration: 16 ms", "shines for 0.016 s, of which the shutter is fully open for 1/125 s: 50 % of"),
        ("1/125 s", "duration: 1 ms, offset: 7.5 ms", "fully open for 1/2000 s: 50 % of its light is lost"),
        ("1/125 s", "duration: 1 ms, offset: 8 ms", "while the shutter is closed: none"),
        ("1/125 s", "duration: 1 ms, offset: -2 ms", "while the shutter is closed: none"),
        # Half of the ramp is an eighth of the light of all of it.
        (f"{RAMPED}4 ms}}", "duration: 2 ms, offset: -4 ms", "for 0 s: 75 % of"),
        ("{opening: [[0, 0.5], [8 ms, 0.5]]}", "duration: 16 ms", "fully open for 1/125 s: 50 % of"),
        # Beyond the sync speed: a slit of 2 ms crosses in 4 ms.  When the last line is open, half has closed again.
        (f"{SLIT}4 ms, direction: down}}", "duration: 1 us", f"50 to 100 % of the height from the top; .*{LONGER}"),
        (f"{SLIT}4 ms, direction: up}}", "duration: 1 us", f"50 to 100 % of the height from the bottom; .*{LONGER}"),
        (f"{SLIT}4 ms, direction: right}}", "duration: 1 us", f"50 to 100 % of the width from the left; .*{LONGER}"),
        (f"{SLIT}4 ms, direction: left}}", "duration: 1 us", f"50 to 100 % of the width from the right; .*{LONGER}"),
        # At 3 to 4 ms, lines that begin to open at 1 to 4 ms are open, those of 2 to 3 ms all the while.
        (f"{SLIT}5 ms}}", "duration: 1 ms, offset: -2 ms", "20 to 80 % .* the top, and 40 to 60 % in full; all of it"),
        (f"{SLIT}5 ms}}", "duration: 3 ms, offset: -2 ms", "20 to 100 % of the height .* the top, none of it in full"),
        # A shutter that is open for long enough, but not then.
        ("{duration: 8 ms, readout: 5 ms}", "duration: 1 ms, offset: -4 ms", "0 to 40 % .*, and 0 to 20 % in full$"),
    ],
)
def test_light_of_a_flash_that_the_shutter_keeps_out_is_a_warning(shutter, flash, words):
    found = flash_warnings(shutter, flash)
    assert len(found) == (words is not None)
    assert all(re.search(words, sentence) for sentence in found)


# ---- Motion

SPEED = ", motion: {velocity: [3, 0, 0]}"
REST = ball("a", 10.0)
MOVES = ball("a", 10.0, SPEED)
# 1920 px/s and 1/60 s of readout over 1080 rows: 32 px, 1.697 deg.  Streaks are those of a row.
TRAIN = ball("a", 10.0, f", motion: {{velocity: [{1920.0 * 20.0 * math.tan(math.radians(20.0)) / 1080.0!r}, 0, 0]}}")
# A square that faces the camera: its corners are sqrt(2) from its middle.
SQUARE = "type: quad, name: a, corner: [-1, -1, -10], edges: [[2, 0, 0], [0, 2, 0]]"
TURNS = f"{SQUARE}, motion: {{spin: {{axis: [0, 0, 1], rate: 1 turn/s}}}}"
CAMERA = "type: pinhole, vfov: 40, shutter: "
PANS = "type: pinhole, vfov: 90, shutter: {open: -1, close: 1}, motion: {spin: {axis: [0, 1, 0], rate: 1 deg/s}}"
QUARTER = "type: pinhole, vfov: 90, shutter: {duration: 1/4 s, readout: 1/30 s}"
BEHIND = "type: thin_lens, vfov: 40, aperture: 20 mm, focus_distance: 3, shutter: 1/60 s"


@pytest.mark.parametrize(
    ("camera", "item", "key", "value"),
    [
        (f"{CAMERA}1/60 s", MOVES, "streak_px", near(7.418, 0.005)),
        (f"{CAMERA}1/60 s", REST, "streak_px", None),
        (f"{CAMERA}{{close: 0.1}}", MOVES, "streak_px", near(6 * 7.418, 0.005)),
        # A ramp counts at half its height.
        (f"{CAMERA}{{duration: 1/60 s, opening: trapezoid, ramp: 1/120 s}}", MOVES, "streak_px", near(7.418, 0.005)),
        # A moving camera draws the same streak of what rests; one that pans, from -1 to 1 degree off the axis.
        (f"{CAMERA}1/60 s, motion: {{velocity: [-3, 0, 0]}}", REST, "streak_px", near(7.418, 0.005)),
        (PANS, REST, "streak_px", near(1080.0 * math.tan(math.radians(1.0)), 1e-7)),
        # A quarter of a turn; 64 chords are shorter than their arc by (pi / 256)^2 / 6.
        (QUARTER, TURNS, "streak_px", 0.0),
        (QUARTER, TURNS, "skew_px", None),
        (QUARTER, TURNS, "corner_streak_px", near(0.5 * math.pi * math.sqrt(2.0) / 10.0 * 540.0, 0.01)),
        (f"{CAMERA}{{duration: 1/480 s, readout: 1/60 s}}", TRAIN, "skew_px", near(32.0, 1e-6)),
        (f"{CAMERA}{{duration: 1/480 s, readout: 1/60 s}}", TRAIN, "skew_deg", near(1.697, 5e-4)),
        (f"{CAMERA}{{duration: 1/480 s, readout: 1/60 s}}", TRAIN, "streak_px", near(4.0, 1e-6)),
        # What runs along with the readout is stretched, and does not lean.
        (f"{CAMERA}{{duration: 1/480 s, readout: 1/60 s, direction: right}}", TRAIN, "skew_px", 0.0),
        # What is behind the camera has no blur.
        (BEHIND, ball("a", -3.0, SPEED), "distance_m", -3.0),
        (BEHIND, ball("a", -3.0, SPEED), "streak_px", None),
        (BEHIND, ball("a", -3.0, SPEED), "circle_of_confusion_px", None),
    ],
)
def test_streaks_and_skews(camera, item, key, value):
    assert explained(camera, item, width=1920, height=1080).objects["a"].get(key) == value


@pytest.mark.parametrize("place", [(1.3, -0.7, -9.1), (130.0, 70.0, -1e4), (0.1, 0.003, -0.07)])
def test_rounding_is_no_motion_but_the_slowest_motion_is(place):
    x, y, z = place
    ball = f"type: sphere, name: ball, center: [{x}, {y}, {z}], radius: {0.1 * abs(z)}"
    turns = f"spin: {{axis: [1, 2, 3], rate: 33 turn/s, center: [{x}, {y}, {z}]}}"
    camera = "type: pinhole, vfov: 40, shutter: 1 s"
    assert explained(camera, f"{ball}, motion: {{{turns}}}").objects["ball"]["streak_px"] == 0.0
    # A ten millionth of the distance is 1.4e-4 px.
    goes = f"velocity: [{1e-7 * abs(z)!r}, 0, 0]"
    streak = explained(camera, f"{ball}, motion: {{{turns}, {goes}}}").objects["ball"]["streak_px"]
    assert streak == pytest.approx(1e-7 * 500.0 / math.tan(math.radians(20.0)), rel=1e-3)


def test_a_hand_that_shakes_draws_streaks():
    camera = f"type: pinhole, {HERE}, vfov: 40, shutter: 1/8 s, shake: {{amplitude: 0.2 deg, bandwidth: 5 Hz}}"
    text = f"camera: {{{camera}}}\nobjects: [{{{ball('ball', 10.0)}}}]"
    spec = scene(text, filled=False, width=1000, height=1000)
    rows = pack(spec).scene.camera.trajectories.rows
    # Small turns about the camera: pixels by the angle between quaternions, along the way that is packed.
    turns = [row_at(rows, fraction / 512)[9:13] for fraction in range(513)]
    tilts = [2.0 * (turn[2:0:-1] if turn[0] > 0 else -turn[2:0:-1]) for turn in turns]
    length = math.fsum(math.dist(a, b) for a, b in zip(tilts[1:], tilts, strict=False))
    pixel = 2.0 * math.tan(math.radians(20.0)) / 1000.0
    assert explain(spec).objects["ball"]["streak_px"] == pytest.approx(length / pixel, rel=0.01)


@pytest.mark.parametrize(
    "camera", ["type: equirectangular", "type: fisheye", "type: orthographic, height: 3", f"type: none, {FULL_FRAME}"]
)
def test_cameras_without_a_lens_are_explained(camera):
    numbers = explained(f"{camera}, shutter: 1/60 s", ball("ball", 5.0, SPEED)).objects["ball"]
    assert numbers["distance_m"] == pytest.approx(5.0)
    assert "circle_of_confusion_px" not in numbers
    assert ("streak_px" in numbers) == ("none" not in camera)


# ---- What is printed


def test_objects_are_those_with_a_name_or_a_motion():
    moving = ("type: sphere, center: [0, 0, -5], radius: 1, motion: {velocity: [1, 0, 0]}",) * 10
    found = explained(
        "type: pinhole, shutter: 1/60 s", "type: sphere, center: [0, 0, -9], radius: 1", ball("a", 3.0), *moving
    )
    assert list(found.objects) == ["a", *(f"objects[{number}]" for number in range(2, 12))]
    assert "and 2 more that move" in found.text()


@pytest.mark.parametrize("focal_length", ["0.6 mm", "1.4 mm"])
def test_a_light_field_camera_is_focused_where_its_key_says_and_not_where_microlenses_see(focal_length):
    # Microlenses that show the image of that plane lie before or behind it, in the image of another.
    array = f"{{pixels: 15, arrangement: focused, focal_length: {focal_length}}}"
    optics = "sensor: {width: 6 mm, height: 6 mm}, focal_length: 40 mm, f_number: 4, focus_distance: 2"
    effects = explained(f"type: light_field, {optics}, microlenses: {array}").effects
    assert effects["defocus"] == (True, "the lens is 10 mm wide and focused at 2 m")
    assert not effects["projection"].active


# ---- Keys


def test_all_keys_of_a_scene_are_listed_and_read_back_as_they_are():
    path = SCENES / "lecture" / "iso_noise.yaml"
    spec = load(path)
    keys = explain(spec, every_key=True).keys
    # A path is what -D takes.  Keys that go with others cannot be changed alone, so all are given at once.
    given = {key.path: key.value for key in keys if key.is_given and ".type" not in key.path}
    assert "camera.sensor.noise" in given
    assert load(path, given) == spec


def test_keys_have_their_meaning_at_any_depth_whether_given_or_not():
    keys = {key.path: key for key in explain(SCENES / "cornell.yaml", every_key=True).keys}
    assert (keys["camera.vfov"].value, keys["camera.vfov"].is_given) == (40.0, True)
    assert (keys["render.seed"].value, keys["render.seed"].is_given) == (0, False)
    assert keys["camera.shake.amplitude"].meaning.startswith("root mean square (deg) of the angle about each axis")
    own = set(properties_of(Pinhole))
    # All that stands within others in the schema is there, where this camera, its film or an object may have it.
    for nested in nested_mappings(scene_schema()):
        wanted = [place for place in nested.places if place.startswith("camera.") and place.split(".")[1] in own]
        for place, form in ((place, form) for place in wanted for form in nested.forms):
            assert {f"{place}.{key}" for key in form["properties"]} <= set(keys)
    assert "camera.motion.keyframes[].transform[].rotate.axis" in keys
    assert all(key.meaning for path, key in keys.items() if not key.is_given)


def test_keys_are_told_on_the_command_line(capsys):
    assert main(["explain", str(SCENES / "cornell.yaml"), "--all", "--json", "-D", "camera.vfov=30"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == ["effects", "camera", "objects", "warnings", "keys"]
    keys = found["keys"]
    assert {"path": "camera.vfov", "value": 30.0, "is_given": True}.items() <= keys[2].items()
    assert main(["explain", str(SCENES / "cornell.yaml"), "--all"]) == 0
    out = capsys.readouterr().out
    assert "\n  render.seed = 0  (default)\n      Seed: the same scene, seed and spp give the same image\n" in out
    assert "\n  camera.shake.seed  (not given)\n" in out
    assert main(["explain", str(SCENES / "cornell.yaml")]) == 0
    assert "render.seed" not in capsys.readouterr().out


def test_focused_at_the_hyperfocal_distance_all_from_half_of_it_is_sharp():
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 35 mm, f_number: 8, focus_distance: "
    hyperfocal = explained(lens + "3").camera["hyperfocal_m"]
    beyond = explained(f"{lens}{1.0001 * hyperfocal!r}").camera
    assert beyond["far_limit_m"] == math.inf
    assert explained(f"{lens}{0.9999 * hyperfocal!r}").camera["far_limit_m"] < math.inf
    # Half of it, to first order in the focal length.
    assert beyond["near_limit_m"] == pytest.approx(hyperfocal / 2.0, rel=1e-3)


def test_flashes_are_told_apart():
    found = flash_warnings("1/60 s", "duration: 1 ms", "duration: 1 ms, offset: 1")
    assert [sentence.split(" shines")[0] for sentence in found] == ["the flash lights[1]"]


def test_text_is_aligned_in_groups():
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 22, focus_distance: inf, shutter: 1/125 s"
    text = explained(lens, ball("ball", 5.0, SPEED), width=6000, height=4000).text()
    lines = text[text.index("Camera: thin_lens") :].splitlines()
    assert [line for line in lines if line and not line.startswith(" ")] == [
        "Camera: thin_lens",
        "Objects in the middle of the exposure; their blur is the circle of confusion",
        "Simulated",
        "Warnings",
    ]
    numbers = dict(line.strip().split("  ", 1) for line in lines if line.startswith("    ") and "  " in line.strip())
    assert {name: value.strip() for name, value in numbers.items()}.items() >= {
        ("focal length", "50 mm"),
        ("f-number", "f/22"),
        ("shutter", "1/125 s"),
        ("far limit", "infinity"),
        ("diagonal", "46.79 deg"),
    }
    table = lines[lines.index("Objects in the middle of the exposure; their blur is the circle of confusion") + 1 :][:2]
    assert len({len(line) for line in table}) == 1
    assert max(map(len, lines)) <= 120


def test_kinds_that_a_scene_has_none_of_are_a_line_a_family():
    found = explained("type: pinhole", every_key=True)
    left_out = found.text().partition("Left out\n")[2].partition("\n\n")[0]
    joined = " ".join(left_out.split())
    assert "material none of boundary, cutout, dielectric, emitter, metal, " in joined
    assert "shape none of box, disc, " in joined
    assert "sphere" not in joined
    assert "0 objects" not in joined
    assert max(map(len, left_out.splitlines())) <= 100
    # Without --all there is their number.
    active = sum(effect.active for effect in found.effects.values())
    short = explained("type: pinhole").text()
    assert f"  and {len(found.effects) - active} effects left out: --all lists them" in short
    assert short.startswith("Camera: pinhole\n")
    # For programs there is a line each.
    assert found.json()["effects"]["material.metal"] == {"active": False, "why": "0 objects of 1"}


def test_a_light_without_effect_keeps_its_reason():
    text = explained("type: pinhole", lights="{type: point, position: [0, 1, 0], intensity: 0}", every_key=True).text()
    assert "light.point" in text.partition("Left out")[2]
    assert "which is black" in text


EXPOSED = f"{THIN}focal_length: 50 mm, f_number: 16, shutter: 1/128 s"
READ = f"{THIN}focal_length: 50 mm, f_number: 2, shutter: {{duration: 1/60 s, readout: 10 ms}}, iso: 200"
NONE = f"type: none, {FULL_FRAME}"


@pytest.mark.parametrize(
    ("camera", "is_said", "words"),
    [
        # Without a speed it is that of ISO 100.
        (f"{EXPOSED}, exposure: auto", True, "EV100 at ISO 100 15\n"),
        (f"{EXPOSED}, iso: 200", True, "EV100 14\n"),
        (EXPOSED, True, "at ISO 100 15\n"),
        ("type: pinhole, vfov: 40, shutter: 1e-30", True, "\nshutter 1.000e-30 s\n"),
        ("type: pinhole, vfov: 40, shutter: 1e-6", True, "\nshutter 1/1000000 s\n"),
        # Every number has words, and what is not there is not explained.
        (READ, False, "Further numbers"),
        (NONE, False, "blur ("),
        (NONE, False, "their blur is"),
        ("type: pinhole", True, "their blur is"),
    ],
)
def test_words_of_the_text(camera, is_said, words):
    lines = explained(camera, ball("ball", 5.0, SPEED if "1e-" in camera else "")).text().splitlines()
    assert (words in "".join(f"{' '.join(line.split())}\n" for line in lines)) == is_said


def test_json_has_four_parts(tmp_path, capsys):
    file = tmp_path / "scene.yaml"
    file.write_text(
        f"camera: {{type: thin_lens, {HERE}, {FULL_FRAME}, focal_length: 50 mm, f_number: 22, focus_distance: inf}}\n"
        f"film: {{width: 6000, height: 4000}}\nenvironment: {{type: gradient}}\nobjects: [{{{ball('ball', 5.0)}}}]\n"
    )
    assert main(["explain", str(file), "--json", "--circle", "0.03 mm"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == ["effects", "camera", "objects", "warnings"]
    assert found["camera"]["far_limit_m"] == "inf"
    assert found["camera"]["circle_mm"] == pytest.approx(0.03)
    assert list(found["objects"]) == ["ball"]
    assert len(found["warnings"]) == 1


def test_explaining_compiles_no_kernel():
    compiled = len(render_tile.signatures)
    explained(
        "type: thin_lens, vfov: 41, aperture: 20 mm, focus_at: [0.5, 0.5], shutter: 1/60 s", ball("a", 2.0, SPEED)
    )
    assert len(render_tile.signatures) == compiled


def test_effects_tell_of_the_photograph():
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2, shutter: 1/60 s"
    plain, exposed = explained(lens).effects, explained(f"{lens}, iso: 800").effects
    assert not plain["exposure"].active
    assert exposed["exposure"].active
    assert "ISO 800" in exposed["exposure"].why
    for name in ("sensor_noise", "white_balance", "tone_curve", "aperture_shape", "vignetting"):
        assert not exposed[name].active
    shaped = explained(f"{lens}, aperture_shape: {{type: polygon, blades: 6}}").effects
    assert shaped["aperture_shape"] == (True, "the opening has the shape polygon")
