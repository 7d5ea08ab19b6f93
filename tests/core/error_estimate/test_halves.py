"""Error estimates of one unbroken run, against the errors of pictures whose truth is known."""

import math

import numpy as np
import pytest

from raytracer.core.error_estimate.halves import ErrorEstimator
from raytracer.core.error_estimate.metric import error_weights, relative_error
from raytracer.core.error_estimate.rates import ConvergenceRate, sampler_exponent
from raytracer.core.sampling.sobol import Sobol
from tests.core.sampling.draws import draw_2d

SEEDS = 40


def _windows(width, height, edge=16):
    return [
        (left, top, min(left + edge, width), min(top + edge, height))
        for top in range(0, height, edge)
        for left in range(0, width, edge)
    ]


def _estimator_of(means, windows, counts, steepest=1.5):
    """The tally of a render, from means (height, width, 3) at 8, 16, 32, ... of the whole picture."""
    estimator = ErrorEstimator(windows, steepest)
    for n, mean in sorted(means.items()):
        for i, (left, top, right, bottom) in enumerate(windows):
            if n <= counts[i]:
                estimator.record(i, mean[top:bottom, left:right], n)
    estimator.set_scale(means[8])
    return estimator


def _scene(width, height):
    """A picture with edges, gradients and dark parts: (height, width, 3)."""
    y, x = np.mgrid[:height, :width]
    picture = 0.3 + 0.2 * np.sin(x / 9.0) + 0.9 * ((x - 20) ** 2 + (y - 14) ** 2 < 90) + 0.01 * y
    picture *= np.where(x > 0.7 * width, 0.02, 1.0)
    return picture[..., None] * [1.0, 0.8, 0.5]


def _independent_means(rng, truth, spp, sample):
    """Running means of independent samples at powers of two."""
    total, means = np.zeros_like(truth), {}
    for n in range(1, spp + 1):
        total += truth * sample(rng, truth.shape[:2])[..., None]
        if n >= 8 and n & (n - 1) == 0:
            means[n] = total / n
    return means


# Of the mean 1: mild, and one sample in 50 with a variance of 49.
SAMPLES = {
    "even": lambda rng, shape: rng.exponential(1.0, shape),
    "rare": lambda rng, shape: 50.0 * (rng.random(shape) < 0.02),
}


def _covered(truth, windows, spp, draw, reference, steepest=1.5):
    """How many intervals hold the error of the picture, the estimates, and the errors, by seed."""
    held, counts = [], [spp] * len(windows)
    for seed in range(SEEDS):
        means = draw(seed)
        estimate = _estimator_of(means, windows, counts, steepest).estimate(counts)
        error = relative_error(means[spp], reference)
        held.append((estimate.low <= error <= estimate.high, estimate.error, error, estimate.exponent))
    covered, estimates, errors, exponents = np.transpose(held)
    return covered.sum(), estimates, errors, exponents


@pytest.mark.parametrize(("sample", "spp"), [("even", 64), ("rare", 512)])
def test_the_interval_of_independent_samples_holds_the_error_of_the_picture(sample, spp):
    truth = _scene(48, 40)

    def draw(seed):
        return _independent_means(np.random.default_rng(seed), truth, spp, SAMPLES[sample])

    steepest = sampler_exponent("independent")
    covered, estimates, errors, exponents = _covered(truth, _windows(48, 40), spp, draw, truth, steepest)
    assert covered >= 34
    assert np.mean(estimates) == pytest.approx(np.mean(errors), rel=0.05)
    assert (exponents == 1.0).all()


def _places(truth):
    """Where each pixel has its edge: (pixels, 1)."""
    return np.linspace(0.1, 0.9, truth[..., 0].size)[:, None]


def _sobol_means(seed, truth, spp, integrand):
    """Running means of the sampler of renders, each pixel with an edge of its own in two dimensions, and noise."""
    height, width, _ = truth.shape
    points = draw_2d(Sobol(seed), height * width, spp, dimensions=(0,) if integrand is _edge else (0, 1, 2))
    values = integrand(points, _places(truth))
    running = np.cumsum(values, axis=1) / np.arange(1, spp + 1)
    return {n: truth * running[:, n - 1].reshape(height, width, 1) for n in 2 ** np.arange(3, 12) if n <= spp}


def _edge_and_noise(points, place):
    """An edge in the first pair, worth N^-1.5; and a product over all pairs, of the mean 1, worth 1/N."""
    product = np.prod(1.0 + 0.9 * np.sign(points[..., 0] - 0.5) * np.sign(points[..., 1] - 0.5), axis=2)
    return _edge(points, place) + product - 0.1


def _edge(points, place):
    """Of u, v: 0.5, and 1 more where u + v / 2 > p."""
    return 0.5 + (points[:, :, 0, 0] + 0.5 * points[:, :, 0, 1] > place)


def _mean_of_edge(place):
    """1.5 less the area below the edge: p^2 where it is a triangle, which p > 1/2 makes a trapezoid, p - 1/4."""
    return 1.5 - np.where(place < 0.5, place**2, place - 0.25)


@pytest.mark.parametrize(("integrand", "spp"), [(_edge_and_noise, 32), (_edge_and_noise, 128), (_edge, 128)])
def test_the_interval_of_the_sampler_of_renders_holds_the_error_of_the_picture(integrand, spp):
    truth = _scene(40, 24)
    mean = _mean_of_edge(_places(truth)) + (0.9 if integrand is _edge_and_noise else 0.0)
    reference = truth * mean.reshape(24, 40, 1)
    covered, estimates, errors, _ = _covered(
        truth, _windows(40, 24), spp, lambda seed: _sobol_means(seed, truth, spp, integrand), reference
    )
    assert covered >= 34
    # What noise in the weights may do grows with the error.
    expected = np.sqrt(np.mean(np.square(errors)))
    assert np.mean(estimates) == pytest.approx(expected, rel=0.05 + 0.25 * expected)


def test_the_slope_of_a_smooth_picture_is_found():
    truth, windows = _scene(40, 24), _windows(40, 24)
    estimator = _estimator_of(_sobol_means(1, truth, 256, _edge), windows, [256] * len(windows))
    assert estimator.estimate([256] * len(windows)).exponent > 1.35


def _means_by_rate(rng, truth, rate, spp):
    """Means at powers of two with independent normal errors, exchangeable in halves, of a given rate.

    Going down: A = T + a difference of the variance s2(n/2) - s2(n) that T does not feel.
    """
    mean = truth * (1.0 + math.sqrt(rate.mse(spp)) * rng.standard_normal(truth.shape[:2])[..., None])
    means, n = {spp: mean}, spp
    while n > 8:
        mean = mean + truth * math.sqrt(rate.half_difference(n)) * rng.standard_normal(truth.shape[:2])[..., None]
        n //= 2
        means[n] = mean
    return dict(sorted(means.items()))


def test_tiles_may_stop_anywhere():
    """Left tiles with 24 samples, others with 64 and 200: what the prefix formula makes of 16, 64 and 128."""
    rate = ConvergenceRate(0.05, 0.4)
    truth, windows = np.ones((96, 96, 3)), _windows(96, 96)
    counts = np.array([24 if w[0] < 32 else 64 if w[0] < 64 else 200 for w in windows])
    estimates = []
    for seed in range(10):
        means = _means_by_rate(np.random.default_rng(seed), truth, rate, 128)
        estimates.append(_estimator_of(means, windows, counts).estimate(counts))
    # Weights of an even picture: 1 / 1.01.
    last = [rate.mse(64), rate.mse(128) * rate.mse(200) / rate.mse(128)]
    # With a single difference the steep term is taken to be a quarter.
    guess = ConvergenceRate(0.75 * 16, 0.25 * 64.0)
    first = rate.half_difference(16) / guess.half_difference(16) * guess.mse(24)
    expected = math.sqrt((first + sum(last)) / 3.0 / 1.01)
    assert np.mean([t.error for t in estimates]) == pytest.approx(expected, rel=0.03)
    assert estimates[0].samples == pytest.approx((24 + 64 + 200) / 3)
    truly = math.sqrt((rate.mse(24) + sum(last)) / 3.0 / 1.01)
    assert all(t.low <= truly <= t.high for t in estimates)


def test_errors_by_tile_add_up_to_the_whole():
    rng = np.random.default_rng(3)
    truth = _scene(40, 40)
    windows = _windows(40, 40)
    counts = np.full(len(windows), 64)
    estimator = _estimator_of(_means_by_rate(rng, truth, ConvergenceRate(0.05, 0.4), 64), windows, counts)
    pixels = np.array([(right - left) * (bottom - top) for left, top, right, bottom in windows])
    by_tile = estimator.tile_mse(counts)
    total = math.sqrt(np.sum(by_tile * pixels) / pixels.sum())
    assert estimator.estimate(counts).error == pytest.approx(total, rel=1e-9)

    # And each is that of its tile, within the noise of 64 to 256 pixels.
    w = error_weights(truth) * truth**2 * ConvergenceRate(0.05, 0.4).mse(64)
    expected = [w[top:bottom, left:right].mean() for left, top, right, bottom in windows]
    np.testing.assert_allclose(by_tile, expected, rtol=0.6)
    counts[4] = 8
    assert np.isnan(estimator.tile_mse(counts)).tolist() == (counts == 8).tolist()


@pytest.mark.parametrize("exposure", [1e-12, 1e-5, 1e9])
def test_the_estimate_does_not_depend_on_exposure(exposure):
    truth, windows = _scene(40, 24), _windows(40, 24)
    counts = [32] * len(windows)
    plain, exposed = (
        _estimator_of(
            _means_by_rate(np.random.default_rng(4), k * truth, ConvergenceRate(0.2, 0.4), 32), windows, counts
        ).estimate(counts)
        for k in (1.0, exposure)
    )
    np.testing.assert_allclose(exposed, plain, rtol=1e-4)


def test_bright_errors_do_not_hide_in_their_own_weights():
    """One sample in 500 carries all light: at 128 samples, errors of 200 %, of which the noisy weights see a third."""
    truth, windows = np.ones((64, 64, 3)), _windows(64, 64)
    rng = np.random.default_rng(11)
    means = _independent_means(rng, truth, 128, lambda rng, shape: 500.0 * (rng.random(shape) < 1 / 500))
    error = relative_error(means[128], truth)
    hidden = math.sqrt(np.mean(error_weights(means[128]) * (means[64] - means[128]) ** 2))
    estimate = _estimator_of(means, windows, [128] * 16, steepest=1.0).estimate([128] * 16)
    assert hidden < 0.4 * error
    assert estimate.error == pytest.approx(error, rel=0.35)


def test_few_samples_tell_nothing():
    truth, windows = _scene(40, 24), _windows(40, 24)
    estimator = _estimator_of(
        _means_by_rate(np.random.default_rng(5), truth, ConvergenceRate(0.2, 0.4), 32), windows, [32] * len(windows)
    )
    assert estimator.estimate([32] * 5 + [15]) is None
    assert estimator.estimate([32] * 6) is not None
    # Not recorded yet.
    assert estimator.estimate([32] * 5 + [64]) is None
    assert ErrorEstimator(windows).estimate([32] * 6) is None


def test_a_level_left_out_is_lost_and_no_other():
    truth, windows = _scene(16, 16), _windows(16, 16)
    means = _means_by_rate(np.random.default_rng(6), truth, ConvergenceRate(0.2, 0.4), 128)
    whole = _estimator_of(means, windows, [128])
    del means[16]
    gap = _estimator_of(means | {12: truth, 24: truth}, windows, [128])
    assert gap.estimate([128]).error == pytest.approx(whole.estimate([128]).error, rel=0.3)
    assert gap.estimate([128]) is not None
    late = ErrorEstimator(windows)
    late.set_scale(truth)
    late.record(0, means[64], 64)
    assert late.estimate([64]) is None
    late.record(0, means[128], 128)
    assert late.estimate([128]) is not None


def test_pictures_without_noise_have_no_error_black_ones_too():
    windows = _windows(16, 16)
    black = {n: np.zeros((16, 16, 3)) for n in (8, 16, 32)}
    for same in (black, dict.fromkeys((8, 16, 32), _scene(16, 16))):
        assert _estimator_of(same, windows, [32]).estimate([32])[:3] == (0.0, 0.0, 0.0)

    # Light that comes late: unknown until the scale is settled anew.
    lit = black | {32: np.eye(16)[..., None] * np.ones(3)}
    estimator = _estimator_of(lit, windows, [32])
    assert estimator.estimate([32]) is None
    estimator.set_scale(lit[32])
    assert estimator.estimate([32]).error > 0.5
    assert estimator.estimate([32]).high > estimator.estimate([32]).error


def test_values_beyond_all_measure_leave_the_error_unknown():
    wild = {8: np.ones((16, 16, 3)), 16: np.full((16, 16, 3), 1e80)}
    assert _estimator_of(wild, _windows(16, 16), [16]).estimate([16]) is None


def test_the_first_half_of_a_stratified_run_tells_an_upper_bound():
    """Strata in random order: the mean of half of them has more noise than the net of half as many."""
    rng = np.random.default_rng(12)
    truth, windows = np.ones((32, 32, 3)), _windows(32, 32)
    spp = 64
    strata = np.argsort(rng.random((32 * 32, spp)), axis=1)
    values = 0.5 + (strata + rng.random(strata.shape)) / spp
    means = {n: truth * values[:, :n].mean(axis=1).reshape(32, 32, 1) for n in (8, 16, 32, 64)}
    assert _estimator_of(means, windows, [spp] * 4).estimate([spp] * 4).error > relative_error(means[spp], truth)


def test_a_single_pixel_tells_little():
    # The square of one normal difference is chi-square of one degree.
    rng = np.random.default_rng(5)
    samples = 1.0 + 0.5 * rng.standard_normal(64)
    estimator = ErrorEstimator([(0, 0, 1, 1)], sampler_exponent("independent"))
    for n in (8, 16, 32, 64):
        estimator.record(0, np.full((1, 1, 3), samples[:n].mean()), n)
    estimator.set_scale(np.full((1, 1, 3), samples.mean()))
    estimate = estimator.estimate([64])
    assert estimate is not None
    assert estimate.high > 2.0 * estimate.error > 4.0 * estimate.low
