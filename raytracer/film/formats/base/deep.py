"""Images of 16 bits a channel, read by Pillow, which keeps but 8 of them where there are colours.

Pillow's modes for colours have 8 bits, and its unpackers for 16 take the first byte of each number, or the second where
these are stored the other way round.  So a file is decoded twice, each time by one of two unpackers that differ in the
order of bytes alone: once for the upper bytes, and once for the lower.
"""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.util.safe_open import BrokenFileError

if TYPE_CHECKING:
    import PIL.Image

_SWAPPED = {"B": "L", "L": "B", "N": "L" if sys.byteorder == "big" else "B"}
"""The other order of bytes, by the last letter of an unpacker's name; N is that of the machine."""

_UNPACKERS = ("RGB;16", "RGBX;16", "RGBA;16")
"""Names of the unpackers, without the order of bytes, that keep one byte of each number as it is."""

_TIFF_BITS = 258
"""Tag of a TIFF file with the bits of each channel."""

_TIFF_PLANES, _APART = 284, 2
"""Tag of a TIFF file with the order of colours, and its value if there is a picture for each."""

_PNG_DEPTH = 24
"""Place of the depth of a PNG file, after which the type of its colours comes."""

_PNG_GREY_ALPHA, _PNG_COLOR_ALPHA = 4, 6


def is_deep(file: "PIL.Image.Image", data: bytes) -> bool:
    """Tell if an image that Pillow has opened has more than 8 bits a channel, and Pillow would keep only 8."""
    if file.mode.startswith(("I", "F")):
        return False
    if file.format == "PNG":
        return data[_PNG_DEPTH] == 16
    return file.format == "TIFF" and max(getattr(file, "tag_v2", {}).get(_TIFF_BITS, (8,))) > 8


def read_deep(open_file: Callable[[bytes], Any], file: "PIL.Image.Image", data: bytes) -> NDArray[np.uint16]:
    """Read the values of an image that `is_deep`, uint16 (height, width, channels), with opacity if it has any.

    Parameters
    ----------
    open_file : opens bytes as a Pillow image, as a context.

    Raises
    ------
    BrokenFileError : its channels are stored in a way of which Pillow keeps 8 bits only.
    """
    if file.format == "PNG" and data[_PNG_DEPTH + 1] == _PNG_GREY_ALPHA:
        # Pillow knows no second order of bytes for these; four channels of 8 bits have the same bytes.
        with open_file(_as_bytes(data)) as bytewise:
            values = np.asarray(bytewise, np.uint16)
        return np.asarray(values[..., ::2] << 8 | values[..., 1::2])
    if getattr(file, "tag_v2", {}).get(_TIFF_PLANES) == _APART:
        raise BrokenFileError("has its colours one after the other, of 16 bits each: only pixel by pixel are they read")
    upper = _unpacked(file, lambda name: name)
    with open_file(data) as again:
        lower = _unpacked(again, lambda name: name[:-1] + _SWAPPED[name[-1]])
    values = np.asarray(upper.astype(np.uint16) << 8 | lower, np.uint16)
    key = file.info.get("transparency")
    if isinstance(key, tuple):
        is_opaque = (values != np.array(key, np.uint16)).any(axis=-1, keepdims=True)
        alpha = np.where(is_opaque, np.uint16(65535), np.uint16(0))
        values = np.asarray(np.concatenate([values, alpha], axis=-1), np.uint16)
    return values


def _unpacked(file: Any, rename: Callable[[str], str]) -> NDArray[np.uint8]:
    """Decode the bytes that unpackers keep whose names are changed by `rename`."""
    tiles: list[Any] = []
    for tile in file.tile:
        settings: Any = tile[3]
        name = settings if isinstance(settings, str) else settings[0]
        if not isinstance(name, str) or name[:-1] not in _UNPACKERS or name[-1] not in _SWAPPED:
            raise BrokenFileError("has more than 8 bits a channel, stored in a way that is not read")
        settings = rename(name) if isinstance(settings, str) else (rename(name), *settings[1:])
        tiles.append(type(tile)(*tile[:3], settings) if hasattr(tile, "_fields") else (*tile[:3], settings))
    file.tile = tiles
    file.load()
    bands = {"RGBX": 3}.get(file.mode, len(file.getbands()))
    return np.asarray(file)[..., :bands]


def _as_bytes(data: bytes) -> bytes:
    """Give a PNG file of grey and opacity, of 16 bits, the header of one with four channels of 8 bits."""
    import zlib

    header = b"IHDR" + data[16:_PNG_DEPTH] + bytes([8, _PNG_COLOR_ALPHA]) + data[_PNG_DEPTH + 2 : 29]
    return data[:12] + header + zlib.crc32(header).to_bytes(4, "big") + data[33:]
