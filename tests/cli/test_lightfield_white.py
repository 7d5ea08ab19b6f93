"""`rt lightfield white` and `rt lightfield devignette`."""

import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from tests.repository import SCENES


@pytest.fixture(autouse=True)
def _inside(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def _write(name, radiance):
    position = np.stack(np.meshgrid([-1e-3, 0.0, 1e-3], [1e-3, 0.0, -1e-3]), axis=-1)
    lf.write(name, LightField(radiance, Views(position, Plane(0.01, -0.03, 0.02), 6, 4, 0.5)))


def test_devignette_writes_views_that_are_evenly_bright(rt):
    light = np.linspace(0.2, 1.0, 9).reshape(3, 3, 1, 1, 1) * np.ones((3, 3, 4, 6, 3))
    _write("shot.lf", 0.5 * light)
    _write("white.lf", light)
    assert "even.lf" in rt("lightfield devignette shot.lf white.lf -o even.lf").err
    with lf.open("even.lf") as field:
        np.testing.assert_allclose(field.radiance[...], 0.5 * light[1, 1, 0, 0, 0], rtol=1e-6)
        np.testing.assert_allclose(field.layers["lit"][0, 2], light[0, 2, 0, 0, 0] / light[1, 1, 0, 0, 0], rtol=1e-6)


def test_what_cannot_be_is_refused_in_a_sentence(refused):
    _write("shot.lf", np.ones((3, 3, 4, 6, 3)))
    _write("black.lf", np.zeros((3, 3, 4, 6, 3)))
    assert "black.lf" in refused("lightfield devignette shot.lf black.lf -o even.lf")
    assert "gone.lf: no such file" in refused("lightfield devignette shot.lf gone.lf -o even.lf")
    cover = SCENES / "cover.yaml"
    assert "this one has no views" in refused(f"lightfield white {cover} -o white.lf")
    assert "white.txt" in refused(f"lightfield white {SCENES / 'lightfield' / 'small.yaml'} -o white.txt")


@pytest.mark.slow
def test_a_raw_picture_through_glass_is_devignetted(rt):
    scene = SCENES / "lightfield" / "glass_double_gauss.yaml"
    keys = "-D camera.microlenses.pixels=6 --size 120x90 --spp 16 --quiet"
    rt(f"render {scene} -o shot.lf {keys}")
    rt(f"lightfield white {scene} -o white.lf -o white.exr {keys}")
    rt("lightfield devignette shot.lf white.lf -o even.lf --quiet")
    with lf.open("shot.lf") as plain, lf.open("even.lf") as even:
        # From beside the lens's rim its corners are dark, and the wall in them is not.
        dark, bright = (field.view(3, 0)[0, 0].mean() / field.view(3, 0)[0, 10].mean() for field in (plain, even))
        assert dark < 0.75 < bright
