"""Limits on the size of images that are read, checked by their headers alone.

A few bytes can claim any number of pixels, and hold it in zeros; what is too large, or cannot be in a file as short as
that, is refused before memory is allocated for it.
"""

import contextlib
from collections.abc import Iterator

from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError

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
