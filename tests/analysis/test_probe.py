"""The plenoptic function: the radiance at a point, out of a direction, at a time and a wavelength."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from raytracer.analysis.probe import probe, probe_sphere
from raytracer.cli.base.app import main
from raytracer.core.spectra import response, spectrum_of
from raytracer.optics.glass import CATALOGUE
from raytracer.scene.load import build
from raytracer.util.errors import InputError

HORIZON, ZENITH = (1.0, 0.9, 0.6), (0.2, 0.4, 1.0)

# A lamp that flies past, before a gradient; and a matt ball that both light.
ROOM = """
camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], vfov: 30, shutter: {open: 0.25, close: 0.75}}
film: {width: 8, height: 8}
render: {spp: 4, max_depth: 6}
environment: {type: gradient, horizon: [1.0, 0.9, 0.6], zenith: [0.2, 0.4, 1.0]}
materials:
  lamp: {type: emitter, radiance: [3, 2, 1]}
  matt: {type: lambertian, albedo: [0.7, 0.5, 0.3]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 0.5, material: lamp, motion: {velocity: [4, 0, 0]}}
  - {type: sphere, center: [0, -5, 0], radius: 1, material: matt}
"""

# Light that comes out of a half-space of dense flint below y = 0, at 60 degrees, from a strip a metre down that only
# blue light reaches.
FLINT = """
camera: {{type: pinhole, look_from: [0, 1, 1], look_at: [0, 0, 0], vfov: 30}}
film: {{width: 8, height: 8}}
render: {{spp: 4, max_depth: 4}}
objects:
  - {{type: quad, corner: [-9, 0, 9], edges: [[18, 0, 0], [0, 0, -18]],
     material: {{type: dielectric, ior: N-SF11}}}}
  - {{type: quad, corner: [{left}, -1, 9], edges: [[{wide}, 0, 0], [0, 0, -18]],
     material: {{type: emitter, radiance: 5}}}}
"""

BLUE, RED, ANGLE = 450.0, 650.0, math.radians(60.0)


def gradient(direction):
    a = 0.5 * (np.asarray(direction)[..., 1:2] / np.linalg.norm(direction, axis=-1, keepdims=True) + 1.0)
    return (1.0 - a) * np.array(HORIZON) + a * np.array(ZENITH)


@pytest.fixture(scope="module")
def spec():
    return build(ROOM, "room.yaml")


def measured(spec, **keys):
    return probe(spec, (0.0, 0.0, 5.0), **{"spp": 64, **keys})


UPRIGHT = [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (1e-9, 1.0, 0.0)]


@pytest.mark.parametrize("direction", [(3.0, 4.0, 12.0), *UPRIGHT])
def test_a_direction_sees_the_environment_in_it(spec, direction):
    found = measured(spec, direction=direction)
    np.testing.assert_allclose(found.radiance, gradient(direction), rtol=1e-14)
    np.testing.assert_allclose(found.towards, np.array(direction) / np.linalg.norm(direction), rtol=1e-15)
    np.testing.assert_allclose(found.standard_error, 0.0, atol=1e-15)


def test_a_lamp_that_flies_is_there_while_it_passes(spec):
    """It is a metre wide and does 4 m/s, so it covers the axis until 0.125 s."""
    for time, radiance in ((0.0, (3.0, 2.0, 1.0)), (0.12, (3.0, 2.0, 1.0)), (0.13, gradient((0, 0, -1)))):
        found = measured(spec, toward=(0.0, 0.0, 0.0), time=time)
        np.testing.assert_allclose(found.radiance, radiance, rtol=1e-12)
        assert found.time == time
    assert measured(spec, toward=(0.0, 0.0, 0.0)).time == 0.25, "the shutter of the scene opens then"


def test_the_standard_error_is_that_of_repetitions(spec):
    """Of 50 repetitions the deviation itself is known to 1 / sqrt(98), 10 %: three times that is allowed."""
    found = [measured(spec, toward=(0.3, -4.5, 0.0), spp=1024, seed=seed) for seed in range(50)]
    spread = np.std([one.radiance for one in found], axis=0, ddof=1)
    claimed = np.sqrt(np.mean(np.square([one.standard_error for one in found]), axis=0))
    assert (spread > 0.0).all()
    np.testing.assert_allclose(claimed, spread, rtol=0.3)


def test_the_spectral_radiance_of_a_colour_is_its_spectrum(spec):
    """And its integral against what the camera records of each wavelength is the colour."""
    colour = measured(spec, toward=(0.0, 0.0, 0.0), time=0.0).radiance
    waves = np.linspace(380.0, 780.0, 9)
    seen = [measured(spec, toward=(0.0, 0.0, 0.0), time=0.0, wavelength=float(wave)) for wave in waves]
    np.testing.assert_allclose([one.radiance[0] for one in seen], spectrum_of(colour, waves), rtol=1e-7)
    assert all(len(one.radiance) == len(one.standard_error) == 1 for one in seen)
    fine = np.arange(380.0, 780.5, 0.5)
    recorded = np.trapezoid(response(fine) * spectrum_of(colour, fine)[:, None], fine, axis=0)
    np.testing.assert_allclose(recorded, colour, rtol=1e-3)


@pytest.mark.slow
def test_glass_that_disperses_shows_each_wavelength_its_own_place():
    """Snell's law by wavelength, and Fresnel's for how much comes through."""
    glass = CATALOGUE["N-SF11"]
    n = {wave: float(glass.ior(wave)) for wave in (BLUE, RED)}
    place = {wave: math.tan(math.asin(math.sin(ANGLE) / n[wave])) for wave in n}
    assert place[RED] - place[BLUE] > 0.005
    ray = {"toward": (0.0, 0.0, 0.0), "spp": 2**14}
    at = (-math.tan(ANGLE), 1.0, 0.0)
    for lit, dark in ((BLUE, RED), (RED, BLUE)):
        spec = build(FLINT.format(left=place[lit] - 0.002, wide=0.004), "flint.yaml")
        found = probe(spec, at, wavelength=lit, **ray)
        inside = math.asin(math.sin(ANGLE) / n[lit])
        s = math.sin(ANGLE - inside) / math.sin(ANGLE + inside)
        p = math.tan(ANGLE - inside) / math.tan(ANGLE + inside)
        expected = 5.0 * (1.0 - 0.5 * (s * s + p * p))
        assert abs(found.radiance[0] - expected) < 4.0 * found.standard_error[0]
        assert found.standard_error[0] < 0.01 * expected
        assert probe(spec, at, wavelength=dark, **ray).radiance == (0.0,)


@pytest.mark.slow
def test_all_directions_as_a_picture(spec):
    width, height = 32, 16
    image = probe_sphere(spec, (0.0, 0.0, 40.0), toward=(0.0, 0.0, 80.0), width=width, spp=4).image.radiance
    assert image.shape == (height, width, 3)
    latitude = math.pi * (0.5 - (np.arange(height) + 0.5) / height)
    # The mean of the sine over a row of pixels; looking away from all that is in the scene.
    row = np.sin(latitude) * math.sin(0.5 * math.pi / height) / (0.5 * math.pi / height)
    a = 0.5 * (row[:, None] + 1.0)
    expected = (1.0 - a) * np.array(HORIZON) + a * np.array(ZENITH)
    np.testing.assert_allclose(image[:, 8:24].mean(axis=1), expected, rtol=0.02)


def test_the_command_prints_what_python_finds(spec, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("room.yaml").write_text(ROOM)
    ray = ["probe", "room.yaml", "--at", "0,0,5", "--toward", "0,0,0", "--time", "0", "--spp", "64", "-q"]
    assert main([*ray, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == json.loads(json.dumps(measured(spec, toward=(0.0, 0.0, 0.0), time=0.0).json()))
    np.testing.assert_allclose(found["radiance"], [3.0, 2.0, 1.0], rtol=1e-14)
    assert main([*ray, "--wavelength", "0.55um"]) == 0
    out = capsys.readouterr().out
    assert "at 550 nm, relative to D65" in out
    assert "samples          64" in out


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--at", "1,2", "--toward", "0,0,0"], "--at 1,2: must be three numbers, X,Y,Z"),
        (["--at", "1,2,x", "--toward", "0,0,0"], "--at x: must be a length"),
        (["--at", "1,2,3"], "give --toward X,Y,Z or --direction X,Y,Z for one ray, or -o FILE"),
        (["--at", "1,2,3", "--toward", "1,2,3"], "the point to look toward is the point that light comes to"),
        (["--at", "1,2,3", "--toward", "0,0,0", "--direction", "0,0,1"], "give one of them"),
        (["--at", "1,2,3", "--direction", "0,0,0"], "a direction must have a length"),
        (["--at", "1,2,3", "--direction", "0,0,1", "-o", "a.exr"], "--toward says what is in its middle"),
        (["--at", "1,2,3", "--toward", "0,0,0", "--width", "8"], "--width is of the picture that -o FILE writes"),
        (["--at", "1,2,3", "-o", "a.exr", "--width", "7"], "its width must be even"),
        (["--at", "1,2,3", "-o", "a.exr", "--json"], "--json prints the radiance of one ray"),
        (["--at", "1,2,3", "-o", "a.foo"], "a.foo: unknown suffix"),
        (["--at", "1,2,3", "-o", "a.lf"], "a.lf: a picture of all directions from one point is no light field"),
        (["--at", "1,2,3", "--toward", "0,0,0", "--wavelength", "900nm"], "wavelength: must be at most 780"),
        (["--at", "1,inf,3", "--toward", "0,0,0"], "at: must be finite"),
        (["--at", "1,2,3", "--toward", "0,0,0", "--time", "soon"], "--time soon: must be a time"),
    ],
)
def test_what_cannot_be_probed_is_told_in_a_sentence(words, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("room.yaml").write_text(ROOM)
    assert main(["probe", "room.yaml", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("rt: ")
    assert sentence in captured.err
    assert len(captured.err.splitlines()) == 1
    assert not list(tmp_path.glob("a.*"))


def test_an_interrupted_probe_tells_nothing(spec):
    def interrupt(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        probe(spec, (0.0, 0.0, 5.0), direction=(0.0, 0.0, -1.0), spp=2**24, progress=interrupt)


def test_a_point_on_the_way_and_a_direction_are_the_same(spec):
    ways = {"toward": (0.0, -5.0, 0.0)}, {"direction": (0.0, -1.0, -1.0)}
    one, other = (measured(spec, **way, spp=4096) for way in ways)
    np.testing.assert_allclose(one.radiance, other.radiance, rtol=1e-12)
    assert one.samples == 4096


def test_python_refuses_what_is_no_ray(spec):
    for at, keys, words in (
        ((0.0, 0.0, 5.0), {}, "either a point to look toward, or a direction"),
        ((0.0, 0.0, 5.0), {"direction": (0.0, 0.0, 1.0), "spp": 0}, "spp must be an integer"),
        ((0.0, 0.0), {"direction": (0.0, 0.0, 1.0)}, "at must be three numbers"),
        ((0.0, 0.0, 5.0), {"toward": "lamp"}, "toward must be three numbers, got 'lamp'"),
    ):
        with pytest.raises(InputError, match=words):
            probe(spec, at, **keys)
