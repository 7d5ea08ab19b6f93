"""The AOV `rays`: every camera ray of a picture."""

import numpy as np
import pytest

from raytracer.rendering.render import render
from raytracer.util.errors import InputError
from tests.small_scenes import scene

WIDTH, HEIGHT, SPP, RADIUS, FOCUS = 8, 6, 5, 0.05, 2.0

LENS = "thin_lens, vfov: 40, aperture: 100, focus_distance: 2"


def picture_of(camera=LENS, x=512.0, *, threads=1, height=HEIGHT, **settings):
    text = f"""
camera: {{type: {camera}, look_from: [{1.0 + x}, 2, 5], look_at: [{x}, 1, 1]}}
materials: {{lamp: {{type: emitter, radiance: {{type: checker, scale: 0.3, even: [1, 2, 3], odd: [3, 1, 0.5]}}}}}}
objects:
  - {{type: sphere, center: [{x}, 0, 0], radius: 1.5, material: lamp}}
"""
    spec = scene(text, width=WIDTH, height=height, spp=SPP, max_depth=1, filled=False)
    return render(spec, threads=threads, aovs=("rays",), **settings).image


def samples(picture):
    return picture.layers["rays"].reshape(*picture.layers["rays"].shape[:2], -1, 8)


@pytest.fixture(scope="module")
def picture():
    return picture_of()


def test_the_picture_is_the_mean_of_its_rays(picture):
    found = samples(picture)
    assert found.shape == (HEIGHT, WIDTH, SPP, 8)
    assert (found[..., 7] == 1.0).all()
    assert picture.radiance.std() > 0.1
    np.testing.assert_allclose(found[..., 4:7].mean(axis=2), picture.radiance, rtol=1e-14)


def test_rays_go_through_the_lens_to_their_pixel_s_image_in_the_plane_of_focus(picture):
    u, v, s, t = np.moveaxis(samples(picture)[..., :4], -1, 0)
    assert 0.8 * RADIUS < np.hypot(u, v).max() <= RADIUS * (1.0 + 1e-12)
    pixel = 2.0 * np.tan(np.radians(20.0)) / HEIGHT
    x, y = s + u / FOCUS, t + v / FOCUS
    assert (np.floor(x / pixel + 0.5 * WIDTH) == np.arange(WIDTH)[:, None]).all()
    assert (np.floor(0.5 * HEIGHT - y / pixel) == np.arange(HEIGHT)[:, None, None]).all()


def test_they_are_the_same_on_any_number_of_threads_and_in_crops(picture):
    assert (picture_of(threads=2).layers["rays"] == picture.layers["rays"]).all()
    assert (picture_of(crop=(2, 1, 6, 5)).layers["rays"] == picture.layers["rays"][1:5, 2:6]).all()


def test_what_is_far_from_the_origin_has_the_same_rays(picture):
    # The world's origin moves for both.  By powers of two, so that nothing is rounded in the scene's own numbers.
    far = samples(picture_of(x=2.0**23))
    np.testing.assert_allclose(far[..., :4], samples(picture)[..., :4], rtol=1e-9, atol=1e-12)


def test_what_it_cannot_record_is_said():
    with pytest.raises(InputError, match="rays needs as many samples in every pixel"):
        picture_of(noise=0.1)
    with pytest.raises(InputError, match="rays needs a camera that has an axis and does not move"):
        picture_of(LENS + ", shutter: 1, motion: {velocity: [1, 0, 0]}")


def test_what_looks_backwards_has_no_place_in_planes_ahead():
    found = samples(picture_of("equirectangular", height=4))
    ahead = np.isin(np.arange(8), range(2, 6))
    assert (np.isfinite(found[..., :4]).all(axis=(0, 2, 3)) == ahead).all()
    assert np.isfinite(found[..., 4:]).all()
