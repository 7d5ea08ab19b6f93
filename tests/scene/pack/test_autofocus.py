"""Focusing on an object and at a place in the frame: the distance that is found, and what is sharp then."""

import math

import numba
import numpy as np
import pytest

from raytracer.scene.pack.scene import pack
from raytracer.util.errors import SceneError
from tests.plugins.cameras.kernels import camera_rays
from tests.small_scenes import scene

LENS = "type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -1]"
FULL_FRAME = "sensor: {width: 36 mm, height: 24 mm}, focal_length: 50 mm, f_number: 2"


def packed(camera, *objects, before="", width=300, height=200):
    items = "".join(f"  - {{{item}}}\n" for item in objects)
    text = f"camera: {{{LENS}, {camera}}}\n{before}objects:\n{items}"
    return pack(scene(text, filled=False, width=width, height=height))


def focus(camera, *objects, before=""):
    """The distance at which a camera at the origin that looks along -z is focused."""
    found = packed(camera, *objects, before=before).spec.camera
    assert found.focus_on is None
    assert found.focus_at is None
    return float(found.focus_distance)


BALL = "type: sphere, name: ball, center: [1, 0, -5], radius: 0.5"
WIDE = "vfov: 60, aperture: 20 mm"
WALL = "type: quad, corner: [-90, -90, -8], edges: [[180, 0, 0], [0, 180, 0]]"


# ---- On an object


def test_focus_on_is_the_depth_of_the_middle():
    # Along the axis, and not along the ray; of an instance, of its box; and in the middle of the exposure.
    assert focus(f"{WIDE}, focus_on: ball", BALL, WALL) == 5.0
    pair = "{type: sphere, center: [0, 0, 0], radius: 1}, {type: sphere, center: [0, 0, 4], radius: 1}"
    both = "type: instance, of: pair, name: both, transform: [{translate: [0, 0, -9]}]"
    assert focus(f"{WIDE}, focus_on: both", both, before=f"groups: {{pair: [{pair}]}}\n") == pytest.approx(7.0)
    moving = f"{BALL}, motion: {{velocity: [0, 0, -8]}}"
    assert focus(f"{WIDE}, focus_on: ball, shutter: 1/4 s, time: 2", moving) == pytest.approx(22.0)
    backwards = "motion: {velocity: [0, 0, 8]}"
    assert focus(f"{WIDE}, focus_on: ball, shutter: 1/4 s, {backwards}", BALL) == pytest.approx(6.0)


def test_focus_on_is_the_same_scene_as_its_distance():
    by_name = packed(f"{FULL_FRAME}, focus_on: ball", BALL, WALL)
    by_distance = packed(f"{FULL_FRAME}, focus_distance: 5", BALL, WALL)
    assert by_name.scene.camera == by_distance.scene.camera
    assert numba.typeof(by_name.scene) == numba.typeof(by_distance.scene)
    assert by_name.built is None


# ---- At a place in the frame


def test_focus_at_is_the_depth_of_what_is_seen():
    # The ray to the ball's middle meets it a radius earlier; the middle of the frame sees the wall.
    x = 0.5 + 0.5 * 0.5 / 5.0 / math.tan(math.radians(30.0)) * 200.0 / 300.0
    ball = "type: sphere, name: ball, center: [0.5, 0, -5], radius: 0.25"
    camera = f"{WIDE}, focus_at: "
    t = math.hypot(5.0, 0.5) - 0.25
    assert focus(f"{camera}[{x!r}, 0.5]", ball, WALL) == pytest.approx(t * 5.0 / math.hypot(5.0, 0.5), rel=1e-6)
    assert focus(f"{camera}[0.5, 0.5]", ball, WALL) == pytest.approx(8.0, rel=1e-6)
    # Off the axis, but at the same depth.
    assert focus(f"{camera}[1, 0]", ball, WALL) == pytest.approx(8.0, rel=1e-6)


def test_focus_at_measures_from_the_top_left():
    left = "type: quad, corner: [-5, 0, -4], edges: [[5, 0, 0], [0, 5, 0]]"
    assert focus(f"{WIDE}, focus_at: [0.25, 0.25]", left, WALL) == pytest.approx(4.0, rel=1e-6)
    for place in ("[0.25, 0.75]", "[0.75, 0.25]", "[0.75, 0.75]"):
        assert focus(f"{WIDE}, focus_at: {place}", left, WALL) == pytest.approx(8.0, rel=1e-6)


def test_focus_at_looks_through_mere_boundaries():
    assert focus(f"{WIDE}, focus_at: [0.1, 0.1]", BALL) == math.inf
    before = "media: {fog: {type: homogeneous, scattering: 0.1}}\n"
    camera = f"{WIDE}, focus_at: [0.5, 0.5]"
    sphere = "type: sphere, center: [0, 0, -4], radius: 2"
    assert focus(camera, f"{sphere}, medium: fog", WALL, before=before) == pytest.approx(8.0, rel=1e-6)
    # Glass is a surface.
    assert focus(camera, f"{sphere}, material: {{type: dielectric}}", WALL) == pytest.approx(2.0, rel=1e-6)
    before += "groups: {one: [{type: sphere, center: [0, 0, 0], radius: 1}]}\n"
    solid = "type: instance, of: one, transform: [{translate: [0, 0, -6]}]"
    clear = "type: instance, of: one, material: {type: boundary}, medium: fog, transform: [{translate: [0, 0, -3]}]"
    assert focus(camera, solid, clear, before=before) == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("sheet", "distance"),
    [
        ("{type: cutout, material: {type: metal}, opacity: 0}", 8.0),
        ("{type: cutout, material: {type: metal}, opacity: 0.3, threshold: 0.5}", 8.0),
        ("{type: cutout, material: {type: boundary}, opacity: 0.5}", 8.0),
        ("{type: two_sided, front: {type: boundary}, back: {type: cutout, material: {type: metal}, opacity: 0}}", 8.0),
        ("{type: two_sided, front: {type: boundary}, back: {type: metal}}", 4.0),
        # What has some holes is solid, in its holes too.
        ("{type: cutout, material: {type: metal}, opacity: 0.1}", 4.0),
        ("{type: cutout, material: {type: metal}, opacity: {type: checker, scale: 90, even: 0, odd: 0}}", 4.0),
    ],
)
def test_focus_at_looks_through_what_lets_all_light_through(sheet, distance):
    hung = f"type: quad, corner: [-1, -1, -4], edges: [[2, 0, 0], [0, 2, 0]], material: {sheet}"
    assert focus(f"{WIDE}, focus_at: [0.5, 0.5]", hung, WALL) == pytest.approx(distance, rel=1e-6)


def test_focus_at_what_moves_is_for_the_middle_of_the_exposure():
    straight = "type: sphere, center: [0, 0, -4], radius: 1, motion: {velocity: [0, 0, -8]}"
    camera = f"{WIDE}, focus_at: [0.5, 0.5], shutter: 1/2 s"
    assert focus(camera, straight) == pytest.approx(5.0, rel=1e-6)
    # A board that turns about a vertical axis beside it is edge on at first, and faces the camera in the middle.
    board = "type: box, min: [-1, -1, -6.1], max: [1, 1, -5.9]"
    turning = f"{board}, motion: {{spin: {{axis: [0, 1, 0], rate: 360, center: [0, 0, -6]}}}}"
    assert focus(camera.replace("1/2 s", "{open: 0, close: 0.5}"), turning) == pytest.approx(5.0, rel=1e-5)


def test_focus_at_of_a_lens_that_breathes_is_of_the_focused_picture():
    # Close by, a lens of 50 mm sees far less than at infinity: the place is where it is once all is in focus.
    slope = "type: quad, corner: [-0.5, -1, -0.7], edges: [[1, 0, 1], [0, 2, 0]]"
    found = packed(f"{FULL_FRAME}, focus_at: [0.9, 0.5]", slope)
    camera = found.spec.camera
    optics = camera.optics(300, 200)
    right = 0.8 * optics.top * 300.0 / 200.0
    # On the slope z = -0.2 + x, so that the depth d = 0.2 - right d.
    assert camera.focus_distance == pytest.approx(0.2 / (1.0 + right), rel=1e-6)
    assert camera.describe(300, 200)["hfov_deg"] < 0.8 * 39.6


def test_the_ray_casters_structure_is_built_once(monkeypatch):
    found = packed(f"{WIDE}, focus_at: [0.5, 0.5]", WALL)
    assert found.built is not None
    monkeypatch.setattr("raytracer.scene.pack.scene.Accel", None)
    assert found.build() is found.built


# ---- What cannot be


@pytest.mark.parametrize(
    ("camera", "item", "words"),
    [
        ("focus_on: ball", "type: sphere, name: ball, center: [9, 0, 0], radius: 1", "beside"),
        ("focus_on: ball, focus_at: [0.5, 0.5]", BALL, "focus_on and focus_at both"),
        ("focus_on: pair", "type: instance, of: pair", "is a group"),
        ("focus_on: one", "type: instance, of: pair", "is in a group"),
    ],
)
def test_what_cannot_be_focused_on_is_an_error_of_its_key(camera, item, words):
    before = "groups: {pair: [{type: sphere, name: one, center: [0, 0, 0], radius: 1}]}\n"
    with pytest.raises(SceneError, match=words) as caught:
        packed(f"{WIDE}, {camera}", item, before=before)
    assert caught.value.key.startswith("camera.focus_")


# ---- What is sharp

# Three boards side by side, each of a third of the frame's width at its distance, the right half of which it fills.
DISTANCES = {"near": 1.5, "middle": 3.0, "far": 9.0}


def blurs(focused):
    """The width in pixels, by name, of the disc that each board's left edge, in the middle of its third, becomes."""
    third = 2.0 * math.tan(math.radians(20.0)) * 1.5 / 3.0
    boards = []
    for number, (name, distance) in enumerate(DISTANCES.items()):
        left, width, height = (number - 1) * third * distance, third * distance / 2.0, 0.6 * distance
        boards.append(
            f"type: quad, name: {name}, corner: [{left!r}, {-height / 2!r}, {-distance}], "
            f"edges: [[{width!r}, 0, 0], [0, {height!r}, 0]]"
        )
    camera = packed(f"vfov: 40, aperture: 200 mm, {focused}", *boards, width=144, height=96).scene.camera
    widths = {}
    for number, (name, distance) in enumerate(DISTANCES.items()):
        origins, ways = camera_rays(camera, np.full(512, 24.0 + 48.0 * number), 48.0)
        met = origins + (-distance - origins[:, 2:]) / ways[:, 2:] * ways
        np.testing.assert_allclose(met[:, 0].mean(), (number - 1) * third * distance, atol=0.02)
        widths[name] = np.ptp(met[:, 0]) / (third * distance / 48.0)
    return widths


@pytest.mark.parametrize("name", list(DISTANCES))
def test_what_is_focused_on_is_the_sharpest(name):
    x = (list(DISTANCES).index(name) + 0.75) / 3.0
    for focused in (f"focus_on: {name}", f"focus_at: [{x!r}, 0.5]"):
        widths = blurs(focused)
        assert widths.pop(name) < 1e-4
        # What is out of focus is blurred by pixels.
        assert min(widths.values()) > 2.0
