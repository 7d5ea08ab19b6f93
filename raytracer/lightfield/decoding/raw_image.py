"""Raw pictures of a camera: reading, dark frame, colour filters, and correction by the white picture (flat field)."""

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import StoredImage
from raytracer.film.formats.registry import linear_suffixes
from raytracer.film.light_field import lf
from raytracer.util.errors import InputError

Floats32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class RawPicture:
    """A picture that was read already: linear light, of which the end of the scale is 1, and its name in messages."""

    values: Floats32
    name: str


Source = str | Path | NDArray[Any] | RawPicture
"""A file's name, or an array (height, width) or (height, width, 3) of linear light; uint8 and uint16 stand for 0..1."""

BAYER = ("rggb", "bggr", "grbg", "gbrg")
"""Colours of the filters on the first two pixels of the first two rows."""

_DARKEST = 1e-30
"""Light of a picture that has none, so that nothing is divided by 0."""


def source_name(source: Source | None, otherwise: str) -> str:
    """Return the name of a source in messages: that of its file, or else the one given."""
    if isinstance(source, RawPicture):
        return source.name
    return str(source) if isinstance(source, str | Path) else otherwise


def read_stored(path: str | Path) -> StoredImage:
    """Read the file of a raw picture as it is stored; an InputError says what is wrong with it."""
    from raytracer.scene.assets.images import read_image

    if Path(path).suffix.lower() == lf.SUFFIX:
        raise InputError(f"{path}: is a light field already, and no raw picture")
    return read_image(path)


def read_raw(source: Source, name: str, srgb: bool) -> Floats32:
    """Read a picture (height, width) or (height, width, 3) in linear light; three equal channels become one."""
    if isinstance(source, RawPicture):
        source = source.values
    if isinstance(source, str | Path):
        image = read_stored(source)
        stored = image.texels.dtype == np.float32 and not (srgb and image.integer)
        values = np.asarray(image.texels, np.float32) if stored else image.linear(srgb and image.integer)
    else:
        array = np.asarray(source)
        if array.dtype.kind not in "fu" or array.ndim not in (2, 3) or array.size == 0:
            raise InputError(f"{name}: a picture has the shape (height, width) or (height, width, 3)")
        largest = np.iinfo(array.dtype).max if array.dtype.kind == "u" else 1.0
        values = np.asarray(array, np.float32) / np.float32(largest)
        values = values[..., None] if values.ndim == 2 else values
        if not np.isfinite(values.sum(dtype=np.float64)):
            raise InputError(f"{name}: holds values that are not finite")
    channels = values.shape[2]
    if channels > 4:
        raise InputError(f"{name}: a picture has 1 or 3 channels, got {channels}")
    if channels < 3:
        return np.ascontiguousarray(values[..., 0])
    values = np.ascontiguousarray(values[..., :3])
    is_grey = np.array_equal(values[..., 0], values[..., 1]) and np.array_equal(values[..., 0], values[..., 2])
    return np.ascontiguousarray(values[..., 0]) if is_grey else values


def check_fits(picture: Floats32, raw: Floats32, names: dict[str, str], kind: str) -> Floats32:
    """Return a picture, or raise an InputError if it does not fit the raw one in size and channels."""
    if picture.shape[:2] != raw.shape[:2]:
        (height, width), (tall, wide) = picture.shape[:2], raw.shape[:2]
        turned = ", turned by 90 degrees" if (height, width) == (wide, tall) else ""
        raise InputError(
            f"{names[kind]}: has {width} x {height} pixels, and {names['raw']} has {wide} x {tall}{turned}: "
            f"the {kind} picture must be of the same camera, as it comes from it"
        )
    if picture.ndim == 3 and raw.ndim == 2:
        raise InputError(f"{names[kind]}: has three colours, and {names['raw']} has one channel")
    return picture


def has_largest_value(source: Source) -> bool:
    """Tell if a source has a largest value: the end of its scale."""
    if isinstance(source, str | Path):
        return Path(source).suffix.lower() not in linear_suffixes()
    return np.asarray(source).dtype.kind == "u"


def subtract_dark(picture: Floats32, background: Floats32 | None) -> Floats32:
    """Subtract the dark picture, if there is one."""
    if background is None:
        return picture
    return picture - (background[..., None] if picture.ndim > background.ndim else background)


def check_bayer(bayer: str, raw: Floats32, name: str) -> str:
    """Check the order of colour filters, and return it in small letters.

    Raises InputError: it is not known, the picture has three colours already, or the library is not installed.
    """
    from raytracer.film.sensor_response import require_demosaic

    if bayer.lower() not in BAYER:
        raise InputError(f"--bayer {bayer}: must be one of {', '.join(BAYER)}")
    if raw.ndim == 3:
        raise InputError(f"{name}: has three colours already, and --bayer is for one channel behind colour filters")
    require_demosaic()
    return bayer.lower()


def demosaic(mosaic: Floats32, bayer: str) -> tuple[NDArray[np.uint16], float]:
    """Demosaic to three colours (height, width, 3), along edges.

    Returns the colours as 16-bit codes, and the light of one step.

    References: https://docs.opencv.org/4.x/d8/d01/group__imgproc__color__conversions.html, "Edge-Aware Demosaicing".
    """
    import cv2

    # Noise where there is next to no light must not take up the range of integers.
    most = 1.5 * max(bright_quantile(mosaic), _DARKEST)
    numbers = np.clip(mosaic * np.float32(LARGEST_CODE / most), 0.0, LARGEST_CODE).astype(np.uint16)
    colors = cv2.demosaicing(numbers, getattr(cv2, f"COLOR_Bayer{bayer.upper()}2RGB_EA"))
    return np.asarray(colors), most / LARGEST_CODE


LEAST_LIGHT = 0.03
"""Least light of a pixel, as a share of the brightest: less is noise once it is divided by the light."""

_HOT, _DEAD = 1.6, 0.4
"""Ratios of a pixel to the brightest and the darkest of its eight neighbours, beyond which it is defective."""

MANY_CLIPPED = 0.001
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
    for row, column in np.ndindex(2, 2):
        part = picture[row::2, column::2]
        mean = float(part.mean(dtype=np.float64))
        flat[row::2, column::2] = part / mean if mean > 0.0 else part
    return flat


def has_color_filters(white: Floats32) -> bool:
    """Tell if a picture seems to be behind a mosaic of colour filters."""
    if white.ndim == 3:
        return False
    means = [float(white[i::2, j::2].mean(dtype=np.float64)) for i, j in np.ndindex(2, 2)]
    return max(means) > _FILTER_RATIO * min(means)


def note_clipping(white: Floats32, name: str, notes: list[str]) -> None:
    """Append a note if many pixels of the white picture are clipped."""
    highest = float(white.max())
    share = np.count_nonzero(white == highest) / white.size
    # A picture rendered without noise may be equal everywhere, without being at the end of a scale.
    if share > MANY_CLIPPED and _ends_a_scale(highest):
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
