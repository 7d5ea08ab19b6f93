"""Image files read and written by Pillow, their size checked before pixels are decoded."""

import contextlib
import io
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.deep import is_deep, read_deep
from raytracer.film.formats.base.image_format import StoredImage, check_size
from raytracer.util import srgb
from raytracer.util.safe_open import BrokenFileError

if TYPE_CHECKING:
    import PIL.Image

# Pillow would try all that it knows, by content: PostScript, which it hands to another program, among them.
_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "WEBP")

_LARGEST_UINT16 = 65535
_MOST_UINT16 = np.float32(_LARGEST_UINT16)


@contextlib.contextmanager
def open_with_pillow(data: bytes, formats: tuple[str, ...] = _FORMATS) -> Iterator["PIL.Image.Image"]:
    """Open an image file, and check its size; its pixels are decoded when they are asked for.

    Raises BrokenFileError: see `check_size`.
    Raises Exception: whatever Pillow raises about broken files.
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
    """Decode a PNG, JPEG or TIFF file to linear values, float64 (height, width, 3)."""
    return _decode(data, is_linear=True)


def decode_display(data: bytes) -> NDArray[np.float64]:
    """Decode a PNG, JPEG or TIFF file to the values that it holds, sRGB-encoded: float64 (height, width, 3) in 0..1."""
    return _decode(data, is_linear=False)


def _decode(data: bytes, *, is_linear: bool) -> NDArray[np.float64]:
    samples = _read_samples(data, ("PNG", "JPEG", "TIFF"), is_opaque=True)
    if samples.dtype == np.float32:
        # Numbers that a file stores as such are linear light.
        values = samples.astype(np.float64)
        values = values if is_linear else srgb.encode(values)
    else:
        # A power for each of all values that there may be is quicker than one for each pixel.
        largest = int(np.iinfo(samples.dtype).max)
        shades = np.arange(largest + 1) / largest
        values = np.take(srgb.decode(shades) if is_linear else shades, samples)
    channels = values.shape[2]
    return np.repeat(values[..., :1], 3, axis=2) if channels < 3 else values[..., :3]


def decode_stored(data: bytes) -> StoredImage:
    """Decode a file of any of the formats that Pillow reads for textures, with the channels that it has."""
    samples = _read_samples(data, _FORMATS)
    if samples.dtype == np.uint8:
        return StoredImage(samples.astype(np.uint8), True)
    is_integer = samples.dtype == np.uint16
    return StoredImage(samples.astype(np.float32) / (_MOST_UINT16 if is_integer else np.float32(1.0)), is_integer)


def _read_samples(data: bytes, formats: tuple[str, ...], *, is_opaque: bool = False) -> NDArray[Any]:
    """Read the channels of a file as they are stored, uint8, uint16 or float32 (height, width, channels).

    Channels are grey, or red, green and blue, and opacity where the file has it, unless `is_opaque`.
    """
    with open_with_pillow(data, formats) as file:
        if file.mode == "F":
            return np.asarray(np.array(file, np.float32)[..., None])
        if file.mode.startswith("I"):
            return np.asarray(np.clip(np.array(file), 0, _LARGEST_UINT16).astype(np.uint16)[..., None])
        if is_deep(file, data):
            return read_deep(lambda content: open_with_pillow(content, formats), file, data)
        transparent = "transparency" in file.info or file.mode in ("PA", "LA", "La", "RGBA", "RGBa")
        transparent &= not is_opaque
        grey = file.mode in ("1", "L", "LA", "La")
        picture = file.convert(("LA" if transparent else "L") if grey else ("RGBA" if transparent else "RGB"))
        texels = np.array(picture, np.uint8)
    return texels[..., None] if texels.ndim == 2 else texels


def encode_pixels(pixels: NDArray[np.uint8], name: str, **settings: Any) -> bytes:
    """Encode pixels in the format that Pillow knows by `name`."""
    import PIL.Image

    return _encode(PIL.Image.fromarray(pixels), name, **settings)


def encode_frames(
    frames: Sequence[NDArray[np.uint8]], duration: int, boomerang: bool, *, name: str, **settings: Any
) -> bytes:
    """Encode an animation in the format that Pillow knows by `name`; see `ImageFormat`."""
    import PIL.Image

    return encode_animation([PIL.Image.fromarray(frame) for frame in frames], duration, boomerang, name, **settings)


def encode_animation(
    pictures: Sequence["PIL.Image.Image"], duration: int, boomerang: bool, name: str, **settings: Any
) -> bytes:
    """Encode pictures as an animation that repeats without end; see `encode_frames`."""
    first, *others = [*pictures, *(pictures[-2:0:-1] if boomerang else ())]
    return _encode(first, name, save_all=True, append_images=others, duration=duration, loop=0, **settings)


def _encode(picture: "PIL.Image.Image", name: str, **settings: Any) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, name, **settings)
    return buffer.getvalue()


def is_transparent(data: bytes) -> bool:
    """Return True if an image file that Pillow reads has an opacity; a BrokenFileError if it cannot be opened."""
    try:
        with open_with_pillow(data) as file:
            return "A" in file.getbands() or "transparency" in file.info
    except Exception as error:
        # A broken file raises anything, from SyntaxError to struct.error.
        raise BrokenFileError("is broken, or no image") from error


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
