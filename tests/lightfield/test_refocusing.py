"""Refocusing, by formulas: planes that are sharp, openings, borders, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.focusing import alpha_to_inverse_distance, refocusable, slope_to_inverse_distance
from raytracer.lightfield.refocusing.fourier import FourierRefocuser
from raytracer.lightfield.refocusing.refocus import focal_stack, refocus
from raytracer.lightfield.refocusing.shift_and_sum import INTERPOLATIONS, interpolation_taps, make_shift
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.plugins.apertures.polygon import PolygonAperture
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, away, light_field, views, waves

WALL = waves(1, 0.1)


@pytest.fixture(scope="module")
def wall():
    """A textured wall at 1.6 m, where views converge at 2 m."""
    return light_field(views(7, 7, spacing=0.05, width=64, height=48), [Surface(1.6, WALL)], supersampling=2)


@pytest.fixture(scope="module")
def floor():
    """A wall that leans away at its top by 40 degrees, and to the right by 20."""
    tilt = math.tan(math.radians(20.0)), math.tan(math.radians(40.0))
    return light_field(views(7, 7, spacing=0.05, width=64, height=48), [Surface(1.6, WALL, tilt)], supersampling=2)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_a_wall_in_focus_is_what_the_middle_sees(wall, interpolation):
    # What a pinhole sees of it, however far the views are apart: that is what sharp means.
    found = refocus(wall, 1.6, interpolation=interpolation).radiance
    assert away(found, wall.view(3, 3), 8) < {"linear": 0.03, "cubic": 0.01, "lanczos": 0.005}[interpolation]
    assert away(refocus(wall, 2.0).radiance, wall.view(3, 3), 8) > 0.05


def test_the_default_is_the_plane_where_views_converge(wall):
    found = refocus(wall)
    np.testing.assert_allclose(found.radiance, np.asarray(wall.radiance).mean(axis=(0, 1)), rtol=1e-12)
    assert found.settings["refocused_m"] == pytest.approx(2.0)


def test_a_tilted_plane_is_sharp_all_over(floor):
    found = refocus(floor, 1.6, tilt=40.0, swing=20.0).radiance
    assert away(found, floor.view(3, 3), 8) < 0.005
    # Neither is it so for a plane that faces the views, nor for one that leans the other way.
    assert away(refocus(floor, 1.6).radiance, floor.view(3, 3), 8) > 0.03
    assert away(refocus(floor, 1.6, tilt=-40.0, swing=-20.0).radiance, floor.view(3, 3), 8) > 0.05


def test_a_plane_that_hardly_leans_is_one_that_faces_the_views(wall):
    leaning = refocus(wall, 1.6, tilt=1e-9, interpolation="linear").radiance
    np.testing.assert_allclose(leaning, refocus(wall, 1.6, interpolation="linear").radiance, atol=1e-8)


def test_alpha_is_the_film_s_distance_over_what_it_was():
    # 50 mm focused at 2 m has its film at 51.282 mm; moved to 52.632 mm it is focused at 1 m.
    lens = replace(views(3, 3), focal_length=50.0, aperture=0.025)
    assert alpha_to_inverse_distance(lens, (1 / (1 / 50 - 1 / 1000)) / (1 / (1 / 50 - 1 / 2000))) == pytest.approx(1.0)
    assert alpha_to_inverse_distance(lens, 1.0) == pytest.approx(0.5)
    # Of an array the plane itself is moved.
    assert alpha_to_inverse_distance(views(3, 3), 1.5) == pytest.approx(1.0 / 3.0)
    with pytest.raises(ValueError, match=r"beyond infinity: the least is 0\.975"):
        alpha_to_inverse_distance(lens, 0.9)


def test_a_slope_is_counted_from_view_to_view(wall):
    # The wall moves by spacing (w - w0) / pixel from a view to the next.
    slope = 0.05 * (1 / 1.6 - 1 / 2.0) / wall.views.plane.pixel
    assert slope_to_inverse_distance(wall.views, slope) == pytest.approx(1 / 1.6)
    np.testing.assert_allclose(refocus(wall, slope=slope).radiance, refocus(wall, 1.6).radiance, atol=1e-9)


def test_the_range_is_where_neighbours_differ_by_a_pixel():
    geometry = views(3, 5, vfov=10.0)
    near, far = refocusable(geometry)
    for distance in (near, far):
        shift = geometry.shift(1.0 / distance)
        assert abs(shift[0, 1, 0] - shift[0, 0, 0]) == pytest.approx(1.0)
    assert refocusable(replace(geometry, inverse_focus=0.0))[1] == math.inf


def test_a_stack_is_its_planes(wall):
    distances = [1.2, 1.6, math.inf]
    stack = focal_stack(wall, distances)
    for distance, image in zip(distances, stack, strict=True):
        np.testing.assert_allclose(image.radiance, refocus(wall, distance).radiance, rtol=1e-12)


@pytest.mark.parametrize("method", ["shift", "fourier"])
def test_a_crop_is_a_part_of_the_picture(wall, method):
    whole = refocus(wall, 1.3, method=method).radiance
    part = refocus(wall, 1.3, method=method, crop=(5, 20, 40, 48)).radiance
    np.testing.assert_allclose(part, whole[20:48, 5:40], rtol=1e-12)
    leaning = refocus(wall, 1.3, tilt=30.0).radiance
    np.testing.assert_allclose(refocus(wall, 1.3, tilt=30.0, crop=(5, 20, 40, 48)).radiance, leaning[20:48, 5:40])


def test_at_borders_it_is_the_mean_of_the_views_that_see_there():
    # Views that are as bright as their number squared: the mean over those which see a pixel, computed one by one.
    geometry = views(1, 5, spacing=0.05, width=20, height=4, vfov=3.0)
    shades = np.broadcast_to(np.arange(5.0)[None, :, None, None, None] ** 2, (1, 5, 4, 20, 3))
    found = refocus(LightField(shades, geometry), 1.0, interpolation="linear").radiance
    moved = geometry.shift(1.0)[0, :, 0]
    for column in range(20):
        seeing = [number**2 for number in range(5) if -0.5 <= column + moved[number] <= 19.5]
        np.testing.assert_allclose(found[:, column], np.mean(seeing))
    assert len({float(value) for value in found[0, :, 0]}) > 2


@pytest.mark.parametrize("options", [{}, {"tilt": 30.0}, {"method": "fourier"}, {"f_number": 8.0}])
def test_an_even_scene_stays_even(options):
    lens = replace(views(5, 5, width=24, height=16), cell=(0.01, 0.01), aperture=0.05, focal_length=100.0)
    field = LightField(np.full((5, 5, 16, 24, 3), 0.7), lens)
    np.testing.assert_allclose(refocus(field, 1.4, **options).radiance, 0.7, rtol=1e-3)


@pytest.mark.parametrize(("interpolation", "degree"), [("linear", 1), ("cubic", 2)])
def test_polynomials_are_moved_exactly(interpolation, degree):
    places = np.arange(40.0)
    for shift in (0.3, -2.75, 4.0):
        move = make_shift(shift, 10, 30, 40, interpolation)
        moved = move.apply((places**degree)[move.low : move.high], move.low, 0)
        np.testing.assert_allclose(moved, (places[10:30] + shift) ** degree, rtol=1e-12)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_whole_pixels_are_moved_as_they_are(interpolation):
    # And so nearly that they hardly move.
    assert interpolation_taps(interpolation, 0.0)[0].tolist() == [1.0]
    weights, first = interpolation_taps(interpolation, 1e-9)
    np.testing.assert_allclose(weights, np.arange(first, first + len(weights)) == 0, atol=1e-8)


def test_cells_are_weighted_by_what_of_them_is_covered():
    geometry = replace(views(15, 15, spacing=0.004), cell=(0.004, 0.004), aperture=0.06)
    weights = cell_weights(geometry)
    # Their areas add up to that of the disc.
    assert weights.sum() * 0.004**2 == pytest.approx(math.pi * 0.03**2, rel=2e-4)
    assert weights[7, 7] == 1.0
    assert weights[0, 0] == 0.0
    assert 0.0 < weights[0, 7] < 1.0


def test_a_square_diaphragm_has_the_disc_s_area():
    geometry = views(21, 21, spacing=0.004)
    square = PolygonAperture(blades=4, rotation=45.0).pack({})
    weights = cell_weights(geometry, 0.05, square)
    assert weights.sum() * 0.004**2 == pytest.approx(math.pi * 0.025**2, rel=2e-2)
    # Its half edge is sqrt(pi) / 2 of the disc's radius: 22.16 mm, 5 cells and 0.54 of the sixth.
    np.testing.assert_allclose(weights[10, 10:17], [1, 1, 1, 1, 1, 1, 0.0], atol=0.05)
    np.testing.assert_allclose(weights[4:17, 4:17], np.minimum.outer(weights[4:17, 10], weights[10, 4:17]), atol=0.05)


def test_an_opening_may_be_off_the_middle(wall):
    # So small that only one view is within it: the picture is that view, focused or not, moved to the plane.
    found = refocus(wall, aperture=0.01, center=(0.1, 0.05)).radiance
    np.testing.assert_allclose(found, wall.view(2, 5), rtol=1e-12)


def test_an_aperture_may_be_named(wall):
    shape = "{type: polygon, blades: 3}"
    named = refocus(wall, 1.3, aperture=0.25, aperture_shape=shape).radiance
    made = refocus(wall, 1.3, aperture=0.25, aperture_shape=PolygonAperture(blades=3)).radiance
    assert (named == made).all()
    assert away(named, refocus(wall, 1.3, aperture=0.25).radiance, 8) > 1e-3


def test_rays_go_where_they_meet_the_plane():
    # One ray through (0.01, -0.02) of the lens, to (0.1, 0.05) in the plane at 2 m, that is 0.2 m right and 0.1 m up:
    # at 1 m it is half way.
    geometry = replace(views(1, 1, width=64, height=48), aperture=0.1, focal_length=100.0)
    rays = Rays(np.array([[0.01, -0.02, 0.1, 0.05]]), np.array([[2.0, 4.0, 6.0]]), np.array([2.0]))
    field = LightField(np.zeros((1, 1, 48, 64, 3)), geometry, rays=rays)
    for tilt in (0.0, 30.0):
        # A plane through (0.105, 0.04, 1) leaves the axis at 1 - 0.04 tan(tilt).
        distance = 1.0 - 0.04 * math.tan(math.radians(tilt))
        found = refocus(field, distance, tilt=tilt, method="rays").radiance
        row, column = np.argwhere(found[..., 0])[0]
        assert column == math.floor((0.105 - geometry.plane.left) / geometry.plane.pixel)
        assert row == math.floor((geometry.plane.top - 0.04) / geometry.plane.pixel)
        np.testing.assert_allclose(found[row, column], [1.0, 2.0, 3.0])
        assert np.count_nonzero(found) == 3
    assert not refocus(field, 1.0, aperture=0.04, method="rays").radiance.any()
    assert refocus(field, 1.0, method="rays", scale=2.0).radiance.shape == (96, 128, 3)


@pytest.mark.parametrize("size", [(7, 7), (4, 6), (1, 5)])
def test_a_slice_is_the_sum(size):
    field = light_field(views(*size, spacing=0.03, width=48, height=48), [Surface(1.6, WALL)], supersampling=1)
    for distance in (0.8, 1.6, 5.0):
        summed = refocus(field, distance).radiance
        assert away(refocus(field, distance, method="fourier").radiance, summed, 12) < 0.01


def test_a_slice_is_a_sum_over_shifted_sines():
    # Of views that hold a sine, the mean of sines moved by u (w0 - w), to what the kernel leaves.
    geometry = views(9, 9, width=60, height=40)
    frequency = 0.11
    x = np.arange(60)
    view = np.broadcast_to((1.0 + np.sin(2 * np.pi * frequency * x))[None, :, None], (40, 60, 3))
    field = LightField(np.broadcast_to(view, (9, 9, 40, 60, 3)), geometry)
    moved = geometry.shift(1.0 / 1.3)[..., 0]
    expected = np.mean(1.0 + np.sin(2 * np.pi * frequency * (x + moved[..., None])), axis=(0, 1))
    found = FourierRefocuser(field).picture(1.0 / 1.3)
    np.testing.assert_allclose(found[20, 20:40, 1], expected[20:40], atol=2e-3)


def test_slices_are_made_for_a_range(wall):
    with pytest.raises(InputError, match="made for planes of focus from"):
        FourierRefocuser(wall, [0.5, 0.6]).picture(2.0)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"distance": 0.0}, "farther than 0"),
        ({"distance": math.nan}, "farther than 0"),
        ({"distance": 1.0, "alpha": 1.0}, "give one of them"),
        ({"f_number": 2.0}, "needs the focal length"),
        ({"f_number": 2.0, "aperture": 0.1}, "give one of them"),
        ({"aperture": 0.0}, "greater than 0"),
        ({"aperture": 0.05, "center": (1.0, 0.0)}, "no view lies within"),
        ({"aperture_shape": "hexagon", "aperture": 0.25}, "aperture_shape hexagon: unknown"),
        ({"aperture_shape": "polygon"}, "give aperture"),
        ({"tilt": 90.0}, "between -90 and 90"),
        ({"tilt": 5.0, "method": "fourier"}, "refocus by shift"),
        ({"method": "rays"}, "render it with --aov rays"),
        ({"method": "magic"}, "shift, fourier, rays"),
        ({"interpolation": "sharp"}, "linear, cubic, lanczos"),
        ({"crop": (0, 0, 65, 10)}, "must lie within a view"),
        ({"scale": 2.0}, "only method rays"),
    ],
)
def test_what_cannot_be_is_said(wall, options, sentence):
    with pytest.raises(InputError, match=sentence):
        refocus(wall, **options)


def test_a_light_field_without_metres_takes_slopes_only(wall):
    bare = replace(wall, settings={"units": "views"})
    with pytest.raises(InputError, match="give a slope"):
        refocus(bare, 2.0)
    assert refocus(bare, slope=0.5).radiance.shape == (48, 64, 3)


def test_an_opening_is_no_wider_than_the_lens():
    lens = replace(views(5, 5, width=24, height=16), cell=(0.01, 0.01), aperture=0.05, focal_length=100.0)
    field = LightField(np.zeros((5, 5, 16, 24, 3)), lens)
    with pytest.raises(InputError, match=r"100 mm is wider than the lens was, 50 mm \(f/2\)"):
        refocus(field, f_number=1.0)


def test_a_single_view_has_its_focus_for_good():
    with pytest.raises(InputError, match="but one view"):
        refocus(LightField(np.zeros((1, 1, 4, 5, 3)), views(1, 1, width=5, height=4)), 1.0)


def test_scattered_views_have_no_slices(wall):
    places = wall.views.position + 1e-4 * np.random.default_rng(1).standard_normal(wall.views.position.shape)
    scattered = replace(wall, views=replace(wall.views, position=places))
    with pytest.raises(InputError, match="not on a regular grid"):
        refocus(scattered, 1.6, method="fourier")
    # By shift they are focused where they are.
    assert refocus(scattered, 1.6).radiance.std() > 0.01
