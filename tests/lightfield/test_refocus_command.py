"""`rt lightfield refocus`, as one uses it."""

import json

import numpy as np
import PIL.Image
import pytest
from typer.testing import CliRunner

from raytracer.cli.base.app import application
from raytracer.film import image_file
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField, Rays
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, light_field, views, waves


@pytest.fixture(scope="module")
def field():
    geometry = views(3, 3, width=24, height=18)
    return light_field(geometry, [Surface(1.6, waves(1, 0.3))], supersampling=1)


@pytest.fixture(scope="module")
def file(field, tmp_path_factory):
    path = tmp_path_factory.mktemp("refocus") / "wall.lf"
    lf.write(path, field, dtype="float64")
    return path


def _run(*arguments):
    found = CliRunner().invoke(application(), ["lightfield", "refocus", *map(str, arguments)], catch_exceptions=False)
    assert found.exit_code == 0, found.output
    return found.stdout


def _refused(*arguments):
    with pytest.raises(InputError) as caught:
        CliRunner().invoke(application(), ["lightfield", "refocus", *map(str, arguments)], catch_exceptions=False)
    return str(caught.value)


def test_a_photograph_is_written_as_python_makes_it(field, file, tmp_path):
    _run(file, "--distance", "160cm", "--aperture", "25mm", "--tilt", "0.2 rad", "-o", tmp_path / "a.npy")
    expected = refocus(field, 1.6, aperture=0.025, tilt=float(np.degrees(0.2))).radiance
    np.testing.assert_allclose(image_file.load(tmp_path / "a.npy"), expected, rtol=1e-12)


def test_a_stack_is_an_animation_or_a_picture_each(field, file, tmp_path):
    told = json.loads(
        _run(file, "-d", "1:4:3:inverse", "-d", "inf", "-o", tmp_path / "a.gif", "-o", tmp_path / "a.npy", "--json")
    )
    assert told["distances_m"] == [1.0, pytest.approx(1.6), 4.0, None]
    # There and back again, without the ends twice.
    with PIL.Image.open(tmp_path / "a.gif") as animation:
        assert getattr(animation, "n_frames", 1) == 6
    assert told["files"] == [str(tmp_path / "a.gif"), *(str(tmp_path / f"a_{number}.npy") for number in range(1, 5))]
    for number, distance in enumerate((1.0, 1.6, 4.0, np.inf), 1):
        found = image_file.load(tmp_path / f"a_{number}.npy")
        np.testing.assert_allclose(found, refocus(field, distance).radiance, rtol=1e-10)


def test_equal_steps_of_distance_and_slopes(file, tmp_path):
    told = json.loads(_run(file, "-d", "1:2:3,5", "-o", tmp_path / "a.webp", "--json"))
    assert told["distances_m"] == [1.0, 1.5, 2.0, 5.0]
    told = json.loads(_run(file, "--slope", "0:1:2", "--method", "fourier", "-o", tmp_path / "b.webp", "--json"))
    pixel = 2.0 * np.tan(np.radians(15.0)) / 18
    assert told["distances_m"] == pytest.approx([2.0, 1.0 / (0.5 + pixel / 0.01)])


def test_without_metres_it_tells_slopes(field, tmp_path):
    lf.write(tmp_path / "a.lf", LightField(field.radiance, field.views, settings={"units": "views"}))
    told = json.loads(_run(tmp_path / "a.lf", "--slope", "-0.5:1:3", "-o", tmp_path / "b.gif", "--json"))
    assert set(told) == {"slopes_px", "files"}
    np.testing.assert_allclose(told["slopes_px"], [-0.5, 0.25, 1.0], atol=1e-12)


def test_rays_that_leave_pixels_black_are_told_of(field, tmp_path):
    rays = Rays(np.zeros((1, 4)), np.ones((1, 3)), np.ones(1))
    single = LightField(np.zeros((1, 1, 18, 24, 3)), views(1, 1, width=24, height=18), rays=rays)
    lf.write(tmp_path / "rays.lf", single)
    found = CliRunner().invoke(
        application(),
        ["lightfield", "refocus", str(tmp_path / "rays.lf"), "--method", "rays", "-o", str(tmp_path / "a.png")],
    )
    assert found.exit_code == 0
    assert "no ray comes to 99.8 % of the pixels" in found.stderr


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["-d", "2", "--alpha", "1", "-o", "a.png"], "give one of them"),
        (["-d", "2 kg", "-o", "a.png"], "--distance 2 kg"),
        (["-d", "1:4", "-o", "a.gif"], "START:STOP:COUNT"),
        (["-d", "1:inf:4", "-o", "a.gif"], "1:inf:4:inverse"),
        (["-d", "0:4:4:inverse", "-o", "a.gif"], "greater than 0"),
        (["-d", "1:4:1", "-o", "a.gif"], "from 2 to 10000 planes"),
        (["-d", "2", "-o", "a.gif"], "needs several distances"),
        (["-d", "2", "-o", "a.lf"], "unknown suffix '.lf' for a photograph"),
        (["-d", "2", "--center", "1", "-o", "a.png"], "two lengths"),
        (["-d", "2", "--crop", "0,0,30,10", "-o", "a.png"], "wall.lf: crop 0,0,30,10 must lie within a view"),
        (["-d", "2", "--f-number", "4", "-o", "a.png"], "wall.lf: an f-number needs the focal length"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(file, tmp_path, monkeypatch, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    assert sentence in _refused(file, *arguments)
    assert not list(tmp_path.iterdir())


def test_a_plane_beyond_the_range_is_told_of(file, tmp_path):
    found = CliRunner().invoke(
        application(), ["lightfield", "refocus", str(file), "-d", "0.2", "-o", str(tmp_path / "a.png")]
    )
    assert "0.2 m is beyond" in found.stderr
    assert "edges out of focus come apart" in found.stderr
