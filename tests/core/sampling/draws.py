"""Compiled loops over a sampler's numbers."""

import numpy as np

from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import pixel_key, sample_1d, sample_2d


@entry
def _keys(sampler, left, top, keys):
    for row in range(keys.shape[0]):
        for column in range(keys.shape[1]):
            keys[row, column] = pixel_key(sampler, left + column, top + row)


@entry
def _fill_1d(sampler, keys, first, dimensions, out):
    for k in range(out.shape[0]):
        for i in range(out.shape[1]):
            for d in range(out.shape[2]):
                out[k, i, d] = sample_1d(sampler, keys[k], first + i, dimensions[d])


@entry
def _fill_2d(sampler, keys, first, dimensions, out):
    for k in range(out.shape[0]):
        for i in range(out.shape[1]):
            for d in range(out.shape[2]):
                u, v = sample_2d(sampler, keys[k], first + i, dimensions[d])
                out[k, i, d, 0] = u
                out[k, i, d, 1] = v


def keys(sampler, width, height, left=0, top=0):
    """Keys of a rectangle of pixels: uint64 (height, width)."""
    out = np.empty((height, width), np.uint64)
    _keys(sampler, left, top, out)
    return out


def draw_1d(sampler, pixels, count, dimensions=(0,), first=0):
    """Numbers of samples first .. first + count - 1: float64 (pixels, count, dimensions).

    pixels : how many pixels, or their keys.
    """
    chosen = keys(sampler, pixels, 1)[0] if isinstance(pixels, int) else pixels
    out = np.empty((len(chosen), count, len(dimensions)))
    _fill_1d(sampler, chosen, first, np.array(dimensions, np.int64), out)
    return out


def draw_2d(sampler, pixels, count, dimensions=(0,), first=0):
    """Like `draw_1d`, pairs: float64 (pixels, count, dimensions, 2)."""
    chosen = keys(sampler, pixels, 1)[0] if isinstance(pixels, int) else pixels
    out = np.empty((len(chosen), count, len(dimensions), 2))
    _fill_2d(sampler, chosen, first, np.array(dimensions, np.int64), out)
    return out
