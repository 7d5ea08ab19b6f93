"""Pictures of what moves, against closed forms, and scenes in which nothing does, against those without the keys."""

import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.analysis.explain import explain
from raytracer.core.shutter.table import Shutter
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from tests.core.motion.kernels import drawn_times, shooter
from tests.small_scenes import mean, scene

Array = NDArray[np.float64]

LAMP = "material: {type: emitter, radiance: 1}"
WINDOW = (
    "camera: {type: orthographic, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 4, shutter: {open: 1, close: 3}"
)


def packed_of(text, **keys):
    return pack(scene(text, filled=False, **keys))


# ---- A ball in flight

RADIUS, START, WAY = 0.7, -1.1, 2.3
PIXELS, SPP = 64, 256
BALL = f"objects:\n  - {{type: sphere, radius: {RADIUS}, {LAMP}, center: "


def flight(camera, ball):
    text = f"{WINDOW}{camera}}}\n{BALL}[{START - WAY / 2}, 0, 0]{ball}}}"
    size = {"width": PIXELS, "height": PIXELS, "spp": SPP, "max_depth": 1, "sampler": "sobol"}
    return render(scene(text, filled=False, **size), threads=2).image.radiance[..., 0]


def coverage():
    """The share of the time in which the ball's outline covers a point, as the mean over each pixel.

    At height y the outline is a chord of length 2 sqrt(r^2 - y^2) that goes from `START` on by `WAY`.
    """
    fine = (np.arange(16 * PIXELS) + 0.5) * 4 / (16 * PIXELS) - 2
    half = np.sqrt(np.maximum(0.0, RADIUS**2 - fine**2))[:, None]
    first, last = (fine[None] - half - START) / WAY, (fine[None] + half - START) / WAY
    share = np.clip(last, 0, 1) - np.clip(first, 0, 1)
    return share.reshape(PIXELS, 16, PIXELS, 16).mean(axis=(1, 3))


@pytest.fixture(scope="module")
def blurred():
    """A sphere that goes to the right, by velocity (it is at x = 0 at time 0)."""
    return flight("", f", motion: {{velocity: [{WAY / 2}, 0, 0]}}")


def test_the_blur_of_a_moving_sphere_is_its_chord_by_its_way(blurred):
    expected = coverage()
    assert expected.max() == pytest.approx(2 * RADIUS / WAY, rel=0.01)
    error = blurred - expected
    # Stratified times: an edge within a pixel is uncertain by 1 of 256 samples in time, and by the lens in place.
    assert np.sqrt((error**2).mean()) < 0.004
    assert np.abs(error).max() < 0.04
    assert blurred.sum() == pytest.approx(expected.sum(), rel=2e-3)
    assert not blurred[expected == 0.0].any()


def test_a_camera_that_moves_sees_what_objects_moving_the_other_way_show(blurred):
    other = flight(f", motion: {{velocity: [{-WAY / 2}, 0, 0]}}", "")
    # The same times and film positions: only rounding at the outline may differ.
    assert (np.abs(other - blurred) > 1e-12).mean() < 0.01
    assert np.abs(other - blurred).max() <= 2 / SPP


# ---- Turning

TURNING = """camera: {type: pinhole, look_from: [0, 0, 9], shutter: 1}
objects:
  - {type: sphere, center: [10.98, -4, 2], radius: 0.02,
     motion: {spin: {axis: [0, 0, 1], rate: 360, center: [10, -4, 2]}}}
  - type: box
    min: [-1, -0.5, -0.25]
    max: [1, 0.5, 0.25]
    motion:
      keyframes:
        - {time: 0, transform: []}
        - {time: 1, transform: [{scale: 2}, {rotate: {axis: [0, 0, 1], angle: 90}}]}
"""


def frames_in(folder, *sizes):
    """Squares with these half edges, as frames at times 0, 0.5, 1, ..."""
    for number, size in enumerate(sizes):
        corners = "".join(f"v {x * size} {y * size} 0\n" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        (folder / f"{number}.obj").write_text(f"{corners}f 1 2 3\nf 1 3 4\n")
    return ", ".join(f"{{time: {number / 2}, file: {number}.obj}}" for number in range(len(sizes)))


@pytest.fixture(scope="module")
def shoot(tmp_path_factory):
    """Rays at what turns, and at a square of frames far beside it, so that one compiled loop serves all."""
    folder = tmp_path_factory.mktemp("frames")
    frames = f"[{frames_in(folder, 0.5, 1.0, 0.5)}]"
    square = f"  - {{type: mesh, frames: {frames}, transform: [{{translate: [-50, 0, 0]}}]}}\n"
    return shooter(packed_of(TURNING + square, base=folder))


def random_times(count, seed):
    return np.random.default_rng(seed).random(count).astype(np.float32).astype(np.float64)


def test_a_point_that_turns_once_stays_on_its_circle(shoot):
    """Radii 1 - 0.001 and 1 + 0.001 tell a circle from 128 chords, which cut 0.0003, in Embree as in float64.

    The sphere's outermost point is at distance 1 from the axis: rays parallel to the axis that pass 0.1 % within it
    meet the sphere at any time, and those 0.1 % outside never do.
    """
    times = random_times(2000, 1)
    center = np.array([10.0, -4.0, 2.0])
    out = np.column_stack([np.cos(2 * np.pi * times), np.sin(2 * np.pi * times), np.zeros_like(times)])
    above = np.add(center, [0, 0, 3])
    hits = shoot(above + 0.999 * out, [0, 0, -1], times=times)
    assert (hits.table >= 0).all()
    assert len({*hits.instance}) == 1
    assert (shoot(above + 1.001 * out, [0, 0, -1], times=times).table < 0).all()

    # The float64 hit is on the sphere where it is at the time, wherever that is.
    middle = center + 0.98 * out
    np.testing.assert_allclose(np.linalg.norm(hits.point - middle, axis=1), 0.02, atol=1e-12)
    np.testing.assert_allclose(hits.normal, (hits.point - middle) / 0.02, atol=1e-9)


def test_keyframes_turn_and_scale_as_by_their_formula(shoot):
    """A box that turns by 90 degrees while it grows: points of its faces, carried back, lie on the box's faces."""
    rng = np.random.default_rng(2)
    times = random_times(500, 2)
    origins = np.column_stack([rng.uniform(-1, 1, (500, 2)), np.full(500, 5.0)])
    points = shoot(origins, [0, 0, -1], times=times).point
    size, angle = 1 + times, np.radians(90 * times)
    x, y = origins[:, 0], origins[:, 1]
    there = np.stack([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)], axis=1)
    inside = (np.abs(there / size[:, None]) - [1, 0.5]).max(axis=1)
    met = np.isfinite(points[:, 0])
    np.testing.assert_array_equal(met[np.abs(inside) > 1e-5], inside[np.abs(inside) > 1e-5] < 0)
    np.testing.assert_allclose(points[met], np.column_stack([origins[:, :2], 0.25 * size])[met], atol=1e-12)


def test_frames_are_met_as_they_are_at_the_time(shoot):
    """A square that grows from half edges of 0.5 to 1 and back."""
    times, x = random_times(5000, 6), np.random.default_rng(7).uniform(-1.2, 1.2, (5000, 2))
    hits = shoot(np.column_stack([x - [50.0, 0.0], np.full(5000, 5.0)]), [0, 0, -1], times=times)
    inside = 1 - np.abs(times - 0.5) - np.abs(x).max(axis=1)
    np.testing.assert_array_equal((hits.table >= 0)[np.abs(inside) > 1e-5], inside[np.abs(inside) > 1e-5] > 0)


# ---- Nothing that moves

STILL_CAMERA = "camera: {type: pinhole, look_from: [0, 1, 5], look_at: [0, 0, 0]"
OBJECTS = (
    "  - {type: sphere, center: [0.3, 0.1, -0.7], radius: 0.9",
    "  - {type: box, min: [0, 0, 0], max: [1, 1, 1], transform: [{rotate: {axis: [1, 2, 3], angle: 33}}]",
    "  - {type: disc, center: [0, 0, 0], normal: [1, 2, 3], radius: 1",
    "  - {type: triangle, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
)
FLYING = "motion: {velocity: [1, 2, 3]}"


def still_scene(camera="", motion="name: null", objects=OBJECTS):
    return f"{STILL_CAMERA}{camera}}}\nobjects:\n" + "".join(f"{item}, {motion}}}\n" for item in objects)


STILL_KEYS = {
    "no velocity": (", shutter: 1", "motion: {velocity: [0, 0, 0]}"),
    "no rate": (", shutter: 1", "motion: {spin: {axis: [0, 0, 1], rate: 0}}"),
    "a moment": (", shutter: 0", "motion: {velocity: [1, 2, 3], spin: {axis: [0, 0, 1], rate: 90}}"),
    "no shutter": ("", FLYING),
    "before it starts": (
        ", shutter: {open: -2, close: -1}",
        "motion: {keyframes: [{time: 0, transform: []}, {time: 1, transform: [{scale: 2}]}]}",
    ),
    "after it ended": (
        ", shutter: {open: 2, close: 3}",
        "motion: {keyframes: [{time: 0, transform: [{scale: 2}]}, {time: 1, transform: []}]}",
    ),
    "equal poses": (", shutter: 1", "motion: {keyframes: [{time: 0, transform: []}, {time: 1, transform: []}]}"),
    "a shutter alone": (", shutter: {open: -2, close: -1}",),
    "no time": (", shutter: {duration: 0, opening: trapezoid, ramp: 0}",),
    "a scan of what rests": (
        ", shutter: {duration: 1, opening: trapezoid, ramp: 0.1, readout: 2, curtain: focal_plane}",
    ),
    "a curve": (", shutter: {opening: [[0, 0], [1, 1]]}",),
    "no time to shake": (", time: 3, shake: {amplitude: 2 deg}",),
    "no shake": (", shutter: {duration: 1, readout: 1}, shake: {amplitude: 0, seed: 5}",),
}


def bytes_of(value):
    """The bits of all arrays and numbers in nested tuples."""
    if isinstance(value, tuple):
        return [bits for item in value for bits in bytes_of(item)]
    return [np.asarray(value).tobytes()] if isinstance(value, np.ndarray | int | float) else []


def assert_same_scene(one, other):
    """The same type, so the same kernel, and the same bits: pictures are then bit-identical."""
    assert numba.typeof(one.scene) == numba.typeof(other.scene)
    assert bytes_of(one.scene) == bytes_of(other.scene)
    for number, geometry in other.objects.geometries.items():
        assert bytes_of(one.objects.geometries[number].vertices) == bytes_of(geometry.vertices)


@pytest.mark.parametrize("name", STILL_KEYS)
def test_what_moves_nothing_is_packed_as_without_the_keys(name):
    assert_same_scene(packed_of(still_scene(*STILL_KEYS[name])), packed_of(still_scene()))


@pytest.mark.parametrize(
    "shutter",
    [
        "{duration: 1, opening: trapezoid, ramp: 0}",
        "{duration: 1, readout: 0, direction: up, curtain: focal_plane}",
        "{opening: [[0, 1], [1, 1]]}",
    ],
)
def test_a_shutter_without_a_ramp_or_readout_is_the_plain_one(shutter):
    plain, keyed = (packed_of(still_scene(f", shutter: {text}", FLYING, OBJECTS[:1])) for text in ("1", shutter))
    assert keyed.scene.shutter == Shutter(0.0, 1.0)
    assert_same_scene(keyed, plain)


def test_the_size_of_a_curve_or_film_is_not_part_of_the_type():
    shutters = (
        "{duration: 1, opening: trapezoid, ramp: 0.5, readout: 1}",
        "{opening: [[0, 0], [1, 1]], readout: 2 ms, direction: left, curtain: focal_plane}",
    )
    packed = [packed_of(still_scene(f", shutter: {text}", FLYING, OBJECTS[:1])) for text in shutters]
    assert len({numba.typeof(one.scene) for one in packed}) == 1


def test_only_what_moves_is_packed_as_moving():
    moves = ("", ", motion: {velocity: [1, 0, 0]}", ", motion: {velocity: [0, 0, 2]}")
    objects = "".join(f"{OBJECTS[0]}{motion}}}\n" for motion in moves) + f"{OBJECTS[2]}}}\n"
    moving = packed_of(f"{STILL_CAMERA}, shutter: 1}}\nobjects:\n{objects}").scene
    assert [type(table).__name__ for table in moving.primitives] == ["Discs", "Spheres", "Translated"]
    np.testing.assert_array_equal(moving.primitives[2].shift, [[1, 0, 0], [0, 0, 2]])
    assert moving.shutter is not None
    assert moving.instances is None


CURVE = "opening: [[0, 0], [1, 1]], readout: 1"
MOVED = ", motion: {velocity: [1, 0, 0]}"


@pytest.mark.parametrize(
    ("camera", "motion", "active", "words"),
    [
        ("", "", set(), {"motion_blur": "open for no time, at 0 s"}),
        (", time: 2", MOVED, set(), {"motion_blur": "open for no time, at 2 s"}),
        (", shutter: 1/8 s", "", set(), {"motion_blur": "nothing moves while the shutter is open, for 0.125 s"}),
        (", shutter: 1/8 s", MOVED, {"motion_blur"}, {"motion_blur": "0.125 s, in which 1 object may move"}),
        (f", shutter: 1/8 s{MOVED}", "", {"motion_blur"}, {"motion_blur": "in which the camera may move"}),
        (
            ", shutter: {duration: 1, opening: trapezoid, ramp: 0.5}",
            MOVED,
            {"motion_blur", "shutter_curve"},
            {"shutter_curve": "counts as 1 s", "rolling_shutter": "at the same time"},
        ),
        (
            ", shutter: {duration: 1, readout: 1/30 s, direction: up}",
            MOVED,
            {"motion_blur", "rolling_shutter"},
            {"rolling_shutter": "up, over 0.03333 s", "shutter_curve": "at once"},
        ),
        (
            f", shutter: {{{CURVE}}}, shake: {{amplitude: 0.5}}",
            "",
            {"motion_blur", "shutter_curve", "rolling_shutter", "camera_shake"},
            {"camera_shake": "turns by 0.5 deg (rms) about each axis, up to 10 Hz"},
        ),
        (
            f", shutter: {{{CURVE}}}",
            "",
            set(),
            {"shutter_curve": "nothing changes", "rolling_shutter": "nothing changes", "camera_shake": "held still"},
        ),
        (", shake: {amplitude: 1}", MOVED, set(), {"camera_shake": "no time to shake"}),
    ],
)
def test_motion_and_shutters_are_explained(camera, motion, active, words):
    text = f"{STILL_CAMERA}{camera}}}\nobjects:\n{OBJECTS[0]}{motion}}}"
    effects = explain(scene(text, filled=False)).effects
    names = ("motion_blur", "shutter_curve", "rolling_shutter", "camera_shake")
    assert {name for name in names if effects[name].active} == active
    for name, why in words.items():
        assert why in effects[name].why


# ---- Time as a dimension of the samples

WHOLE = Shutter(0.0, 1.0)


@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
def test_a_pixels_times_are_stratified(sampler):
    for count in (16, 64, 256):
        times, weights = drawn_times(WHOLE, count, sampler=sampler)
        np.testing.assert_array_equal(np.sort(np.floor(times * count)), np.arange(count))
        assert (weights == 1.0).all()


def test_times_are_floats_that_float32_holds():
    """Embree's ray and the hit in float64 are of the same time, never beyond the shutter."""
    times = np.concatenate([drawn_times(WHOLE, 5000, sampler="independent", pixel=pixel)[0] for pixel in range(4)])
    np.testing.assert_array_equal(times, times.astype(np.float32))
    assert times.min() >= 0.0
    assert times.max() <= 1.0
    assert times.mean() == pytest.approx(0.5, abs=4 / np.sqrt(12 * len(times)))
    assert not np.array_equal(*(drawn_times(WHOLE, 64, pixel=pixel)[0] for pixel in (1, 2)))


# ---- Pictures with light that moves


def _irradiance(height, side, radius):
    """Irradiance below a whole uniform sphere of radiance 1: pi r^2 / d^2 cos.

    References: Pharr et al. 2023, sec. 4.2.3, and Lambert's cosine law for the view factor of a sphere.
    """
    distance2 = height**2 + side**2
    return np.pi * radius**2 / distance2 * height / np.sqrt(distance2)


@pytest.mark.slow
def test_lamps_that_fly_and_turn_light_as_their_mean():
    """One lamp goes along a line, one on a circle; below, a small square of known albedo is looked at from beside."""
    text = """camera: {type: orthographic, look_from: [0.002, 0.5, 0.0], look_at: [0, 0, 0], height: 0.001, shutter: 1}
materials: {grey: {type: lambertian, albedo: 0.5}, lamp: {type: emitter, radiance: 10}}
objects:
  - {type: quad, corner: [-0.005, 0, 0.005], edges: [[0.01, 0, 0], [0, 0, -0.01]], material: grey}
  - {type: sphere, center: [-2, 1, 0.5], radius: 0.2, material: lamp, motion: {velocity: [4, 0, 0]}}
  - type: sphere
    center: [2.5, 2, 0]
    radius: 0.3
    material: {type: emitter, radiance: 20}
    motion: {spin: {axis: [0, 0, 1], rate: 360, center: [1.5, 2, 0]}}
"""
    picture = render(scene(text, filled=False, width=8, height=8, spp=4096, max_depth=2), seed=1, threads=2).image
    t = (np.arange(4000) + 0.5) / 4000
    first = 10 * _irradiance(np.full_like(t, 1.0), np.hypot(-2 + 4 * t, 0.5), 0.2).mean()
    turn = 2 * np.pi * t
    second = 20 * _irradiance(2 + np.sin(turn), 1.5 + np.cos(turn), 0.3).mean()
    value, deviation = mean(picture)
    expected = 0.5 / np.pi * (first + second)
    assert deviation[0] < 0.005 * expected
    assert value[0] == pytest.approx(expected, abs=4 * deviation[0] + 1e-3 * expected)


def test_frames_that_do_not_differ_in_the_shutter_are_a_mesh(tmp_path):
    frames = frames_in(tmp_path, 0.5, 0.5, 1.0)
    camera = "camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0]"
    still = packed_of(f"{camera}}}\nobjects:\n  - {{type: mesh, file: 0.obj}}\n", base=tmp_path)
    for shutter in ("shutter: 0.5", "time: 0.25", "shutter: {open: -1, close: 0.5}"):
        text = f"{camera}, {shutter}}}\nobjects:\n  - {{type: mesh, frames: [{frames}]}}\n"
        packed = packed_of(text, base=tmp_path)
        assert_same_scene(packed, still)
    text = f"{camera}, time: 0.75}}\nobjects:\n  - {{type: mesh, frames: [{frames}]}}\n"
    between = packed_of(text, base=tmp_path).scene.primitives[0].vertices
    np.testing.assert_array_equal(between, 1.5 * still.scene.primitives[0].vertices)


def test_the_bouncing_scene_is_what_its_script_writes(tmp_path):
    scenes = Path(__file__).parents[3] / "scenes"
    script = scenes / "generate" / "bouncing.py"
    subprocess.run([sys.executable, str(script), str(tmp_path / "again.yaml")], check=True)
    assert (tmp_path / "again.yaml").read_bytes() == (scenes / "bouncing.yaml").read_bytes()
