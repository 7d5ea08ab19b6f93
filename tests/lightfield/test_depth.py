"""Depth from focus and from slopes, against distances that are known."""

import math

import numpy as np
import pytest

from raytracer.lightfield.depth.depth_map import METHODS, Depth, depth_map
from raytracer.lightfield.super_resolution import all_in_focus, supersampled, upsample_cubic
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, away, light_field, seen, views, waves

SURE = 0.5


def share(found, exact):
    """RMSE where the confidence is large, as a share of the range of distances; and how much of the picture that is."""
    sure = found.confidence >= SURE
    error = (found.distance - exact)[sure]
    return float(np.sqrt((error**2).mean()) / np.ptp(exact)), float(sure.mean())


@pytest.fixture(scope="module")
def leaning():
    """One plane that leans away, 1.6 to 3.3 m, seen by 7 x 7 views with noise."""
    return light_field(
        views(7, 7, spacing=0.03, width=72, height=60),
        [Surface(2.2, waves(1, 0.05), tilt=(0.6, 0.5))],
        noise=0.01,
        supersampling=1,
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_leaning_plane(leaning, method):
    found = depth_map(leaning, method=method, threads=2)
    error, part = share(found, leaning.layers["depth"][3, 3])
    assert error < 0.02
    assert part > 0.8


def test_what_is_in_front(leaning):
    """A square before a wall: its own distance and the wall's, up to its edges."""
    surfaces = [Surface(3.0, waves(0, 0.06)), Surface(1.6, waves(2, 0.04), bounds=(-0.2, -0.15, 0.15, 0.2))]
    field = light_field(views(7, 7, spacing=0.03, width=72, height=54), surfaces, noise=0.01, supersampling=2)
    found = depth_map(field, threads=2)
    exact = field.layers["depth"][3, 3]
    error, part = share(found, exact)
    assert error < 0.02
    assert part > 0.7
    assert np.median(found.distance[exact < 2.0]) == pytest.approx(1.6, rel=0.003)


@pytest.mark.parametrize("method", ["focus", "slopes"])
def test_without_texture_nothing_is_sure(method):
    flat = light_field(
        views(5, 5, width=32, height=24), [Surface(2.0, lambda x, y: np.full((*x.shape, 3), 0.5))], noise=0.01
    )
    assert np.quantile(depth_map(flat, method=method, threads=1).confidence, 0.9) < SURE


def test_same_bits_by_any_number_of_threads(leaning):
    one, three = (depth_map(leaning, threads=threads, near=1.4, far=4.0) for threads in (1, 3))
    assert np.array_equal(one.inverse, three.inverse)
    assert np.array_equal(one.confidence, three.confidence)


def test_sharp_everywhere_and_finer_than_any_view():
    """Against the views without noise, and against a view rendered with smaller pixels."""
    surfaces = [Surface(2.2, waves(1, 0.06), tilt=(0.3, 0.2))]
    geometry = views(5, 5, spacing=0.0345, width=60, height=50)
    field = light_field(geometry, surfaces, noise=0.02, supersampling=2)
    row, column = geometry.nearest()
    exact = seen(geometry, surfaces, (0.0, 0.0), 2)[0]
    found = depth_map(field, threads=2)

    def sharpness(picture):
        return float((np.diff(picture, axis=0) ** 2).mean() + (np.diff(picture, axis=1) ** 2).mean())

    sharp = all_in_focus(field, found)
    assert sharpness(sharp) > 0.95 * sharpness(exact)
    assert away(sharp, exact) < 0.7 * away(field.view(row, column), exact)

    fine = seen(views(width=120, height=100), surfaces, (0.0, 0.0), 1)[0]
    assert away(supersampled(field, 2, found), fine) < 0.8 * away(upsample_cubic(field.view(row, column), 2), fine)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"method": "guess"}, "no method guess"),
        ({"row": 7}, "no view 7,3"),
        ({"near": 3.0, "far": 2.0}, "near must be less than far"),
        ({"near": -1.0}, "near must be a distance greater than 0"),
    ],
)
def test_wrong_wishes(leaning, wrong, told):
    with pytest.raises(InputError, match=told):
        depth_map(leaning, **wrong)


def test_infinity():
    found = Depth(np.array([[0.0, 0.5, -0.1]]), np.ones((1, 3)), 0, 0)
    assert found.distance.tolist() == [[math.inf, 2.0, math.inf]]
