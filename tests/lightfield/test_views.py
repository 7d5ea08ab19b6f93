"""Views, slices and paths among views."""

import dataclasses

import numpy as np
import pytest

from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.epipolar import draw_slice, epipolar_slice
from raytracer.lightfield.splines import Spline
from raytracer.lightfield.views.camera_paths import PATHS, look_around, path_places
from raytracer.lightfield.views.contact_sheet import montage
from raytracer.lightfield.views.synthesis import reproject_depth, view_at, view_weights
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, away, light_field, seen, views, waves

SURFACES = [Surface(3.0, waves(0, 0.1)), Surface(1.7, waves(2, 0.06), bounds=(-0.2, -0.2, 0.15, 0.2))]
GEOMETRY = views(5, 5, spacing=0.03, width=72, height=60)


@pytest.fixture(scope="module")
def field():
    return light_field(GEOMETRY, SURFACES)


def test_moved_as_a_whole_is_moved_pixel_by_pixel():
    image = np.random.default_rng(0).random((20, 30, 3))
    spline = Spline(image)
    for right, down in [(0.0, 0.0), (1.3, -2.75), (-5.25, 3.5), (40.0, 1.0)]:
        moved, (rows, columns) = spline.shifted(right, down)
        y, x = np.indices((20, 30)).astype(float)
        assert moved == pytest.approx(spline.at(y + down, x + right)[0], abs=1e-12)
        inside = (y + down >= 0) & (y + down <= 19) & (x + right >= 0) & (x + right <= 29)
        marked = np.zeros((20, 30), dtype=bool)
        marked[rows, columns] = True
        assert np.array_equal(marked, inside)
    assert np.allclose(spline.shifted(0.0, 0.0)[0], image, rtol=0.0, atol=1e-12)


@pytest.fixture(scope="module")
def wall():
    return light_field(GEOMETRY, SURFACES[:1])


def test_a_view_where_one_is(field):
    for row, column in [(0, 0), (2, 2), (4, 1)]:
        right, up = GEOMETRY.position[row, column]
        assert np.array_equal(view_at(field, right, up), field.view(row, column))


def test_a_view_between_others_with_and_without_depth(field, wall):
    """Against the view from there: blended at one distance things of others are doubled, by depth they are not."""
    place = 0.014, 0.017
    exact = seen(GEOMETRY, SURFACES, place)[0]
    depth = Depth(1.0 / field.layers["depth"][2, 2], np.ones((60, 72)), 2, 2)
    by_depth = away(view_at(field, *place, depth=depth), exact)
    plain = away(view_at(field, *place), exact)
    nearest = away(field.view(*GEOMETRY.nearest(*place)), exact)
    assert by_depth < 0.025
    assert by_depth < plain < nearest
    assert away(view_at(wall, *place, distance=3.0), seen(GEOMETRY, SURFACES[:1], place)[0]) < 0.02


def test_what_is_hidden_in_a_view_is_not_taken_from_it():
    """Of views 0.1 m apart; with the nearer thing for the hidden one the error would be 0.06."""
    apart = views(3, 3, spacing=0.1, width=72, height=60)
    field = light_field(apart, SURFACES)
    depth = Depth(1.0 / field.layers["depth"][1, 1], np.ones((60, 72)), 1, 1)
    place = 0.045, 0.05
    assert away(view_at(field, *place, depth=depth), seen(apart, SURFACES, place)[0]) < 0.04


def test_depth_carried_to_another_place(field):
    depth = Depth(1.0 / field.layers["depth"][2, 2], np.ones((60, 72)), 2, 2)
    there = reproject_depth(depth, GEOMETRY, GEOMETRY.position[2, 4])
    wrong = np.abs(1.0 / there - field.layers["depth"][2, 4]) > 0.01
    assert wrong.mean() < 0.03


def test_places_that_are_no_grid():
    random = np.random.default_rng(3)
    position = GEOMETRY.position + random.uniform(-0.005, 0.005, GEOMETRY.position.shape)
    scattered = dataclasses.replace(GEOMETRY, position=position)
    around = view_weights(scattered, 0.011, -0.02)
    assert len(around) == 3
    assert sum(s.weight for s in around) == pytest.approx(1.0, abs=1e-12)
    middle = sum(s.weight * position[s.row, s.column] for s in around)
    assert middle == pytest.approx([0.011, -0.02], abs=1e-12)


def test_the_montage_has_each_view_in_its_place(field):
    whole = montage(field, gap=2)
    assert whole.shape == (5 * 62 - 2, 5 * 74 - 2, 3)
    assert np.array_equal(whole[62 * 3 : 62 * 3 + 60, 74 : 74 + 72], field.view(3, 1))
    small = montage(field, width=200)
    assert small.shape[1] <= 200
    assert small[:30, :36] == pytest.approx(field.view(0, 0).reshape(30, 2, 36, 2, 3).mean(axis=(1, 3)), abs=1e-12)
    with pytest.raises(InputError, match="no room"):
        montage(field, width=10)


@pytest.mark.parametrize("direction", ["horizontal", "vertical"])
def test_slices_stand_upright_at_their_distance(wall, direction):
    """What is 3 m away is the same in all lines of a slice sheared to 3 m, and lines are those of the views."""
    plain = epipolar_slice(wall, direction=direction, line=20)
    line = wall.view(2, 1)[20] if direction == "horizontal" else wall.view(1, 2)[:, 20]
    assert np.array_equal(plain.radiance[1], line)
    upright = epipolar_slice(wall, direction=direction, line=20, inverse_distance=1.0 / 3.0)
    spread = [np.ptp(found.radiance[:, 8:-8], axis=0).mean() for found in (upright, plain)]
    assert spread[0] < 0.1 * spread[1]
    assert draw_slice(plain).ndim == 3


def test_a_slope_is_a_distance():
    right, _ = GEOMETRY.shift(1.0 / 3.0)[2, 4]
    # From x - u (w - w0): -slope is (w - w0) over a pixel's edge.
    assert GEOMETRY.inverse_focus - right / 0.06 * GEOMETRY.plane.pixel == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize("path", PATHS)
def test_paths_stay_within_the_views(path):
    places = path_places(GEOMETRY, path, frames=16)
    assert np.abs(places).max() == pytest.approx(0.06)
    assert np.hypot(*(places[0] - places[-1])) < 0.06
    with pytest.raises(InputError, match="does not fit"):
        path_places(GEOMETRY, path, radius=0.061)


def test_near_things_move_against_far_ones(field):
    left, right = look_around(field, [(-0.06, 0.0), (0.06, 0.0)])
    assert np.array_equal(left, field.view(2, 0))
    assert np.array_equal(right, field.view(2, 4))
