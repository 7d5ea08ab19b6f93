"""Flat-field correction: the light that each pixel gets, by the white picture, and the pixels that are defective."""

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats32 = NDArray[np.float32]

LEAST_LIGHT = 0.03
"""Least light of a pixel, as a share of the brightest: less is noise once it is divided by the light."""

_HOT, _DEAD = 1.6, 0.4
"""Ratios of a pixel to the brightest and the darkest of its eight neighbours, beyond which it is defective."""

_MANY_CLIPPED = 0.001
"""Share of clipped pixels from which on a note is made."""

LARGEST_CODE = 65535.0
"""Of 16 bits."""

_LEAST_SCALE = 255
"""Largest code of the coarsest sensor."""

_BAND = 256
"""Rows of pixels that are processed together: few enough for the processor's caches."""

_SAMPLE = 1_000_000
"""Pixels from which a quantile is computed."""

_FILTER_RATIO = 1.1
"""Ratio of the mean of one in four pixels to that of another, from which on colour filters are assumed."""


def flatten_channels(picture: Floats32, bayer: str | None) -> Floats32:
    """Reduce a picture to one channel (height, width): the mean of colours, or a mosaic with its colours made equal."""
    if picture.ndim == 3:
        return np.asarray(picture.mean(axis=2), np.float32)
    if bayer is None:
        return picture
    flat = np.empty_like(picture)
    for row in (0, 1):
        for column in (0, 1):
            part = picture[row::2, column::2]
            mean = float(part.mean(dtype=np.float64))
            flat[row::2, column::2] = part / mean if mean > 0.0 else part
    return flat


def has_color_filters(white: Floats32) -> bool:
    """Tell if a picture seems to be behind a mosaic of colour filters."""
    if white.ndim == 3:
        return False
    means = [float(white[i::2, j::2].mean(dtype=np.float64)) for i in (0, 1) for j in (0, 1)]
    return max(means) > _FILTER_RATIO * min(means)


def note_clipping(white: Floats32, name: str, notes: list[str]) -> None:
    """Append a note if many pixels of the white picture are clipped."""
    highest = float(white.max())
    share = np.count_nonzero(white == highest) / white.size
    # A picture rendered without noise may be equal everywhere, without being at the end of a scale.
    if share > _MANY_CLIPPED and _ends_a_scale(highest):
        notes.append(f"{name}: {share:.1%} of it is clipped: the raw picture is too dark there once it is devignetted")


def _ends_a_scale(value: float) -> bool:
    """Tell if a value can be the largest of a sensor: its 16-bit code is a run of ones in binary."""
    number = round(value * LARGEST_CODE)
    if number < 1:
        return False
    ones = number // (number & -number)
    return ones >= _LEAST_SCALE and ones & (ones + 1) == 0


def light_weight(flat: Floats32) -> Floats32:
    """Compute the light of each pixel as a share of the brightest, 0..1."""
    brightest = bright_quantile(flat)
    if not brightest > 0.0:
        brightest = float(flat.max())
    weight = np.asarray(flat / np.float32(brightest), np.float32)
    return np.clip(weight, 0.0, 1.0, out=weight)


def find_defects(picture: Floats32, mosaic: bool, dead: bool = False) -> NDArray[np.bool_]:
    """Find pixels (height, width) that are much brighter than all their neighbours, or if `dead` much darker, too.

    Defects are single pixels: no lens makes one so much brighter than the next, as long as both have one colour.
    """
    if picture.ndim == 3:
        return np.asarray(np.any([find_defects(picture[..., i], False, dead) for i in range(picture.shape[2])], axis=0))
    apart = 2 if mosaic else 1
    height, width = picture.shape
    least = np.float32(LEAST_LIGHT * max(0.0, bright_quantile(picture)))
    bad = np.zeros(picture.shape, bool)
    # A band at a time, with the neighbours of its first and last row.
    for top in range(0, height, _BAND):
        part = picture[top : top + _BAND]
        around = np.pad(picture[max(0, top - apart) : top + _BAND + apart], ((0, 0), (apart, apart)), mode="edge")
        above, below = min(top, apart), max(0, min(apart, height - top - len(part)))
        around = np.pad(around, ((apart - above, apart - below), (0, 0)), mode="edge")
        places = [(i, j) for i in (0, apart, 2 * apart) for j in (0, apart, 2 * apart) if (i, j) != (apart, apart)]
        ring = [around[i : i + len(part), j : j + width] for i, j in places]
        highest = np.maximum(functools.reduce(np.maximum, ring), least)
        is_defective = part > np.float32(_HOT) * highest
        if dead:
            is_defective |= part < np.float32(_DEAD) * functools.reduce(np.minimum, ring)
        bad[top : top + _BAND] = is_defective
    return bad


def bright_quantile(picture: NDArray[Any]) -> float:
    """Return the 99th percentile, estimated from some of the pixels."""
    step = max(1, math.isqrt(picture.size // _SAMPLE))
    return float(np.quantile(picture[::step, ::step], 0.99))


def divide_by_white(picture: Floats32, bright: Floats32, weight: Floats32) -> Floats32:
    """Divide a picture by the white one; 0 where that has no light."""
    ratio = np.zeros_like(picture)
    lit = weight >= np.float32(0.25 * LEAST_LIGHT)
    if picture.ndim == 2:
        np.divide(picture, bright, out=ratio, where=lit & (bright > 0.0))
        return ratio
    for channel in range(picture.shape[2]):
        light = bright if bright.ndim == 2 else bright[..., channel]
        np.divide(picture[..., channel], light, out=ratio[..., channel], where=lit & (light > 0.0))
    return ratio
