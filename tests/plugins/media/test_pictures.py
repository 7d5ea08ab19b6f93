"""Pictures of media against closed forms and quadrature.

All scenes hold the same kinds of things, if need be as specks that no ray meets or as light of 1e-30, so that they
share one compiled kernel, with homogeneous media and a grid.
"""

import math
import pickle

import numba
import numpy as np
import pytest

from raytracer.scene.pack.scene import pack
from tests.plugins.materials.kernels import frame
from tests.repository import ROOT
from tests.small_scenes import image, mean, scene

DARK = 1e-30
"""A radiance of the environment or of a lamp that is no light but is there for the compiler."""

_SPECKS = f"""
  - {{type: sphere, center: [0, -99, 0], radius: 1.0e-9, material: {{type: emitter, radiance: {DARK}}}}}
  - {{type: sphere, center: [0, -95, 0], radius: 1.0e-9, material: {{type: emitter, radiance: {DARK}}}}}
  - {{type: sphere, center: [0, -98, 0], radius: 1.0e-9, material: {{type: lambertian}}}}
  - {{type: sphere, center: [0, -97, 0], radius: 1.0e-9, material: {{type: dielectric}}}}
  - {{type: sphere, center: [0, -96, 0], radius: 1.0e-9, medium: speck}}
  - {{type: sphere, center: [0, -94, 0], radius: 1.0e-9, medium: grains}}
"""

# Any array of three axes is a grid.
_SPECK = f"""speck: {{type: homogeneous, absorption: 1}}
  grains: {{type: grid, file: {ROOT / "tests" / "hard_cases" / "scenes" / "38_hot_pixel.npy"}}}"""


def text(
    objects, media="", *, camera="look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 0.01", environment=DARK, scene=""
):
    """A scene; its camera looks at the origin, from 4 m away along the z axis, through a pinpoint."""
    return f"""
camera: {{type: pinhole, {camera}}}
environment: {{type: constant, radiance: {environment!r}}}
{scene}
media:
  {_SPECK}
  {media}
objects:
{_SPECKS}
{objects}
"""


def picture(*arguments, spp=64, max_depth=2000, rr_depth=1000, seed=1, **settings):
    scene = text(*arguments, **settings)
    return image(scene, filled=False, spp=spp, max_depth=max_depth, rr_depth=rr_depth, seed=seed)


def assert_channels(result, expected, *, noise=0.01):
    """Each channel's mean is what is expected, within 4.5 standard deviations, which are at most `noise` of it."""
    value, deviation = mean(result)
    expected = np.array(expected)
    assert (deviation <= noise * expected + 1e-6).all(), f"too noisy to tell: {deviation / expected}"
    # Embree's distances are good to 1e-6 of themselves.
    z = (value - expected) / (deviation + 1e-5 * expected / 4.5)
    assert (np.abs(z) < 4.5).all(), f"{value} is not {expected}: {z} sigma"


# ---- Absorption


ABSORPTION = np.array([0.1, 0.5, 2.0])
FOG = "fog: {type: homogeneous, absorption: [0.1, 0.5, 2.0]}"


FOGGY = {"media": FOG, "scene": "medium: fog"}
LAMP = "  - {type: sphere, center: [0, 0, -6], radius: 2, material: {type: emitter, radiance: [1, 2, 3]}}\n"
GLASS = "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: 1}}\n"
NESTED = """
  - {type: sphere, center: [0, 0, 0], radius: 1, medium: fog}
  - {type: sphere, center: [0, 0, 0.2], radius: 0.5, medium: ink, outside_medium: fog}
  - {type: sphere, center: [0, 0, 0.2], radius: 0.25, medium: air, outside_medium: ink}
"""
INKS = "ink: {type: homogeneous, absorption: [3, 1, 0.5]}\n  air: {type: homogeneous, absorption: 0}"
WITHIN = "look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 0.01, medium: fog"
LONG = {"media": "fog: {type: homogeneous, absorption: [0, 0.001, 2]}", "scene": "medium: fog", "environment": 3.0}

ABSORBING = {
    "a ball": ("  - {type: sphere, center: [0, 0, 0], radius: 1, medium: fog}", {"environment": 3.0}, 3.0, 2.0),
    "a lamp": (LAMP, FOGGY, [1.0, 2.0, 3.0], 8.0),
    # Glass of index 1 without a medium of its own takes its 2 m out of the fog's 8 m.
    "a clear ball in fog": (GLASS + LAMP, FOGGY, [1.0, 2.0, 3.0], 6.0),
    "nested media": (NESTED, {"media": f"{FOG}\n  {INKS}", "environment": 1.0}, np.exp([-1.5, -0.5, -0.25]), 1.0),
    "the camera in a ball": (
        "  - {type: sphere, center: [0, 0, 4], radius: 1.5, medium: fog}", {"camera": WITHIN, "environment": 1.0}, 1.0,
        1.5,
    ),
    # Transmittance over an infinite distance: 0, or 1 in a channel that is not absorbed.
    "an endless fog": ("", LONG, [3.0, 0.0, 0.0], 0.0),
}  # fmt: skip


@pytest.mark.parametrize("name", ABSORBING)
def test_absorption_along_a_way_is_beers_law(name):
    # Whatever does the tracing draws no random number for it.
    objects, settings, emitted, way = ABSORBING[name]
    result = picture(objects, **{"media": FOG, **settings}, spp=8)
    expected = emitted * np.exp(-way * ABSORPTION)
    np.testing.assert_allclose(result.radiance, np.broadcast_to(expected, (16, 16, 3)), rtol=1e-5)


# ---- Scattering


def test_white_furnace():
    # Nothing is lost, so every direction brings back the environment.  Channels may trade, but their sum may not
    # change, since they are drawn by throughput; grey light does not vary at all.
    ball = "  - {type: sphere, center: [0, 0, 0], radius: 1, medium: milk}"
    # Hard case 45, no choice: forwards only, as if nothing were there; back only, back and forth, and out again.
    for extinction, g in (("[0.5, 1, 3]", 0.3), ("2", -0.6), ("4", 0.9), ("2", 1.0), ("2", -1.0)):
        milk = f"milk: {{type: homogeneous, extinction: {extinction}, albedo: 1, g: {g}}}"
        result = picture(ball, milk, environment=1.0, max_depth=100_000)
        np.testing.assert_allclose(result.radiance.sum(axis=2), 3.0, rtol=1e-11)
        if "[" not in extinction:
            np.testing.assert_allclose(result.radiance, 1.0, rtol=1e-12)
        else:
            assert_channels(result, [1.0, 1.0, 1.0])


def single_scattering(extinction, scattering, g, toward, solid_angle):
    """Radiance by channel, along the axis of a unit ball of fog, of light of radiance 1 that is scattered once.

    The light comes from directions `toward` (n, 3), which have weights `solid_angle` (n,).  By Gauss and Legendre along
    the axis; the way to the surface, from a point at z, is found from the ball's equation.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)
    total = np.zeros(3)
    for depth, weight in zip(1.0 + nodes, weights, strict=True):
        z = 1.0 - depth
        cosine = toward[:, 2]
        out = -z * cosine + np.sqrt(1.0 - z * z * (1.0 - cosine * cosine))
        # Light travels along -toward, and then along +z to the camera.
        phase = (1.0 - g * g) / (4.0 * math.pi * (1.0 + g * g + 2.0 * g * cosine) ** 1.5)
        arriving = np.exp(-np.outer(out, extinction)) * (phase * solid_angle)[:, None]
        total += weight * scattering * np.exp(-extinction * depth) * arriving.sum(axis=0)
    return total


def sphere_of_directions(cos_low, axis):
    """Quadrature over directions within arccos(cos_low) of a unit axis: points (n, 3) and weights (n,)."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    cosine = 0.5 * (1.0 + cos_low) + 0.5 * (1.0 - cos_low) * nodes
    phi = 2.0 * math.pi * (np.arange(48) + 0.5) / 48
    sine = np.sqrt(1.0 - cosine * cosine)
    s, t, n = frame(np.array(axis))
    points = (
        sine[:, None, None] * (np.cos(phi)[None, :, None] * s + np.sin(phi)[None, :, None] * t)
        + cosine[:, None, None] * n
    ).reshape(-1, 3)
    return points, np.repeat(weights * 0.5 * (1.0 - cos_low) * 2.0 * math.pi / 48, 48)


EXTINCTION = np.array([0.4, 1.0, 2.5])
ALBEDO = np.array([0.9, 0.3, 0.6])
SMOKE = "smoke: {{type: homogeneous, extinction: [0.4, 1, 2.5], albedo: [0.9, 0.3, 0.6], g: {g}}}"
BALL = "  - {type: sphere, center: [0, 0, 0], radius: 1, medium: smoke}\n"


@pytest.mark.parametrize("g", [0.0, 0.7, -0.4])
def test_single_scattering_of_an_environment(g):
    toward, weights = sphere_of_directions(-1.0, (0.0, 0.0, 1.0))
    once = single_scattering(EXTINCTION, EXTINCTION * ALBEDO, g, toward, weights)
    expected = np.exp(-2.0 * EXTINCTION) + once
    result = picture(BALL, SMOKE.format(g=g), environment=1.0, max_depth=2, spp=512)
    assert_channels(result, expected)


@pytest.mark.parametrize("g", [0.0, 0.7, -0.4])
def test_single_scattering_of_a_lamp(g):
    # A lamp so far away that its cone is the same for all points of the ball, to 1e-4; it is aimed at.
    far, radius, axis = 1e5, 2e4, np.array([0.6, 0.48, 0.64])
    toward, weights = sphere_of_directions(math.sqrt(1.0 - (radius / far) ** 2), tuple(axis.tolist()))
    expected = 50.0 * single_scattering(EXTINCTION, EXTINCTION * ALBEDO, g, toward, weights)
    center = [round(float(x), 6) for x in far * axis]
    lamp = f"  - {{type: sphere, center: {center}, radius: {radius}, material: {{type: emitter, radiance: 50}}}}"
    result = picture(BALL + lamp, SMOKE.format(g=g), max_depth=2, spp=512)
    assert_channels(result, expected)


def test_depth_counts_what_scatters_but_no_boundaries():
    # Depth 2 is what is scattered once at most, through five boundaries each way.
    shells = "".join(
        f"  - {{type: sphere, center: [0, 0, 0], radius: {radius}, medium: smoke, outside_medium: smoke}}\n"
        for radius in (0.9, 0.7, 0.5, 0.3)
    )
    toward, weights = sphere_of_directions(-1.0, (0.0, 0.0, 1.0))
    once = single_scattering(EXTINCTION, EXTINCTION * ALBEDO, 0.0, toward, weights)
    result = picture(BALL + shells, SMOKE.format(g=0), environment=1.0, max_depth=2, spp=512)
    assert_channels(result, np.exp(-2.0 * EXTINCTION) + once)


ROOM = """
  - {type: sphere, center: [0, 0, 0], radius: 1, medium: smoke}
  - {type: sphere, center: [0.5, 2, 0], radius: 0.5, material: {type: emitter, radiance: 8}}
  - {type: sphere, center: [0.2, -0.1, -0.4], radius: 0.3, material: {type: lambertian, albedo: 0.8}}
  - {type: sphere, center: [0, -11, 0], radius: 9.5, material: {type: lambertian, albedo: [0.8, 0.5, 0.3]}}
"""


SHELL = "  - {type: sphere, center: [0.1, 0, 0.2], radius: 0.8, medium: smoke}\n"
"""Of the same medium on both sides where the scene is full of it, so that it is nothing there, for shadow rays too."""


@pytest.mark.parametrize(
    ("objects", "extinction", "scene", "spp"),
    [(ROOM, "[0.4, 1, 2.5]", "", 3072), (ROOM + SHELL, "[0.04, 0.1, 0.2]", "medium: smoke", 2048)],
)
def test_light_sampling_leaves_the_mean_alone(objects, extinction, scene, spp):
    # Many times scattered, from and to surfaces within and outside of the fog, in the shadow of both.
    smoke = f"smoke: {{type: homogeneous, extinction: {extinction}, albedo: [0.9, 0.3, 0.6], g: 0.4}}"
    camera = "look_from: [0, 0.3, 4], look_at: [0, 0, 0], vfov: 35"
    settings = {"filled": False, "max_depth": 2000, "rr_depth": 3}
    (a, deviation_a), (b, deviation_b) = (
        mean(image(text(each, smoke, camera=camera, scene=scene), light_sampling=mode, spp=count, **settings))
        for each, mode, count in ((objects, "mis", spp // 4), (ROOM, "paths", spp))
    )
    deviation = np.hypot(deviation_a, deviation_b)
    assert (deviation < 0.02 * b).all(), "too noisy to tell"
    assert (np.abs(a - b) < 4.5 * deviation).all(), (a, b, (a - b) / deviation)
    assert (deviation_a < deviation_b).all(), "aiming at lights does not help four times"


def test_a_constant_grid_looks_homogeneous(tmp_path):
    np.save(tmp_path / "half.npy", np.full((9, 3, 20), 0.5))
    camera = "look_from: [0, 0.3, 4], look_at: [0, 0, 0], vfov: 35"
    rest = "albedo: [0.9, 0.3, 0.6], g: 0.4}"
    grid = f"{{type: grid, file: half.npy, min: [-1, -1, -1], max: [1, 1, 1], extinction: 3, {rest}"
    plain = f"{{type: homogeneous, extinction: 1.5, {rest}"
    settings = {"filled": False, "spp": 128, "max_depth": 200}
    a, deviation_a = mean(image(text(ROOM, f"smoke: {grid}", camera=camera), base=tmp_path, **settings))
    b, deviation_b = mean(image(text(ROOM, f"smoke: {plain}", camera=camera), seed=2, **settings))
    deviation = np.hypot(deviation_a, deviation_b)
    assert (deviation < 0.02 * b).all()
    assert (np.abs(a - b) < 4.5 * deviation).all(), (a, b, (a - b) / deviation)


# ---- What is not there


def test_a_medium_that_takes_nothing_is_packed_as_none():
    # Hard case 45: sigma = 0 equals no medium; and so does a medium that is defined and not used.
    ball = """
camera: {type: pinhole, look_from: [0, 0, 4]MEDIUM}
media: {air: {type: homogeneous, absorption: 0, scattering: 0, g: 1}}
objects: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric}MEDIUM}]
"""
    without, clear = (pack(scene(ball.replace("MEDIUM", key), filled=False)).scene for key in ("", ", medium: air"))
    assert without.media is None
    # The same kernel for the same numbers: the same bits.
    assert pickle.dumps(clear) == pickle.dumps(without)


def test_values_of_a_medium_are_not_part_of_the_type():
    fogs = ("absorption: 1", "extinction: [1, 2, 3], albedo: 1, g: -1")
    texts = [text(ABSORBING["a ball"][0], f"fog: {{type: homogeneous, {fog}}}", scene="SCENE") for fog in fogs]
    whole = [each.replace("SCENE", keys) for each in texts for keys in ("", "medium: fog")]
    assert len({numba.typeof(pack(scene(each, filled=False)).scene) for each in whole}) == 1


def test_a_light_seen_edge_on_is_not_brighter_through_fog():
    # The gap that a shadow ray leaves before a lamp is longer than its way, for a point almost in the lamp's plane;
    # light over a negative distance would be enhanced without bounds.
    lamp = """
  - {type: sphere, center: [0, 0, 0], radius: 30, medium: smoke}
  - {type: sphere, center: [0, -1e6, 0], radius: 999999, material: {type: emitter, radiance: 1}}
"""
    smoke = "smoke: {type: homogeneous, extinction: 5, albedo: 0.99}"
    camera = "look_from: [0, 0.001, 4], look_at: [0, -1, 0], vfov: 60, medium: smoke"
    result = picture(lamp, smoke, camera=camera, max_depth=30, spp=256)
    assert result.radiance.max() < 10.0
