"""The light tree: its probabilities, and what it is worth."""

import math

import numpy as np
import pytest

from raytracer.core.sampling.alias import AliasTable
from raytracer.plugins.lights.base.light_choice import choose_light, count_lights, light_probability, translate_choice
from raytracer.plugins.lights.base.light_tree import LightTree, build_choice
from raytracer.scene.pack.scene import pack
from tests.plugins.lights.kernels import aim
from tests.small_scenes import scene
from tests.vectorised import rows, vectorised

POINTS = ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (-3.0, 40.0, 2.0), (1e6, -2e7, 3.0))


def random_lights(count, seed=1):
    rng = np.random.default_rng(seed)
    lower = rng.random((count, 3))
    return 10.0 ** rng.uniform(-3.0, 3.0, count), (lower, lower + 0.1 * rng.random((count, 3)))


def probabilities(tree, points, lights):
    """Probabilities (points, lights)."""
    at, row = np.repeat(points, lights, axis=0), np.tile(np.arange(lights), len(points))
    return vectorised(light_probability)(tree, rows(np.array(at, np.float64)), rows(row)).reshape(-1, lights)


@pytest.mark.parametrize("count", [2, 3, 8, 9, 100])
def test_probabilities_add_up_to_one(count):
    tree = build_choice(*random_lights(count))
    assert isinstance(tree, LightTree)
    assert count_lights(tree) == count
    np.testing.assert_allclose(probabilities(tree, POINTS, count).sum(axis=1), 1.0, rtol=1e-12)


def test_lights_are_chosen_as_often_as_the_probability_says():
    count, bins = 5, 40_000
    tree = build_choice(*random_lights(count))
    for point, expected in zip(POINTS, probabilities(tree, POINTS, count), strict=True):
        # Numbers in order fall into intervals as long as the probabilities, so no chance is involved.
        chosen, probability, rest = vectorised(choose_light)(tree, point, rows((np.arange(bins) + 0.5) / bins))
        share = np.bincount(chosen, minlength=count) / bins
        np.testing.assert_allclose(share, expected, atol=count / bins)
        np.testing.assert_allclose(probability, expected[chosen], rtol=1e-12)
        # What is left of the number is even again.
        assert ((rest >= 0.0) & (rest < 1.0)).all()
        assert rest[chosen == np.argmax(share)].mean() == pytest.approx(0.5, abs=1e-3)


def test_two_equal_lights_are_chosen_by_the_square_of_distance():
    places = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    tree = build_choice(np.array([1.0, 1.0]), (places, places))
    # At distances 1 and 2, 1 : 1/4.
    assert light_probability(tree, (1.0, 0.0, 0.0), 0) == pytest.approx(0.8, rel=1e-12)
    # A light at the point itself lights nothing there.
    assert light_probability(tree, (0.0, 0.0, 0.0), 0) == 0.0
    assert choose_light(tree, (0.0, 0.0, 0.0), 0.3)[:2] == (1, 1.0)


def test_a_node_stands_in_the_middle_of_all_its_lights():
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [10.0, 0.0, 0.0], [11.0, 0.0, 0.0]])
    tree = build_choice(np.ones(4), (places, places))
    # From x = 4 the pairs are 3.5 and 6.5 m away, and those of the first 4 and 3 m.
    near, first = 6.5**2 / (3.5**2 + 6.5**2), 3.0**2 / (3.0**2 + 4.0**2)
    assert light_probability(tree, (4.0, 0.0, 0.0), 0) == pytest.approx(near * first, rel=1e-12)


def test_within_its_bounds_a_light_is_as_at_their_rim():
    lower = np.array([[-1.0, -1.0, -1.0], [9.0, -1.0, -1.0]])
    tree = build_choice(np.array([1.0, 1.0]), (lower, lower + 2.0))
    # A squared radius of 3, and 10 m to the other's middle.
    assert light_probability(tree, (0.0, 0.0, 0.0), 0) == pytest.approx((1.0 / 3.0) / (1.0 / 3.0 + 0.01), rel=1e-12)


def test_black_lights_are_never_chosen():
    powers, boxes = random_lights(4)
    powers[[0, 2]] = 0.0
    tree = build_choice(powers, boxes)
    assert {choose_light(tree, POINTS[0], u)[0] for u in np.linspace(0.0, 0.999, 100)} == {1, 3}


def test_a_single_light_needs_no_tree():
    powers, boxes = random_lights(1)
    choice = build_choice(powers, boxes)
    assert isinstance(choice, AliasTable)
    assert choose_light(choice, POINTS[0], 0.3) == (0, 1.0, 0.3)
    assert isinstance(build_choice(np.ones(3), None), AliasTable)


def test_lights_at_one_place_are_chosen_by_power():
    places = np.tile([1.0, 2.0, 3.0], (3, 1))
    tree = build_choice(np.array([1.0, 2.0, 5.0]), (places, places))
    assert [light_probability(tree, (0.0, 0.0, 0.0), row) for row in range(3)] == pytest.approx([0.125, 0.25, 0.625])


def test_a_tree_moves_with_the_world():
    powers, (lower, upper) = random_lights(6)
    by = (100.0, -20.0, 3.0)
    built = build_choice(powers, (lower, upper))
    moved = translate_choice(built, by)
    for x, y, z in POINTS[:3]:
        there = (x + by[0], y + by[1], z + by[2])
        expected = [light_probability(built, (x, y, z), row) for row in range(6)]
        assert [light_probability(moved, there, row) for row in range(6)] == pytest.approx(expected, rel=1e-10)


ROW_OF_LAMPS = """
camera: {type: pinhole, look_from: [0, 9, 0], look_at: [0, 0, 0], up: [0, 0, 1], vfov: 60}
materials: {grey: {type: lambertian, albedo: 0.5}, lamp: {type: emitter, radiance: 1}}
objects:
  - {type: quad, corner: [-6, 0, 6], edges: [[12, 0, 0], [0, 0, -12]], material: grey}
""" + "".join(
    f"  - {{type: quad, corner: [{x}, 0.3, {z}], edges: [[0.2, 0, 0], [0, 0, 0.2]], material: lamp}}\n"
    for x in range(-5, 6, 2)
    for z in range(-5, 6, 2)
)


def test_many_lamps_light_a_point_as_if_chosen_by_power(monkeypatch):
    spec = scene(ROW_OF_LAMPS)
    by_tree = pack(spec).scene
    monkeypatch.setattr("raytracer.scene.pack.lights.boxes", lambda *_: None)
    means, deviations = [], []
    for packed in (by_tree, pack(spec).scene):
        light = aim(packed.lights, packed, (0.7, 0.0, -1.2), 100_000)
        irradiance = light.weight[:, 0] * light.direction[:, 1]
        means.append(irradiance.mean())
        deviations.append(irradiance.std() / math.sqrt(100_000))
    assert abs(means[0] - means[1]) < 4.0 * math.hypot(*deviations)
    assert deviations[0] < 0.02 * means[0]
    # With 36 lamps just over the floor, most of the light at a point is that of the nearest.
    assert deviations[0] < 0.75 * deviations[1]
