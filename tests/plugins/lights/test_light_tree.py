"""The light tree: its probabilities, and what it is worth."""

import math

import numpy as np
import pytest

from raytracer.core.sampling.alias import AliasTable
from raytracer.plugins.lights.base.light_choice import choose_light, count_lights, light_probability, translate_choice
from raytracer.plugins.lights.base.light_tree import LightTree, build_choice
from tests.small_scenes import image, mean

POINTS = ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (-3.0, 40.0, 2.0), (1e6, -2e7, 3.0))


def random_lights(count, seed=1):
    rng = np.random.default_rng(seed)
    lower = rng.random((count, 3))
    return 10.0 ** rng.uniform(-3.0, 3.0, count), (lower, lower + 0.1 * rng.random((count, 3)))


@pytest.mark.parametrize("count", [2, 3, 8, 9, 100])
def test_probabilities_add_up_to_one(count):
    tree = build_choice(*random_lights(count))
    assert isinstance(tree, LightTree)
    assert count_lights(tree) == count
    for point in POINTS:
        assert math.fsum(light_probability(tree, point, row) for row in range(count)) == pytest.approx(1.0, rel=1e-12)


def test_lights_are_chosen_as_often_as_the_probability_says():
    count, bins = 5, 40_000
    tree = build_choice(*random_lights(count))
    for point in POINTS:
        # Numbers in order fall into intervals as long as the probabilities, so no chance is involved.
        chosen = [choose_light(tree, point, (index + 0.5) / bins) for index in range(bins)]
        share = np.bincount([row for row, _, _ in chosen], minlength=count) / bins
        expected = [light_probability(tree, point, row) for row in range(count)]
        np.testing.assert_allclose(share, expected, atol=count / bins)
        for row, probability, rest in chosen:
            assert probability == pytest.approx(expected[row], rel=1e-12)
            assert 0.0 <= rest < 1.0
        # What is left of the number is even again.
        assert np.mean([rest for row, _, rest in chosen if row == np.argmax(share)]) == pytest.approx(0.5, abs=1e-3)


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


def test_many_lamps_light_a_floor_as_if_chosen_by_power(monkeypatch):
    by_tree = mean(image(ROW_OF_LAMPS, spp=64, max_depth=2))
    monkeypatch.setattr("raytracer.scene.pack.lights.boxes", lambda *_: None)
    by_power = mean(image(ROW_OF_LAMPS, spp=64, max_depth=2, seed=2))
    np.testing.assert_array_less(np.abs(by_tree[0] - by_power[0]), 4.0 * np.hypot(by_tree[1], by_power[1]))
    # With 36 lamps just over it, most of the light at a point is that of the nearest.
    np.testing.assert_array_less(by_tree[1], 0.75 * by_power[1])
