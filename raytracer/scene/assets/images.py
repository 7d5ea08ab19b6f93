"""Read image files for textures: as they are stored, with the channels that they have, by `film.formats`."""

import re
from pathlib import Path

import numpy as np

from raytracer.film.formats.base.image_format import ImageFormat, StoredImage, to_single, wrap_decode_errors
from raytracer.film.formats.registry import image_formats, texture_suffixes
from raytracer.scene.assets.gltf import read_image_bytes
from raytracer.util.safe_open import BrokenFileError, check_suffix, name_read_errors, read_regular

_IN_GLTF = re.compile(r"(.+\.(?:gltf|glb))#(\d+)", re.IGNORECASE)


def decode_image(data: bytes, suffix: str) -> StoredImage:
    """Decode the image in the bytes of a file with this suffix, one of `texture_suffixes`.

    Raises
    ------
    BrokenFileError : the bytes are broken, too many, or hold what is not finite.
    MemoryError : the image does not fit into memory.
    """
    with wrap_decode_errors(suffix):
        image = _decode(data, image_formats()[suffix.lower()])
    with np.errstate(invalid="ignore"):
        total = 0.0 if image.texels.dtype == np.uint8 else image.texels.sum(dtype=np.float64)
    if not np.isfinite(total):
        finite = np.isfinite(image.texels)
        row, column, channel = (int(index) for index in np.argwhere(~finite)[0])
        value = image.texels[row, column, channel]
        raise BrokenFileError(f"has a pixel that is not finite ({value} in row {row}, column {column})")
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
    with name_read_errors(path):
        if inside is not None:
            return decode_image(*read_image_bytes(path.with_name(inside[1]), int(inside[2])))
        check_suffix(path, texture_suffixes(), "an image")
        return decode_image(read_regular(path), path.suffix)
