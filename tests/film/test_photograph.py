"""Photographs: a scene exposed, recorded, balanced and shown, from the scene file to the picture."""

import json
import math
from pathlib import Path

import numba
import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.film import Image, load, load_layers
from raytracer.film.exposure import CropWindow, luminance
from raytracer.film.photograph import DevelopSettings, check_develop_settings, develop_photograph
from raytracer.film.tone import Filmic, ToneCurveSpec
from raytracer.film.white_balance import balance_gains
from raytracer.optics.sensor_formats import SensorSpec
from raytracer.optics.thin_lens import ExposureSettings, Metering
from raytracer.rendering.render import render
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.util import srgb
from raytracer.util.errors import InputError

WIDTH, HEIGHT = 48, 32
WHOLE = CropWindow(WIDTH, HEIGHT, 0, 0)
LINEAR = ToneCurveSpec()

# A wall of even light that fills the picture, so far away that its image lies in the focal plane; and a speck behind.
WALL = """
camera: {{type: thin_lens, look_from: [0, 0, 0], look_at: [0, 0, -1], focal_length: 200 mm, focus_distance: inf,
         sensor: {{{sensor}}}, f_number: {f_number}, shutter: {shutter} s, {camera}}}
film: {{width: {width}, height: {height}, {film}}}
render: {{spp: 16, max_depth: 1}}
environment: {{type: constant, radiance: {radiance}}}
objects: [{{type: sphere, center: [0, 0, 9], radius: 0.001}}]
"""


PLAIN = {"sensor": "format: full_frame", "f_number": 8.0, "shutter": 1 / 125, "film": "", "radiance": "2"}


def wall(camera="iso: 100", width=WIDTH, height=HEIGHT, **keys):
    return build(WALL.format(camera=camera, width=width, height=height, **{**PLAIN, **keys}), "wall.yaml")


def taken(scene, **settings):
    return render(scene, threads=2, **settings)


def exposed(radiance, f_number, seconds, iso):
    """The value on the axis, by the irradiance behind an ideal lens, E = pi L / (4 N^2), and ISO 12232."""
    return 179.0 * math.pi * radiance / (4.0 * f_number**2) * seconds * iso / 78.0


def centre(image):
    height, width, _ = image.radiance.shape
    return float(image.radiance[height // 2 - 1 : height // 2 + 1, width // 2 - 1 : width // 2 + 1].mean())


@pytest.mark.parametrize(
    ("f_number", "seconds", "iso"), [(8.0, 1 / 125, 100.0), (2.8, 1 / 1000, 100.0), (16.0, 1 / 30, 400.0)]
)
def test_a_photograph_has_the_values_of_the_standard(f_number, seconds, iso):
    image = taken(wall(f"iso: {iso}", f_number=f_number, shutter=seconds)).image
    assert centre(image) == pytest.approx(exposed(2.0, f_number, seconds, iso), rel=2e-3)


def test_speed_is_a_factor_and_nothing_else():
    one, other = taken(wall("iso: 100")).image, taken(wall("iso: 800, exposure_compensation: 1")).image
    np.testing.assert_array_equal(other.radiance, 16.0 * one.radiance)
    np.testing.assert_array_equal(other.variance, 256.0 * one.variance)


def test_auto_finds_the_speed_and_says_it():
    result = taken(wall("exposure: {metering: mean}"))
    image, setting = result.image, result.setting
    assert luminance(image.radiance).mean() == pytest.approx(10.0 / 78.0, rel=1e-12)
    # The mean of a picture of 200 mm is darker than its middle by cos^4 of 3 degrees.
    assert setting.iso == pytest.approx(100.0 * 10.0 / 78.0 / exposed(2.0, 8.0, 1 / 125, 100.0), rel=0.01)
    assert image.settings["iso"] == result.stats.exposure["iso"] == setting.iso
    assert image.settings["metering"] == "mean"
    assert image.settings["shutter_seconds"] == 1 / 125
    assert image.settings["ev100"] == pytest.approx(math.log2(64.0 * 125.0 / (setting.iso / 100.0)))
    np.testing.assert_array_equal(taken(wall(f"iso: {setting.iso!r}")).image.radiance, image.radiance)


def test_noise_is_that_of_the_photons_in_a_rendered_picture():
    # 300 x 200 pixels of three channels: the variance is known to 0.33 %.
    clean = taken(wall("iso: 1600", shutter=1 / 4000, width=300, height=200)).image
    noisy = taken(
        wall("iso: 1600", shutter=1 / 4000, sensor="format: full_frame, noise: true", width=300, height=200)
    ).image
    electrons = 50_000.0 * 100.0 / 1600.0
    expected = clean.radiance.mean() / electrons + (3.0 / electrons) ** 2 + 1.0 / 12.0 / (2**14 - 1 - 512) ** 2
    noise = noisy.radiance - clean.radiance
    assert noise.var() == pytest.approx(expected, rel=0.03)
    assert abs(noise.mean()) < 5.0 * math.sqrt(expected / noise.size)
    assert noisy.variance.mean() == pytest.approx(noise.var(), rel=0.03)
    assert float(noisy.settings["sensor_electrons"]) == electrons


def test_without_noise_a_sensor_does_nothing():
    plain = taken(wall()).image
    off = taken(wall(sensor="format: full_frame, noise: false, full_well: 100, read_noise: 50, seed: 3")).image
    np.testing.assert_array_equal(off.radiance, plain.radiance)
    assert off.settings == plain.settings


def test_what_happens_after_the_light_is_gathered_compiles_nothing():
    kernel = numba.typeof(pack(wall()).scene)
    noise = wall(sensor="format: full_frame, noise: true, bayer: rggb")
    shown = wall("exposure: auto, exposure_compensation: 2", film="white_balance: auto, tone_curve: filmic")
    assert numba.typeof(pack(noise).scene) == numba.typeof(pack(shown).scene) == kernel


def test_a_crop_is_the_crop_of_the_noisy_whole():
    scene = wall("iso: 3200", sensor="format: full_frame, noise: true", shutter=1 / 4000)
    whole, part = taken(scene).image, taken(scene, crop=(11, 7, 40, 20)).image
    np.testing.assert_array_equal(part.radiance, whole.radiance[7:20, 11:40])


def test_seeds_of_render_and_sensor():
    scene = wall("iso: 3200", sensor="format: full_frame, noise: true", shutter=1 / 4000)
    own = wall("iso: 3200", sensor="format: full_frame, noise: true, seed: 1", shutter=1 / 4000)
    np.testing.assert_array_equal(taken(scene, seed=1).image.radiance, taken(scene, seed=1).image.radiance)
    assert (taken(scene, seed=1).image.radiance != taken(scene, seed=2).image.radiance).mean() > 0.9
    # Other light by a hair, of another seed of the render, is the same number of electrons almost everywhere.
    assert (taken(own, seed=2).image.radiance != taken(scene, seed=1).image.radiance).mean() < 0.05


def test_light_of_a_temperature_is_balanced_to_neutral():
    # CIE 15: illuminant A in linear Rec. 709, from its chromaticity (0.44758, 0.40745).
    warm = "[1.8422, 0.8266, 0.2338]"
    image = taken(wall(film="white_balance: 2856 K", radiance=warm)).image
    mean = image.radiance.mean(axis=(0, 1))
    np.testing.assert_allclose(mean / mean[1], 1.0, rtol=0.01)
    plain = taken(wall(radiance=warm)).image
    assert luminance(mean) == pytest.approx(luminance(plain.radiance.mean(axis=(0, 1))), rel=1e-3)


PINHOLE = """\
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40%s}
film: {width: 24, height: 16%s}
render: {spp: 16, max_depth: 1}
environment: {type: constant, radiance: %s}
objects: [{type: sphere, center: [0, 0, 9], radius: 0.001}]
"""


def test_radiance_may_be_balanced_and_shown_on_film_too():
    plain, shown, balanced = (
        taken(build(PINHOLE % ("", film, "[0.6, 0.5, 0.2]"), "a.yaml"), aovs=["direct", "depth", "variance"]).image
        for film in ("", ", tone_curve: filmic", ", white_balance: [2, 1, 4]")
    )
    np.testing.assert_array_equal(shown.radiance, plain.radiance)
    np.testing.assert_array_equal(shown.display(), srgb.to_uint8(Filmic(4.0)(plain.radiance)))
    np.testing.assert_array_equal(balanced.radiance, plain.radiance * [2.0, 1.0, 4.0])
    np.testing.assert_allclose(balanced.layers["direct"], balanced.radiance, rtol=1e-12)
    np.testing.assert_array_equal(balanced.layers["variance"], balanced.variance)
    np.testing.assert_array_equal(balanced.layers["depth"], np.inf)


def process(exposure=None, sensor=None, white_balance=None, tone_curve=LINEAR):
    return DevelopSettings(exposure, sensor, white_balance, tone_curve)


def camera(iso=100.0, metering=None):
    return ExposureSettings(1 / 125, iso, 0.0, metering, 2.8, True)


def light(value=0.5):
    radiance = np.full((HEIGHT, WIDTH, 3), value)
    return Image(radiance, 0.01 * radiance, 4, {"spp": 4}, {"direct": 0.4 * radiance, "depth": radiance})


def test_a_process_of_nothing_hands_the_picture_on():
    image = light()
    result, setting = develop_photograph(image, process(), WHOLE, 0, {})
    assert result is image
    assert setting is None


def test_a_balance_that_was_measured_is_told_from_one_that_was_asked_for():
    measured, given = (
        develop_photograph(light(), process(white_balance=balance), WHOLE, 0, {})[0].settings
        for balance in ("auto", (1.0, 1.0, 1.0))
    )
    assert measured["white_balance_gains"] == given["white_balance_gains"] == "1.0,1.0,1.0"
    assert measured["white_balance"] == "auto"
    assert "white_balance" not in given


def test_layers_of_light_are_exposed_as_the_picture_is():
    image = light()
    units = {"direct": "W/(m2 sr)", "depth": "m"}
    result, setting = develop_photograph(image, process(camera(), white_balance=(2.0, 1.0, 0.5)), WHOLE, 0, units)
    gain = setting.gain * np.array([2.0, 1.0, 0.5])
    np.testing.assert_allclose(result.layers["direct"], 0.4 * result.radiance, rtol=1e-12)
    np.testing.assert_allclose(result.radiance, gain * image.radiance, rtol=1e-12)
    np.testing.assert_allclose(result.variance, gain**2 * image.variance, rtol=1e-12)
    np.testing.assert_array_equal(result.layers["depth"], image.layers["depth"])
    assert result.settings["spp"] == 4


def test_what_saturates_the_sensor_stays_white_when_it_is_balanced():
    image = light(100.0)
    result, _ = develop_photograph(image, process(camera(3200.0), SensorSpec(noise=True), 3200.0), WHOLE, 0, {})
    assert np.unique(result.radiance).size == 1
    assert (result.radiance > 1.0).all()
    assert (result.display() == 255).all()


@pytest.mark.parametrize("bayer", [None, "rggb"])
@pytest.mark.parametrize("balance", [None, 3200.0])
@pytest.mark.parametrize("compensation", [0.0, -1.0])
def test_what_is_overexposed_at_the_base_iso_is_even(compensation, balance, bayer):
    # All wells are full, whatever reading them adds: one value, which is half as large when made a stop darker.
    if bayer is not None:
        pytest.importorskip("cv2")
    sensor = SensorSpec(noise=True, bayer=bayer)
    exposure = camera()._replace(compensation=compensation)
    result, _ = develop_photograph(light(100.0), process(exposure, sensor, balance), WHOLE, 0, {})
    assert np.unique(result.radiance).size == 1
    white = 1.0 if balance is None else balance_gains(balance, light().radiance).max()
    np.testing.assert_allclose(result.radiance, 2.0**compensation * white, rtol=1e-12)


def test_metering_chooses_no_speed_below_the_base_iso_of_a_sensor():
    sensor = SensorSpec(noise=True, base_iso=200.0)
    exposure = camera(None, Metering("mean", 0.5, 0.5, 1.0))._replace(base_iso=sensor.base_iso)
    result, setting = develop_photograph(light(100.0), process(exposure, sensor), WHOLE, 0, {})
    assert setting.iso == 200.0
    assert setting.summary().endswith("as slow as the sensor is")
    assert (result.display() == 255).all()
    dim, chosen = develop_photograph(light(0.01), process(exposure, sensor), WHOLE, 0, {})
    assert chosen.iso > 200.0
    assert luminance(dim.radiance).mean() == pytest.approx(10.0 / 78.0, rel=0.01)


def test_a_sensor_is_shown_on_film_with_its_saturation_as_white():
    curve = ToneCurveSpec(type="filmic")
    result, _ = develop_photograph(light(100.0), process(camera(), SensorSpec(noise=True), None, curve), WHOLE, 0, {})
    assert (result.display() >= 254).all()
    assert result.settings["tone_curve"] == "filmic, white 1, in display files only"


def test_a_denoised_picture_has_no_variance_to_begin_with():
    image = Image(light().radiance)
    result, _ = develop_photograph(image, process(camera(), SensorSpec(noise=True)), WHOLE, 0, {})
    assert result.variance is None


def test_what_cannot_be_developed_is_refused_before_the_work():
    spot = process(camera(None, Metering("spot", 0.0, 0.0, 0.1)))
    with pytest.raises(InputError, match="outside of the crop"):
        check_develop_settings(spot, CropWindow(100, 100, 50, 50), 20, 20)
    pytest.importorskip("cv2")
    with pytest.raises(InputError, match="at least 3 x 3 pixels"):
        check_develop_settings(process(camera(), SensorSpec(noise=True, bayer="rggb")), CropWindow(2, 2, 0, 0), 2, 2)


def test_the_command_line_says_what_was_metered(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    film = ", tone_curve: {type: filmic, white: 2}"
    Path("a.yaml").write_text(PINHOLE % (", exposure: auto", film, 20))
    assert main(["render", "a.yaml", "-o", "a.exr", "-o", "a.png", "--stats", "a.json"]) == 0
    err = capsys.readouterr().err
    assert "exposure: light times 0.00641, metered by center_weighted\n" in err
    # Linear files hold exposed values, 10 / 78 of saturation; the other is shown as grey.
    np.testing.assert_allclose(load("a.exr"), 10.0 / 78.0, rtol=1e-6)
    np.testing.assert_array_equal(np.rint(255.0 * srgb.encode(load("a.png"))), 118)
    _, settings = load_layers("a.exr")
    assert settings["metering"] == "center_weighted"
    assert float(settings["exposure_gain"]) == pytest.approx(10.0 / 78.0 / 20.0)
    assert "in display files only" in settings["tone_curve"]
    stats = json.loads(Path("a.json").read_text())
    assert stats["exposure"]["exposure_gain"] == pytest.approx(10.0 / 78.0 / 20.0)
    assert set(stats["seconds"]) == {"load", "pack", "build", "compile", "render", "develop", "total"}

    assert main(["render", "a.yaml", "-q", "-o", "b.npy"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["render", "a.yaml", "-o", "b.npy", "--crop", "2,2,8,8"]) == 0
    assert "metered by center_weighted in the crop\n" in capsys.readouterr().err
