"""The error measure, and error and bias by it from replicates alone, against what was planted."""

import math

import numpy as np
import pytest

from raytracer.analysis.compare import relmse
from raytracer.core.error_estimate.intervals import ratio_of_sums, sqrt_interval
from raytracer.core.error_estimate.metric import (
    FLOOR,
    brightness_by_tile,
    error_weights,
    mean_scale,
    mse_by_tile,
    relative_error,
    squared_bias_by_tile,
    worst_pixel_share,
)

# ---- The measure: relative, the same for any exposure, and defined for black pictures

RNG = np.random.default_rng(1)
PICTURE = RNG.random((12, 9, 3)) ** 3
NOISY = PICTURE + 0.05 * RNG.standard_normal(PICTURE.shape)


def test_the_measure_is_the_root_of_relmse_of_pictures_over_the_mean_of_the_reference():
    m = PICTURE.mean()
    assert relative_error(NOISY, PICTURE) == pytest.approx(math.sqrt(relmse(NOISY / m, PICTURE / m)), rel=1e-12)


@pytest.mark.parametrize("exposure", [1e-5, 3.0, 1e6])
def test_the_measure_does_not_depend_on_exposure(exposure):
    assert relative_error(exposure * NOISY, exposure * PICTURE) == pytest.approx(relative_error(NOISY, PICTURE))


def test_an_even_excess_is_its_own_error_but_for_the_floor():
    grey = np.full((4, 4, 3), 0.3)
    assert relative_error(1.02 * grey, grey) == pytest.approx(0.02 / math.sqrt(1.0 + FLOOR**2), rel=1e-12)


def test_black_pictures_have_no_error_and_others_are_infinitely_far_from_black():
    black = np.zeros((2, 2, 3))
    assert relative_error(black, black) == 0.0
    assert relative_error(PICTURE[:2, :2], black) == math.inf
    assert not error_weights(black).any()


def test_a_black_pixel_counts_as_a_tenth_of_the_mean():
    picture = np.array([[[0.0, 0.0, 0.0], [2.0, 2.0, 2.0]]])
    np.testing.assert_allclose(error_weights(picture)[0, :, 0], [100.0, 1.0 / 4.01])


def test_the_scale_may_come_from_elsewhere():
    np.testing.assert_allclose(error_weights(PICTURE, mean_scale(PICTURE)), error_weights(PICTURE))
    np.testing.assert_allclose(error_weights(PICTURE, 2.0), 1.0 / (PICTURE**2 + 0.04))
    assert mean_scale(-PICTURE) == mean_scale(PICTURE) > 0.0


# ---- Replicates

TILES, PIXELS = 60, 16
TILE = np.repeat(np.arange(TILES), PIXELS)


def _picture(rng):
    """A picture whose tiles differ in brightness: (P, 3)."""
    return np.repeat(rng.lognormal(0.0, 0.8, TILES), PIXELS)[:, None] * rng.uniform(0.5, 1.5, (TILES * PIXELS, 3))


def _noise(rng, shape, heavy):
    """Noise of the variance 1 and the mean 0; heavy: one sample in 50 carries all of it."""
    if not heavy:
        return rng.standard_normal(shape)
    p = 0.02
    return (rng.random(shape) < p) / np.sqrt(p * (1 - p)) - np.sqrt(p / (1 - p))


@pytest.mark.parametrize("heavy", [False, True])
def test_the_mse_is_that_of_one_replicate(heavy):
    rng = np.random.default_rng(3)
    truth = _picture(rng)
    renders = truth + 0.1 * truth * _noise(rng, (4, *truth.shape), heavy)
    w = error_weights(truth)
    expected = np.mean(w * (0.1 * truth) ** 2)
    sums = mse_by_tile(renders, w, TILE)
    assert sums.mean == pytest.approx(expected, rel=0.1)
    assert sums.mean == pytest.approx(np.mean([relative_error(a, truth) ** 2 for a in renders]), rel=0.1)
    np.testing.assert_array_equal(sums.pixels, np.full(TILES, PIXELS))


def test_sums_are_over_pixels_of_the_mean_over_channels():
    renders = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], [[2.0, 0.0, 0.0], [1.0, 1.0, 4.0]]])
    sums = mse_by_tile(renders, np.ones((2, 3)), [1, 0])
    np.testing.assert_allclose(sums.sums, [4.5 / 3.0, 2.0 / 3.0])
    np.testing.assert_allclose(sums.pixels, [1.0, 1.0])
    assert sums.mean == pytest.approx(6.5 / 6.0)


@pytest.mark.parametrize("heavy", [False, True])
def test_a_planted_bias_far_below_the_noise_is_found(heavy):
    """2 % too bright, of noise of 15 %, from 9 replicates: within its interval in 34 or more of 40 seeds."""
    detected, resolved = 0, 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        truth = _picture(np.random.default_rng(100))
        r, a = (truth + 0.15 * truth * _noise(rng, (9, *truth.shape), heavy) for _ in range(2))
        w = error_weights(truth)
        bias = sqrt_interval(ratio_of_sums(*squared_bias_by_tile(a + 0.02 * truth, r, w, TILE), seed=seed))
        planted = relative_error(1.02 * truth, truth)
        detected += bias.low <= planted <= bias.high
        resolved += bias.low > 0.0
    assert detected >= 34
    assert resolved <= 36  # 2 % against 15 % / sqrt(9 * 2880 / 2) of the mean square: some 2 standard deviations


def test_common_random_numbers_sharpen_the_bias():
    rng = np.random.default_rng(5)
    truth = _picture(rng)
    r = truth * (1.0 + 0.3 * rng.standard_normal((9, *truth.shape)))
    bias = sqrt_interval(ratio_of_sums(*squared_bias_by_tile(1.02 * r, r, error_weights(truth), TILE)))
    planted = relative_error(1.02 * truth, truth)
    assert bias.low > 0.0
    assert bias.low <= planted <= bias.high
    assert bias.value == pytest.approx(planted, rel=0.01)


def test_equal_arms_have_no_bias():
    """Equal renders have no bias; others of the same scene one whose interval holds 0 in nearly all seeds."""
    resolved = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        truth = _picture(rng)
        r, a = (truth * (1.0 + 0.3 * rng.standard_normal((9, *truth.shape))) for _ in range(2))
        resolved += ratio_of_sums(*squared_bias_by_tile(a, r, error_weights(truth), TILE), seed=seed).low > 0.0
        assert tuple(ratio_of_sums(*squared_bias_by_tile(r, r, error_weights(truth), TILE))) == (0.0, 0.0, 0.0)
    assert resolved <= 4


def test_brightness():
    rng = np.random.default_rng(7)
    truth = _picture(rng)
    r = truth * (1.0 + 0.1 * rng.standard_normal((9, *truth.shape)))
    darker = ratio_of_sums(*brightness_by_tile(0.9 * r[::-1], r, TILE))
    assert darker.value == pytest.approx(0.9)
    assert darker.high - darker.low < 1e-9
    noisier = ratio_of_sums(*brightness_by_tile(0.9 * r * (1.0 + 0.1 * rng.standard_normal(r.shape)), r, TILE))
    assert noisier.low <= 0.9 <= noisier.high
    assert 1e-4 < noisier.high - noisier.low < 0.01


def test_the_share_of_the_worst_pixels():
    sigma = np.ones(5000)
    sigma[:5] = 100.0
    renders = np.stack([sigma, -sigma])[:, :, None] * np.ones(3)
    assert worst_pixel_share(renders, np.ones((5000, 3))) == pytest.approx(50_000 / (50_000 + 4995))
    assert worst_pixel_share(np.abs(renders) / sigma[:, None] * [[[1]], [[-1]]], np.ones((5000, 3))) == pytest.approx(
        1e-3
    )
    assert worst_pixel_share(np.zeros((2, 10, 3)), np.ones((10, 3))) == 0.0


def test_pixels_may_stand_for_many():
    rng = np.random.default_rng(8)
    sigma, stands = rng.lognormal(0.0, 1.0, 400), rng.integers(1, 6, 400)
    stands[np.argmax(sigma)] = 1
    few = np.stack([sigma, -sigma])[:, :, None] * np.ones(3)
    many = np.repeat(few, stands, axis=1)
    told = worst_pixel_share(few, np.ones((400, 3)), 1.0 / stands.sum(), stands)
    assert told == pytest.approx(worst_pixel_share(many, np.ones((many.shape[1], 3)), 1.0 / stands.sum()))


def test_one_replicate_tells_nothing_of_its_noise():
    one = np.ones((1, 4, 3))
    with pytest.raises(ValueError, match="do not tell their noise"):
        mse_by_tile(one, one[0], [0, 0, 0, 0])
    with pytest.raises(ValueError, match="do not tell their noise"):
        squared_bias_by_tile(one, one, one[0], [0, 0, 0, 0])
