"""The metrics are their formulas, and what independent implementations make of the same images."""

import functools
import math
import time

import numpy as np
import pytest
from skimage import metrics as peer

from raytracer.analysis import compare
from raytracer.analysis.compare.image_pair import map_row_bands
from raytracer.analysis.compare.metrics import exposures, flip_package, require_extra, sums
from raytracer.util.errors import InputError

# Higher than a band of rows, and with a last band that is not full.
SHAPE = (147, 38, 3)


@pytest.fixture(scope="module")
def display():
    rng = np.random.default_rng(1)
    b = rng.random(SHAPE)
    return np.clip(b + 0.1 * rng.standard_normal(SHAPE), 0.0, 1.0), b


@pytest.fixture(scope="module")
def linear():
    """Two random images in linear light over six decades."""
    rng = np.random.default_rng(2)
    b = rng.lognormal(-1.0, 2.0, SHAPE)
    return b * rng.lognormal(0.0, 0.3, SHAPE), b


def test_metrics_are_their_formulas():
    a, b = np.zeros((1, 2, 3)), np.zeros((1, 2, 3))
    a[0, 0], b[0, 0] = 0.5, 0.3
    assert compare.mae(a, b) == pytest.approx(0.2 / 2)
    assert compare.mse(a, b) == pytest.approx(0.04 / 2)
    assert compare.rmse(a, b) == pytest.approx(math.sqrt(0.02))
    assert compare.relmse(a, b) == pytest.approx(0.04 / (0.09 + 0.01) / 2)
    assert compare.mrse(a, b) == pytest.approx((0.2 / 0.31) ** 2 / 2)
    assert compare.psnr(a, b) == pytest.approx(-10 * math.log10(0.02))
    assert compare.psnr(a, b, peak=10) == pytest.approx(20 - 10 * math.log10(0.02))
    assert compare.psnr(a, a) == math.inf
    # Relative errors are of the reference; one that would make it infinite is left out.
    bright, dim = np.full((2, 2, 3), 1.0), np.full((2, 2, 3), 0.5)
    assert compare.relmse(bright, dim) == pytest.approx(0.25 / 0.26)
    assert compare.relmse(dim, bright) == pytest.approx(0.25 / 1.01)
    assert compare.mrse(bright, dim) == pytest.approx(0.25 / 0.51**2)
    a, b = np.full((1, 4, 3), 1.0), np.full((1, 4, 3), 1.0)
    a[0, 0], b[0, 1] = 1.5, -0.01
    assert compare.mrse(a, b) == pytest.approx((0.5 / 1.01) ** 2 / 4)


def test_metrics_equal_those_of_scikit_image(display, linear):
    for a, b in (display, linear):
        assert compare.mse(a, b) == pytest.approx(peer.mean_squared_error(b, a), rel=1e-12)
        assert compare.psnr(a, b) == pytest.approx(peer.peak_signal_noise_ratio(b, a, data_range=1.0), rel=1e-12)
        # Its normalised root mean square error, times what it divides by.
        root = peer.normalized_root_mse(b, a) * math.sqrt(np.mean(b**2))
        assert compare.rmse(a, b) == pytest.approx(root, rel=1e-12)
    a, b = display
    gaussian = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    expected = peer.structural_similarity(b, a, channel_axis=2, data_range=1.0, **gaussian)
    assert compare.ssim(a, b) == pytest.approx(expected, abs=1e-12)
    # Sums do not depend on where bands of rows end, and what is not a number is not hidden in one.
    assert sums(a, b) == pytest.approx(sums(a[::-1], b[::-1]), rel=1e-13)
    broken = a.copy()
    broken[100, 3, 1] = np.nan
    assert all(math.isnan(metric(broken, b)) for metric in (compare.mae, compare.mse, compare.relmse, compare.mrse))


@pytest.mark.parametrize("size", [(1, 1), (3, 40), (11, 11), (40, 50)])
def test_flip_equals_its_authors(size, display, linear):
    for (a, b), domain, kind in ((display, "display", "LDR"), (linear, "linear", "HDR")):
        test, reference = (np.ascontiguousarray(image[: size[0], : size[1]], np.float32) for image in (a, b))
        found, mean, _ = flip_package().evaluate(reference, test, kind, applyMagma=False)
        assert compare.flip(test, reference, domain) == pytest.approx(mean, abs=1e-6)
        np.testing.assert_array_equal(compare.flip_map(test, reference, domain), found[..., 0])


def test_flip_tells_colours_apart_within_what_a_display_shows(display):
    # Largest where green meets blue, of which the paper says what its scale ends with; none where nothing differs.
    green, blue = np.zeros((9, 9, 3)), np.zeros((9, 9, 3))
    green[..., 1], blue[..., 2] = 1.0, 1.0
    assert compare.flip(green, blue, "display") > 0.95
    assert compare.flip(green, green, "display") == 0.0
    a, b = display
    assert compare.flip(2 * a, b - 1, "display") == compare.flip(np.minimum(2 * a, 1), np.maximum(b - 1, 0), "display")


linear_flip = functools.partial(compare.flip, domain="linear")


@pytest.mark.parametrize(
    ("metric", "a", "b", "words"),
    [
        (compare.mse, np.ones((4, 5)), np.ones((4, 5)), r"\(height, width, 3\)"),
        (compare.ssim, np.ones((4, 5, 3)), np.ones((5, 4, 3)), "differ in size: 5 x 4 and 4 x 5 pixels"),
        (compare.ssim, np.ones((10, 40, 3)), np.ones((10, 40, 3)), "11 x 11 pixels or more, got 40 x 10"),
        # Before the package ends the process.
        (linear_flip, np.ones((4, 4, 3)), np.zeros((4, 4, 3)), "black"),
        (linear_flip, np.ones((4, 4, 3)), np.full((4, 4, 3), 1e-30), "black"),
        (linear_flip, np.ones((4, 4, 3)), np.full((4, 4, 3), -1.0), "black"),
    ],
)
def test_images_that_cannot_be_measured(metric, a, b, words):
    with pytest.raises(InputError, match=words):
        metric(a, b)


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setattr("raytracer.analysis.compare.metrics.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"flip needs flip-evaluator.*pip install 'raytracer\[compare\]'"):
        require_extra("flip")
    with pytest.raises(InputError, match="ssim needs scikit-image"):
        compare.ssim(np.ones((12, 12, 3)), np.ones((12, 12, 3)))


@pytest.mark.parametrize("scale", [2.4e-7, 1.0, 1e37])
def test_flip_of_any_brightness_that_is_not_black_is_measured(scale, linear):
    a, b = (image[:8, :8] for image in linear)
    scale /= (b @ [0.2126, 0.7152, 0.0722]).max()
    assert 0.0 < compare.flip(a * scale, b * scale, "linear") <= 1.0


def test_exposures_are_as_many_as_the_package_takes(linear):
    rng = np.random.default_rng(3)
    for scale in (0.1, 1.0, 3.0):
        reference = rng.lognormal(0.0, scale, (9, 15, 3))
        _, _, used = flip_package().evaluate(
            reference.astype(np.float32), reference.astype(np.float32), "HDR", applyMagma=False
        )
        assert exposures(reference) == used["numExposures"]


def test_bands_are_kept_in_order_and_cover_everything():
    def slow_first(top, bottom):
        time.sleep(0.02 if top == 0 else 0.0)
        return top, bottom

    assert map_row_bands(slow_first, 10, 4) == [(0, 4), (4, 8), (8, 10)]
