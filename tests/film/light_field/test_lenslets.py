"""Raw pictures by views: geometry on pictures that are linear in what their pixels see, which interpolation keeps."""

import math
from functools import cache

import numpy as np
import pytest

from raytracer.film.image import Image
from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.lenslets import Lenslets, disc_coverage

ROW = math.sqrt(3.0) / 2.0
TURN = math.radians(4.0)

LATTICES = {
    "whole pixels": Lattice((9.0, 8.0), (10.0, 0.0), (0.0, 10.0)),
    "turned": Lattice((60.3, 60.8), (10.3 * math.cos(TURN), -10.3 * math.sin(TURN)), (0.72, 10.27)),
    "hexagonal": Lattice((60.0, 60.0), (11.0, 0.0), (5.5, 11.0 * ROW)),
}


def lenslets(name, **keys):
    numbers = {"slope": 2e-3, "stride": 1e-3, "inverse_distance": 0.4, "inverse_focus": 0.4, **keys}
    return Lenslets(LATTICES[name], 120, 110, (60.0, 55.0), **numbers)


@cache
def places_and_nearest(lattice):
    """Pixels' middles (height, width, 2), and that of the nearest of all microlenses, whichever they are."""
    places = np.stack(np.meshgrid(np.arange(120) + 0.5, np.arange(110) + 0.5), axis=-1)
    numbers = np.stack(np.meshgrid(np.arange(-40, 41), np.arange(-40, 41)), axis=-1).reshape(-1, 2)
    middles = lattice.place(numbers[:, 0], numbers[:, 1])
    middles = middles[(np.abs(middles - [60.0, 55.0]) < 80.0).all(axis=1)]
    return places, middles[((places[:, :, None, :] - middles) ** 2).sum(axis=-1).argmin(axis=-1)]


def seen(layout, inverse_distance):
    """Compute points on the main lens (m) of pixels' rays, and their tangents: (height, width, 2) right, up."""
    places, nearest = places_and_nearest(layout.lattice)
    on_lens = layout.stride * (places - nearest) * [1.0, -1.0]
    slopes = layout.slope * (nearest - layout.middle) * [1.0, -1.0]
    return on_lens, slopes + on_lens * (inverse_distance - layout.inverse_distance)


def within(layout, views):
    """The views whose places, with the pixels next to them, are within every sub-image."""
    away = np.hypot(views.position[..., 0], views.position[..., 1]) / layout.stride
    return np.asarray(away < 0.5 * layout.lattice.pitch - 1.0)


def tangents(views):
    """Compute the tangents of the middles of a view's pixels: (height, width, 2) right, up."""
    x = views.plane.left + views.plane.pixel * (np.arange(views.width) + 0.5)
    y = views.plane.top - views.plane.pixel * (np.arange(views.height) + 0.5)
    return np.stack(np.meshgrid(x, y), axis=-1)


def image(values):
    return Image(np.concatenate([values, np.ones((*values.shape[:2], 1))], axis=-1))


@pytest.mark.parametrize("name", LATTICES)
def test_views_see_through_the_places_that_are_said(name):
    layout = lenslets(name)
    field = layout.light_field(image(seen(layout, 0.4)[0]))
    position = field.views.position[:, :, None, None, :]
    inner = within(layout, field.views)
    found = field.radiance[..., :2]
    assert inner.sum() > 50
    np.testing.assert_allclose(found[inner], np.broadcast_to(position, found.shape)[inner], rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(field.views.position[0, 0] * [-1.0, 1.0] > 0.0, True)


@pytest.mark.parametrize("name", LATTICES)
def test_pixels_of_views_see_where_the_plane_says(name):
    layout = lenslets(name)
    field = layout.light_field(image(seen(layout, 0.4)[1]))
    assert field.views.inverse_focus == 0.4
    expected = tangents(field.views)
    # Beyond the outermost microlenses their own values are continued: look at what is within.
    found = field.radiance[within(layout, field.views)][:, 2:-2, 2:-2, :2]
    np.testing.assert_allclose(found, np.broadcast_to(expected[2:-2, 2:-2], found.shape), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", LATTICES)
@pytest.mark.parametrize("inverse_focus", [1.4, -2.6])
def test_focused_views_have_the_pixels_of_the_sensor_in_the_plane_that_is_sharp(name, inverse_focus):
    layout = lenslets(name, inverse_focus=inverse_focus, inverse_distance=-0.6, slope=5e-4)
    field = layout.light_field(image(seen(layout, inverse_focus)[1]))
    plane, expected = field.views.plane, tangents(field.views)
    assert field.views.inverse_focus == inverse_focus
    assert plane.pixel == pytest.approx(abs(inverse_focus + 0.6) * layout.stride)
    found = field.radiance[..., :2]
    # The picture's own rim is seen by fewer microlenses than it takes.
    inner = (slice(None), slice(None), slice(7, -7), slice(7, -7))
    assert (field.radiance[inner][..., 2] > 0.0).all()
    # At the edge of a sub-image, pixels on one side of a place may be another's: that moves it by less than one.
    error = (found - expected)[inner] / plane.pixel
    assert np.abs(error).max() < 0.75
    assert np.median(np.abs(error)) < 1e-9
    assert math.sqrt((error**2).mean()) < 0.05


def test_a_ray_a_pixel_is_kept_of_a_focused_picture():
    layout = lenslets("hexagonal", inverse_focus=1.4, inverse_distance=-0.6)
    on_lens, slopes = seen(layout, 1.4)
    rays = layout.light_field(image(slopes)).rays
    assert len(rays.value) == 120 * 110
    np.testing.assert_allclose(rays.place[:, :2].reshape(110, 120, 2), on_lens, atol=1e-15)
    np.testing.assert_allclose(rays.place[:, 2:], rays.value[:, :2], atol=1e-15)


def test_the_geometry_of_a_focused_camera_needs_no_pixels():
    """`rt explain` asks it for many microlenses before a sensor of any size."""
    layout = lenslets("hexagonal", inverse_focus=1.4, inverse_distance=-0.6)
    assert layout.views.columns > 1
    assert "_pixels" not in vars(layout)


def test_layers_are_sliced_as_the_picture_is():
    layout = lenslets("whole pixels")
    values = np.arange(120.0 * 110.0).reshape(110, 120)
    found = layout.light_field(Image(np.zeros((110, 120, 3)), layers={"depth": values}))
    # The first whole sub-image begins at (4, 3).
    assert found.layers["depth"].shape == (10, 10, 10, 11)
    assert found.layers["depth"][2, 7, 4, 6] == values[3 + 40 + 2, 4 + 60 + 7]


def test_pixels_at_the_rim_of_the_lens_are_as_bright_as_the_others():
    layout = lenslets("whole pixels", aperture=10e-3)
    picture = Image(np.repeat(layout.lit[..., None], 3, axis=2))
    assert picture.radiance.min() < 0.1
    field = layout.light_field(picture)
    # Of views in the corners the lens covers nothing.
    covered = field.radiance[..., 0, 0, 0] > 0.0
    assert covered.sum() == 88
    np.testing.assert_allclose(field.radiance[covered], 1.0, rtol=0.0, atol=1e-9)


def test_a_picture_smaller_than_a_sub_image_holds_no_views():
    layout = Lenslets(LATTICES["whole pixels"], 9, 9, (4.5, 4.5), 1e-3, 1e-3, 0.0, 0.0)
    with pytest.raises(ValueError, match="holds no whole sub-image"):
        _ = layout.views


def test_a_disc_in_a_square_covers_a_quarter_of_pi():
    assert disc_coverage(-3.0, -3.0, 6.0, 6.0, 3.0) == pytest.approx(math.pi / 4.0)
    assert disc_coverage(-3.0, 0.0, 6.0, 3.0, 3.0) == pytest.approx(math.pi / 4.0)
    assert disc_coverage(-1.0, -1.0, 2.0, 2.0, 3.0) == pytest.approx(1.0)
    assert disc_coverage(3.0, -1.0, 2.0, 2.0, 3.0) == pytest.approx(0.0)


def test_parts_of_rectangles_are_those_of_points_in_them():
    rng = np.random.default_rng(4)
    left, bottom = rng.uniform(-2.0, 1.0, (2, 40))
    found = disc_coverage(left, bottom, 0.9, 0.4, 1.3)
    steps = (np.arange(400) + 0.5) / 400
    x, y = left[:, None, None] + 0.9 * steps, bottom[:, None, None] + 0.4 * steps[:, None]
    counted = (x * x + y * y < 1.3**2).mean(axis=(1, 2))
    np.testing.assert_allclose(found, counted, rtol=0.0, atol=2e-3)
    assert ((found > 0.01) & (found < 0.99)).sum() > 10
