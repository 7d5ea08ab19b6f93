"""Devignetting by a white picture."""

import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.layout import extract_light_field
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.devignetting import devignette, white_scene, write_devignetted
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.rendering.render import render
from raytracer.util.errors import InputError
from tests.repository import SCENES
from tests.small_scenes import scene

ROWS, HEIGHT, WIDTH = 5, 8, 10


def views(**keys):
    steps = 1e-3 * (np.arange(ROWS) - 2.0)
    position = np.stack(np.meshgrid(steps, -steps), axis=-1)
    numbers = {"inverse_focus": 0.5, "cell": (1e-3, 1e-3), **keys}
    return Views(position, Plane(0.01, -0.05, 0.04), WIDTH, HEIGHT, **numbers)


def vignetted():
    """The light that reaches pixels: all in the middle, less of other views and towards a border; none of one view."""
    rng = np.random.default_rng(4)
    light = rng.uniform(0.2, 1.0, (ROWS, ROWS, HEIGHT, WIDTH, 3))
    light[2, 2] = 1.0
    light[1, 3] = 0.0
    light[0, 0, :, :4] = 0.01
    return 0.7 * light


def test_views_are_as_bright_as_the_middle_and_count_by_their_light():
    rng = np.random.default_rng(8)
    seen, light = rng.uniform(0.1, 1.0, (ROWS, ROWS, HEIGHT, WIDTH, 3)), vignetted()
    even = devignette(LightField(seen * light, views()), LightField(light, views()))
    part = light / 0.7
    lit = (part >= 0.03).all(axis=-1)
    # The middle keeps its radiance, 0.7 of what is seen: a camera that darkens all is not made brighter.
    np.testing.assert_allclose(even.radiance[lit], 0.7 * seen[lit], rtol=1e-12)
    assert (even.radiance[~lit] == 0.0).all()
    np.testing.assert_allclose(even.layers["lit"], np.where(lit, part.mean(axis=-1), 0.0), rtol=1e-6)

    # Focused where all views see the same, each pixel is their mean, weighted by the light that they got.
    weights = np.where(lit, part.mean(axis=-1), 0.0)[..., None]
    expected = 0.7 * (weights * seen).sum(axis=(0, 1)) / weights.sum(axis=(0, 1))
    np.testing.assert_allclose(refocus(even).radiance, expected, rtol=1e-6)


def test_something_even_is_even_wherever_it_is_focused():
    light = vignetted()
    even = devignette(LightField(0.3 * light, views()), LightField(light, views()))
    for distance in (0.1, 2.0, np.inf):
        np.testing.assert_allclose(refocus(even, distance).radiance, 0.21, rtol=1e-6)
        np.testing.assert_allclose(refocus(even, distance, tilt=20.0).radiance, 0.21, rtol=1e-6)


def test_files_are_divided_view_by_view(tmp_path):
    light = vignetted()
    field = LightField(0.3 * light, views(), {"depth": np.ones(light.shape[:4])})
    white = LightField(light, views())
    write_devignetted(tmp_path / "even.lf", field, white)
    with lf.open(tmp_path / "even.lf") as stored:
        expected = devignette(field, white)
        np.testing.assert_allclose(stored.radiance[...], expected.radiance, rtol=1e-6)
        np.testing.assert_array_equal(stored.layers["lit"][...], expected.layers["lit"])
        np.testing.assert_array_equal(stored.layers["depth"][...], 1.0)


def test_a_white_of_another_camera_is_refused():
    light = vignetted()
    field = LightField(light, views())
    with pytest.raises(InputError, match="of another camera, or of another focus"):
        devignette(field, LightField(light, views(inverse_focus=0.6)))
    narrow = Views(views().position, views().plane, WIDTH - 1, HEIGHT, 0.5)
    with pytest.raises(InputError, match="5 x 5 views of 9 x 8, not 5 x 5 views of 10 x 8"):
        devignette(field, LightField(light[..., :-1, :], narrow))
    with pytest.raises(InputError, match="black in its middle"):
        devignette(field, LightField(np.zeros_like(light), views()))


_LENS = (
    "camera: {type: light_field, lens: ../lenses/double-gauss-50mm.yaml, f_number: 2, look_from: [0, 0, 0], look_at: "
    "[0, 0, -1], sensor: {width: 24 mm, height: 18 mm}, dispersion: false, microlenses: {pixels: 10}, focus_on: wall}\n"
)
_WALL = """
materials: {grey: {type: emitter, radiance: [0.5, 0.5, 0.5]}}
objects: [{type: quad, name: wall, corner: [-2, -2, -0.5], edges: [[4, 0, 0], [0, 4, 0]], material: grey}]
"""


@pytest.mark.slow
def test_glass_that_vignettes_shows_an_even_wall_evenly():
    spec = scene(_LENS + _WALL, base=SCENES / "lightfield", width=320, height=240, spp=144, max_depth=1, filled=False)
    white = extract_light_field(render(white_scene(spec), threads=2, seed=9).image)
    plain = extract_light_field(render(spec, threads=2, seed=1).image)
    even = devignette(plain, white)
    distances = (0.35, 0.5, 1.0)
    dark, bright = ([refocus(field, d).radiance for d in distances] for field in (plain, even))
    for before, after in zip(dark, bright, strict=True):
        # The corners get half of the light: the lens vignettes.  Both pictures have noise of their own.
        assert before[1, 1].mean() < 0.65 * before[12, 16].mean()
        assert np.abs(after / after.mean() - 1.0).max() < 0.03
        assert after.std() < 0.005 * after.mean()
    # Views from the rim of the lens got less light, and say so.
    lit = np.asarray(even.layers["lit"]).mean(axis=(2, 3))
    assert lit[5, 0] < 0.8 * lit[5, 5]
