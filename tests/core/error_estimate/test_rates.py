"""Convergence rates: partial nets, fits, and predictions."""

import math

import numpy as np
import pytest

from raytracer.core.error_estimate.rates import (
    ConvergenceRate,
    PowerLaw,
    fit_differences,
    fit_power_law,
    fit_rate,
    prefix_mse,
    sampler_exponent,
    split_run_penalty,
)
from raytracer.core.sampling.sobol import Sobol
from tests.core.sampling.draws import draw_1d, draw_2d

# Relative standard error of a variance of so many normal means: sqrt(2 / RUNS) is 0.6 %.
RUNS = 50_000
WITHIN = 0.04

RATES = [
    ConvergenceRate(3.0, 0.0),
    ConvergenceRate(0.0, 2.0),
    ConvergenceRate(0.4, 1.1),
    ConvergenceRate(0.4, 0.2, 4.0),
    ConvergenceRate(0.0, 0.0, 1.0),
]


def _prefix_variances(values):
    """Variance of the mean of the first 1, 2, 3, ... of `values` (runs, n), around the integral 0."""
    means = np.cumsum(values, axis=1) / np.arange(1, values.shape[1] + 1)
    return np.mean(means**2, axis=0)


def test_independent_samples_lie_on_one_line():
    for n in (1, 2, 3, 7, 100, 1023):
        assert prefix_mse(lambda k: 5.0 / 2**k, n) == pytest.approx(5.0 / n, rel=1e-12)


def test_prefix_of_three_of_a_linear_integrand():
    # One of each of 2^k strata of width 2^-k, at an even place in it: Var of the mean of u is 1 / (12 * 8^k).  Of
    # three, a whole net of two and one of the half net of two: 4/9 /96 + 1/9 /12 + 4/9 (2/768 - 1/96).
    s2 = [1.0 / (12.0 * 8.0**k) for k in range(8)]
    assert prefix_mse(lambda k: s2[k], 3) == pytest.approx(4 / 864 + 1 / 108 + (4 / 9) * (2 / 768 - 1 / 96), rel=1e-12)

    measured = _prefix_variances(draw_1d(Sobol(3), RUNS, 16)[:, :, 0] - 0.5)
    expected = [prefix_mse(lambda k: s2[k], n) for n in range(1, 17)]
    np.testing.assert_allclose(measured, expected, rtol=WITHIN)


def _edge(u, v):
    return (u + 0.6 * v > 0.7).astype(float)


def _smooth(u, v):
    return np.sin(3.0 * u + 1.0) * np.exp(v)


@pytest.fixture(scope="module")
def points():
    """Points of the sampler of renders: (runs, 64, 2)."""
    return draw_2d(Sobol(5), RUNS, 64)[:, :, 0]


@pytest.mark.parametrize("integrand", [_edge, _smooth, lambda u, v: _edge(u, v) + _smooth(v, u)])
def test_prefixes_of_the_sampler_of_renders(integrand, points):
    values = integrand(points[..., 0], points[..., 1])
    grid = (np.arange(2048) + 0.5) / 2048
    measured = _prefix_variances(values - integrand(grid[:, None], grid[None]).mean())
    s2 = measured[2 ** np.arange(7) - 1]
    for n in (3, 5, 6, 7, 11, 12, 24, 31, 33, 40, 48, 56, 63):
        assert measured[n - 1] == pytest.approx(prefix_mse(lambda k: s2[k], n), rel=WITHIN)


def test_halves_of_the_sampler_of_renders_differ_by_what_the_error_drops_by(points):
    values = _edge(points[..., 0], points[..., 1]) + points[..., 0]
    values -= values.mean()
    for n in (4, 16, 64):
        half, whole = values[:, : n // 2].mean(axis=1), values[:, :n].mean(axis=1)
        drop = np.mean(half**2) - np.mean(whole**2)
        assert np.mean((half - whole) ** 2) == pytest.approx(drop, rel=WITHIN)


@pytest.mark.parametrize("rate", RATES)
def test_a_rate_between_powers_of_two_is_the_prefix_formula(rate):
    for n in (1, 2, 3, 5, 96, 1000):
        assert rate.mse(n) == pytest.approx(prefix_mse(lambda k: rate.mse_at_power(2.0**k), n), rel=1e-12)
    assert rate.mse(64) == pytest.approx(rate.mse_at_power(64), rel=1e-12)
    assert rate.mse(5.25) == pytest.approx(
        rate.linear / 5.25 + 0.75 * (rate.mse(5) - rate.linear / 5) + 0.25 * (rate.mse(6) - rate.linear / 6)
    )


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("mse", [0.5, 0.1, 0.0123, 1e-3])
def test_the_samples_reach_the_error_and_fewer_do_not(rate, mse):
    n = rate.samples(mse)
    brute = next(n for n in range(1, 20_000) if rate.mse(n) <= mse)
    assert n <= brute + 1e-9
    assert n > brute - max(1.0, brute / 256)


def test_no_number_of_samples_reaches_nothing():
    assert ConvergenceRate(1.0, 1.0).samples(0.0) == math.inf
    assert ConvergenceRate(1.0, 1.0).samples(-1.0) == math.inf
    assert ConvergenceRate(0.0, 0.0).samples(1e-9) == 1.0
    assert ConvergenceRate(1.0, 0.0).samples(1e-30) == pytest.approx(1e30)
    assert PowerLaw(1.0, 1.2).samples(0.0) == math.inf
    assert PowerLaw(1.0, 1.2).samples(2.0) == 1.0


def test_slopes_lie_between_those_of_the_terms():
    assert ConvergenceRate(2.0, 0.0).exponent_at(64) == 1.0
    assert ConvergenceRate(0.0, 2.0).exponent_at(64) == 1.5
    assert ConvergenceRate(0.0, 0.0).exponent_at(64) == 1.0
    mixed, h = ConvergenceRate(0.4, 1.1, 2.0), 1e-5
    local = -math.log(mixed.mse_at_power(64 * (1 + h)) / mixed.mse_at_power(64)) / math.log1p(h)
    assert mixed.exponent_at(64) == pytest.approx(local, rel=1e-4)


@pytest.mark.parametrize("rate", RATES)
def test_fits_find_the_rate_that_made_the_points(rate):
    spp = 2.0 ** np.arange(4, 10)
    fitted = fit_rate(spp, [rate.mse_at_power(n) for n in spp])
    np.testing.assert_allclose(fitted, rate, atol=1e-9)
    fitted = fit_differences(spp, [rate.half_difference(n) for n in spp])
    np.testing.assert_allclose(fitted, rate, atol=1e-9)


def test_few_points_decide_on_few_terms_and_no_error_on_none():
    rate = ConvergenceRate(0.4, 1.1)
    np.testing.assert_allclose(fit_rate([16, 64, 256], [rate.mse_at_power(n) for n in (16, 64, 256)]), rate, atol=1e-9)
    np.testing.assert_allclose(fit_rate([16], [0.5]), (8.0, 0.0, 0.0))
    assert fit_rate([16, 64], [0.0, 0.0]) == ConvergenceRate(0.0, 0.0)
    assert fit_power_law([16, 64], [0.0, 0.0]) == PowerLaw(0.0, 1.0)


def test_fits_are_the_library_s_nonnegative_least_squares():
    from scipy.optimize import nnls

    rng = np.random.default_rng(2)
    spp = 2.0 ** np.arange(4, 9)
    for _ in range(50):
        mse = rng.uniform(0.5, 1.5, spp.size) * spp ** -rng.uniform(0.7, 2.3)
        terms = np.stack([1 / spp, spp**-1.5, spp**-2.0], axis=1) * (np.sqrt(spp) / mse)[:, None]
        size = np.linalg.norm(terms, axis=0)
        np.testing.assert_allclose(fit_rate(spp, mse), nnls(terms / size, np.sqrt(spp))[0] / size, rtol=1e-6, atol=1e-9)


def test_independent_samples_have_no_steep_term():
    assert sampler_exponent("independent") == 1.0
    assert sampler_exponent("sobol") == sampler_exponent("stratified") == 1.5
    noisy = fit_rate([16, 64, 256], [1 / 15, 1 / 66, 1 / 270], steepest=1.0)
    assert noisy.steep == noisy.early == 0.0
    assert noisy.linear == pytest.approx(1.0, rel=0.06)


@pytest.mark.parametrize("unknown", [math.nan, math.inf, -1e-9])
def test_of_an_error_that_is_unknown_nothing_is_foretold(unknown):
    for fit in (fit_rate([16, 64, 256], [0.1, unknown, 0.01]), fit_power_law([16, 64, 256], [0.1, unknown, 0.01])):
        assert np.isnan(fit).all()
        assert math.isnan(fit.mse(100.0))
        assert math.isnan(fit.samples(1e-4))
    unknown_rate = fit_rate([16], [unknown])
    assert math.isnan(unknown_rate.exponent_at(16))
    assert math.isnan(split_run_penalty(unknown_rate, 4, 256))


def test_levels_before_rare_light_came_tell_nothing():
    spp, mse = [16, 64, 256, 1024], [0.0, 0.04, 0.01, 0.0025]
    assert fit_rate(spp, mse).samples(1e-4) == pytest.approx(0.04 * 64 / 1e-4)
    assert fit_rate(spp, mse) == pytest.approx(fit_rate(spp[1:], mse[1:]))
    assert fit_power_law(spp, mse) == pytest.approx((0.04 * 64, 1.0))
    # One that is left has the slope -1.
    assert fit_rate([16, 64], [0.0, 0.5]) == pytest.approx((32.0, 0.0, 0.0))


@pytest.mark.parametrize("rate", RATES)
def test_errors_that_take_more_samples_than_floats_hold_are_out_of_reach(rate):
    assert rate.samples(0.0) == math.inf
    for mse in (5e-324, 1e-310):
        # The last term that falls decides: 1e-310 takes 1e310 independent samples, but 1e155 of N^-2.
        slope = 1.0 if rate.linear else 1.5 if rate.steep else 2.0
        reachable = slope > 1.0
        assert math.isfinite(rate.samples(mse)) is reachable
        if reachable:
            assert math.log(rate.samples(mse)) == pytest.approx(-math.log(mse) / slope, rel=0.01)
    assert rate.mse(math.inf) == 0.0


@pytest.mark.parametrize(("made_by", "fitted"), [(0.8, 1.0), (1.0, 1.0), (1.23, 1.23), (1.5, 1.5), (2.4, 1.5)])
def test_power_laws_are_clamped(made_by, fitted):
    spp = np.array([16.0, 64.0, 256.0])
    law = fit_power_law(spp, 3.0 * spp**-made_by)
    assert law.exponent == pytest.approx(fitted, rel=1e-12)
    # The clamped line goes through the middle of the points.
    assert law.mse(64.0) == pytest.approx(3.0 * 64.0**-made_by, rel=1e-12)
    assert law.samples(law.mse(100.0)) == pytest.approx(100.0)
    assert fit_power_law(spp, spp**-1.4, steepest=1.0).exponent == 1.0


@pytest.mark.parametrize(
    ("rate", "penalty"), [((2.0, 0.0), 1.0), ((0.0, 2.0), 2.0), ((0.0, 0.0, 2.0), 4.0), ((0, 0), 1.0)]
)
def test_halving_is_the_power_of_the_replicates(rate, penalty):
    assert split_run_penalty(ConvergenceRate(*rate), 4, 256) == pytest.approx(penalty, rel=1e-12)


def test_the_mean_of_replicates_of_the_sampler_of_renders_is_worse_by_the_halving():
    points = draw_2d(Sobol(7), 20_000, 256)[:, :, 0]
    values = _edge(points[..., 0], points[..., 1])
    values -= values.mean()
    spp = 2 ** np.arange(3, 9)
    mse = np.array([np.mean(values[:, :n].mean(axis=1) ** 2) for n in spp])
    of_four = np.mean(values[:, :64].mean(axis=1).reshape(-1, 4).mean(axis=1) ** 2)
    assert of_four / mse[-1] == pytest.approx(split_run_penalty(fit_rate(spp, mse), 4, 64), rel=0.06)
    assert of_four / mse[-1] > 1.7
