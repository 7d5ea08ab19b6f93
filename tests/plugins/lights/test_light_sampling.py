"""`render.light_sampling`: aiming at lights, following paths, and both; one mean, and the noise that each is known for.

References: Veach 1997, thesis, sec. 9.2 and fig. 9.2, where plates from smooth to rough reflect small and large lights.
"""

import itertools
import math

import numpy as np
import pytest

from raytracer.analysis.explain import explain
from raytracer.plugins.lights.base.interface import (
    Lights,
    LightSamplingOnly,
    NoLightSampling,
    mis_weight_light_sample,
    mis_weight_path,
)
from raytracer.rendering.render import render
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import SceneError
from tests.plugins.lights.kernels import escaped, table_of
from tests.repository import REFERENCES

MODES = ("mis", "lights", "paths")

HEAD = """
film: {width: 24, height: 24}
render: {spp: 64, max_depth: 4, rr_depth: 1000, sampler: independent}
"""


def spec_of(text, mode, base=None, **settings):
    """A scene by this setting; others of its `film` and `render`, such as render__spp."""
    overrides = {key.replace("__", "."): value for key, value in settings.items()}
    return build(HEAD + text, "test.yaml", {"render.light_sampling": mode, **overrides}, base=base)


def pictures(text, modes=MODES, base=None, **settings):
    """The same scene by each of the settings, from random numbers of their own."""
    measured = {}
    for seed, mode in enumerate(modes):
        result = render(spec_of(text, mode, base, render__seed=seed, **settings), threads=2)
        assert result.stats.nan_samples == 0
        measured[mode] = result.image
    return measured


def mean(picture):
    """Means (12,) of the quarters of a picture by channel, and their variances (12,)."""
    height, width, _ = picture.radiance.shape
    quarters = (2, height // 2, 2, width // 2, 3)
    value = picture.radiance.reshape(quarters).mean(axis=(1, 3))
    return value.ravel(), picture.variance.reshape(quarters).sum(axis=(1, 3)).ravel() / (height * width / 4) ** 2


def assert_one_mean(measured, *, noise):
    """All pictures have the same mean within their noise, which is at most this part of it, in each quarter."""
    for one, other in itertools.combinations(measured, 2):
        (a, variance_a), (b, variance_b) = mean(measured[one]), mean(measured[other])
        deviation = np.sqrt(variance_a + variance_b)
        assert (deviation <= noise * b).all(), f"{one}, {other}: too noisy to tell: {deviation / b}"
        z = (a - b) / (deviation + 1e-9 * b)
        assert (np.abs(z) < 4.5).all(), f"{one} is not {other}: {z} sigma of {deviation / b}"


# ---- Weights


@pytest.mark.parametrize("heuristic", [None, LightSamplingOnly()])
def test_light_that_both_ways_find_counts_once(heuristic):
    for by_light, by_path in ((2.0, 3.0), (1e-300, 1e300), (5.0, 1e-9)):
        aimed, measured = (
            mis_weight_light_sample(heuristic, by_light, by_path),
            mis_weight_path(heuristic, by_path, by_light),
        )
        assert aimed + measured == pytest.approx(1.0)
    # Neither infinite densities nor those that rounding has left at 0 make a weight that is no number; what a path
    # finds without choice is its own, even where light samples are as sure of it.
    for pdf in (0.0, 1e-320, 1.0, 1e308, math.inf):
        for other in (0.0, 1e-320, 1.0, 1e308, math.inf):
            assert 0.0 <= mis_weight_light_sample(heuristic, pdf, other) <= 1.0
            assert 0.0 <= mis_weight_path(heuristic, pdf, other) <= 1.0
    assert mis_weight_path(heuristic, math.inf, math.inf) == 1.0
    # What only one way finds is all its own: light in a mirror, that which is never aimed at, and that of a point.
    assert mis_weight_path(heuristic, math.inf, 2.0) == 1.0
    assert mis_weight_path(heuristic, 2.0, 0.0) == 1.0
    assert mis_weight_light_sample(heuristic, math.inf, 2.0) == 1.0
    assert mis_weight_light_sample(heuristic, 2.0, 0.0) == 1.0


def test_rays_see_a_disc_by_how_light_is_sampled():
    suns = table_of("sun", {"direction": [0.0, -1.0, 0.0], "irradiance": [1.0, 2.0, 0.0], "angle": 2.0})
    up, bright = np.array([[0.0, 1.0, 0.0]]), 1.0 / (math.pi * math.sin(math.radians(1.0)) ** 2)
    whole = [[bright, 2.0 * bright, 0.0]]
    for pdf in (1e-3, 10.0, 1e6, math.inf):
        np.testing.assert_allclose(escaped(NoLightSampling((suns,), None), up, pdf), whole, rtol=1e-12)
        aimed = escaped(Lights((suns,), None, LightSamplingOnly()), up, pdf)
        np.testing.assert_allclose(aimed, whole if math.isinf(pdf) else np.zeros((1, 3)), rtol=1e-12)


# ---- What is packed

CAMERA = "camera: {type: pinhole, look_from: [0, 1, 3], look_at: [0, 0, -0.5], vfov: 40}\n"
FLOOR = "  - {type: quad, corner: [-2, 0, 2], edges: [[4, 0, 0], [0, 0, -4]], material: {type: lambertian}}\n"
LAMP = "  - {type: sphere, center: [0.8, 0.9, -1], radius: 0.4, material: {type: emitter, radiance: 4}}\n"
SUN = "lights: [{type: sun, direction: [-1, -2, -0.5], irradiance: [3, 2, 1], angle: 25}]\n"
SPOTLIT = "lights: [{type: spot, position: [0, 2, 0], look_at: [0, 0, 0], intensity: 1, angle: 40}]\n"
PARALLEL = SUN.replace("angle: 25", "angle: 0")
EXPOSED = CAMERA.replace("vfov", "shutter: 1, vfov")
FLASHED = EXPOSED + "lights: [{type: flash, energy: 2, duration: 1/100 s}]\n"


def test_the_setting_is_part_of_the_type():
    text = CAMERA + SUN + "environment: {type: sky}\nobjects:\n" + FLOOR + LAMP
    packed = {mode: pack(spec_of(text, mode)).scene for mode in MODES}
    assert packed["mis"].lights.heuristic is None
    assert isinstance(packed["lights"].lights.heuristic, LightSamplingOnly)
    assert [type(table).__name__ for table in packed["lights"].lights.tables] == ["Emitters", "Suns", "Background"]
    # Only what lies at infinity is not in the scene that paths are traced through.
    assert isinstance(packed["paths"].lights, NoLightSampling)
    assert [type(table).__name__ for table in packed["paths"].lights.tables] == ["Suns"]
    assert packed["paths"].lights.background_tables is packed["paths"].environment
    assert pack(spec_of(CAMERA + "objects:\n" + FLOOR + LAMP, "paths")).scene.lights is None


@pytest.mark.parametrize("mode", MODES)
def test_where_nothing_can_be_lit_nothing_is_aimed_at(mode):
    mirror = "objects:\n  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal, fuzz: 0}}\n"
    assert isinstance(pack(spec_of(CAMERA + SUN + mirror, mode)).scene.lights, NoLightSampling)
    # And lights that make no difference there are no reason to refuse the scene.
    for lights in (SPOTLIT, PARALLEL, "environment: {type: sky}\n"):
        assert pack(spec_of(CAMERA + lights + mirror, mode)).scene.lights is None
    for lights, depth in (("{type: gradient}", 4), ("{type: sky}", 1)):
        text = f"{CAMERA}environment: {lights}\nobjects:\n{FLOOR}"
        assert pack(spec_of(text, mode, render__max_depth=depth)).scene.lights is None


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (CAMERA + SPOTLIT, "spot"),
        (CAMERA + PARALLEL, "sun"),
        (FLASHED, "flash"),
        (CAMERA + "lights: [{type: point, position: [0, 2, 0], intensity: 1}]\n", "point"),
    ],
)
def test_paths_that_would_miss_a_light_are_refused(text, kind):
    with pytest.raises(SceneError, match=rf"render\.light_sampling: paths never find a {kind} light without extent"):
        pack(spec_of(text + "objects:\n" + FLOOR, "paths"))
    for mode in ("mis", "lights"):
        assert pack(spec_of(text + "objects:\n" + FLOOR, mode)).scene.lights is not None
    # A light that is off is missed by nobody.
    off = text.replace("intensity: 1", "intensity: 0").replace("energy: 2", "energy: 0").replace("[3, 2, 1]", "0")
    assert pack(spec_of(off + "objects:\n" + FLOOR, "paths")).scene.lights is None


def test_explanation_says_how_light_is_found():
    text = CAMERA + "environment: {type: sky, sun: true}\nobjects:\n" + FLOOR + LAMP
    effects = {mode: explain(spec_of(text, mode)).effects for mode in MODES}
    assert {mode: active["light_sampling"].active for mode, active in effects.items()} == {
        "mis": True,
        "lights": True,
        "paths": False,
    }
    assert "by chance do not count" in effects["lights"]["light_sampling"].why
    assert "no next-event estimation" in effects["paths"]["light_sampling"].why
    assert not effects["paths"]["environment_sampling"].active
    assert "light_sampling is paths" in effects["paths"]["environment_sampling"].why
    assert effects["paths"]["light.sun"].active


# ---- Noise

# Plates that grow rougher, and lights of the same power that grow larger: one colour each.
ROUGHNESS = (0.08, 0.2, 0.4, 0.8)
RADII = (0.1, 0.3, 0.9)
SPHERES = "".join(
    f"  - {{type: sphere, center: [{3 * (light - 1)}, 3, -1], radius: {radius}, "
    f"material: {{type: emitter, radiance: {[3.0 / radius**2 * (channel == light) for channel in range(3)]}}}}}\n"
    for light, radius in enumerate(RADII)
)
PLATE = """
camera: {{type: pinhole, look_from: [0, 3, 7], look_at: [0, 0, 3], vfov: 12}}
objects:
  - type: quad
    corner: [-6, 0, 4]
    edges: [[12, 0, 0], [0, 0, -2]]
    material: {{type: rough_conductor, albedo: 0.9, roughness: {roughness}}}
"""


@pytest.mark.slow
def test_plates_and_lights():
    """Veach's picture: each way is bad where the other is good, and both together are never worse than the better."""
    size = {"film__width": 48, "film__height": 8, "render__max_depth": 2, "render__spp": 256}
    variance = {mode: [] for mode in MODES}
    for roughness in ROUGHNESS:
        for mode, picture in pictures(PLATE.format(roughness=roughness) + SPHERES, **size).items():
            variance[mode].append(picture.variance.mean(axis=(0, 1)))
    mis, lights, paths = (np.array(variance[mode]) for mode in MODES)

    # Large lights in a near-mirror: few points that are aimed at are in the lobe.  Measured: 2800 times the variance.
    assert lights[0, 2] > 100.0 * mis[0, 2]
    # Small lights on a rough plate: few directions of the lobe meet them.  Measured: 2300 times.
    assert paths[3, 0] > 100.0 * mis[3, 0]
    # Between these corners each gets better in the direction in which the other gets worse.
    worse = np.log(paths / lights)
    assert (np.diff(worse, axis=0) > 0.0).all()
    assert (np.diff(worse, axis=1) < 0.0).all()
    # Measured: from 0.4 to 1.1.
    assert (mis < 1.3 * np.minimum(lights, paths)).all()


# ---- The mean

SMOKE = """
media:
  smoke: {type: homogeneous, extinction: [0.4, 1, 2.5], albedo: [0.9, 0.3, 0.6], g: 0.4}
  thin: {type: homogeneous, extinction: 0.1, albedo: 0.8}
medium: thin
"""

SCENES = {
    "lamps of all kinds, on all kinds of materials": CAMERA
    + "objects:\n"
    + FLOOR
    + LAMP
    + """
  - type: quad
    corner: [-0.9, 0.5, -1.5]
    edges: [[1, 0, 0], [0, 0.5, 0.5]]
    material: {type: emitter, radiance: 3, two_sided: true}
  - type: mesh
    file: octahedron.obj
    smooth: true
    transform: [{scale: 0.4}, {translate: [-1.3, 0.5, 0]}]
    material: {type: emitter, radiance: 2}
  - {type: sphere, center: [0, 0.35, 0.3], radius: 0.35, material: {type: dielectric}}
  - {type: sphere, center: [0.8, 0.3, 0.4], radius: 0.3, material: {type: metal, albedo: 0.8, fuzz: 0.3}}
  - type: sphere
    center: [-0.7, 0.25, 0.7]
    radius: 0.25
    material: {type: principled, base_color: [0.2, 0.5, 0.8], roughness: 0.4, emission: 0.2}
  - {type: sphere, center: [1.3, 0.25, 0.9], radius: 0.25, material: {type: rough_dielectric, roughness: 0.5}}
""",
    "an image and the sun's disc": CAMERA
    + SUN
    + "environment: {type: image, file: map.npy}\nobjects:\n"
    + FLOOR
    + """
  - {type: sphere, center: [0.8, 0.3, 0.4], radius: 0.3, material: {type: metal, albedo: 0.8, fuzz: 0}}
  - {type: sphere, center: [0, 0.35, 0.3], radius: 0.35, material: {type: dielectric}}
  - {type: sphere, center: [-0.7, 0.4, 0], radius: 0.4, material: {type: rough_conductor, albedo: 0.8, roughness: 0.5}}
""",
    "media": CAMERA
    + SMOKE
    + "environment: {type: image, file: map.npy}\nobjects:\n"
    + FLOOR
    + LAMP
    + """
  - {type: sphere, center: [0, 0.7, -0.5], radius: 0.6, medium: smoke, outside_medium: thin}
  - type: sphere
    center: [0.9, 0.35, 0.3]
    radius: 0.35
    material: {type: dielectric}
    medium: smoke
    outside_medium: thin
""",
    "holes, mixtures, and bumps": CAMERA
    + SUN
    + "textures: {squares: {type: checker}}\nobjects:\n"
    + FLOOR.replace("type: lambertian", "type: lambertian, bump: squares")
    + """
  - type: quad
    corner: [-1.5, 0.9, -1.5]
    edges: [[3, 0, 0], [0, 0, 3]]
    material: {type: cutout, opacity: 0.4, material: {type: lambertian, albedo: 0.5}}
  - type: quad
    corner: [-1, 1.2, -1]
    edges: [[2, 0, 0], [0, 0, 2]]
    material: {type: cutout, opacity: 0.6, material: {type: emitter, radiance: 3, two_sided: true}}
  - type: box
    min: [-0.9, 0.1, -0.5]
    max: [-0.3, 0.6, 0]
    material: {type: mixture, weight: 0.3, materials: [{type: emitter, radiance: 2}, {type: lambertian}]}
""",
    "what moves, and is placed": CAMERA.replace("vfov", "shutter: 1, motion: {velocity: [0.2, 0, 0]}, vfov")
    + "groups: {lamp: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: emitter, radiance: 3}}]}\n"
    + "objects:\n"
    + FLOOR
    + LAMP.replace("radius", "motion: {velocity: [-0.8, 0, 0.5]}, radius")
    + """
  - type: instance
    of: lamp
    transform: [{scale: [0.4, 0.2, 0.3]}, {rotate: {axis: [1, 2, 0.5], angle: 40}}, {translate: [-0.8, 0.6, -0.6]}]
  - {type: sphere, center: [0, 0.35, 0.3], radius: 0.35, material: {type: metal, albedo: 0.8, fuzz: 0.4}}
""",
    "smooth meshes, whose normals are far from those of their faces": CAMERA
    + "environment: {type: image, file: map.npy}\nobjects:\n"
    + FLOOR
    + LAMP
    + "".join(
        f"  - {{type: mesh, file: octahedron.obj, smooth: true, material: {{type: {material}}}, "
        f"transform: [{{scale: 0.5}}, {{rotate: {{axis: [1, 2, 3], angle: 40}}}}, {{translate: [{x}, 0.6, 0]}}]}}\n"
        for x, material in (
            (-1.2, "lambertian"),
            (0, "rough_conductor, albedo: 0.9, roughness: 0.3"),
            (1.2, "rough_dielectric, roughness: 0.4"),
        )
    ),
    "a hollow lamp with holes": CAMERA
    + "objects:\n"
    + FLOOR
    + "  - type: sphere\n    center: [0, 0.9, -1]\n    radius: 0.7\n"
    + "    material: {type: cutout, material: {type: emitter, radiance: 4, two_sided: true}}\n",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_all_ways_have_one_mean(tmp_path, name):
    sky = np.random.default_rng(2).random((6, 12, 3)) ** 3
    sky[1, 3] = 10.0
    np.save(tmp_path / "map.npy", sky)
    (tmp_path / "octahedron.obj").write_bytes((REFERENCES / "octahedron.obj").read_bytes())
    assert_one_mean(pictures(SCENES[name], base=tmp_path, render__spp=4096), noise=0.02)


@pytest.mark.slow
def test_lights_that_paths_never_find_are_aimed_at_by_the_other_ways():
    text = (
        EXPOSED.replace("vfov", "motion: {velocity: [0.2, 0, 0]}, vfov")
        + """
lights:
  - {type: flash, energy: 2, duration: 1/100 s}
  - {type: point, position: [-1, 1, 0], intensity: 1}
  - {type: spot, position: [0, 2, 0], look_at: [0, 0, 0], intensity: 1, angle: 40}
  - {type: sun, direction: [-1, -2, -0.5], irradiance: [1, 2, 3], angle: 0}
objects:
"""
        + FLOOR
        + LAMP
    )
    assert_one_mean(pictures(text, ("mis", "lights"), render__spp=1024), noise=0.02)


@pytest.mark.slow
def test_glowing_glass_does_not_light_itself_from_nowhere():
    # Points on a sphere, from which it is aimed at itself: through its inside to the far wall, and not where they are.
    text = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 25}
objects:
  - type: sphere
    center: [0.1, 0.2, 0]
    radius: 1
    material: {type: principled, transmission: 0.7, roughness: 0.5, emission: 1}
"""
    assert_one_mean(pictures(text, render__spp=1024), noise=0.005)
