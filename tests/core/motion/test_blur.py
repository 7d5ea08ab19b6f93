"""Pictures of what moves, against closed forms, and scenes in which nothing does, against those without the keys."""

import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.primitives.translated import Translated
from raytracer.core.primitives.triangles import DeformingTriangles
from raytracer.rendering.render import render
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import pack
from raytracer.schema.transform import Rotate, Step
from tests.core.motion.kernels import leave, met, times_of
from tests.plugins.shapes.kernels import uniform_directions, unit
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


def flight(sampler="sobol"):
    """A sphere that goes to the right, by velocity (it is at x = 0 at time 0)."""
    text = f"{WINDOW}}}\n{BALL}[{START - WAY / 2}, 0, 0], motion: {{velocity: [{WAY / 2}, 0, 0]}}}}"
    size = {"width": PIXELS, "height": PIXELS, "spp": SPP, "max_depth": 1, "sampler": sampler}
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
    return flight()


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
    text = f"{WINDOW}, motion: {{velocity: [{-WAY / 2}, 0, 0]}}}}\n{BALL}[{START - WAY / 2}, 0, 0]}}"
    size = {"width": PIXELS, "height": PIXELS, "spp": SPP, "max_depth": 1, "sampler": "sobol"}
    other = render(scene(text, filled=False, **size), threads=2).image.radiance[..., 0]

    # The same times and film positions: only rounding at the outline may differ.
    assert (np.abs(other - blurred) > 1e-12).mean() < 0.01
    assert np.abs(other - blurred).max() <= 2 / SPP


# ---- Turning

SPIN = "spin: {axis: [0, 0, 1], rate: 360, center: [10, -4, 2]}"
POINT = f"""camera: {{type: pinhole, look_from: [10, -4, 9], look_at: [10, -4, 2], shutter: 1}}
objects:
  - {{type: sphere, center: [10.98, -4, 2], radius: 0.02, motion: {{{SPIN}}}}}
"""


def test_a_point_that_turns_once_stays_on_its_circle():
    """Radii 1 - 0.001 and 1 + 0.001 tell a circle from 128 chords, which cut 0.0003, in Embree as in float64.

    The sphere's outermost point is at distance 1 from the axis: rays parallel to the axis that pass 0.1 % within it
    meet the sphere at any time, and those 0.1 % outside never do.
    """
    packed = packed_of(POINT)
    times = np.random.default_rng(1).random(2000).astype(np.float32).astype(np.float64)
    center = np.array([10.0, -4.0, 2.0])
    out = np.column_stack([np.cos(2 * np.pi * times), np.sin(2 * np.pi * times), np.zeros_like(times)])
    above = np.add(center, [0, 0, 3])
    points, normals, instances = met(packed, above + 0.999 * out, [0, 0, -1], times)
    assert np.isfinite(points).all()
    assert (instances == 0).all()
    outside, _, _ = met(packed, above + 1.001 * out, [0, 0, -1], times)
    assert np.isnan(outside).all()

    # The float64 hit is on the sphere where it is at the time, wherever that is.
    middle = center + 0.98 * out
    np.testing.assert_allclose(np.linalg.norm(points - middle, axis=1), 0.02, atol=1e-12)
    np.testing.assert_allclose(normals, (points - middle) / 0.02, atol=1e-9)


@pytest.mark.parametrize("arm", [0, 10, 1000])
def test_rays_that_leave_what_turns_do_not_meet_it_again(arm):
    """Embree's angle is wrong by up to 2e-6 rad, which at the end of a long arm is more than its coordinates' error."""
    n = 50_000
    text = f"""camera: {{type: pinhole, look_from: [0, 0, 9], shutter: 1}}
objects:
  - {{type: sphere, center: [{arm}, 0, 0], radius: 0.5, motion: {{spin: {{axis: [0, 0, 1], rate: 360}}}}}}
"""
    times = np.random.default_rng(1).random(n).astype(np.float32).astype(np.float64)
    turn = 2 * np.pi * times
    center = arm * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    origins = 3 * uniform_directions(n, 2)
    directions = unit(0.3 * uniform_directions(n, 3) - origins)
    self_hit = leave(packed_of(text), origins + center, directions, uniform_directions(n, 4), times)
    assert (self_hit >= 0).all()
    assert (self_hit == 1).sum() <= 1e-5 * n


def test_keyframes_turn_and_scale_in_a_picture_as_by_their_formula():
    """A box that turns by 90 degrees while it grows: points of its faces, carried back, lie on the box's faces."""
    text = """camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], shutter: 2}
objects:
  - type: box
    min: [-1, -0.5, -0.25]
    max: [1, 0.5, 0.25]
    motion:
      keyframes:
        - {time: 0, transform: []}
        - {time: 2, transform: [{scale: 2}, {rotate: {axis: [0, 0, 1], angle: 90}}]}
"""
    rng = np.random.default_rng(2)
    times = rng.random(500).astype(np.float32).astype(np.float64)
    origins = np.column_stack([rng.uniform(-1, 1, (500, 2)), np.full(500, 5.0)])
    points, _, _ = met(packed_of(text), origins, [0, 0, -1], times)
    for time, point, origin in zip(times, points, origins, strict=True):
        turn = Step(rotate=Rotate(axis=(0.0, 0.0, 1.0), angle=90 * time)).matrix()[:3, :3]
        size = 1 + time
        there = turn.T @ [*origin[:2], 0.25 * size] / size
        inside = (np.abs(there[:2]) - [1, 0.5]).max()
        if abs(inside) > 1e-5:
            assert np.isfinite(point).all() == (inside < 0)
        if np.isfinite(point).all():
            np.testing.assert_allclose(point, [*origin[:2], 0.25 * size], atol=1e-12)


# ---- Nothing that moves

STILL_CAMERA = "camera: {type: pinhole, look_from: [0, 1, 5], look_at: [0, 0, 0]"
OBJECTS = (
    "  - {type: sphere, center: [0.3, 0.1, -0.7], radius: 0.9",
    "  - {type: box, min: [0, 0, 0], max: [1, 1, 1], transform: [{rotate: {axis: [1, 2, 3], angle: 33}}]",
    "  - {type: disc, center: [0, 0, 0], normal: [1, 2, 3], radius: 1",
    "  - {type: triangle, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
)
STILL_KEYS = {
    "no velocity": (", shutter: 1", "motion: {velocity: [0, 0, 0]}"),
    "no rate": (", shutter: 1", "motion: {spin: {axis: [0, 0, 1], rate: 0}}"),
    "a moment": (", shutter: 0", "motion: {velocity: [1, 2, 3], spin: {axis: [0, 0, 1], rate: 90}}"),
    "no shutter": ("", "motion: {velocity: [1, 2, 3]}"),
    "before it starts": (
        ", shutter: {open: -2, close: -1}",
        "motion: {keyframes: [{time: 0, transform: []}, {time: 1, transform: [{scale: 2}]}]}",
    ),
    "a shutter alone": (", shutter: {open: -2, close: -1}", "name: null"),
}


def bytes_of(value):
    """The bits of all arrays and numbers in nested tuples."""
    if isinstance(value, tuple):
        return [bits for item in value for bits in bytes_of(item)]
    return [np.asarray(value).tobytes()] if isinstance(value, np.ndarray | int | float) else []


@pytest.mark.parametrize("name", STILL_KEYS)
def test_what_moves_nothing_is_packed_as_without_the_keys(name):
    """Check that both have the same type, so the same kernel, and the same bits: pictures are then bit-identical."""
    camera, motion = STILL_KEYS[name]
    plain = packed_of(f"{STILL_CAMERA}}}\nobjects:\n" + "".join(f"{item}}}\n" for item in OBJECTS))
    keyed = packed_of(
        f"{STILL_CAMERA}{camera}}}\nobjects:\n" + "".join(f"{item}, {motion}}}\n" for item in OBJECTS if motion)
    )
    assert numba.typeof(keyed.scene) == numba.typeof(plain.scene)
    assert bytes_of(keyed.scene) == bytes_of(plain.scene)
    for number, geometry in plain.objects.geometries.items():
        assert len(keyed.objects.geometries[number].vertices) == 1
        assert bytes_of(keyed.objects.geometries[number].vertices) == bytes_of(geometry.vertices)


def test_only_what_moves_is_packed_as_moving():
    text = f"{STILL_CAMERA}, shutter: 1}}\nobjects:\n"
    moving = packed_of(
        text
        + f"{OBJECTS[0]}}}\n{OBJECTS[0]}, motion: {{velocity: [1, 0, 0]}}}}\n"
        + f"{OBJECTS[0]}, motion: {{velocity: [0, 0, 2]}}}}\n{OBJECTS[2]}}}\n"
    )
    assert [type(table).__name__ for table in moving.scene.primitives] == ["Discs", "Spheres", "Translated"]
    table = moving.scene.primitives[2]
    assert isinstance(table, Translated)
    np.testing.assert_array_equal(table.shift, [[1, 0, 0], [0, 0, 2]])
    assert moving.scene.shutter is not None
    assert moving.scene.instances is None


@pytest.mark.parametrize(
    ("camera", "motion", "active", "words"),
    [
        ("", "", False, "open for no time, at 0 s"),
        (", time: 2", ", motion: {velocity: [1, 0, 0]}", False, "open for no time, at 2 s"),
        (", shutter: 1/8 s", "", False, "nothing moves while the shutter is open, for 0.125 s"),
        (", shutter: 1/8 s", ", motion: {velocity: [1, 0, 0]}", True, "0.125 s, in which 1 object may move"),
        (", shutter: 1/8 s, motion: {velocity: [1, 0, 0]}", "", True, "in which the camera may move"),
    ],
)
def test_motion_blur_is_explained(camera, motion, active, words):
    spec = scene(f"{STILL_CAMERA}{camera}}}\nobjects:\n{OBJECTS[0]}{motion}}}", filled=False)
    effect = effects_of(spec, pack(spec).scene)["motion_blur"]
    assert effect.active == active
    assert words in effect.why


# ---- Time as a dimension of the samples


@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
def test_a_pixels_times_are_stratified(sampler):
    for count in (16, 64, 256):
        times = times_of(sampler, count)
        np.testing.assert_array_equal(np.sort(np.floor(times * count)), np.arange(count))


def test_times_are_floats_that_float32_holds():
    """Embree's ray and the hit in float64 are of the same time, never beyond the shutter."""
    times = np.concatenate([times_of("independent", 5000, pixel) for pixel in range(4)])
    np.testing.assert_array_equal(times, times.astype(np.float32))
    assert times.min() >= 0.0
    assert times.max() <= 1.0
    assert times.mean() == pytest.approx(0.5, abs=4 / np.sqrt(12 * len(times)))
    assert not np.array_equal(times_of("sobol", 64, 1), times_of("sobol", 64, 2))


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


SQUARE = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
{0} {0} 0
{1} {0} 0
{1} {1} 0
{0} {1} 0
3 0 1 2
3 0 2 3
"""


def frames_in(folder, *sizes):
    """Squares with these half edges, as frames at times 0, 0.5, 1, ..."""
    for number, size in enumerate(sizes):
        (folder / f"{number}.ply").write_text(SQUARE.format(-size, size))
    return ", ".join(f"{{time: {number / 2}, file: {number}.ply}}" for number in range(len(sizes)))


@pytest.mark.slow
def test_a_square_that_grows_is_as_bright_as_its_mean_area(tmp_path):
    """Half edges 0.5 to 1 to 0.5: the mean of (2 s)^2 is 4 (0.25 + 0.5 + 1) / 3 = 7/3."""
    frames = frames_in(tmp_path, 0.5, 1.0, 0.5)
    text = f"""camera: {{type: orthographic, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 4, shutter: 1}}
objects:
  - {{type: mesh, frames: [{frames}], {LAMP}}}
"""
    spec = scene(text, filled=False, width=32, height=32, spp=256, max_depth=1, sampler="sobol", base=tmp_path)
    assert isinstance(pack(spec).scene.primitives[0], DeformingTriangles)
    picture = render(spec, threads=2).image.radiance[..., 0]
    assert picture.sum() * (4 / 32) ** 2 == pytest.approx(7 / 3, rel=5e-4)


def test_frames_that_do_not_differ_in_the_shutter_are_a_mesh(tmp_path):
    frames = frames_in(tmp_path, 0.5, 0.5, 1.0)
    camera = "camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0]"
    still = packed_of(f"{camera}}}\nobjects:\n  - {{type: mesh, file: 0.ply}}\n", base=tmp_path)
    for shutter in ("shutter: 0.5", "time: 0.25", "shutter: {open: -1, close: 0.5}"):
        text = f"{camera}, {shutter}}}\nobjects:\n  - {{type: mesh, frames: [{frames}]}}\n"
        packed = packed_of(text, base=tmp_path)
        assert numba.typeof(packed.scene) == numba.typeof(still.scene)
        assert bytes_of(packed.scene) == bytes_of(still.scene)
    text = f"{camera}, time: 0.75}}\nobjects:\n  - {{type: mesh, frames: [{frames}]}}\n"
    between = packed_of(text, base=tmp_path).scene.primitives[0].vertices
    np.testing.assert_array_equal(between, 1.5 * still.scene.primitives[0].vertices)


def test_the_bouncing_scene_is_what_its_script_writes(tmp_path):
    scenes = Path(__file__).parents[3] / "scenes"
    script = scenes / "generate" / "bouncing.py"
    subprocess.run([sys.executable, str(script), str(tmp_path / "again.yaml")], check=True)
    assert (tmp_path / "again.yaml").read_bytes() == (scenes / "bouncing.yaml").read_bytes()


@pytest.mark.slow
def test_a_furnace_of_things_that_move_stays_white():
    """Albedo 1 in a uniform environment of 1: every path brings 1, wherever what it meets has gone meanwhile."""
    text = """camera: {type: pinhole, look_from: [0, 0, 5], vfov: 60, shutter: 1, motion: {velocity: [0, 1, 0]}}
environment: {type: constant, radiance: 1}
materials: {white: {type: lambertian, albedo: 1}}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: white, motion: {velocity: [1, 0, 0]}}
  - type: box
    min: [-2, -1, -1]
    max: [-1.2, 1, 1]
    material: white
    motion: {spin: {axis: [0, 1, 0], rate: 200, center: [-1.6, 0, 0]}}
  - {type: disc, center: [0, -1.5, 0], normal: [0, 1, 0], radius: 4, material: white, motion: {velocity: [0, -0.2, 0]}}
"""
    picture = {}
    for threads in (1, 3):
        spec = scene(text, filled=False, width=24, height=24, spp=32, max_depth=2000)
        result = render(spec, seed=2, threads=threads)
        assert result.stats.nan_samples == 0
        picture[threads] = result.image.radiance
    np.testing.assert_allclose(picture[1], 1.0, atol=1e-12)
    np.testing.assert_array_equal(picture[1], picture[3])
