"""Random numbers: range, uniformity, independence, stratification, and the speed at which errors fall."""

import itertools
import math

import numpy as np
import pytest
from scipy.stats import norm, qmc

from raytracer.core.sampling import SAMPLERS
from raytracer.core.sampling.independent import Independent
from raytracer.core.sampling.sobol import _SOBOL, Sobol, _seeds, _shuffled, nested_scramble
from raytracer.core.sampling.stratified import Stratified, permute
from tests.core.sampling.draws import draw_1d, draw_2d, keys
from tests.statistics import chi2_counts, chi2_test, sidak
from tests.vectorised import rows, vectorised

ALL = [Independent(7), Stratified.of(7, 16), Stratified.of(7, 13), Sobol(7)]
NAMES = ["independent", "stratified16", "stratified13", "sobol"]
each_sampler = pytest.mark.parametrize("sampler", ALL, ids=NAMES)

VARIANCE_OF_PRODUCT = 7.0 / 144.0
"""The variance of u v for independent uniform numbers: E[u^2] E[v^2] - E[u]^2 E[v]^2 = 1/9 - 1/16."""


# ---- What every sampler does


@each_sampler
def test_numbers_are_uniform_in_the_unit_interval(sampler):
    # From different pixels, since those of one pixel are more even than chance.
    everywhere = keys(sampler, 400, 400).ravel()
    for index in (0, 5, 70000):
        for draw, cells in ((draw_1d, [256]), (draw_2d, [16, 16])):
            values = draw(sampler, everywhere, 1, first=index).reshape(-1, len(cells))
            assert values.max() < 1.0
            chi2_test(values, lambda x: np.ones(len(x)), [(0.0, 1.0)] * len(cells), cells, tests=24)


@each_sampler
@pytest.mark.parametrize(("draw", "dimensions"), [(draw_1d, 64), (draw_2d, 32)])
def test_dimensions_are_uncorrelated(sampler, draw, dimensions):
    # Hard case 47: E[u_i u_j] = 1/4 for all pairs of 64 numbers.  Stratification within a pixel only makes the estimate
    # better, so the bound is that of independent numbers.
    products, count = np.zeros((64, 64)), 4096 * 16
    # Some pixels at a time, whose numbers stay in the processor's cache.
    for pixels in np.split(keys(sampler, 4096, 1)[0], 32):
        numbers = draw(sampler, pixels, 16, range(dimensions)).reshape(-1, 64)
        assert numbers.min() >= 0.0
        assert numbers.max() < 1.0
        products += numbers.T @ numbers / count
    z = (products[np.triu_indices(64, 1)] - 0.25) / np.sqrt(VARIANCE_OF_PRODUCT / count)
    assert np.abs(z).max() < norm.isf(0.5 * sidak(1e-3, len(z)))
    assert np.sqrt((z**2).mean()) < 1.1


@each_sampler
def test_two_dimensions_of_one_pixel_fill_the_square(sampler):
    # If all dimensions went through their strata in one order, half of the 4 x 4 cells would stay empty.
    numbers = draw_1d(sampler, 20000, 16, (3, 11)).reshape(-1, 2)
    observed, _, _ = np.histogram2d(*numbers.T, bins=8, range=[(0.0, 1.0)] * 2)
    # Strata make the counts of rows and columns exact, so the statistic is below its bound more often than not.
    chi2_counts(observed, np.full((8, 8), len(numbers) / 64.0), tests=4)


@each_sampler
def test_neighbouring_pixels_and_samples_are_uncorrelated(sampler):
    # The same number of pixels up to 8 apart, of the next sample, and of seeds 7 and 8.
    tile = draw_1d(sampler, keys(sampler, 256, 256).ravel(), 2, (5,)).reshape(256, 256, 2) - 0.5
    z = []
    for dx, dy in itertools.product((0, 1, 2, 4, 8), repeat=2):
        if dx or dy:
            products = tile[: 256 - dy, : 256 - dx, 0] * tile[dy:, dx:, 0]
            z.append(products.mean() * np.sqrt(products.size) * 12.0)
    other_seed = draw_1d(sampler._replace(seed=8), keys(sampler._replace(seed=8), 256, 256).ravel(), 1, (5,))
    z.append((tile[..., 0] * (other_seed.reshape(256, 256) - 0.5)).mean() * 256.0 * 12.0)
    assert np.abs(z).max() < norm.isf(0.5 * sidak(1e-3, len(z)))


@pytest.mark.parametrize("name", sorted(SAMPLERS))
def test_a_number_depends_on_what_it_is_asked_for_and_on_nothing_else(name):
    sampler = SAMPLERS[name](5, 16)
    whole = draw_2d(sampler, keys(sampler, 8, 8).ravel(), 16, range(4)).reshape(8, 8, 16, 4, 2)
    crop = draw_2d(sampler, keys(sampler, 2, 2, left=5, top=3).ravel(), 6, (3,), first=9).reshape(2, 2, 6, 2)
    assert np.array_equal(crop, whole[3:5, 5:7, 9:15, 3])


# ---- Sobol


def _natural_points(count):
    """Sobol's points as the sampler's table makes them, unscrambled, in natural order: float64 (count, 2)."""
    points = np.empty((count, 2))
    for index in range(count):
        word = int(f"{index:016b}"[::-1], 2)
        words = int(_SOBOL[word >> 8]) | int(_SOBOL[word & 255]) << 8
        words ^= (words >> 8) & 0x00FF0000
        for axis in range(2):
            digits = (words >> (16 * axis)) & 0xFFFF
            points[index, axis] = int(f"{digits:016b}"[::-1], 2) / 65536.0
    return points


def test_the_points_before_scrambling_are_sobols():
    # scipy goes through them in the order of the Gray code (Antonov, Saleev 1979).
    n = 4096
    gray = np.arange(n) ^ (np.arange(n) >> 1)
    peer = qmc.Sobol(2, scramble=False, bits=16).random(n)
    assert np.array_equal(_natural_points(n)[gray], peer)


def _is_net(points, m):
    """Return True if 2^m points put one in each elementary interval of area 2^-m."""
    for k in range(m + 1):
        cell = np.floor(points[:, 0] * 2**k) * 2 ** (m - k) + np.floor(points[:, 1] * 2 ** (m - k))
        if len(np.unique(cell)) != 2**m:
            return False
    return True


@pytest.mark.parametrize("m", [*range(11), 16])
def test_each_power_of_two_samples_are_a_net(m):
    sampler = Sobol(11)
    # Aligned blocks, which is what makes it a sequence, of different pixels and dimensions.
    for first in (0, 2**m, 5 * 2**m, 65536, 65536 * 3 + 2**m) if m < 16 else (0,):
        points = draw_2d(sampler, 3, 2**m, (0, 1, 9), first=first)
        for pixel, dimension in itertools.product(range(3), range(3)):
            assert _is_net(points[pixel, :, dimension], m)
        numbers = draw_1d(sampler, 3, 2**m, (0, 1, 9), first=first)
        strata = np.sort(np.floor(numbers * 2**m), axis=1)
        assert np.array_equal(strata, np.broadcast_to(np.arange(2.0**m)[None, :, None], strata.shape))


def test_blocks_of_65536_samples_are_independent():
    sampler = Sobol(3)
    first = draw_2d(sampler, 1024, 16)[:, :, 0].reshape(-1, 2)
    second = draw_2d(sampler, 1024, 16, first=65536)[:, :, 0].reshape(-1, 2)
    z = ((first * second).mean(axis=0) - 0.25) / np.sqrt(VARIANCE_OF_PRODUCT / len(first))
    assert np.abs(z).max() < norm.isf(0.5 * sidak(1e-3, 2))


def scrambled(words, seeds):
    """`nested_scramble` of words by seeds, broadcast against one another."""
    words, seeds = np.broadcast_arrays(np.asarray(words, np.uint64), np.asarray(seeds, np.uint64))
    out = vectorised(nested_scramble)(rows(words.ravel()), rows(seeds.ravel()))
    return out.astype(np.uint64).reshape(words.shape)


def test_scrambling_flips_a_digit_by_the_digits_before_it():
    # Lower bits of the result depend on no higher bit of the word.
    words, seeds = np.random.default_rng(3).integers(0, 2**32, (2, 64, 1), np.uint64)
    bits = np.arange(1, 32, dtype=np.uint64)
    bit = np.uint64(1) << bits
    changed = scrambled(words, seeds) ^ scrambled(words ^ bit, seeds)
    assert not (changed & (bit - np.uint64(1))).any()
    assert (changed & bit == bit).all()


def test_seeds_of_scrambles_have_no_bit_in_common():
    # Every bit of the three words, for dimensions d and d + 1 .. d + 5 and for the next 65536 samples: each pair of
    # bits agrees half of the time, a normal variable of n trials.
    n = 2048
    some = rows(np.random.default_rng(6).integers(0, 2**32, n, np.uint64))
    columns = []
    for index, dimension in [(0, 3), (0, 4), (0, 5), (0, 8), (65536, 3)]:
        words = np.stack(vectorised(_seeds)(some, index, dimension), axis=1).astype(np.uint64)
        bits = (words[:, :, None] >> np.arange(32, dtype=np.uint64)) & np.uint64(1)
        columns.append(1.0 - 2.0 * bits.reshape(n, 96).astype(np.float64))
    signs = np.concatenate(columns, axis=1)
    z = np.concatenate([signs.sum(axis=0), (signs.T @ signs)[np.triu_indices(signs.shape[1], 1)]]) / np.sqrt(n)
    assert np.abs(z).max() < norm.isf(0.5 * sidak(1e-3, len(z)))


def _flips(depth, seeds):
    """Signs +-1 of the flips at all places of the tree, one a prefix of `depth` digits: float64 (2^depth, seeds)."""
    nodes = np.arange(2**depth, dtype=np.uint64)[:, None]
    return 1.0 - 2.0 * (((scrambled(nodes, seeds) ^ nodes) >> np.uint64(depth)) & np.uint64(1)).astype(np.float64)


def test_flips_of_a_scramble_are_fair_and_uncorrelated():
    # The variance of a scrambled net depends on no more than this (Owen 1997, "Monte Carlo Variance of Scrambled Net
    # Quadrature").  Correlations over n seeds of independent signs have the standard deviation 1 / sqrt(n).
    seeds = np.random.default_rng(5).integers(0, 2**32, 1024, np.uint64)
    for depth in (0, 1, 2, 3, 4, 6):
        signs = _flips(depth, seeds)
        assert np.abs(signs.mean(axis=1)).max() * np.sqrt(len(seeds)) < norm.isf(0.5 * sidak(1e-4, len(signs)))
        if depth:
            pairs = np.triu_indices(len(signs), 1)
            z = (signs @ signs.T)[pairs] / np.sqrt(len(seeds))
            assert np.abs(z).max() < norm.isf(0.5 * sidak(1e-4, len(z)))


def test_the_dimensions_of_a_pair_are_scrambled_apart():
    # Whether the first digit is flipped: in one dimension as often as in the other, and independently of it.
    sampler, natural = Sobol(4), _natural_points(65536)
    pixels = keys(sampler, 64, 64).ravel()
    seeds = vectorised(_seeds)(rows(pixels), 0, 0)[0].astype(np.uint64)
    low, high = np.transpose(vectorised(_shuffled)(0, rows(seeds))).astype(np.int64).T
    points = natural[[int(f"{word:016b}"[::-1], 2) for word in high << 8 | low]]
    flips = (draw_2d(sampler, pixels, 1).reshape(-1, 2) >= 0.5) != (points >= 0.5)
    signs = 1.0 - 2.0 * np.column_stack([flips, flips[:, 0] ^ flips[:, 1]])
    assert np.abs(signs.mean(axis=0)).max() * np.sqrt(len(signs)) < norm.isf(0.5 * sidak(1e-4, 3))


# ---- Stratified


@pytest.mark.parametrize("spp", [1, 2, 3, 7, 16, 61])
def test_each_round_fills_the_strata(spp):
    sampler = Stratified.of(4, spp)
    assert 0 <= sampler.columns * sampler.rows - spp < max(sampler.columns, sampler.rows)
    for turn in (0, 1, 5):
        numbers = draw_1d(sampler, 20, spp, range(4), first=turn * spp)
        strata = np.sort(np.floor(numbers * spp), axis=1)
        assert np.array_equal(strata, np.broadcast_to(np.arange(float(spp))[None, :, None], strata.shape))
        pairs = draw_2d(sampler, 20, spp, range(4), first=turn * spp)
        column = np.floor(pairs[..., 0] * sampler.columns)
        row = np.floor(pairs[..., 1] * sampler.rows)
        cells = np.sort(row * sampler.columns + column, axis=1)
        assert (np.diff(cells, axis=1) > 0.0).all()


def test_rounds_go_through_the_strata_in_orders_of_their_own():
    # Two permutations of 16 agree at 1 place on average, 1 with a variance of 1 for a thousand pixels' mean.
    strata = np.floor(draw_1d(Stratified.of(4, 16), 1000, 48) * 16.0).reshape(1000, 3, 16)
    for one, other in ((0, 1), (0, 2), (1, 2)):
        agreeing = (strata[:, one] == strata[:, other]).sum(axis=1)
        assert abs(agreeing.mean() - 1.0) < 5.0 / np.sqrt(1000.0)


def test_a_stratified_sampler_needs_a_sample():
    with pytest.raises(ValueError, match="at least 1"):
        Stratified.of(0, 0)


def permuted(length, seeds):
    """Orders of `length` by seeds: (seeds, length)."""
    places, seeds = np.broadcast_arrays(np.arange(length), np.asarray(seeds)[:, None])
    return vectorised(permute)(rows(places.ravel()), length, rows(seeds.ravel())).astype(int).reshape(places.shape)


@pytest.mark.parametrize("length", [1, 2, 3, 5, 8, 13, 100, 257])
def test_permute_permutes(length):
    orders = permuted(length, [0, 1, 0xFFFFFFFF, 0x9E3779B9])
    np.testing.assert_array_equal(np.sort(orders, axis=1), np.tile(np.arange(length), (4, 1)))


@pytest.mark.parametrize("length", [2, 3, 4, 5])
def test_permutations_are_equally_likely(length):
    orders = permuted(length, np.random.default_rng(length).integers(0, 2**32, 12000))
    _, observed = np.unique(orders, axis=0, return_counts=True)
    count = math.factorial(length)
    assert len(observed) == count
    chi2_counts(observed, np.full(count, len(orders) / count), tests=4)


# ---- How errors fall


def _variance_slope(make, few, many, pixels):
    """Exponent p of var ~ n^p between n = few and many, for the mean of exp(x + y) over n samples a pixel."""
    logs = []
    for n in (few, many):
        points = draw_2d(make(n), pixels, n)[:, :, 0]
        logs.append(np.log2(np.exp(points.sum(axis=-1)).mean(axis=1).var(ddof=1)))
    return (logs[1] - logs[0]) / np.log2(many / few)


@pytest.mark.parametrize(
    ("make", "slope"),
    [(lambda n: Independent(21), -1.0), (lambda n: Stratified.of(21, n), -2.0), (lambda n: Sobol(21), -3.0)],
    ids=["independent", "stratified", "sobol"],
)
def test_variance_falls_as_fast_as_it_should(make, slope):
    # For a smooth integrand in two dimensions: n^-1; jittered n^-(1 + 2/2) (Cook 1986); an Owen-scrambled net
    # n^-3 log n (Owen 1997, "Scrambled Net Variance for Integrals of Smooth Functions"): between 64 and 1024 the
    # logarithm, from m = 6 to 10, adds log2(10 / 6) / 4 = 0.18.  A variance of k means has the relative deviation
    # sqrt(2 / k) if they are normal: 2^-4.5 for 1024, so the slope has log2(e) sqrt(2) 2^-4.5 / 4 = 0.023; 5 of these.
    measured = _variance_slope(make, 64, 1024, 1024)
    logarithm = 0.18 if slope == -3.0 else 0.0
    assert slope - 0.12 < measured < slope + logarithm + 0.12


def test_the_mean_is_right_for_any_number_of_samples():
    # Of x^2 y, 1/6, also for numbers of samples that fill no net or grid; 5 standard deviations of the pixels' means.
    for sampler, n in itertools.product(ALL, (1, 3, 13, 40)):
        points = draw_2d(sampler, 8192, n)[:, :, 0]
        means = (points[..., 0] ** 2 * points[..., 1]).mean(axis=1)
        assert abs(means.mean() - 1.0 / 6.0) < 5.0 * means.std(ddof=1) / np.sqrt(len(means))
