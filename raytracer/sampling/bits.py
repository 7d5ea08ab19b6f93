"""Integer mixing on uint64 words; 32-bit words are held in them, masked."""

import numpy as np

from raytracer.jit import kernel

U = np.uint64
MASK32 = U(0xFFFFFFFF)
_TO_UNIT_32 = 2.0**-32
_TO_UNIT_53 = 2.0**-53


@kernel
def mix64(x):  # type: ignore[no-untyped-def]
    """A bijection of 64-bit words in which every input bit flips every output bit half of the time.

    References: Stafford 2011, "Better Bit Mixing", variant 13 (the finaliser of SplitMix64, Steele et al. 2014).
    """
    x = U(x)
    x = (x ^ (x >> U(30))) * U(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> U(27))) * U(0x94D049BB133111EB)
    return x ^ (x >> U(31))


@kernel
def combine(key, index, dimension):  # type: ignore[no-untyped-def]
    """One word from three, mixed; odd constants keep different triples apart."""
    return mix64(U(key) + U(index) * U(0x9E3779B97F4A7C15) + U(dimension) * U(0xD1B54A32D192ED03))


@kernel
def key_of(seed, x, y):  # type: ignore[no-untyped-def]
    """The key of a pixel."""
    return mix64(mix64(U(seed) + U(0x9E3779B97F4A7C15)) ^ (U(x) | (U(y) << U(32))))


@kernel
def unit53(word):  # type: ignore[no-untyped-def]
    """The top 53 bits of a 64-bit word as a float64 in [0, 1)."""
    return float(np.int64(word >> U(11))) * _TO_UNIT_53


@kernel
def unit32(word):  # type: ignore[no-untyped-def]
    """A 32-bit word as a float64 in [0, 1)."""
    return float(np.int64(word)) * _TO_UNIT_32


@kernel
def reverse32(x):  # type: ignore[no-untyped-def]
    """A 32-bit word with its bits in the opposite order."""
    x = ((x >> U(1)) & U(0x55555555)) | ((x & U(0x55555555)) << U(1))
    x = ((x >> U(2)) & U(0x33333333)) | ((x & U(0x33333333)) << U(2))
    x = ((x >> U(4)) & U(0x0F0F0F0F)) | ((x & U(0x0F0F0F0F)) << U(4))
    x = ((x >> U(8)) & U(0x00FF00FF)) | ((x & U(0x00FF00FF)) << U(8))
    return (x >> U(16)) | ((x << U(16)) & MASK32)
