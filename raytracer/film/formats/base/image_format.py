"""The record by which a module declares an image format, images as files store them, and limits on what is read.

A few bytes can claim any number of pixels, and hold it in zeros; what is too large, or cannot be in a file as short as
that, is refused by its header alone, before memory is allocated for it.
"""

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.util import srgb
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError

if TYPE_CHECKING:
    from raytracer.film.image import Image


class StoredImage(NamedTuple):
    """An image as stored.

    texels : uint8 or float32 (height, width, channels), row 0 at the top, with 1 (grey), 2 (grey, alpha), 3 (rgb) or
        4 (rgb, alpha) channels; integers of 16 bits are float32 in 0..1.
    integer : the file holds integers, which are sRGB by convention if they are colours.
    """

    texels: NDArray[np.uint8] | NDArray[np.float32]
    integer: bool

    @staticmethod
    def curve(is_srgb: bool) -> NDArray[np.float64]:
        """Table of the linear values (256,) of bytes, in 0..1."""
        values = np.arange(256) / 255.0
        return srgb.decode(values) if is_srgb else values

    def linear(self, is_srgb: bool) -> NDArray[np.float32]:
        """Return the texels in 0..1, with the colours, but not the alpha, decoded if they are in sRGB."""
        values = self.texels if self.texels.dtype == np.float32 else self.texels / np.float32(255.0)
        if not is_srgb:
            return np.asarray(values, np.float32)
        colors = values.shape[2] - (values.shape[2] in (2, 4))
        return np.concatenate([srgb.decode(values[..., :colors]), values[..., colors:]], axis=2, dtype=np.float32)


def to_single(array: NDArray[np.generic]) -> NDArray[np.float32]:
    """Convert to float32; a float64 that it cannot hold becomes inf, which is refused with all that is not finite."""
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


Layers = Mapping[str, NDArray[np.floating[Any]]]
"""Arrays by name, (height, width) or (height, width, 3), that are written besides an image's own layers."""

DecodedLayers = tuple[dict[str, NDArray[np.float64]], dict[str, str]]
"""Layers and settings of a file; see `raytracer.film.image_file.load_layers`."""


@dataclass(frozen=True)
class ImageFormat:
    """A format of image files: its suffixes, what it holds, and how it is written and read.

    A decoder takes the bytes of a file, and may raise anything for a broken one.  What a format cannot do is None.

    suffixes : in lower case, with the dot, the usual one first.
    is_linear : it holds linear light, and not what a display shows.
    has_layers : it holds the layers of an image besides its radiance.
    is_lossy : it does not keep 8-bit pixels as they are.
    media_type : of formats that browsers show.
    encode : the bytes of a file with an image, and further layers if the format has any.
    write : writes a file by itself, in place of `encode`.
    encode_pixels : the bytes of a file with pixels for a display, uint8 (height, width) or (height, width, 3).
    encode_map : the bytes of a file with a number for each pixel, (height, width).
    encode_frames : the bytes of an animation: frames uint8 (height, width, 3), milliseconds a frame, and whether to go
        back from the last frame to the first.
    decode : linear values, float64 (height, width, 3), row 0 at the top.
    decode_display : sRGB-encoded values as the file holds them, of the same shape, in 0..1; None for a linear format.
    decode_layers : layers and settings, of all layers or of those that are named.
    decode_stored : an image as textures read it, where that is more than `decode` tells: bytes, grey, or opacity.
    order : place among the formats in messages, ascending; formats without one come last, by suffix.
    """

    suffixes: tuple[str, ...]
    is_linear: bool
    has_layers: bool = False
    is_lossy: bool = False
    media_type: str = ""
    encode: Callable[["Image", Layers], bytes] | None = None
    write: Callable[["Image", Path], None] | None = None
    encode_pixels: Callable[[NDArray[np.uint8]], bytes] | None = None
    encode_map: Callable[[NDArray[np.floating[Any]]], bytes] | None = None
    encode_frames: Callable[[Sequence[NDArray[np.uint8]], int, bool], bytes] | None = None
    decode: Callable[[bytes], NDArray[np.float64]] | None = None
    decode_display: Callable[[bytes], NDArray[np.float64]] | None = None
    decode_layers: Callable[[bytes, Collection[str] | None], DecodedLayers] | None = None
    decode_stored: Callable[[bytes], "StoredImage"] | None = None
    order: int = 1000


def header_settings(image: "Image") -> dict[str, str]:
    """List what a header holds, as strings: no format's own numbers hold a float64 or a 64-bit seed."""
    return {**{key: str(value) for key, value in image.settings.items()}, "samples": str(image.samples)}


MAX_PIXELS = 2**28
"""More is refused before it is decoded: 16384 x 16384 pixels of three bytes are 0.8 GB."""

# DEFLATE makes at most 1032 bytes of one, which are 8256 pixels of one bit; WebP without losses, and the blocks of
# OpenEXR, have no such bound, but no picture comes near.
_MAX_PIXELS_PER_BYTE = 2**14

# 4096 x 4096: of one colour, as flat normal maps are, a few hundred bytes of WebP hold them.
_PIXELS_OF_ANY_FILE = 2**24


@contextlib.contextmanager
def wrap_decode_errors(suffix: str) -> Iterator[None]:
    """Turn whatever decoders raise about a broken file, from SyntaxError to struct.error, into a BrokenFileError."""
    try:
        yield
    except (InputError, BrokenFileError, MemoryError):
        raise
    except Exception as error:
        # The system's errors have a number and the decoders' have none.
        if isinstance(error, OSError) and error.errno:
            raise
        raise BrokenFileError(f"broken, or no {suffix} image") from error


def check_size(width: int, height: int, length: int) -> None:
    """Raise a BrokenFileError for an image of no or too many pixels, or more than `length` bytes can hold."""
    if width <= 0 or height <= 0:
        raise BrokenFileError("has no pixels")
    if width * height > MAX_PIXELS:
        raise BrokenFileError(f"is {width} x {height} pixels, and at most {MAX_PIXELS:,} are read")
    if width * height > max(_PIXELS_OF_ANY_FILE, _MAX_PIXELS_PER_BYTE * length):
        raise BrokenFileError(f"is {width} x {height} pixels in {length} bytes, which no picture is")
