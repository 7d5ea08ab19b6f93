"""Stratified: a jittered point in each cell of a grid, in an order of its own for every dimension and pixel."""

import math
from typing import NamedTuple

import numpy as np

from raytracer.jit import kernel
from raytracer.sampling.bits import MASK32, combine, key_of, unit32
from raytracer.sampling.interface import pixel_key, sample_1d, sample_2d

U = np.uint64


class Stratified(NamedTuple):
    """A round of `spp` samples fills `spp` strata in 1D, and `columns * rows` >= spp cells in 2D.

    References: Kensler 2013, "Correlated Multi-Jittered Sampling", Pixar Technical Memo 13-01 (the permutation).
    """

    seed: int
    spp: int
    columns: int
    rows: int

    @classmethod
    def of(cls, seed: int, spp: int) -> "Stratified":
        """The sampler for `spp` samples per pixel: as square a grid as holds them."""
        columns = math.isqrt(spp - 1) + 1
        return cls(seed, spp, columns, -(-spp // columns))


@kernel
def _permute(i, length, seed):  # type: ignore[no-untyped-def]
    """Element i of a random permutation of 0 .. length - 1.

    References: Kensler 2013, listing in sec. 3 (a hash by cycle walking).
    """
    mask = U(length - 1)
    mask |= mask >> U(1)
    mask |= mask >> U(2)
    mask |= mask >> U(4)
    mask |= mask >> U(8)
    mask |= mask >> U(16)
    x = U(i)
    while True:
        # Odd multiples and downward shifts are bijections of the words below a power of two.
        for step in range(3):
            x = (x + (seed >> U(8 * step))) & mask
            x = (x * U(0x9E3779B1)) & mask
            x ^= x >> U(3)
            x = (x * ((seed >> U(16)) | U(1))) & mask
            x ^= x >> U(5)
        if x < U(length):
            return np.int64(x)


@pixel_key.register(Stratified)
def _(sampler, x, y):  # type: ignore[no-untyped-def]
    return key_of(sampler.seed, x, y)


@sample_1d.register(Stratified)
def _(sampler, key, index, dimension):  # type: ignore[no-untyped-def]
    turn, i = index // sampler.spp, index % sampler.spp
    cell = _permute(i, sampler.spp, combine(key, turn, dimension))
    jitter = unit32(combine(key, index, dimension) >> U(32))
    return min((cell + jitter) / sampler.spp, 1.0 - 2.0**-53)


@sample_2d.register(Stratified)
def _(sampler, key, index, dimension):  # type: ignore[no-untyped-def]
    turn, i = index // sampler.spp, index % sampler.spp
    cells = sampler.columns * sampler.rows
    cell = _permute(i, cells, combine(key, turn, dimension))
    jitter = combine(key, index, dimension)
    u = (cell % sampler.columns + unit32(jitter >> U(32))) / sampler.columns
    v = (cell // sampler.columns + unit32(jitter & MASK32)) / sampler.rows
    return min(u, 1.0 - 2.0**-53), min(v, 1.0 - 2.0**-53)
