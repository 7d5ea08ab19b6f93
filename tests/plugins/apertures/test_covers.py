"""Apertures as the stop of a real lens: what they let through is where they draw their points."""

import math

import numpy as np
import pytest

from raytracer.optics.lens_system.surfaces import aperture_extent
from tests.plugins.apertures.kernels import covered, sampled
from tests.plugins.apertures.test_apertures import CASES, COUNT, LETTER, POLYGONS, is_inside, packed, uniform

SHAPES = [*CASES, pytest.param({"type": "round"}, id="disc")]


def grid(half, count=900):
    """Points (count^2, 2), one in each of the squares that a square of this half width is cut into."""
    corners = np.indices((count, count)).reshape(2, -1).T
    return half * (2.0 * (corners + uniform(count * count, seed=4)) / count - 1.0)


@pytest.mark.parametrize("keys", SHAPES)
def test_as_much_light_gets_through_as_through_the_disc(keys):
    shape = packed(**keys)
    half = 1.01 * aperture_extent(shape)
    passed = covered(shape, grid(half))
    assert passed.min() == 0.0
    assert passed.max() <= 1.0
    assert 4.0 * half * half * passed.mean() == pytest.approx(math.pi, rel=5e-4)


@pytest.mark.parametrize("keys", SHAPES)
def test_what_is_drawn_is_let_through_and_within_reach(keys):
    shape = packed(**keys)
    points = sampled(shape, uniform(20_000))
    assert covered(shape, points * (1.0 - 1e-12)).min() > 0.0
    assert np.hypot(*points.T).max() <= aperture_extent(shape) * (1.0 + 1e-15)


@pytest.mark.parametrize("keys", SHAPES)
def test_out_of_reach_all_is_dark(keys):
    shape = packed(**keys)
    angle = np.linspace(0.0, 2.0 * math.pi, 1000)
    for factor in (1.0 + 1e-12, 3.0, 1e9, math.inf):
        with np.errstate(invalid="ignore"):
            circle = factor * aperture_extent(shape) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        np.testing.assert_array_equal(covered(shape, circle), 0.0)
    np.testing.assert_array_equal(covered(shape, [[math.nan, 0.0], [0.0, math.nan]]), 0.0)


@pytest.mark.parametrize("keys", POLYGONS)
def test_polygon_lets_through_what_is_on_the_near_side_of_all_edges(keys):
    points = 4.0 * uniform(COUNT, seed=5) - 2.0
    np.testing.assert_array_equal(covered(packed(type="polygon", **keys), points) == 1.0, is_inside(keys, points))


@pytest.mark.parametrize("curvature", [1e-30, 1e-15, 1e-9])
def test_hardly_curved_edges_are_straight(curvature):
    points = 4.0 * uniform(seed=6) - 2.0
    straight, slight = (covered(packed(type="polygon", blades=5, curvature=bend), points) for bend in (0.0, curvature))
    np.testing.assert_array_equal(slight, straight)


@pytest.mark.parametrize("stretch", [1.0, 2.0])
def test_mask_lets_through_what_its_pixels_do(stretch):
    # The letter upright: five rows of three pixels, each as wide as makes their sum pi, its brightest all clear.
    side = math.sqrt(math.pi / LETTER.sum())
    rows, columns = np.indices(LETTER.shape)
    x, y = side * (columns - 1.0) / math.sqrt(stretch), side * (2.0 - rows) * math.sqrt(stretch)
    for shift in (-0.49, 0.0, 0.49):
        at = np.stack([x + shift * side / math.sqrt(stretch), y + shift * side * math.sqrt(stretch)], axis=-1)
        result = covered(packed(type="image", file="x", anamorphic=stretch), at.reshape(-1, 2))
        # The picture is float32.
        np.testing.assert_allclose(result.reshape(LETTER.shape), LETTER, rtol=0.0, atol=1e-7)
