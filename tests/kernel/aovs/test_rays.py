"""The AOV `rays`: every camera ray of a picture."""

import numpy as np
import pytest

from raytracer.film.image import Image
from raytracer.rendering.render import render
from raytracer.util.errors import InputError
from tests.small_scenes import scene

WIDTH, HEIGHT, SPP, RADIUS, FOCUS = 8, 6, 5, 0.05, 2.0

_SCENE = """
camera: {type: thin_lens, look_from: [1, 2, 5], look_at: [0, 1, 1], vfov: 40, aperture: 100, focus_distance: 2%s}
materials: {lamp: {type: emitter, radiance: {type: checker, scale: 0.3, even: [1, 2, 3], odd: [3, 1, 0.5]}}}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1.5, material: lamp}
"""


def _picture(keys: str = "", threads: int = 1, **settings: object) -> Image:
    spec = scene(_SCENE % keys, width=WIDTH, height=HEIGHT, spp=SPP, max_depth=1, filled=False)
    return render(spec, threads=threads, aovs=("rays",), **settings).image  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def picture() -> Image:
    return _picture()


def _samples(picture: Image) -> np.ndarray:
    return picture.layers["rays"].reshape(HEIGHT, WIDTH, -1, 8)


def test_the_picture_is_the_mean_of_its_rays(picture: Image) -> None:
    samples = _samples(picture)
    assert samples.shape == (HEIGHT, WIDTH, SPP, 8)
    assert (samples[..., 7] == 1.0).all()
    assert picture.radiance.std() > 0.1
    np.testing.assert_allclose(samples[..., 4:7].mean(axis=2), picture.radiance, rtol=1e-14)


def test_rays_go_through_the_lens_to_their_pixel_s_image_in_the_plane_of_focus(picture: Image) -> None:
    u, v, s, t = np.moveaxis(_samples(picture)[..., :4], -1, 0)
    assert np.hypot(u, v).max() <= RADIUS * (1.0 + 1e-12)
    assert np.hypot(u, v).max() > 0.8 * RADIUS
    pixel = 2.0 * np.tan(np.radians(20.0)) / HEIGHT
    x, y = s + u / FOCUS, t + v / FOCUS
    assert (np.floor(x / pixel + 0.5 * WIDTH) == np.arange(WIDTH)[:, None]).all()
    assert (np.floor(0.5 * HEIGHT - y / pixel) == np.arange(HEIGHT)[:, None, None]).all()


def test_they_are_the_same_on_any_number_of_threads(picture: Image) -> None:
    assert (_picture(threads=2).layers["rays"] == picture.layers["rays"]).all()


def test_what_is_far_from_the_origin_has_the_same_rays(picture: Image) -> None:
    # By powers of two, so that nothing is rounded in the scene's own numbers.
    away = 2.0**23
    text = (_SCENE % "").replace("[1, 2, 5]", f"[{1 + away}, 2, 5]").replace("[0, 1, 1]", f"[{away}, 1, 1]")
    text = text.replace("center: [0, 0, 0]", f"center: [{away}, 0, 0]")
    spec = scene(text, width=WIDTH, height=HEIGHT, spp=SPP, max_depth=1, filled=False)
    rendered = render(spec, threads=1, aovs=("rays",)).image
    np.testing.assert_allclose(_samples(rendered)[..., :4], _samples(picture)[..., :4], rtol=1e-9, atol=1e-12)


def test_crops_hold_their_part(picture: Image) -> None:
    part = _picture(crop=(2, 1, 6, 5)).layers["rays"]
    assert (part == picture.layers["rays"][1:5, 2:6]).all()


def test_what_it_cannot_record_is_said() -> None:
    with pytest.raises(InputError, match="rays needs as many samples in every pixel"):
        _picture(noise=0.1)
    with pytest.raises(InputError, match="rays needs a camera that has an axis and does not move"):
        _picture(", shutter: 1, motion: {velocity: [1, 0, 0]}")


def test_what_looks_backwards_has_no_place_in_planes_ahead() -> None:
    spec = scene(
        _SCENE.replace("{type: thin_lens,", "{type: equirectangular,").replace(
            ", vfov: 40, aperture: 100, focus_distance: 2%s", ""
        ),
        width=8,
        height=4,
        spp=SPP,
        max_depth=1,
        filled=False,
    )
    samples = render(spec, threads=1, aovs=("rays",)).image.layers["rays"].reshape(4, 8, -1, 8)
    ahead = np.zeros(8, bool)
    ahead[2:6] = True
    assert (np.isfinite(samples[..., :4]).all(axis=(0, 2, 3)) == ahead).all()
    assert np.isfinite(samples[..., 4:]).all()
