"""Denoising: less error, and a mark that says how that came about."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from raytracer.film import Image
from raytracer.film.denoise import denoise, require_denoiser
from raytracer.util.errors import InputError

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
