"""Independent random numbers."""

from typing import NamedTuple

import numpy as np

from raytracer.core.sampling.hashing import hash_pixel, philox2x32, unit_interval
from raytracer.core.sampling.interface import pixel_key, sample_1d, sample_2d


class Independent(NamedTuple):
    """Random numbers without any relation to each other, for up to 2^32 samples a pixel.

    seed : 0 or more, below 2^63.

    References: Philox2x32-7, see `hashing.philox2x32`.
    """

    seed: int


@pixel_key.register(Independent)
def pixel_key_independent(sampler, x, y):
    return hash_pixel(sampler.seed, x, y)


@sample_1d.register(Independent)
def sample_1d_independent(sampler, key, index, dimension):
    high, low = philox2x32(index, dimension, key)
    return np.int64((high << np.uint64(21)) ^ (low >> np.uint64(11))) * 2.0**-53


@sample_2d.register(Independent)
def sample_2d_independent(sampler, key, index, dimension):
    first, second = philox2x32(index, dimension, key)
    return unit_interval(first), unit_interval(second)
