"""Kinds of lights: what every kind promises, and the irradiance of each against its formula."""

import math

import numpy as np
import pytest

from raytracer.analysis.explain import explain
from raytracer.plugins.lights.base.interface import Lights, power_heuristic
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import LIGHTS
from tests.plugins.lights.kernels import aim, escaped, table_of
from tests.small_scenes import image, scene
from tests.statistics import CYLINDER, chi2_test, cylinder

SPOT = {"position": [0.0, 4.0, 0.0], "direction": [0.0, -2.0, 0.0], "intensity": [0.0, 1.0, 2.0]}

EXAMPLES = {
    "flash": [
        {"position": [0.0, 5.0, 0.0], "energy": [10.0, 5.0, 0.0]},
        {"energy": 2.0, "curtain": "second", "duration": "1/250 s", "offset": "-0.1 s"},
    ],
    "point": [{"position": [0.0, 5.0, 0.0], "intensity": [10.0, 5.0, 0.0]}],
    "spot": [
        {"position": [1.0, 4.0, 0.0], "look_at": [0.0, 0.0, 0.0], "intensity": 3.0, "angle": 60.0},
        {**SPOT, "angle": 90.0, "penumbra": 30.0},
    ],
    "sun": [
        {"direction": [1.0, -2.0, 0.5], "irradiance": 3.0},
        {"direction": [0.0, -1.0, 0.0], "irradiance": [1.0, 2.0, 3.0], "angle": 0.0},
        {"direction": [1.0, -1.0, 0.0], "irradiance": 1.0, "angle": 90.0},
    ],
}

CASES = [
    pytest.param(kind, keys, id=f"{kind} {n}") for kind, all_of in EXAMPLES.items() for n, keys in enumerate(all_of)
]
POINT = (0.3, 0.5, -0.2)


def lights_of(kind, *items):
    return Lights((table_of(kind, *items),), None)


def brightness(kind):
    return {"sun": "irradiance", "flash": "energy"}.get(kind, "intensity")


def test_every_kind_has_an_example():
    assert set(EXAMPLES) == set(LIGHTS.specs())


# ---- Every kind


@pytest.mark.parametrize(("kind", "keys"), CASES)
def test_samples_are_sound(kind, keys):
    aimed = aim(lights_of(kind, keys), None, POINT, 1000)
    np.testing.assert_allclose(np.linalg.norm(aimed.direction, axis=1), 1.0, rtol=1e-14)
    # Integers or numbers, one or many lights: the same compiled code.
    fields = [field for field in table_of(kind, keys, keys) if isinstance(field, np.ndarray)]
    assert all(field.dtype == np.float64 and field.flags.c_contiguous and len(field) == 2 for field in fields)
    way = aimed.target - POINT
    np.testing.assert_allclose(way / np.linalg.norm(way, axis=1)[:, None], aimed.direction, atol=1e-14)
    assert np.isfinite(aimed.weight).all()
    assert (aimed.weight >= 0.0).all()
    assert (aimed.weight > 0.0).any()
    assert (aimed.pdf > 0.0).all()
    assert (aimed.gap < np.linalg.norm(way, axis=1)).all()


@pytest.mark.parametrize("kind", EXAMPLES)
def test_what_does_not_shine_is_left_out(kind):
    keys = EXAMPLES[kind][0]
    dark = {**keys, brightness(kind): 0.0}
    assert table_of(kind, dark) is None
    (count,) = {len(field) for field in table_of(kind, dark, keys) if isinstance(field, np.ndarray)}
    assert count == 1


@pytest.mark.parametrize("kind", EXAMPLES)
def test_lights_of_a_table_are_chosen_by_power_and_add_up(kind):
    keys = EXAMPLES[kind][0]
    red, green = ({**keys, brightness(kind): color} for color in ([1.0, 0.0, 0.0], [0.0, 3.0, 0.0]))
    aimed = aim(lights_of(kind, red, green), None, POINT, 40_000)
    assert (aimed.weight[:, 1] > 0.0).mean() == pytest.approx(0.75, abs=0.01)
    one = aim(lights_of(kind, keys | {brightness(kind): 1.0}), None, POINT, 1).weight[0, 0]
    np.testing.assert_allclose(aimed.weight.mean(axis=0), [one, 3.0 * one, 0.0], rtol=0.03)


# ---- Point


def test_point_falls_off_with_the_square_of_distance():
    # Intensity over distance squared; the cosine is the surface's.
    aimed = aim(lights_of("point", {"position": [1, 2, 3], "intensity": [9, 18, 0]}), None, (1.0, 2.0, 0.0), 3)
    np.testing.assert_allclose(aimed.weight, np.tile([1.0, 2.0, 0.0], (3, 1)), rtol=1e-15)
    np.testing.assert_array_equal(aimed.direction, np.tile([0.0, 0.0, 1.0], (3, 1)))
    assert np.isinf(aimed.pdf).all()
    # A shadow ray ends before what the light may lie on, by what float32 does not resolve there.
    assert (aimed.gap > 2.0**-23 * 3.0).all()
    assert (aimed.gap < 1e-5).all()


def test_a_point_on_the_light_itself_is_dark():
    for kind, keys in ((kind, EXAMPLES[kind][0]) for kind in ("flash", "point", "spot")):
        aimed = aim(lights_of(kind, keys), None, tuple(keys["position"]), 1)
        assert not aimed.weight.any()


# ---- Spot


def spot_weights(degrees, **keys):
    """Intensity at angles from the axis of a spot at the origin that looks along -z, from points at distance 2."""
    lights = lights_of("spot", {"position": [0, 0, 0], "direction": [0, 0, -3], "intensity": 1, **keys})
    points = 2.0 * np.stack([np.sin(np.radians(degrees)), 0.0 * degrees, -np.cos(np.radians(degrees))], axis=1)
    return 4.0 * np.array([aim(lights, None, tuple(point), 1).weight[0, 0] for point in points])


def test_spot_falls_linearly_over_its_penumbra():
    degrees = np.array([0.0, 10.0, 19.9, 20.0, 25.0, 29.0, 29.999, 30.001, 60.0, 120.0, 180.0])
    expected = np.clip((30.0 - degrees) / 10.0, 0.0, 1.0)
    np.testing.assert_allclose(spot_weights(degrees, angle=60, penumbra=10), expected, atol=1e-12)
    np.testing.assert_allclose(spot_weights(degrees, angle=60), (degrees < 30.0) * 1.0, rtol=1e-14)


@pytest.mark.parametrize(("angle", "penumbra"), [(60.0, 0.0), (60.0, 10.0), (60.0, 30.0), (180.0, 45.0), (1.0, 0.5)])
def test_spot_is_weighted_by_its_flux(angle, penumbra):
    # Flux of unit intensity: the integral of 2 pi sin t f(t), by the midpoint rule.
    spec = LIGHTS.specs()["spot"].model_validate({"type": "spot", **SPOT, "angle": angle, "penumbra": penumbra})
    half = math.radians(angle / 2.0)
    t = half * (np.arange(200_000) + 0.5) / 200_000
    fall = np.minimum((half - t) / math.radians(penumbra), 1.0) if penumbra else np.ones_like(t)
    assert spec.solid_angle() == pytest.approx(2.0 * math.pi * (np.sin(t) * fall).sum() * half / 200_000, rel=1e-8)


def test_direction_and_look_at_are_the_same_axis():
    keys = {"position": [1, 2, 3], "intensity": 1, "angle": 40}
    one = table_of("spot", {**keys, "look_at": [0, 0, 3]})
    other = table_of("spot", {**keys, "direction": [-1e-30, -2e-30, 0]})
    np.testing.assert_allclose(one.axis, other.axis, rtol=1e-15)
    np.testing.assert_allclose(one.axis, [[-1.0 / math.sqrt(5.0), -2.0 / math.sqrt(5.0), 0.0]], rtol=1e-15)


# ---- Sun


@pytest.mark.parametrize("angle", [0.0, 1e-30, 1e-6, 0.53, 10.0, 90.0, 180.0])
def test_sun_gives_its_irradiance_at_any_angle(angle):
    # A disc wholly above the horizon gives E cos, whatever its size, since its mean direction is its middle.
    direction = np.array([0.3, -1.0, 0.2])
    toward = -direction / np.linalg.norm(direction)
    keys = {"direction": list(direction), "irradiance": [2.0, 3.0, 4.0], "angle": angle}
    aimed = aim(lights_of("sun", keys), None, POINT, 40_000)
    normal = toward if angle == 180.0 else np.array([0.0, 1.0, 0.0]) if angle < 90.0 else toward
    each = aimed.weight * np.maximum(aimed.direction @ normal, 0.0)[:, None]
    expected = np.array([2.0, 3.0, 4.0]) * (toward @ normal)
    error = np.abs(each.mean(axis=0) - expected)
    np.testing.assert_array_less(error, 4.0 * each.std(axis=0) / 200.0 + 1e-12 * expected)
    # Directions are on the disc, and the light has no end.
    chord = np.linalg.norm(aimed.direction - toward, axis=1)
    assert chord.max() <= 2.0 * math.sin(math.radians(angle / 4.0)) + 1e-15
    assert np.isneginf(aimed.gap).all()
    # Only a disc without a size is parallel light.
    assert np.isinf(aimed.pdf).all() == (angle == 0.0)
    sun = LIGHTS.specs()["sun"].model_validate({"type": "sun", **keys})
    assert sun.is_visible_to_paths() == (angle != 0.0)


def test_sun_is_drawn_evenly_over_its_disc():
    aimed = aim(lights_of("sun", {"direction": [0, 0, -1], "irradiance": 1, "angle": 120}), None, POINT, 100_000)
    # Directions within 60 degrees of +z: half the unit height of a hemisphere.
    chi2_test(cylinder(aimed.direction), lambda x: (x[:, 0] > 0.5) / math.pi, CYLINDER, [16, 24], significance=1e-3)
    np.testing.assert_allclose(aimed.pdf, 1.0 / math.pi, rtol=1e-14)


def test_the_density_of_a_disc_counts_the_choice_among_suns():
    # Of two suns 60 degrees wide the second has three times the power; each is 2 pi (1 - cos 30 degrees) sr.
    suns = [{"direction": [0, 0, z], "irradiance": power, "angle": 60} for z, power in ((-1, 1), (1, 3))]
    aimed = aim(lights_of("sun", *suns), None, POINT, 1000)
    share = np.where(aimed.direction[:, 2] > 0.0, 0.25, 0.75)
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(math.radians(30.0)))
    np.testing.assert_allclose(aimed.pdf, share / solid_angle, rtol=1e-12)


def test_rays_that_leave_the_scene_see_the_disc():
    keys = {"direction": [0.0, -1.0, 0.0], "irradiance": [1.0, 2.0, 0.0], "angle": 2.0}
    lights = lights_of("sun", keys)
    degrees = np.array([0.0, 0.5, 0.999, 1.001, 5.0, 180.0])
    toward = np.stack([np.sin(np.radians(degrees)), np.cos(np.radians(degrees)), 0.0 * degrees], axis=1)
    radiance = escaped(lights, toward, math.inf)
    # E = pi L sin^2, seen by a camera ray as it is.
    bright = 1.0 / (math.pi * math.sin(math.radians(1.0)) ** 2)
    np.testing.assert_allclose(radiance, np.outer(degrees < 1.0, [bright, 2.0 * bright, 0.0]), rtol=1e-12)
    # Parallel light has no disc.
    assert not escaped(lights_of("sun", {**keys, "angle": 0.0}), toward, math.inf).any()


def test_both_ways_to_a_disc_share_it():
    # Weights of the two strategies, each the square of its density over the sum of squares, add up to 1.
    lights = lights_of("sun", {"direction": [0.0, -1.0, 0.0], "irradiance": 1.0, "angle": 20.0})
    aimed = aim(lights, None, POINT, 1)
    seen = escaped(lights, np.array([[0.0, 1.0, 0.0]]), math.inf)
    for pdf in (0.01, 1.0, float(aimed.pdf[0]), 50.0):
        shared = escaped(lights, np.array([[0.0, 1.0, 0.0]]), pdf)
        by_light = power_heuristic(float(aimed.pdf[0]), pdf)
        assert shared[0, 0] / seen[0, 0] + by_light == pytest.approx(1.0, rel=1e-14)


# ---- In a scene

CAMERA = "camera: {type: pinhole, look_from: [0, 3, 0], look_at: [0, 0, 0], up: [0, 0, 1], vfov: 2}\n"
FLOOR = """
materials: {grey: {type: lambertian, albedo: 0.5}, black: {type: lambertian, albedo: 0}}
objects:
  - {type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 4, material: grey}
  - {type: sphere, center: [0, -99, 0], radius: 1.0e-9, material: grey}
  - {type: quad, corner: [0, -98, 0], edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]], material: grey}
"""

# One light a channel, so that one picture shows them all.
THREE = """
lights:
  - {type: point, position: [3, 4, 0], intensity: [100, 0, 0]}
  - {type: spot, position: [0, 2, 2], look_at: [0, 0, 0], intensity: [0, 40, 0], angle: 60, penumbra: 5}
  - {type: sun, direction: [1, -2, 0], irradiance: [0, 0, 6], angle: 3}
"""


def test_floor_is_lit_as_formulas_say():
    # Radiance albedo E / pi.  Point: I cos / d^2, at distance 5 with cosine 4/5.  Spot: on the axis, at distance
    # sqrt 8 and 45 degrees.  Sun: E cos with cosine 2 / sqrt 5.
    picture = image(CAMERA + THREE + FLOOR, filled=False, spp=256, max_depth=2)
    irradiance = np.array([100.0 * 0.8 / 25.0, 40.0 * math.sqrt(0.5) / 8.0, 6.0 * 2.0 / math.sqrt(5.0)])
    value = picture.radiance.mean(axis=(0, 1))
    deviation = np.sqrt(picture.variance.sum(axis=(0, 1))) / 256
    expected = 0.5 * irradiance / math.pi
    # The patch that the camera sees is not a point: a few parts in 10,000.
    np.testing.assert_array_less(np.abs(value - expected), 4.0 * deviation + 1e-3 * expected)
    assert (deviation < 0.01 * expected).all()


def test_what_stands_before_a_light_shadows_it():
    # A ball on the way of each, off the camera's way.
    balls = "".join(
        f"  - {{type: sphere, center: [{x}, {y}, {z}], radius: 0.2, material: black}}\n"
        for x, y, z in ([1.5, 2.0, 0.0], [0.0, 1.0, 1.0], [-1.0, 2.0, 0.0])
    )
    picture = image(CAMERA + THREE + FLOOR + balls, filled=False, spp=16, max_depth=2)
    assert not picture.radiance.any()


def test_nothing_stops_light_behind_a_point():
    # The wall is behind the point light: a shadow ray ends at it.
    wall = "  - {type: quad, corner: [6, -9, -9], edges: [[0, 18, 0], [0, 0, 18]], material: black}\n"
    picture = image(CAMERA + THREE + FLOOR + wall, filled=False, spp=16, max_depth=2)
    assert picture.radiance[..., 0].mean() == pytest.approx(0.5 * 3.2 / math.pi, rel=0.05)


def test_only_what_a_ray_may_find_is_packed_for_mirrors():
    mirror = "objects:\n  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal, fuzz: 0}}\n"
    lights = pack(scene(CAMERA + THREE + mirror, filled=False)).scene.lights
    assert [type(table).__name__ for table in lights.tables] == ["Suns"]
    parallel = THREE.replace("angle: 3}", "angle: 0}")
    assert pack(scene(CAMERA + parallel + mirror, filled=False)).scene.lights is None
    assert len(pack(scene(CAMERA + parallel + FLOOR, filled=False)).scene.lights.tables) == 3
    # At depth 1 the camera sees the disc and nothing is lit.
    lights = pack(scene(CAMERA + THREE + FLOOR, filled=False, max_depth=1)).scene.lights
    assert [type(table).__name__ for table in lights.tables] == ["Suns"]


def test_the_camera_sees_the_sun_in_the_sky():
    # Towards the sun with a view of 8 degrees: a disc of 4 degrees, pi / 16 of the picture (by tangents).
    camera = "camera: {type: pinhole, look_from: [0, 9, 0], look_at: [-1, 11, 0], vfov: 8}\n"
    picture = image(camera + THREE.replace("angle: 3}", "angle: 4}") + FLOOR, filled=False, spp=64)
    share = math.pi * (math.tan(math.radians(2.0)) / (2.0 * math.tan(math.radians(4.0)))) ** 2
    bright = 6.0 / (math.pi * math.sin(math.radians(2.0)) ** 2)
    assert picture.radiance[..., 2].mean() == pytest.approx(share * bright, rel=0.01)
    assert picture.radiance[8, 8, 2] == pytest.approx(bright, rel=1e-9)
    assert not picture.radiance[..., :2].any()


def test_explanation_says_what_is_aimed_at():
    def effects(lights, background=""):
        return explain(scene(CAMERA + background + lights + FLOOR, filled=False)).effects

    three = effects(THREE, "environment: {type: sky}\n")
    lights = "1 point light, 1 spot light, 1 sun light, the environment"
    assert three["light_sampling"].why == f"next-event estimation samples {lights}"
    assert three["environment_sampling"].active
    assert {kind for kind in EXAMPLES if three[f"light.{kind}"].active} == {"point", "spot", "sun"}
    assert three["light.sun"].why == "1 light of 3"

    dark = effects("lights: [{type: point, position: [0, 1, 0], intensity: 0}]\n", "environment: {type: gradient}\n")
    assert not dark["light_sampling"].active
    assert not dark["light.point"].active
    assert "black" in dark["light.point"].why
    assert dark["light.sun"].why == "0 lights of 1"
    assert not dark["environment_sampling"].active
    assert "smooth" in dark["environment_sampling"].why
