"""Read image files for textures: as they are stored, with the channels that they have.

| suffix | holds |
|---|---|
| .png .jpg .jpeg .bmp .tga .tif .tiff .webp | 8 or 16 bits, by custom sRGB; TIFF also float32 |
| .exr | float32 or float16, linear |
| .hdr | 8-bit mantissas with a common exponent, linear |
| .npy | floats of shape (height, width) or (height, width, 1..4), linear; or uint8 and uint16, as in .png |
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film import srgb
from raytracer.film.formats import hdr
from raytracer.film.formats.base.limits import BrokenImageError, check_size
from raytracer.film.formats.base.pillow import open_with_pillow
from raytracer.film.formats.exr import read_exr
from raytracer.scene.assets.gltf import read_image_bytes
from raytracer.util.errors import InputError, abbreviate
from raytracer.util.safe_open import NpyError, parse_npy, read_regular

_MOST_UINT16 = 65535.0

_IN_GLTF = re.compile(r"(.+\.(?:gltf|glb))#(\d+)", re.IGNORECASE)


class Image(NamedTuple):
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


def _decode_pillow(data: bytes) -> Image:
    with open_with_pillow(data) as file:
        if file.mode == "F":
            return Image(np.array(file, np.float32)[..., None], False)
        if file.mode.startswith("I"):
            return Image((np.array(file, np.float32) / np.float32(_MOST_UINT16))[..., None], True)
        transparent = "transparency" in file.info or file.mode in ("PA", "LA", "La", "RGBA", "RGBa")
        grey = file.mode in ("1", "L", "LA", "La")
        picture = file.convert(("LA" if transparent else "L") if grey else ("RGBA" if transparent else "RGB"))
        texels = np.array(picture, np.uint8)
    return Image(texels[..., None] if texels.ndim == 2 else texels, True)


def _decode_exr(data: bytes) -> Image:
    _, channels = read_exr(data)
    names = next((names for names in ("RGBA", "RGB", "YA", "Y") if all(name in channels for name in names)), None)
    if names is None and len(channels) != 1:
        raise BrokenImageError(f"has neither channels R, G, B nor Y, but {abbreviate(', '.join(channels)) or 'none'}")
    planes = [channels[name] for name in names or channels]
    return Image(np.stack([_single(plane) for plane in planes], axis=-1), False)


def _decode_hdr(data: bytes) -> Image:
    return Image(_single(hdr.decode(data)), False)


def _decode_npy(data: bytes) -> Image:
    stored = parse_npy(data)
    shape, dtype = stored.shape, stored.dtype
    if len(shape) not in (2, 3) or (len(shape) == 3 and not 1 <= shape[2] <= 4):
        raise BrokenImageError(f"must be of shape (height, width) or (height, width, 1 to 4), and is of {shape}")
    if dtype.kind != "f" and dtype not in (np.uint8, np.uint16):
        raise BrokenImageError(f"must hold floats, uint8 or uint16, and holds {dtype}")
    check_size(shape[1], shape[0], len(data))
    texels = stored.reshape(shape[0], shape[1], -1)
    if dtype == np.uint8:
        return Image(texels, True)
    return Image(_single(texels / _MOST_UINT16), True) if dtype == np.uint16 else Image(_single(texels), False)


def _single(array: NDArray[Any]) -> NDArray[np.float32]:
    # A float64 that float32 cannot hold becomes inf, which is refused with what was not finite from the start.
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


_DECODERS: dict[str, Callable[[bytes], Image]] = {
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp"), _decode_pillow),
    ".exr": _decode_exr,
    ".hdr": _decode_hdr,
    ".npy": _decode_npy,
}


def decode_image(data: bytes, suffix: str) -> Image:
    """Decode the image in the bytes of a file with this suffix.

    Raises
    ------
    ValueError : the suffix is not known, or the bytes are broken, too many, or hold what is not finite; the text
        completes the sentence "FILE: ...".
    """
    decode = _DECODERS.get(suffix.lower())
    if decode is None:
        problem = f"unknown suffix {suffix!r}" if suffix else "no suffix"
        raise BrokenImageError(f"{problem} for an image; known: {', '.join(_DECODERS)}")
    try:
        image = decode(data)
    except BrokenImageError:
        raise
    except NpyError as error:
        raise BrokenImageError(str(error)) from error
    except MemoryError:
        raise BrokenImageError("does not fit into memory") from None
    except Exception as error:
        # A broken file raises anything, from SyntaxError to struct.error.
        raise BrokenImageError(f"broken, or no {suffix} image") from error
    with np.errstate(invalid="ignore"):
        total = 0.0 if image.texels.dtype == np.uint8 else image.texels.sum(dtype=np.float64)
    if not np.isfinite(total):
        finite = np.isfinite(image.texels)
        row, column, channel = (int(index) for index in np.argwhere(~finite)[0])
        value = image.texels[row, column, channel]
        raise BrokenImageError(f"has a pixel that is not finite ({value} in row {row}, column {column})")
    return image


def file_of(path: Path) -> Path:
    """Return the file on the disk: for image N of a glTF file, `PATH#N`, the part before the #."""
    inside = _IN_GLTF.fullmatch(path.name)
    return path if inside is None else path.with_name(inside[1])


def read_image(path: str | Path) -> Image:
    """Read an image file, or image N of a glTF file `PATH#N`; see `decode_image`.

    Raises
    ------
    InputError : the file is missing, unreadable, broken, too large, not finite, or of an unknown suffix.
    """
    path = Path(path)
    inside = _IN_GLTF.fullmatch(path.name)
    try:
        if inside is not None:
            return decode_image(*read_image_bytes(path.with_name(inside[1]), int(inside[2])))
        data = read_regular(path) if path.suffix.lower() in _DECODERS else b""
        return decode_image(data, path.suffix)
    except BrokenImageError as error:
        raise InputError(f"{path}: {error}") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
