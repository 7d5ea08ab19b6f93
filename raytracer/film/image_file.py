"""Image files written and read: the format is that of the suffix, one of `raytracer.film.formats`.

A file is written to a temporary one and renamed, so that what stood there before is whole whatever goes wrong.
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import DecodedLayers, Layers, wrap_decode_errors
from raytracer.film.formats.registry import display_suffixes, image_formats, image_suffixes, writable_suffixes
from raytracer.util import safe_open
from raytracer.util.atomic_write import check_file, is_special, write_bytes
from raytracer.util.errors import InputError, OutputError

if TYPE_CHECKING:
    from raytracer.film.image import Image

# Bytes that are taken from a pipe at a time.
_CHUNK_BYTES = 1 << 20


def _format_suffix(path: Path, known: Sequence[str]) -> str:
    """Find the suffix of a path's format among those that are known, or raise an InputError; a device takes PNG."""
    if not path.suffix and is_special(path):
        return ".png"
    safe_open.check_suffix(path, known, "an image")
    return path.suffix.lower()


def check_writable(path: str | Path) -> None:
    """Check, before an image is rendered, that it can be written to `path`; leave nothing behind.

    Raises InputError: the suffix is not known, `path` is a folder or protected, or its folder cannot be written.
    """
    check_file(path)
    _format_suffix(Path(path), writable_suffixes())


def save(image: "Image", path: str | Path, layers: Layers | None = None) -> None:
    """Write `image` to `path` in the format that its suffix names.

    Parameters
    ----------
    layers : arrays besides the image's own layers, for .exr, of shape (height, width) for a channel of that name, or
        (height, width, 3) for the channels R, G and B of a layer of that name.

    Raises
    ------
    InputError : the suffix is not known, or a light field asked for of a picture that is none.
    OutputError : the format cannot hold the image, or the file cannot be written.
    """
    path = Path(path)
    suffix = _format_suffix(path, writable_suffixes())
    image_format = image_formats()[suffix]
    if image_format.write is not None:
        image_format.write(image, path)
        return
    assert image_format.encode is not None
    try:
        data = image_format.encode(image, layers or {})
    except (ValueError, OSError, RuntimeError) as error:
        height, width, _ = image.radiance.shape
        raise OutputError(f"{path}: an image of {width} x {height} pixels cannot be written as {suffix}") from error
    write_bytes(path, data)


def _read_bytes(path: Path) -> bytes:
    """Read the bytes of a file, or of a pipe, which has no suffix."""
    if path.suffix or not is_special(path):
        return safe_open.read_regular(path)
    data = bytearray()
    with path.open("rb") as pipe:
        while piece := pipe.read(_CHUNK_BYTES):
            data += piece
            if len(data) > safe_open.MAX_BYTES:
                raise safe_open.BrokenFileError(f"has more than the {safe_open.MAX_BYTES:,} bytes that are read")
    return bytes(data)


def load(path: str | Path) -> NDArray[np.float64]:
    """Read linear values of an image file: float64 (height, width, 3), row 0 at the top.

    .png, .jpg and .tif are decoded from sRGB, without transparency and profiles; a grey image has equal channels.

    Raises
    ------
    InputError : the file is missing, unreadable or broken, or of an unknown suffix.
    """
    path = Path(path)
    decode = image_formats()[_format_suffix(path, image_suffixes())].decode
    assert decode is not None
    with safe_open.name_read_errors(path), wrap_decode_errors(path.suffix):
        return decode(_read_bytes(path))


def load_encoded(path: str | Path) -> NDArray[np.float64]:
    """Read values of a .png, .jpg or .tif file as it holds them, sRGB: float64 (height, width, 3) in 0..1.

    Raises InputError: as `load`; or the file is of a linear format.
    """
    path = Path(path)
    image_format = image_formats().get(path.suffix.lower())
    if image_format is None or image_format.decode_display is None:
        raise InputError(f"{path}: only {', '.join(display_suffixes())} files hold display values")
    with safe_open.name_read_errors(path), wrap_decode_errors(path.suffix):
        return image_format.decode_display(safe_open.read_regular(path))


def load_layers(path: str | Path, wanted: Collection[str] | None = None) -> DecodedLayers:
    """Read layers and settings of an .exr file that `save` wrote, or another program.

    The layers are float64, (height, width, 3) where a layer has the channels R, G and B or X, Y and Z, (height, width,
    2) where it has X and Y, and (height, width) for every other channel, by the layer's name if it is the only one; the
    image itself is called `radiance`.  The settings are strings.  Only the layers `wanted` are read, if any are named.

    Raises
    ------
    InputError : the file is missing, unreadable or broken, or not an .exr file.
    """
    path = Path(path)
    image_format = image_formats().get(path.suffix.lower())
    if image_format is None or image_format.decode_layers is None:
        known = [suffix for suffix, each in image_formats().items() if each.decode_layers is not None]
        raise InputError(f"{path}: only {', '.join(known)} files have layers")
    with safe_open.name_read_errors(path), wrap_decode_errors(path.suffix):
        return image_format.decode_layers(safe_open.read_regular(path), wanted)
