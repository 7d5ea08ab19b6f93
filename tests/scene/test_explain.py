"""`rt explain`: the camera in numbers, each against a formula or a worked number that others have published."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from raytracer.cli.main import main
from raytracer.errors import InputError
from raytracer.explanation import Circle, Explanation, explain, parse_circle
from raytracer.integrator import render_tile
from raytracer.motion import row_at
from raytracer.scene.pack import pack
from tests.rendering import scene

FULL_FRAME = "sensor: {width: 36 mm, height: 24 mm}"
HERE = "look_from: [0, 0, 0], look_at: [0, 0, -1]"


def explained(
    camera: str, *objects: str, circle: Circle | None = None, width: int = 1500, height: int = 1000
) -> Explanation:
    """The explanation of a camera at the origin that looks along -z."""
    items = objects or ("type: sphere, center: [0, 0, -2], radius: 0.1",)
    text = f"camera: {{{HERE}, {camera}}}\nobjects:\n" + "".join(f"  - {{{item}}}\n" for item in items)
    return explain(scene(text, width=width, height=height, filled=False), circle=circle)


def ball(name: str, distance: float, more: str = "") -> str:
    return f"type: sphere, name: {name}, center: [0, 0, {-distance!r}], radius: 0.01{more}"


# ---- The lens


@pytest.mark.parametrize(("focal_length", "diagonal"), [(17, 103.68), (50, 46.79), (200, 12.35)])
def test_field_of_view(focal_length: float, diagonal: float) -> None:
    camera = explained(f"type: pinhole, {FULL_FRAME}, focal_length: {focal_length} mm").camera
    assert camera["dfov_deg"] == pytest.approx(diagonal, abs=0.005)
    assert camera["hfov_deg"] == pytest.approx(math.degrees(2.0 * math.atan(18.0 / focal_length)), rel=1e-12)
    assert camera["vfov_deg"] == pytest.approx(math.degrees(2.0 * math.atan(12.0 / focal_length)), rel=1e-12)


@pytest.mark.parametrize(("width", "height", "crop"), [(23.6, 15.7, 1.526), (17.3, 13.0, 1.999), (13.2, 8.8, 2.727)])
def test_crop_factor(width: float, height: float, crop: float) -> None:
    sensor = f"sensor: {{width: {width} mm, height: {height} mm}}"
    camera = explained(
        f"type: pinhole, {sensor}, focal_length: 25 mm", width=int(100 * width), height=int(100 * height)
    ).camera
    assert camera["crop_factor"] == pytest.approx(crop, abs=5e-4)
    assert camera["equivalent_focal_length_mm"] == pytest.approx(25.0 * camera["crop_factor"], rel=1e-12)


def test_image_distance_and_magnification() -> None:
    # The darkening by (1 + m)^2, m = f / (s - f), of 50 mm at 0.5 m is 1.2346.
    camera = explained(f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2, focus_distance: 0.5").camera
    assert (1.0 + camera["magnification"]) ** 2 == pytest.approx(1.2346, abs=5e-5)
    assert 1.0 / camera["image_distance_mm"] + 1.0 / 500.0 == pytest.approx(1.0 / 50.0, rel=1e-12)
    assert camera["entrance_pupil_mm"] == pytest.approx(25.0)
    assert camera["f_number"] == pytest.approx(2.0)


def test_circle_of_confusion_of_a_named_object() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 1.4, focus_distance: 2"
    objects = explained(lens, ball("focused", 2.0), ball("far", 4.0)).objects
    assert objects["far"]["circle_of_confusion_mm"] == pytest.approx(0.45788, abs=5e-6)
    # 1500 pixels on 36 mm.
    assert objects["far"]["circle_of_confusion_px"] == pytest.approx(0.45788 * 1500.0 / 36.0, abs=2e-4)
    assert objects["focused"]["circle_of_confusion_mm"] == pytest.approx(0.0, abs=1e-15)
    assert objects["far"]["distance_m"] == pytest.approx(4.0)


def test_circle_of_confusion_without_a_sensor() -> None:
    # The camera of Ray Tracing in One Weekend: A = 0.104720.
    lens = "type: thin_lens, vfov: 20, focus_distance: 10, defocus_angle: 0.6"
    found = explained(lens, ball("near", 5.0), ball("far", 20.0), width=1200, height=675)
    assert found.camera["aperture_diameter_mm"] == pytest.approx(104.720, abs=1e-3)
    assert found.objects["near"]["circle_of_confusion_px"] == pytest.approx(20.044, abs=5e-4)
    assert found.objects["far"]["circle_of_confusion_px"] == pytest.approx(10.022, abs=5e-4)
    assert "circle_of_confusion_mm" not in found.objects["near"]


def test_a_hole_of_a_real_size_blurs_more_what_is_near() -> None:
    # d (1 + f / z), by similar triangles.
    hole = f"type: pinhole, {FULL_FRAME}, focal_length: 200 mm, diameter: 6 mm"
    objects = explained(hole, ball("near", 0.5), ball("far", 20.0)).objects
    assert objects["near"]["circle_of_confusion_mm"] == pytest.approx(6.0 * (1.0 + 0.2 / 0.5))
    assert objects["far"]["circle_of_confusion_mm"] == pytest.approx(6.0 * (1.0 + 0.2 / 20.0))


def test_a_point_blurs_nothing() -> None:
    found = explained("type: pinhole, vfov: 40", ball("ball", 5.0))
    assert found.objects["ball"]["circle_of_confusion_px"] == 0.0
    assert "near_limit_m" not in found.camera


# ---- Depth of field


def test_limits_for_a_stated_circle() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2.8, focus_distance: 3"
    limits = explained(lens, circle=parse_circle("0.03 mm")).camera
    assert limits["near_limit_m"] == pytest.approx(2.7295, abs=5e-5)
    assert limits["far_limit_m"] == pytest.approx(3.3301, abs=5e-5)
    assert limits["hyperfocal_m"] == pytest.approx(0.05 * 0.05 / (2.8 * 0.03e-3) + 0.05)
    edges = explained(lens, ball("near", limits["near_limit_m"]), ball("far", limits["far_limit_m"])).objects
    assert edges["near"]["circle_of_confusion_mm"] == pytest.approx(0.03)
    assert edges["far"]["circle_of_confusion_mm"] == pytest.approx(0.03)


def test_a_far_limit_may_be_infinite() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 28 mm, f_number: 11, focus_distance: 2.5"
    assert explained(lens, circle=Circle(0.03, "mm")).camera["far_limit_m"] == math.inf


def test_focused_at_the_hyperfocal_distance_all_from_half_of_it_is_sharp() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 35 mm, f_number: 8, focus_distance: "
    hyperfocal = explained(lens + "3").camera["hyperfocal_m"]
    beyond = explained(f"{lens}{1.0001 * hyperfocal!r}").camera
    assert beyond["far_limit_m"] == math.inf
    assert explained(f"{lens}{0.9999 * hyperfocal!r}").camera["far_limit_m"] < math.inf
    # Half of it, to first order in the focal length.
    assert beyond["near_limit_m"] == pytest.approx(hyperfocal / 2.0, rel=1e-3)


def test_sharp_is_a_1500th_of_the_sensors_diagonal_by_default() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2.8, focus_distance: 3"
    assert explained(lens).camera["circle_mm"] == pytest.approx(math.hypot(36.0, 24.0) / 1500.0)
    assert explained(lens).camera["circle_px"] == pytest.approx(math.hypot(1500.0, 1000.0) / 1500.0)


def test_limits_need_no_sensor() -> None:
    # Limits follow from angles: the same lens and angle of view with a sensor has the same.
    lens = "type: thin_lens, vfov: 30, focus_distance: 3, aperture: 20 mm"
    plain, sized = explained(lens).camera, explained(f"{lens}, {FULL_FRAME}").camera
    for name in ("near_limit_m", "far_limit_m", "circle_px"):
        assert plain[name] == pytest.approx(sized[name], rel=1e-12)
    objects = explained(lens, ball("near", plain["near_limit_m"])).objects
    assert objects["near"]["circle_of_confusion_px"] == pytest.approx(plain["circle_px"], rel=1e-12)
    assert "circle_mm" not in plain


def test_circles_in_millimetres_and_in_pixels_are_the_same() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2.8, focus_distance: 3"
    # A pixel is 24 um wide.
    by_length = explained(lens, circle=parse_circle("48 um")).camera
    by_pixels = explained(lens, circle=parse_circle("2px")).camera
    assert by_length["far_limit_m"] == pytest.approx(by_pixels["far_limit_m"], rel=1e-12)


@pytest.mark.parametrize("text", ["", "0 mm", "-1 px", "inf", "2 px px", "3 s", "nan px", "px"])
def test_what_is_no_circle_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--circle"):
        parse_circle(text)


def test_a_length_needs_a_film_with_a_size() -> None:
    with pytest.raises(InputError, match="give pixels"):
        explained("type: thin_lens, vfov: 30, focus_distance: 3, aperture: 20 mm", circle=Circle(0.03, "mm"))


# ---- Exposure


@pytest.mark.parametrize(
    ("f_number", "shutter", "iso", "ev"),
    [(1.0, "1 s", 100, 0.0), (16.0, "1/128 s", 100, 15.0), (2.0, "1/64 s", 400, 6.0)],
)
def test_exposure_value(f_number: float, shutter: str, iso: float, ev: float) -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: {f_number}, shutter: {shutter}, iso: {iso}"
    assert explained(lens).camera["ev100"] == pytest.approx(ev, abs=1e-12)


def test_diffraction_that_would_show_is_a_warning() -> None:
    # 2.44 x 0.55 um x 22 = 29.5 um, at infinity.
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, focus_distance: inf, f_number: "
    small = explained(f"{lens}22", width=6000, height=4000)
    assert small.camera["airy_disc_um"] == pytest.approx(29.52, abs=0.01)
    assert [sentence.split(" is ")[0] for sentence in small.warnings] == ["diffraction"]
    assert not explained(f"{lens}22", width=1200, height=800).warnings
    assert not explained(f"{lens}4", width=6000, height=4000).warnings


def test_an_impossible_aperture_is_a_warning() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: "
    assert any("f/0.4 is faster than f/0.5" in sentence for sentence in explained(f"{lens}0.4").warnings)
    assert not explained(f"{lens}0.5").warnings


def test_an_aperture_that_is_a_point_is_a_warning() -> None:
    camera = f"type: pinhole, {FULL_FRAME}, focal_length: 50 mm, f_number: 8"
    (sentence,) = explained(camera).warnings
    assert "blurs nothing" in sentence


# ---- Motion

SPEED = ", motion: {velocity: [3, 0, 0]}"


@pytest.mark.parametrize(("shutter", "pixels"), [("1/60 s", 7.418), ("1/30 s", 2 * 7.418), ("{close: 0.1}", 6 * 7.418)])
def test_streak_of_a_moving_object(shutter: str, pixels: float) -> None:
    camera = f"type: pinhole, vfov: 40, shutter: {shutter}"
    objects = explained(camera, ball("moves", 10.0, SPEED), ball("rests", 10.0), width=1920, height=1080).objects
    assert objects["moves"]["streak_px"] == pytest.approx(pixels, abs=0.005)
    assert "streak_px" not in objects["rests"]


def test_a_moving_camera_draws_the_same_streak_of_what_rests() -> None:
    camera = "type: pinhole, vfov: 40, shutter: 1/60 s, motion: {velocity: [-3, 0, 0]}"
    objects = explained(camera, ball("rests", 10.0), width=1920, height=1080).objects
    assert objects["rests"]["streak_px"] == pytest.approx(7.418, abs=0.005)


def test_a_camera_that_pans_draws_streaks_by_angles() -> None:
    # From -1 to 1 degree off the axis.
    camera = "type: pinhole, vfov: 90, shutter: {open: -1, close: 1}, motion: {spin: {axis: [0, 1, 0], rate: 1 deg/s}}"
    objects = explained(camera, ball("rests", 10.0), height=1000).objects
    assert objects["rests"]["streak_px"] == pytest.approx(1000.0 * math.tan(math.radians(1.0)), rel=1e-9)


def test_what_turns_in_place_has_streaks_at_its_corners() -> None:
    # A quarter of a turn of a square that faces the camera: its corners are sqrt(2) from its middle.
    square = "type: quad, name: propeller, corner: [-1, -1, -10], edges: [[2, 0, 0], [0, 2, 0]]"
    turning = f"{square}, motion: {{spin: {{axis: [0, 0, 1], rate: 1 turn/s}}}}"
    camera = "type: pinhole, vfov: 90, shutter: {duration: 1/4 s, readout: 1/30 s}"
    numbers = explained(camera, turning, height=1000).objects["propeller"]
    assert "skew_px" not in numbers
    assert numbers["streak_px"] == pytest.approx(0.0, abs=1e-9)
    # 64 chords are shorter than their arc by (pi / 256)^2 / 6.
    assert numbers["corner_streak_px"] == pytest.approx(0.5 * math.pi * math.sqrt(2.0) / 10.0 * 500.0, rel=1e-4)


def test_a_ramp_counts_at_half_its_height() -> None:
    shutter = "shutter: {duration: 1/60 s, opening: trapezoid, ramp: 1/120 s}"
    objects = explained(f"type: pinhole, vfov: 40, {shutter}", ball("moves", 10.0, SPEED), height=1080).objects
    assert objects["moves"]["streak_px"] == pytest.approx(7.418, abs=0.005)


def test_skew_of_a_rolling_shutter() -> None:
    # 1920 px/s and 1/60 s of readout over 1080 rows: 32 px, 1.697 deg.  Streaks are those of a row.
    speed = 1920.0 * 10.0 * 2.0 * math.tan(math.radians(20.0)) / 1080.0
    motion = f", motion: {{velocity: [{speed!r}, 0, 0]}}"
    camera = "type: pinhole, vfov: 40, shutter: {duration: 1/480 s, readout: 1/60 s, direction: DIRECTION}"
    down = explained(camera.replace("DIRECTION", "down"), ball("train", 10.0, motion), height=1080).objects["train"]
    assert down["skew_px"] == pytest.approx(32.0)
    assert down["skew_deg"] == pytest.approx(1.697, abs=5e-4)
    assert down["streak_px"] == pytest.approx(4.0)
    # What runs along with the readout is stretched, and does not lean.
    right = explained(camera.replace("DIRECTION", "right"), ball("train", 10.0, motion), height=1080).objects["train"]
    assert right["skew_px"] == pytest.approx(0.0, abs=1e-9)


def test_a_hand_that_shakes_draws_streaks() -> None:
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


def test_what_is_behind_the_camera_has_no_blur() -> None:
    camera = "type: thin_lens, vfov: 40, aperture: 20 mm, focus_distance: 3, shutter: 1/60 s"
    numbers = explained(camera, ball("behind", -3.0, SPEED)).objects["behind"]
    assert numbers == {"distance_m": -3.0}


@pytest.mark.parametrize(
    "camera", ["type: equirectangular", "type: fisheye", "type: orthographic, height: 3", f"type: none, {FULL_FRAME}"]
)
def test_cameras_without_a_lens_are_explained(camera: str) -> None:
    numbers = explained(f"{camera}, shutter: 1/60 s", ball("ball", 5.0, SPEED)).objects["ball"]
    assert numbers["distance_m"] == pytest.approx(5.0)
    assert "circle_of_confusion_px" not in numbers
    assert ("streak_px" in numbers) == ("none" not in camera)


# ---- What is printed


def test_objects_are_those_with_a_name_or_a_motion() -> None:
    moving = ("type: sphere, center: [0, 0, -5], radius: 1, motion: {velocity: [1, 0, 0]}",) * 10
    found = explained(
        "type: pinhole, shutter: 1/60 s", "type: sphere, center: [0, 0, -9], radius: 1", ball("a", 3.0), *moving
    )
    assert list(found.objects) == ["a", *(f"objects[{number}]" for number in range(2, 12))]
    assert "and 2 more that move" in found.text()


def test_text_is_aligned_in_groups() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 22, focus_distance: inf, shutter: 1/125 s"
    text = explained(lens, ball("ball", 5.0, SPEED), width=6000, height=4000).text()
    lines = text[text.index("Camera: thin_lens") :].splitlines()
    assert [line for line in lines if line and not line.startswith(" ")] == [
        "Camera: thin_lens",
        "Objects in the middle of the exposure; their blur is the circle of confusion",
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


def test_every_number_has_words() -> None:
    shutter = "shutter: {duration: 1/60 s, readout: 10 ms}"
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2, {shutter}, iso: 200"
    assert "Further numbers" not in explained(lens).text()


def test_json_has_four_parts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(
        f"camera: {{type: thin_lens, {HERE}, {FULL_FRAME}, focal_length: 50 mm, f_number: 22, focus_distance: inf}}\n"
        f"film: {{width: 6000, height: 4000}}\nobjects: [{{{ball('ball', 5.0)}}}]\n"
    )
    assert main(["explain", str(file), "--json", "--circle", "0.03 mm"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert list(found) == ["effects", "camera", "objects", "warnings"]
    assert found["camera"]["far_limit_m"] == "inf"
    assert found["camera"]["circle_mm"] == pytest.approx(0.03)
    assert list(found["objects"]) == ["ball"]
    assert len(found["warnings"]) == 1


def test_explaining_compiles_no_kernel() -> None:
    compiled = len(render_tile.signatures)
    explained(
        "type: thin_lens, vfov: 41, aperture: 20 mm, focus_at: [0.5, 0.5], shutter: 1/60 s", ball("a", 2.0, SPEED)
    )
    assert len(render_tile.signatures) == compiled


def test_effects_tell_of_the_photograph() -> None:
    lens = f"type: thin_lens, {FULL_FRAME}, focal_length: 50 mm, f_number: 2, shutter: 1/60 s"
    plain, exposed = explained(lens).effects, explained(f"{lens}, iso: 800").effects
    assert not plain["exposure"].active
    assert exposed["exposure"].active
    assert "ISO 800" in exposed["exposure"].why
    for name in ("sensor_noise", "white_balance", "tone_curve", "aperture_shape", "vignetting"):
        assert not exposed[name].active
    shaped = explained(f"{lens}, aperture_shape: {{type: polygon, blades: 6}}").effects
    assert shaped["aperture_shape"] == (True, "the opening has the shape polygon")
