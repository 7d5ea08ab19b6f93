"""A sampler's numbers."""

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import pixel_key, sample_1d, sample_2d
from tests.vectorised import rows, vectorised


@kernel
def _cell(shape, place):
    """Where a number stands among those of pixels, samples and dimensions."""
    rest = place // shape[2]
    return rest // shape[1], rest % shape[1], place % shape[2]


@kernel
def _draw_1d(sampler, keys, first, dimensions, shape, place):
    k, i, d = _cell(shape, place)
    return sample_1d(sampler, keys[k], first + i, dimensions[d])


@kernel
def _draw_2d(sampler, keys, first, dimensions, shape, place):
    k, i, d = _cell(shape, place)
    return sample_2d(sampler, keys[k], first + i, dimensions[d])


def keys(sampler, width, height, left=0, top=0):
    """Keys of a rectangle of pixels: uint64 (height, width)."""
    y, x = np.mgrid[top : top + height, left : left + width].reshape(2, -1)
    return vectorised(pixel_key)(sampler, rows(x), rows(y)).astype(np.uint64).reshape(height, width)


def _drawn(kernel_, sampler, pixels, count, dimensions, first):
    chosen = keys(sampler, pixels, 1)[0] if isinstance(pixels, int) else np.ascontiguousarray(pixels)
    shape = (len(chosen), count, len(dimensions))
    places = rows(np.arange(np.prod(shape)))
    out = vectorised(kernel_)(sampler, chosen, first, np.array(dimensions, np.int64), shape, places)
    return out.reshape(*shape, *out.shape[1:])


def draw_1d(sampler, pixels, count, dimensions=(0,), first=0):
    """Numbers of samples first .. first + count - 1: float64 (pixels, count, dimensions).

    pixels : how many pixels, or their keys.
    """
    return _drawn(_draw_1d, sampler, pixels, count, dimensions, first)


def draw_2d(sampler, pixels, count, dimensions=(0,), first=0):
    """Like `draw_1d`, pairs: float64 (pixels, count, dimensions, 2)."""
    return _drawn(_draw_2d, sampler, pixels, count, dimensions, first)
