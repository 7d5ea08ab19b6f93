"""Hashes: known answers, bijections, avalanche."""

import numpy as np
import pytest

from raytracer.core.sampling.hashing import ONE_MINUS_EPSILON, mix32, philox2x32, unit_interval
from raytracer.core.sampling.independent import Independent
from tests.core.sampling.draws import keys
from tests.vectorised import rows, vectorised


def test_philox_gives_the_known_answers():
    # Random123's file kat_vectors, the lines of "philox2x32 7".
    counters = np.array([(0, 0), (0xFFFFFFFF, 0xFFFFFFFF), (0x243F6A88, 0x85A308D3)])
    answers = vectorised(philox2x32)(*map(rows, counters.T), rows([0, 0xFFFFFFFF, 0x13198A2E]))
    expected = [(0x257A3673, 0xCD26BE2A), (0xAB302C4D, 0x3DC9D239), (0xBEDBBE6B, 0xE4C770B3)]
    np.testing.assert_array_equal(np.transpose(answers), expected)


def test_mix32_flips_each_bit_half_of_the_time():
    # Each of 32 x 32 frequencies over n words has the standard deviation 0.5 / sqrt(n); 5 of them leave odds of 6e-4.
    n = 4096
    words = np.random.default_rng(1).integers(0, 2**32, n)
    images = vectorised(mix32)(rows(words)).astype(np.int64)
    for bit in range(32):
        flipped = vectorised(mix32)(rows(words ^ (1 << bit))).astype(np.int64) ^ images
        frequency = ((flipped[:, None] >> np.arange(32)) & 1).mean(axis=0)
        assert np.abs(frequency - 0.5).max() < 5.0 * 0.5 / np.sqrt(n)


def test_the_unit_interval_excludes_its_ends():
    assert vectorised(unit_interval)(rows([0, 2**32 - 1])).tolist() == [2.0**-33, 1.0 - 2.0**-33]
    assert np.nextafter(ONE_MINUS_EPSILON, 2.0) == 1.0


@pytest.mark.parametrize(("left", "top"), [(0, 0), (65536 - 512, 0), (0, 65536 - 512), (65536 - 512, 65536 - 512)])
def test_no_two_pixels_share_a_key(left, top):
    tile = keys(Independent(3), 512, 512, left, top)
    assert len(np.unique(tile)) == tile.size
    assert tile.max() < 2**32


def test_pixels_beyond_65536_have_keys_of_their_own():
    # 2^18 random words of 32 bits have 2^36 / 2^33 = 8 collisions to be expected, a Poisson variable.
    near, far = keys(Independent(3), 1 << 17, 1), keys(Independent(3), 1 << 17, 1, left=1 << 17)
    assert len(np.intersect1d(near, far)) < 25


def test_keys_of_two_seeds_are_not_the_same_ones_moved():
    # Images of two seeds would show the same noise, shifted or mirrored, if key_1(p) = key_2(p xor c).
    first, second = keys(Independent(0), 256, 256), keys(Independent(1), 256, 256)
    assert len(np.intersect1d(first, second)) < 10
    assert len(np.unique(first ^ second)) > 0.99 * first.size


def test_all_bits_of_the_seed_count():
    tiles = [keys(Independent(seed), 16, 16) for seed in (0, *(1 << bit for bit in range(63)))]
    assert len({tile.tobytes() for tile in tiles}) == 64
