"""Bootstrap intervals: how often they hold the truth, and that they are the library's."""

import math

import numpy as np
import pytest

from raytracer.core.error_estimate.intervals import (
    UNKNOWN,
    Interval,
    bootstrap_intervals,
    map_interval,
    median_interval,
    ratio_interval,
    ratio_of_sums,
    sqrt_interval,
)
from raytracer.core.error_estimate.metric import mse_by_tile
from raytracer.core.error_estimate.rates import fit_rate


def test_ratios_of_sums_of_uneven_tiles_hold_the_truth():
    """Tiles with lognormal errors and lognormal sizes, whose ratio of expectations is known."""
    covered = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        size = rng.lognormal(0.0, 0.5, 40)
        error = size * rng.lognormal(0.0, 1.0, 40)
        interval = ratio_of_sums(error, size, seed)
        covered += interval.low <= math.exp(0.5) <= interval.high
    # 95 % less what the bootstrap loses to heavy tails; 200 seeds spread by 3.
    assert 174 <= covered <= 198


def test_the_interval_is_the_library_s():
    from scipy.stats import bootstrap

    rng = np.random.default_rng(4)
    a, b = rng.lognormal(0.0, 1.0, 40), rng.lognormal(0.0, 0.3, 40)
    mine = ratio_of_sums(a, b, seed=1)
    library = bootstrap(
        (a, b),
        lambda x, y, axis: x.sum(axis=axis) / y.sum(axis=axis),
        paired=True,
        n_resamples=20_000,
        rng=np.random.default_rng(2),
    ).confidence_interval
    width = library.high - library.low
    assert mine.value == pytest.approx(a.sum() / b.sum(), rel=1e-12)
    assert mine.low == pytest.approx(library.low, abs=0.05 * width)
    assert mine.high == pytest.approx(library.high, abs=0.05 * width)


def test_all_quantities_come_from_the_same_resamples():
    rng = np.random.default_rng(6)
    columns = rng.random((30, 2))
    once, twice = bootstrap_intervals(columns, lambda sums: np.stack([sums[:, 0], 2.0 * sums[:, 0]], axis=1), seed=5)
    np.testing.assert_allclose(twice, 2.0 * np.array(once))
    assert once == bootstrap_intervals(columns, lambda sums: sums[:, 0], seed=5)[0]
    assert once != bootstrap_intervals(columns, lambda sums: sums[:, 0], seed=6)[0]


def test_intervals_may_be_infinite():
    columns = np.arange(1.0, 21.0)
    everywhere, above = bootstrap_intervals(
        columns[:, None],
        lambda sums: np.stack([np.full(len(sums), np.inf), np.where(sums[:, 0] > 210.0, np.inf, sums[:, 0])], axis=1),
    )
    assert everywhere == (math.inf, math.inf, math.inf)
    assert above.value == 210.0
    assert above.low < 210.0
    assert above.high == math.inf


def test_little_data():
    assert ratio_of_sums([2.0], [4.0])[0] == 0.5
    assert math.isnan(ratio_of_sums([2.0], [4.0]).low)
    assert tuple(ratio_of_sums([2.0, 2.0], [4.0, 4.0])) == (0.5, 0.5, 0.5)
    assert all(map(math.isnan, ratio_of_sums([0.0, 0.0], [0.0, 0.0])))
    assert all(map(math.isnan, median_interval([])))
    assert tuple(median_interval([3.0])) == (3.0, 3.0, 3.0)
    assert all(map(math.isnan, UNKNOWN))


@pytest.mark.parametrize("rounds", [9, 15])
def test_medians_hold_the_truth_whatever_the_tails(rounds):
    """Times of rounds on a machine that is sometimes busy: Cauchy's distribution, whose median is 1."""
    covered = 0
    for seed in range(200):
        times = 1.0 + 0.01 * np.random.default_rng(seed).standard_cauchy(rounds)
        interval = median_interval(times, seed)
        covered += interval.low <= 1.0 <= interval.high
    assert 180 <= covered <= 200


def test_paired_ratios_do_not_feel_what_the_machine_does():
    rng = np.random.default_rng(9)
    machine = np.exp(np.cumsum(rng.normal(0.0, 0.3, 9)))
    a, b = (machine * rng.normal(time, 0.005, 9) for time in (1.1, 1.0))
    interval = ratio_interval(a, b)
    assert interval.low > 1.08
    assert interval.high < 1.12
    same = ratio_interval(b * rng.normal(1.0, 0.005, 9), b)
    assert same.low <= 1.0 <= same.high


def test_functions_of_intervals():
    assert map_interval(Interval(2.0, 1.0, 4.0), lambda x: 1.0 / x) == (0.5, 0.25, 1.0)
    assert sqrt_interval(Interval(4.0, -1.0, 9.0)) == (2.0, 0.0, 3.0)
    assert all(map(math.isnan, sqrt_interval(UNKNOWN)))


def test_the_whole_chain_holds_the_truth():
    """Four replicates at 16, 64 and 256, a fit, the samples to 1 %: 34 or more of 40 intervals hold the true number."""
    tiles, pixels = 50, 16
    tile = np.repeat(np.arange(tiles), pixels)
    held_error, held_samples = 0, 0
    # E sigma^2 over tiles: 0.36 exp(2 * 0.25).
    truth = 0.36 * math.exp(0.5)
    n = next(n for n in range(600, 2000) if truth * (0.5 / n + 2.0 / n**1.5) <= 0.02**2)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        sigma = 0.6 * np.repeat(rng.lognormal(0.0, 0.5, tiles), pixels)[:, None] * np.ones(3)
        columns = [np.full(tiles, float(pixels))]
        for spp in (16, 64, 256):
            shape = (4, tiles * pixels, 3)
            unit = rng.exponential(1.0, shape) - 1.0
            s2 = sigma**2 * (0.5 / spp + 0.5 * 4.0 / spp**1.5)
            columns.append(mse_by_tile(np.sqrt(s2) * unit, np.ones(shape[1:]), tile).sums)

        def quantities(sums):
            mse = sums[:, 1:] / sums[:, :1]
            samples = [fit_rate([16, 64, 256], row).samples(0.02**2) for row in mse]
            return np.stack([np.sqrt(mse[:, 2]), samples], axis=1)

        error, samples = bootstrap_intervals(np.stack(columns, axis=1), quantities, seed=seed, resamples=200)
        held_error += error.low <= math.sqrt(truth * (0.5 / 256 + 2.0 / 4096)) <= error.high
        held_samples += samples.low <= n <= samples.high
    assert held_error >= 34
    assert held_samples >= 34
