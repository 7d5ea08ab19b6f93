"""Pixels below zero: counted, explained by what the scene asks for, and a fault where it asks for none of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.film.negative_pixels import FILTER, READ_NOISE, SPECTRAL, describe_negative_pixels, find_negative_pixels
from raytracer.film.white_balance import balance_gains
from raytracer.plugins.filters.mitchell import Mitchell
from raytracer.rendering.develop import negative_causes
from raytracer.scene.load import build, load
from raytracer.scene.pack.scene import pack

SCENES = Path(__file__).parents[2] / "scenes"

LAMP = """\
camera: {type: orthographic, look_from: [0, 0, 4], look_at: [0, 0, 0], height: 16}
film: {width: 24, height: 16, filter: {type: mitchell, b: 1/3, c: 1/3}}
render: {spp: 256, max_depth: 1}
objects:
  - {type: quad, corner: [-2, -20, 0], edges: [[20, 0, 0], [0, 40, 0]], material: {type: emitter, radiance: 5}}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lamp.yaml").write_text(LAMP)
    return tmp_path


def test_a_picture_without_any_has_none():
    assert find_negative_pixels(np.zeros((2, 3, 3)), [FILTER]) == (0, {})
    assert find_negative_pixels(np.full((2, 3, 3), np.nan), []) == (0, {})


def test_pixels_are_counted_and_the_lowest_is_placed_in_the_whole_picture():
    values = np.ones((4, 5, 3))
    values[1, 2] = (-1.0, -2.0, 0.0)
    values[3, 0, 2] = -0.5
    values[0, 0, 0] = np.nan
    assert find_negative_pixels(values, [FILTER, SPECTRAL], 10, 20) == (
        2,
        {"lowest": -2.0, "pixel": [12, 21], "causes": [FILTER, SPECTRAL]},
    )


@pytest.mark.parametrize(
    ("name", "overrides", "causes"),
    [
        ("cornell", {}, ()),
        ("cornell", {"film.filter": "gaussian"}, ()),
        ("cornell", {"film.filter": "mitchell"}, (FILTER,)),
        # Without the parameter C no lobe is negative.
        ("cornell", {"film.filter": {"type": "mitchell", "b": 1, "c": 0}}, ()),
        ("prism", {}, (SPECTRAL,)),
        ("prism", {"film.filter": "mitchell"}, (FILTER, SPECTRAL)),
        ("optics/chromatic_fringes", {}, (SPECTRAL,)),
        ("optics/chromatic_fringes", {"camera.dispersion": False}, ()),
        # A sensor catches no less than no light.
        ("lecture/iso_noise", {"film.filter": "mitchell"}, (READ_NOISE,)),
    ],
)
def test_causes_are_those_of_the_scene(name, overrides, causes):
    packed = pack(load(SCENES / f"{name}.yaml", overrides))
    assert negative_causes(packed.spec, packed.scene) == causes


def test_light_of_one_wavelength_is_never_negative():
    text = (
        "camera: {type: ray, wavelength: 490}\nfilm: {width: 4, height: 4}\n"
        "objects: [{type: sphere, center: [0, 0, -3], radius: 1, material: {type: dielectric, ior: N-SF11}}]\n"
    )
    packed = pack(build(text, "ray.yaml"))
    assert packed.scene.spectrum is not None
    assert negative_causes(packed.spec, packed.scene) == ()


def test_the_filter_rings_beside_an_edge_by_its_lobes(folder, capsys):
    assert main(["render", "lamp.yaml", "-o", "a.npy", "--stats", "a.json", "--strict"]) == 0
    values, stats = np.load("a.npy"), json.loads(Path("a.json").read_text())
    # The lamp begins 1.5 pixels from the middles of column 8: on it lies what of the outer lobe is farther away, all of
    # it below zero.
    outer = np.polynomial.Polynomial([32.0, -60.0, 36.0, -7.0]) / 18.0
    lobe = outer.integ()(2.0) - outer.integ()(1.5)
    np.testing.assert_allclose(values[:, 8].mean(), 5.0 * lobe, rtol=0.05)
    assert Mitchell().has_negative_lobes()
    assert stats["negative_pixels"] == (values < 0.0).any(axis=2).sum()
    assert stats["negative"]["lowest"] == values.min()
    x, y = stats["negative"]["pixel"]
    assert values[y, x].min() == values.min()
    assert stats["negative"]["causes"] == [FILTER]
    told = capsys.readouterr().err
    assert f"{stats['negative_pixels']} pixels below zero, to {values.min():.3g}, by the negative lobes" in told


def test_what_nothing_explains_is_a_fault(folder, capsys, monkeypatch):
    monkeypatch.setattr("raytracer.rendering.session.negative_causes", lambda spec, scene: ())
    words = ["render", "lamp.yaml", "-q", "-o", "a.npy", "--crop", "4,2,12,9"]
    assert main([*words, "--stats", "a.json"]) == 0
    x, y = json.loads(Path("a.json").read_text())["negative"]["pixel"]
    assert (4 <= x < 12) & (2 <= y < 9)
    told = capsys.readouterr().err
    assert "for which nothing in the scene is a reason" in told
    assert f"--pixel {x},{y} --debug" in told
    Path("a.npy").unlink()
    assert main([*words, "--strict"]) == 1
    # The picture is there all the same, to be looked at.
    assert Path("a.npy").exists()


def test_sentences_name_all_causes():
    found = {"lowest": -0.25, "pixel": [0, 0], "causes": [FILTER, SPECTRAL]}
    assert describe_negative_pixels(1, found) == (
        "1 pixel below zero, to -0.25, by the negative lobes of the filter and colours of single wavelengths"
    )


def test_a_picture_of_a_mean_below_zero_is_balanced_without_turning_it_over():
    # Cyan of a spectrum: the luminance of the mean is below zero.
    balance = balance_gains("auto", np.full((2, 2, 3), (-2.0, 0.1, 0.2)))
    assert (balance > 0.0).all()
    assert balance[0] == 1.0
