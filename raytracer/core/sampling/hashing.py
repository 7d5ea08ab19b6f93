"""Hashes of 32-bit words, which all random numbers are made from.

A number is a pure function of (seed, pixel, sample index, dimension), so an image has the same bits whatever the
threads, the order of the tiles, the crop or the number of sittings.

Words of 32 bits travel in uint64: their products fit, so nothing overflows in the interpreter either, and Numba, which
makes a float of uint64 with int64, sees one type; masks cost nothing, since the compiler narrows what they bound.
"""

import numpy as np

from raytracer.core.compiler.dispatch import kernel

MASK = np.uint64(0xFFFFFFFF)
ONE = np.uint64(1)
ONE_MINUS_EPSILON = 1.0 - 2.0**-53
"""The largest float64 less than 1."""

GOLDEN = np.uint64(0x9E3779B9)
"""2^32 divided by the golden ratio: its multiples spread small integers evenly."""

_PHILOX = np.uint64(0xD256D193)
_HALF_WORD = np.uint64(0xFFFF)
_MIX_1 = np.uint64(0x21F0AAAD)
_MIX_2 = np.uint64(0xD35A2D97)


@kernel
def unit_interval(word):
    """Convert a 32-bit word to a float64 in (0, 1): the middle of its interval of 2^-32, so that the mean is 1/2."""
    return (np.int64(word) + 0.5) * 2.0**-32


@kernel
def mix32(word):
    """Mix the bits of a 32-bit word: a bijection in which any input bit flips each output bit with odds near 1/2.

    References: Wellons 2018, "Prospecting for Hash Functions" (nullprogram.com), and the constants that its search
    program found later (hash-prospector, issue 19), of bias 0.107.
    """
    x = np.uint64(word) & MASK
    x ^= x >> np.uint64(16)
    x = (x * _MIX_1) & MASK
    x ^= x >> np.uint64(15)
    x = (x * _MIX_2) & MASK
    return x ^ (x >> np.uint64(15))


@kernel
def philox2x32(first, second, key):
    """Mix two 32-bit words: a bijection for each `key`, of 7 rounds, the fewest that pass TestU01's BigCrush.

    References: Salmon et al. 2011, "Parallel Random Numbers: As Easy as 1, 2, 3", SC'11, sec. 3.3 and table 2.
    """
    left, right = np.uint64(first) & MASK, np.uint64(second) & MASK
    k = np.uint64(key)
    for _ in range(7):
        product = left * _PHILOX
        left, right = (product >> np.uint64(32)) ^ k ^ right, product & MASK
        k = (k + GOLDEN) & MASK
    return left, right


@kernel
def hash_pixel(seed, x, y):
    """Hash a pixel to a 32-bit key, different for all pixels of an image of up to 65536 x 65536."""
    seed, x, y = np.uint64(seed), np.uint64(x), np.uint64(y)
    low = (x & _HALF_WORD) | ((y & _HALF_WORD) << np.uint64(16))
    high = (x >> np.uint64(16)) ^ (y & (MASK ^ _HALF_WORD))

    # Hash once more with the seed in, or the keys of another seed would be the same ones at other pixels.
    of_seed = mix32(mix32(seed ^ GOLDEN) ^ (seed >> np.uint64(32)))
    return mix32(mix32(low) ^ mix32(high) ^ of_seed)
