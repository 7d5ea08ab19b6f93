"""Image files opened by Pillow, their size checked before pixels are decoded."""

import contextlib
import io
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film import srgb
from raytracer.film.formats.base.limits import BrokenImageError, check_size

if TYPE_CHECKING:
    import PIL.Image

# Pillow would try all that it knows, by content: PostScript, which it hands to another program, among them.
_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "WEBP")


@contextlib.contextmanager
def open_with_pillow(data: bytes, formats: tuple[str, ...] = _FORMATS) -> Iterator["PIL.Image.Image"]:
    """Open an image file, and check its size; its pixels are decoded when they are asked for.

    Raises
    ------
    BrokenImageError : see `check_size`.
    Exception : whatever Pillow raises about broken files.
    """
    import PIL.Image

    from raytracer.core.compiler.lock import compiler_lock

    _check_webp(data)
    with compiler_lock, _disable_size_limit(), warnings.catch_warnings():
        # What Pillow warns of is either of no matter here or raises when it decodes.
        warnings.simplefilter("ignore")
        with PIL.Image.open(io.BytesIO(data), formats=formats) as file:
            check_size(*file.size, len(data))
            yield file


def decode_linear(data: bytes) -> NDArray[np.float64]:
    """Decode a PNG or JPEG file to linear values, float64 (height, width, 3)."""
    return _decode(data, is_linear=True)


def decode_display(data: bytes) -> NDArray[np.float64]:
    """Decode a PNG or JPEG file to the values that it holds, sRGB-encoded: float64 (height, width, 3) in 0..1."""
    return _decode(data, is_linear=False)


def _decode(data: bytes, *, is_linear: bool) -> NDArray[np.float64]:
    with open_with_pillow(data, ("PNG", "JPEG")) as file:
        is_deep = file.mode.startswith("I")
        stored = np.asarray(file if is_deep else file.convert("RGB"))

    # A power for each of all values that there may be is quicker than one for each pixel.
    largest = 65535 if is_deep else 255
    shades = np.arange(largest + 1) / largest
    values = np.take(srgb.decode(shades) if is_linear else shades, stored)
    return np.repeat(values[..., None], 3, axis=2) if is_deep else values


def is_transparent(data: bytes) -> bool:
    """Return True if an image file that Pillow reads has an opacity.

    Raises
    ------
    BrokenImageError : it cannot be opened.
    """
    try:
        with open_with_pillow(data) as file:
            return "A" in file.getbands() or "transparency" in file.info
    except Exception as error:
        # A broken file raises anything, from SyntaxError to struct.error.
        raise BrokenImageError("is broken, or no image") from error


def _check_webp(data: bytes) -> None:
    """Check the size of a WebP file, for which Pillow allocates memory as soon as it opens it.

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
def _disable_size_limit() -> Iterator[None]:
    """Keep Pillow from judging sizes, which are checked here before pixels are decoded."""
    import PIL.Image

    limit = PIL.Image.MAX_IMAGE_PIXELS
    PIL.Image.MAX_IMAGE_PIXELS = None
    try:
        yield
    finally:
        PIL.Image.MAX_IMAGE_PIXELS = limit
