"""Raw pictures of a camera: reading, dark frame and colour filters."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.registry import linear_suffixes
from raytracer.lightfield.decoding.flat_field import LARGEST_CODE, Floats32, bright_quantile
from raytracer.util.errors import InputError

Source = str | Path | NDArray[Any]
"""A file's name, or an array (height, width) or (height, width, 3) of linear light; uint8 and uint16 stand for 0..1."""

BAYER = ("rggb", "bggr", "grbg", "gbrg")
"""Colours of the filters on the first two pixels of the first two rows."""

_DARKEST = 1e-30
"""Light of a picture that has none, so that nothing is divided by 0."""


def source_name(source: Source | None, otherwise: str) -> str:
    """Return the name of a source in messages: that of its file, or else the one given."""
    return str(source) if isinstance(source, str | Path) else otherwise


def read_raw(source: Source, name: str, srgb: bool) -> Floats32:
    """Read a picture (height, width) or (height, width, 3) in linear light; three equal channels become one."""
    from raytracer.scene.assets.images import read_image

    if isinstance(source, str | Path):
        image = read_image(source)
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
    """Check that a picture fits the raw one, in size and channels, and return it.

    Raises
    ------
    InputError : it does not.
    """
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

    Raises
    ------
    InputError : it is not known, the picture has three colours already, or the library is not installed.
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

    Returns
    -------
    The colours as 16-bit codes, and the light of one step.

    References: https://docs.opencv.org/4.x/d8/d01/group__imgproc__color__conversions.html, "Edge-Aware Demosaicing".
    """
    import cv2

    # Noise where there is next to no light must not take up the range of integers.
    most = 1.5 * max(bright_quantile(mosaic), _DARKEST)
    numbers = np.clip(mosaic * np.float32(LARGEST_CODE / most), 0.0, LARGEST_CODE).astype(np.uint16)
    colors = cv2.demosaicing(numbers, getattr(cv2, f"COLOR_Bayer{bayer.upper()}2RGB_EA"))
    return np.asarray(colors), most / LARGEST_CODE
