"""Read image files for textures: as they are stored, with the channels that they have, by `film.formats`."""

import re
from pathlib import Path

import numpy as np

from raytracer.film.formats.base.image_format import ImageFormat
from raytracer.film.formats.base.limits import BrokenImageError
from raytracer.film.formats.base.stored_image import StoredImage, to_single
from raytracer.film.formats.registry import image_formats, texture_suffixes
from raytracer.scene.assets.gltf import read_image_bytes
from raytracer.util.errors import InputError
from raytracer.util.safe_open import NpyError, read_regular

_IN_GLTF = re.compile(r"(.+\.(?:gltf|glb))#(\d+)", re.IGNORECASE)


def decode_image(data: bytes, suffix: str) -> StoredImage:
    """Decode the image in the bytes of a file with this suffix.

    Raises
    ------
    ValueError : the suffix is not known, or the bytes are broken, too many, or hold what is not finite; the text
        completes the sentence "FILE: ...".
    """
    if suffix.lower() not in texture_suffixes():
        problem = f"unknown suffix {suffix!r}" if suffix else "no suffix"
        raise BrokenImageError(f"{problem} for an image; known: {', '.join(texture_suffixes())}")
    try:
        image = _decode(data, image_formats()[suffix.lower()])
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


def _decode(data: bytes, image_format: ImageFormat) -> StoredImage:
    """Decode an image as it is stored, or what the format tells of it: colours, linear or for a display."""
    if image_format.decode_stored is not None:
        return image_format.decode_stored(data)
    decode = image_format.decode_display or image_format.decode
    assert decode is not None
    return StoredImage(to_single(decode(data)), not image_format.is_linear)


def file_of(path: Path) -> Path:
    """Return the file on the disk: for image N of a glTF file, `PATH#N`, the part before the #."""
    inside = _IN_GLTF.fullmatch(path.name)
    return path if inside is None else path.with_name(inside[1])


def read_image(path: str | Path) -> StoredImage:
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
        data = read_regular(path) if path.suffix.lower() in texture_suffixes() else b""
        return decode_image(data, path.suffix)
    except BrokenImageError as error:
        raise InputError(f"{path}: {error}") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
