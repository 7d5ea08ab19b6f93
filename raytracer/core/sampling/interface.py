"""The interface of samplers: random numbers as pure functions of pixel, sample and dimension.

A sampler is a NamedTuple of parameters; it holds no state, so it may be shared by all threads.  `dimension` names what
a number is for: each use within a path has its own, below 2^32, and takes either one number or a pair of it.
"""

from raytracer.core.compiler.dispatch import generic


@generic
def pixel_key(sampler, x, y):
    """Return the key of the random numbers of pixel (x, y): a uint64 below 2^32; x and y are 0 or more."""


@generic
def sample_1d(sampler, key, index, dimension):
    """Draw number `dimension` of sample `index` of the pixel with `key`: float64, uniform in [0, 1)."""


@generic
def sample_2d(sampler, key, index, dimension):
    """Draw two numbers for `dimension` of sample `index` of the pixel with `key`: float64, uniform in [0, 1)^2."""
