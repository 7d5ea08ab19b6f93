"""Owen-scrambled Sobol' points, with the least noise if the number of samples is a power of two."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.hashing import GOLDEN, MASK, ONE, hash_pixel, unit_interval
from raytracer.core.sampling.interface import pixel_key, sample_1d, sample_2d


class Sobol(NamedTuple):
    """Sobol' points of two dimensions, shuffled and Owen-scrambled anew for every pixel and dimension (padding).

    Samples 0 .. 2^k - 1 of a pixel put one point in each elementary interval of area 2^-k, for every k up to 16;
    each 65536 samples are such a set again, independent of those before.

    seed : 0 or more, below 2^63.

    References: Sobol' 1967, "On the Distribution of Points in a Cube and the Approximate Evaluation of Integrals";
    Owen 1995, "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences"; Kollig, Keller 2002, "Efficient Multidimensional
    Sampling" (padding); Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4) (scrambling by a hash, shuffling
    by the same means).
    """

    seed: int


def _reversed_bytes() -> NDArray[np.uint8]:
    """Tabulate the bits of each byte in reverse order: uint8 (256,)."""
    bits = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1)
    return np.packbits(bits[:, ::-1], axis=1)[:, 0]


def _sobol_bytes() -> NDArray[np.uint32]:
    """Tabulate the contribution of a byte of a bit-reversed sample index to its point: uint32 (256,).

    The low half holds the byte with its bits in natural order: by those, Sobol's first dimension is the van der Corput
    sequence.  The high half holds it times Pascal's triangle mod 2, which makes the second dimension.  The triangle of
    a word is the Kronecker power of that of a bit, so it takes one exclusive or for each doubling of the word.
    """
    natural = _reversed_bytes().astype(np.uint32)
    second = natural.copy()
    for shift, low_half in ((4, 0x0F), (2, 0x33), (1, 0x55)):
        second ^= (second >> np.uint32(shift)) & np.uint32(low_half)
    return natural | (second << np.uint32(16))


_REVERSED = _reversed_bytes()
_SOBOL = _sobol_bytes()

_BYTE = np.uint64(0xFF)
_HALF_WORD = np.uint64(0xFFFF)

# Odd, and above 2^31, since the upper half of a product with c stays below c.
_SALT_BLOCK = np.uint64(0xB5297A4D)
_SALT_SHUFFLE = np.uint64(0xD256D193)
_SALT_1 = np.uint64(0xAC564B05)
_SALT_2 = np.uint64(0xCAF649A9)
_SCRAMBLE = np.uint64(0x05526C56)


@kernel
def nested_scramble(word, seed):
    """Flip each bit of a 32-bit word by a hash of `seed` and of the bits below it: Owen's scramble, low digits first.

    The hash of the bits is a product with an odd number (the seed's), then one with an even number.  Over random seeds
    the flips at any two places of the tree are uncorrelated, which is what the variance of a scrambled net depends on;
    four products with constants, as first proposed, leave correlations above 0.5 on its first levels.

    References: Laine, Karras 2011, "Stratified Sampling for Stochastic Transparency", sec. 3.1; Vegdahl 2021, "Building
    a Better LK Hash" (psychopath.io), for the seed's product and the even constant.
    """
    x = ((word + seed) * ((seed >> np.uint64(15)) | ONE)) & MASK
    return x ^ ((x * _SCRAMBLE) & MASK)


@kernel
def _reverse_digits(word):
    """Reverse the lower 16 bits of a word into the upper ones; the other 16, random by now, may come in any order."""
    return (
        (np.uint64(_REVERSED[word & _BYTE]) << np.uint64(24))
        | (np.uint64(_REVERSED[(word >> np.uint64(8)) & _BYTE]) << np.uint64(16))
        | (word >> np.uint64(16))
    )


@kernel
def _folded_product(a, b):
    """Multiply two 32-bit words and XOR the halves of the product: each bit depends on all bits of both."""
    product = a * b
    return (product >> np.uint64(32)) ^ (product & MASK)


@kernel
def _seeds(key, index, dimension):
    """Draw three 32-bit seeds for the 65536 samples around `index` and a dimension: to shuffle, and to scramble by."""
    block = (np.uint64(index) >> np.uint64(16)) * _SALT_BLOCK
    use = (np.uint64(dimension) + block) & MASK
    word = (np.uint64(key) + use * GOLDEN) & MASK
    shuffle = _folded_product(word ^ (word >> np.uint64(16)), _SALT_SHUFFLE)
    return shuffle, _folded_product(shuffle, _SALT_1), _folded_product(shuffle, _SALT_2)


@kernel
def _shuffled(index, seed):
    """Shuffle an index; returns the lower and upper byte of its 16 reversed bits.

    Shuffling is Owen's scramble of the reversed bits, so aligned blocks of 2^k indices stay such blocks.
    """
    low = np.uint64(index)
    reversed_index = (np.uint64(_REVERSED[low & _BYTE]) << np.uint64(24)) | (
        np.uint64(_REVERSED[(low >> np.uint64(8)) & _BYTE]) << np.uint64(16)
    )
    word = nested_scramble(reversed_index, seed)
    return (word >> np.uint64(16)) & _BYTE, word >> np.uint64(24)


@pixel_key.register(Sobol)
def pixel_key_sobol(sampler, x, y):
    return hash_pixel(sampler.seed, x, y)


@sample_1d.register(Sobol)
def sample_1d_sobol(sampler, key, index, dimension):
    shuffle, scramble, _ = _seeds(key, index, dimension)
    low, high = _shuffled(index, shuffle)
    word = np.uint64(_REVERSED[high]) | (np.uint64(_REVERSED[low]) << np.uint64(8))
    return unit_interval(_reverse_digits(nested_scramble(word, scramble)))


@sample_2d.register(Sobol)
def sample_2d_sobol(sampler, key, index, dimension):
    shuffle, scramble_1, scramble_2 = _seeds(key, index, dimension)
    low, high = _shuffled(index, shuffle)

    # Both dimensions of the points at once; the last doubling of Pascal's triangle is from the byte to the half word.
    words = np.uint64(_SOBOL[high]) | (np.uint64(_SOBOL[low]) << np.uint64(8))
    words ^= (words >> np.uint64(8)) & np.uint64(0x00FF0000)
    first = nested_scramble(words & _HALF_WORD, scramble_1)
    second = nested_scramble((words >> np.uint64(16)) & _HALF_WORD, scramble_2)
    return unit_interval(_reverse_digits(first)), unit_interval(_reverse_digits(second))
