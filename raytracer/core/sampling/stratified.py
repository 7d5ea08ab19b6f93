"""Stratified: a jittered point in each cell of a grid, in an order of its own for every dimension and pixel."""

import math
from typing import NamedTuple

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.hashing import (
    GOLDEN,
    MASK,
    ONE,
    ONE_MINUS_EPSILON,
    hash_pixel,
    mix32,
    philox2x32,
    unit_interval,
)
from raytracer.core.sampling.interface import pixel_key, sample_1d, sample_2d


class Stratified(NamedTuple):
    """Rounds of `spp` samples: one in each of `spp` strata in 1D, and in `spp` of `columns * rows` cells in 2D.

    Rounds are independent of each other.  Which of more than spp cells stay empty is random.

    seed : 0 or more, below 2^63.  spp, columns, rows : below 2^31.

    References: Cook 1986, "Stochastic Sampling in Computer Graphics", sec. 3 (jittering); Kensler 2013, "Correlated
    Multi-Jittered Sampling", Pixar Technical Memo 13-01, sec. 3 (an order by a hash, without a table).
    """

    seed: int
    spp: int
    columns: int
    rows: int

    @classmethod
    def of(cls, seed: int, spp: int) -> "Stratified":
        """Make the sampler for `spp` samples per pixel, with the grid nearest to a square that holds them.

        Raises
        ------
        ValueError : spp is less than 1.
        """
        if spp < 1:
            raise ValueError(f"spp must be at least 1, got {spp}")
        columns = math.isqrt(spp - 1) + 1
        return cls(seed, spp, columns, -(-spp // columns))


# Odds of the 24 permutations of 4, where they are the least even, then differ by 2 % (by 18 % after 3 rounds).
_ROUNDS = 6

_SALT = np.uint64(0x2545F491)


@kernel
def permute(i, length, seed):
    """Return element i of a pseudo-random permutation of 0 .. length - 1, length < 2^32, made by a 32-bit `seed`.

    References: Black, Rogaway 2002, "Ciphers with Arbitrary Finite Domains", sec. 3 (cycle walking).
    """
    mask = np.uint64(length) - ONE
    for shift in (1, 2, 4, 8, 16):
        mask |= mask >> np.uint64(shift)

    # Permute the smallest power of two that holds them, until the element is one of them.
    x, n = np.uint64(i), np.uint64(length)
    while True:
        k = np.uint64(seed)
        for _ in range(_ROUNDS):
            # Products with odd numbers carry bits upwards; parities of the bits above carry them downwards.
            x = ((x + (k >> np.uint64(16))) * (k | ONE)) & mask
            for shift in (1, 2, 4, 8, 16):
                x ^= x >> np.uint64(shift)
            k = mix32(k ^ _SALT)
        if x < n:
            # Each element is equally likely then, however the walk went.
            return np.int64((x + k) % n)


@kernel
def _seed_of_round(key, turn, dimension):
    return mix32(mix32(np.uint64(key) ^ ((np.uint64(dimension) * GOLDEN) & MASK)) ^ np.uint64(turn))


@pixel_key.register(Stratified)
def pixel_key_stratified(sampler, x, y):
    return hash_pixel(sampler.seed, x, y)


@sample_1d.register(Stratified)
def sample_1d_stratified(sampler, key, index, dimension):
    turn, i = index // sampler.spp, index % sampler.spp
    stratum = permute(i, sampler.spp, _seed_of_round(key, turn, dimension))
    jitter, _ = philox2x32(index, dimension, key)
    return min((stratum + unit_interval(jitter)) / sampler.spp, ONE_MINUS_EPSILON)


@sample_2d.register(Stratified)
def sample_2d_stratified(sampler, key, index, dimension):
    turn, i = index // sampler.spp, index % sampler.spp
    cell = permute(i, sampler.columns * sampler.rows, _seed_of_round(key, turn, dimension))
    jitter_1, jitter_2 = philox2x32(index, dimension, key)
    u = (cell % sampler.columns + unit_interval(jitter_1)) / sampler.columns
    v = (cell // sampler.columns + unit_interval(jitter_2)) / sampler.rows
    return min(u, ONE_MINUS_EPSILON), min(v, ONE_MINUS_EPSILON)
