"""Denoising: less error, and a mark that says how that came about."""

import sys
from dataclasses import replace

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from raytracer.film import Image, load_layers
from raytracer.film.denoise import denoise, require_denoiser
from raytracer.rendering.render import render
from raytracer.util.errors import InputError
from tests.small_scenes import scene

SIZE = (36, 48)


@pytest.fixture
def image():
    # A step of light, with the noise of exponentially distributed samples.
    rng = np.random.default_rng(3)
    clean = np.where(np.arange(SIZE[1])[:, None] < 24, 0.5, 2.0) * np.ones((*SIZE, 3))
    return Image(clean * rng.exponential(1.0, (*SIZE, 3)), np.ones((*SIZE, 3)), 1, {"spp": 1}, {"depth": np.ones(SIZE)})


def guides():
    albedo = np.where(np.arange(SIZE[1])[:, None] < 24, 0.2, 0.8) * np.ones((*SIZE, 3))
    return albedo, np.broadcast_to([0.0, 0.0, 1.0], (*SIZE, 3))


def test_error_falls_and_the_noisy_picture_is_kept(image):
    pytest.importorskip("pyoidn")
    clean = np.where(np.arange(SIZE[1])[:, None] < 24, 0.5, 2.0)
    kept = image.radiance.copy()
    result = denoise(image, *guides())
    before, after = (np.mean((picture.radiance - clean) ** 2) for picture in (image, result))
    assert after < 0.1 * before
    np.testing.assert_array_equal(image.radiance, kept)
    np.testing.assert_array_equal(result.layers["noisy"], kept)
    assert set(result.layers) == {"depth", "noisy"}
    # It is the variance of the noisy picture, and not of this one.
    assert result.variance is None
    assert result.settings["denoised"].startswith("oidn 2.")
    assert "biased" in str(result.settings["denoised"])
    # The guides tell where the step is, so that it stays between two columns.
    assert result.radiance[:, 23].mean() < 0.8
    assert result.radiance[:, 24].mean() > 1.6


def test_the_result_does_not_depend_on_threads(image):
    pytest.importorskip("pyoidn")
    one, three = (denoise(image, *guides(), threads=threads).radiance for threads in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_what_is_not_finite_or_too_bright_does_no_harm(image):
    pytest.importorskip("pyoidn")
    radiance = image.radiance.copy()
    radiance[3, 3] = 1e300
    radiance[5, 5] = -1.0
    assert np.isfinite(denoise(replace(image, radiance=radiance), *guides()).radiance).all()


def test_a_missing_extra_is_told_with_the_command_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(InputError, match=r"not installed: pip install 'raytracer\[denoise\]'"):
        require_denoiser()


def test_a_library_that_does_not_load_is_told(monkeypatch):
    class Broken:
        OIDN_DEVICE_TYPE_CPU = 1

        def Device(self, kind):  # noqa: N802
            raise OSError("cannot load library")

    monkeypatch.setitem(sys.modules, "pyoidn", Broken())
    with pytest.raises(InputError, match="cannot be loaded: cannot load library"):
        require_denoiser()


BALL = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 0.3}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: [0.8, 0.3, 0.2]}}
  - {type: quad, corner: [-9, -1, 9], edges: [[18, 0, 0], [0, 0, -18]], material: {type: lambertian, albedo: 0.6}}
  - {type: sphere, center: [2, 2, 1], radius: 0.3, material: {type: emitter, radiance: 20}}
"""


@pytest.mark.slow
def test_a_render_is_nearer_to_its_reference_and_says_that_it_is_denoised(tmp_path):
    pytest.importorskip("pyoidn")
    settings = {"width": 64, "height": 48, "sampler": "independent"}
    few = scene(BALL, spp=4, **settings)
    reference = render(scene(BALL, spp=2048, **settings), seed=9, threads=2).image.radiance
    noisy = render(few, seed=1, threads=2, aovs=["depth"]).image
    result = render(few, seed=1, threads=2, aovs=["depth"], denoise=True)
    clean = result.image
    before, after = (np.mean((picture - reference) ** 2) for picture in (noisy.radiance, clean.radiance))
    assert after < 0.3 * before
    assert "denoise" in result.stats.seconds
    # The picture as rendered, with its bits, and only the layers asked for.
    np.testing.assert_array_equal(clean.layers["noisy"], noisy.radiance)
    assert set(clean.layers) == {"depth", "noisy"}

    for name in ("a.exr", "a.png", "a.hdr"):
        clean.save(tmp_path / name)
    layers, found = load_layers(tmp_path / "a.exr")
    assert "biased" in found["denoised"]
    np.testing.assert_array_equal(layers["noisy"], noisy.radiance.astype(np.float32))
    assert "variance" not in layers
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert {"noisy.R", "noisy.G", "noisy.B", "depth.Z"} <= set(file.channels())
    with PIL.Image.open(tmp_path / "a.png") as picture:
        assert "biased" in picture.text["denoised"]
    assert b"rt.denoised=oidn" in (tmp_path / "a.hdr").read_bytes()
    noisy.save(tmp_path / "b.exr")
    assert "denoised" not in load_layers(tmp_path / "b.exr")[1]
