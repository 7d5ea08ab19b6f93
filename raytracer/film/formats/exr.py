"""OpenEXR files (.exr): float32, linear, or uint32 for identifiers; variance, layers, and settings as attributes.

The radiance has the channels R, G and B, another layer `NAME.R` and so on, or its own name for a single one; the name
of a setting's attribute has `rt.` before it.
"""

import contextlib
import io
import os
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import (
    DecodedLayers,
    ImageFormat,
    Layers,
    StoredImage,
    check_size,
    header_settings,
    to_single,
)
from raytracer.util.errors import abbreviate
from raytracer.util.safe_open import BrokenFileError

if TYPE_CHECKING:
    from raytracer.film.image import Image

MAX_DECODED_BYTES = 2**32
"""Bytes of all channels of a file, as float32, that are read: 2^28 pixels of four."""

_PREFIX = "rt."

CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Red, green, blue and white of Rec. 709, as x and y each."""

# 1024 x 1024, for a picture that is smaller; programs write 16 to 512 a side.
_MAX_TILE_PIXELS = 2**20

_SILENCE = threading.Lock()


def encode_exr(image: "Image", layers: Layers) -> bytes:
    """Encode an image with its variance, its layers and further ones."""
    import OpenEXR

    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= {"chromaticities": CHROMATICITIES}
    header |= {_PREFIX + key: value for key, value in header_settings(image).items()}
    variance = {} if image.variance is None else {"variance": image.variance}
    arrays: dict[str, NDArray[Any]] = {"": image.radiance, **variance, **image.layers, **layers}

    # A float64 that float32 cannot hold becomes inf, as it should; identifiers stay integers.
    channels: dict[str, NDArray[Any]] = {}
    for layer, array in arrays.items():
        planes = np.atleast_3d(array)
        names = image.channels.get(layer) or (("",) if array.ndim == 2 else tuple("RGB"))
        with np.errstate(over="ignore"):
            planes = planes if planes.dtype == np.uint32 else planes.astype(np.float32)
        for number, name in enumerate(names):
            full = ".".join(part for part in (layer, name) if part)
            channels[full] = np.ascontiguousarray(planes[..., number])
    buffer = io.BytesIO()
    OpenEXR.File(header, channels).write(buffer)
    return buffer.getvalue()


def decode_exr(data: bytes) -> NDArray[np.float64]:
    """Decode the radiance of a file, float64 (height, width, 3); of a grey one all channels are equal.

    Raises BrokenFileError: it has neither R, G and B nor Y; or as `read_exr`.
    """
    layers, _ = decode_exr_layers(data, {"radiance"})
    if "radiance" not in layers and "Y" not in layers:
        raise BrokenFileError("has neither channels R, G and B nor Y")
    return layers["radiance"] if "radiance" in layers else np.repeat(layers["Y"][..., None], 3, axis=2)


def decode_exr_layers(data: bytes, wanted: Collection[str] | None = None) -> DecodedLayers:
    """Decode layers and settings; see `raytracer.film.image_file.load_layers`, and `read_exr` for errors."""

    def is_wanted(name: str) -> bool:
        return wanted is None or (name.rpartition(".")[0] or "radiance") in wanted or name in wanted

    header, planes = read_exr(data, is_wanted)
    channels = {name: np.asarray(plane, dtype=np.float64) for name, plane in planes.items()}
    settings = {key[len(_PREFIX) :]: str(value) for key, value in header.items() if key.startswith(_PREFIX)}

    # Put the channels of a layer together again.
    layers: dict[str, NDArray[np.float64]] = {}
    for stem in dict.fromkeys(name[: name.rfind(".") + 1] for name in channels):
        own = [name for name in channels if name[: name.rfind(".") + 1] == stem]
        for components in ("RGB", "XYZ", "XY"):
            names = [stem + c for c in components]
            # The image's own channels are not taken for a vector in the plane.
            if all(n in own for n in names) and (stem or components != "XY"):
                layers[stem.removesuffix(".") or "radiance"] = np.stack([channels.pop(n) for n in names], axis=-1)
                break
        else:
            if stem and len(own) == 1:
                layers[stem.removesuffix(".")] = channels.pop(own[0])
    return {**layers, **channels}, settings


def decode_exr_stored(data: bytes) -> StoredImage:
    """Decode colours or grey, with opacity if there is one, or the only channel.

    Raises BrokenFileError: it has neither; or as `read_exr`.
    """
    _, channels = read_exr(data)
    names = next((names for names in ("RGBA", "RGB", "YA", "Y") if all(name in channels for name in names)), None)
    if names is None and len(channels) != 1:
        raise BrokenFileError(f"has neither channels R, G, B nor Y, but {abbreviate(', '.join(channels)) or 'none'}")
    return StoredImage(np.stack([to_single(channels[name]) for name in names or channels], axis=-1), False)


def read_exr(
    data: bytes, is_wanted: Callable[[str], bool] = lambda name: True
) -> tuple[Mapping[str, Any], dict[str, NDArray[Any]]]:
    """Read the header of a file, and those channels (height, width) of its first part that are wanted, by name.

    Raises BrokenFileError: see `check_size`; or its parts hold deep pixels, or more bytes than are read.
    Raises Exception: whatever OpenEXR raises about broken files.
    """
    import OpenEXR

    with suppress_library_output():
        with OpenEXR.File(io.BytesIO(data), separate_channels=True, header_only=True) as file:
            check_parts([part.header for part in file.parts], len(data))
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            header = dict(file.header())
            planes = {name: np.asarray(channel.pixels) for name, channel in file.channels().items() if is_wanted(name)}
    if any(plane.ndim != 2 or plane.dtype.kind not in "fu" for plane in planes.values()):
        raise BrokenFileError("holds channels that are no planes of numbers")
    return header, planes


def check_parts(headers: Sequence[Mapping[str, Any]], length: int) -> None:
    """Refuse a file for what the headers of its parts say; all are decoded, wanted or not."""
    size = 0
    for header in headers:
        (left, top), (right, bottom) = (tuple(int(value) for value in corner) for corner in header["dataWindow"])
        width, height = right - left + 1, bottom - top + 1
        check_size(width, height, length)
        if "deep" in str(header.get("type", "")):
            raise BrokenFileError("holds deep pixels, which are not read")
        # Memory is allocated for a whole tile, however small the picture.
        tiles = header.get("tiles")
        if tiles is not None and tiles.xSize * tiles.ySize > max(_MAX_TILE_PIXELS, width * height):
            raise BrokenFileError(f"has tiles of {tiles.xSize} x {tiles.ySize} for {width} x {height} pixels")
        size += width * height * len(header["channels"]) * np.dtype(np.float32).itemsize
    if size > MAX_DECODED_BYTES:
        raise BrokenFileError(f"has channels of {size:,} bytes, and at most {MAX_DECODED_BYTES:,} are read")


@contextlib.contextmanager
def suppress_library_output() -> Iterator[None]:
    """Keep from the terminal what the OpenEXR library prints about a broken file before it raises.

    By one thread at a time: of two, one would restore what the other has redirected.
    """
    with _SILENCE, contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        with contextlib.suppress(OSError):
            stderr = os.dup(2)
            stack.callback(os.close, stderr)
            stack.callback(os.dup2, stderr, 2)
            null = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, null)
            os.dup2(null, 2)
        yield


FORMAT = ImageFormat(
    (".exr",),
    is_linear=True,
    has_layers=True,
    encode=encode_exr,
    decode=decode_exr,
    decode_layers=decode_exr_layers,
    decode_stored=decode_exr_stored,
    order=70,
)
