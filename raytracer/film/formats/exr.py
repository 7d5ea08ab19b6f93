"""What the libraries for image files find in one, after its size has been judged by its header alone.

A few bytes can claim any number of pixels, and hold it in zeros; what is too large, or cannot be in a file as short as
that, is refused before room is made for it.
"""

import contextlib
import io
import os
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import PIL.Image

MAX_PIXELS = 2**28
"""More is refused before it is decoded: 16384 x 16384 pixels of three bytes are 0.8 GB."""

MAX_DECODED_BYTES = 2**32
"""Of all channels of an .exr file, as float32; 2^28 pixels of four."""

# DEFLATE makes at most 1032 bytes of one, which are 8256 pixels of one bit; WebP without losses, and the blocks of
# OpenEXR, have no such bound, but no picture comes near.
_MOST_PIXELS_A_BYTE = 2**14

# 4096 x 4096: of one colour, as maps of normals without relief have, a few hundred bytes of WebP hold them.
_PIXELS_OF_ANY_FILE = 2**24

# 1024 x 1024, for a picture that is smaller; programs write 16 to 512 a side.
_MOST_TILE_PIXELS = 2**20

# Pillow would try all that it knows, by content: PostScript, which it hands to another program, among them.
_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "WEBP")

_SILENCE = threading.Lock()


class BrokenImageError(ValueError):
    """An image that cannot be used; its text completes the sentence "FILE: ..."."""


def check_size(width: int, height: int, length: int) -> None:
    """Refuse an image of so many pixels, in a file of `length` bytes.

    Raises
    ------
    BrokenImageError : it has none, too many, or more than its file can hold.
    """
    if width <= 0 or height <= 0:
        raise BrokenImageError("has no pixels")
    if width * height > MAX_PIXELS:
        raise BrokenImageError(f"is {width} x {height} pixels, and at most {MAX_PIXELS:,} are read")
    if width * height > max(_PIXELS_OF_ANY_FILE, _MOST_PIXELS_A_BYTE * length):
        raise BrokenImageError(f"is {width} x {height} pixels in {length} bytes, which no picture is")


# ---- Pillow


@contextlib.contextmanager
def pillow(data: bytes, formats: tuple[str, ...] = _FORMATS) -> Iterator["PIL.Image.Image"]:
    """An image file opened by Pillow, its size judged; its pixels are decoded when they are asked for.

    Raises
    ------
    BrokenImageError : see `check_size`.
    Exception : whatever Pillow raises about broken files.
    """
    import PIL.Image

    from raytracer.jit import alone

    _check_webp(data)
    with alone, _any_size(), warnings.catch_warnings():
        # What Pillow warns of is either of no matter here or raises when it decodes.
        warnings.simplefilter("ignore")
        with PIL.Image.open(io.BytesIO(data), formats=formats) as file:
            check_size(*file.size, len(data))
            yield file


def is_transparent(data: bytes) -> bool:
    """Whether an image file that Pillow reads tells how opaque it is.

    Raises
    ------
    BrokenImageError : it cannot be opened.
    """
    try:
        with pillow(data) as file:
            return "A" in file.getbands() or "transparency" in file.info
    except Exception as error:
        # A broken file raises anything, from SyntaxError to struct.error.
        raise BrokenImageError("is broken, or no image") from error


def _check_webp(data: bytes) -> None:
    """Judge the size of a WebP file, for which Pillow makes room as soon as it opens it.

    References: Google, "WebP Container Specification"; RFC 6386, sec. 9.1; "WebP Lossless Bitstream", sec. 3.
    """
    if data[:4] != b"RIFF" or data[8:12] != b"WEBP":
        return
    if data[12:16] == b"VP8X":
        width, height = (int.from_bytes(data[start : start + 3], "little") + 1 for start in (24, 27))
    elif data[12:16] == b"VP8L":
        packed = int.from_bytes(data[21:25], "little")
        width, height = (packed & 0x3FFF) + 1, (packed >> 14 & 0x3FFF) + 1
    else:
        width, height = (int.from_bytes(data[start : start + 2], "little") & 0x3FFF for start in (26, 28))
    check_size(width, height, len(data))


@contextlib.contextmanager
def _any_size() -> Iterator[None]:
    """Keep Pillow from judging sizes, which are checked here before pixels are decoded."""
    import PIL.Image

    kept = PIL.Image.MAX_IMAGE_PIXELS
    PIL.Image.MAX_IMAGE_PIXELS = None
    try:
        yield
    finally:
        PIL.Image.MAX_IMAGE_PIXELS = kept


# ---- OpenEXR


def exr(
    data: bytes, is_wanted: Callable[[str], bool] = lambda name: True
) -> tuple[Mapping[str, Any], dict[str, NDArray[Any]]]:
    """The header of an .exr file, and the channels (height, width) of its first part that are wanted, by name.

    Raises
    ------
    BrokenImageError : see `check_size`; or its parts hold deep pixels, or more bytes than are read.
    Exception : whatever OpenEXR raises about broken files.
    """
    import OpenEXR

    with silenced():
        with OpenEXR.File(io.BytesIO(data), separate_channels=True, header_only=True) as file:
            _check_parts([part.header for part in file.parts], len(data))
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            header = dict(file.header())
            found = {name: np.asarray(channel.pixels) for name, channel in file.channels().items() if is_wanted(name)}
    if any(plane.ndim != 2 or plane.dtype.kind not in "fu" for plane in found.values()):
        raise BrokenImageError("holds channels that are no planes of numbers")
    return header, found


def _check_parts(headers: Sequence[Mapping[str, Any]], length: int) -> None:
    """Refuse an .exr file for what the headers of its parts say; all are decoded, wanted or not."""
    size = 0
    for header in headers:
        (left, top), (right, bottom) = (tuple(int(value) for value in corner) for corner in header["dataWindow"])
        width, height = right - left + 1, bottom - top + 1
        check_size(width, height, length)
        if "deep" in str(header.get("type", "")):
            raise BrokenImageError("holds deep pixels, which are not read")
        # Room is made for a whole tile, however small the picture.
        tiles = header.get("tiles")
        if tiles is not None and tiles.xSize * tiles.ySize > max(_MOST_TILE_PIXELS, width * height):
            raise BrokenImageError(f"has tiles of {tiles.xSize} x {tiles.ySize} for {width} x {height} pixels")
        size += width * height * len(header["channels"]) * np.dtype(np.float32).itemsize
    if size > MAX_DECODED_BYTES:
        raise BrokenImageError(f"has channels of {size:,} bytes, and at most {MAX_DECODED_BYTES:,} are read")


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """Keep from the terminal what the OpenEXR library prints about a broken file before it raises.

    By one thread at a time: of two, one would put back what the other has put in the terminal's place.
    """
    with _SILENCE, contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        with contextlib.suppress(OSError):
            kept = os.dup(2)
            stack.callback(os.close, kept)
            stack.callback(os.dup2, kept, 2)
            null = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, null)
            os.dup2(null, 2)
        yield
