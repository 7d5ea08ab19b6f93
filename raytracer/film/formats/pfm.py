"""Portable float maps (.pfm): float32, rows from the bottom to the top.

Disparities, depths and some pictures are exchanged in them.

References: Debevec, "PFM Portable FloatMap Image Format"; HDRshop's documentation has the same.
"""

import math
import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import ImageFormat, Layers, check_size

if TYPE_CHECKING:
    from raytracer.film.image import Image

_HEADER = re.compile(rb"(P[Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+.\deE]{1,30})\s")
"""Kind, width, height, and the scale, whose sign is the byte order; one white space before the numbers."""


def encode(values: NDArray[np.floating]) -> bytes:
    """Encode a map of (height, width), or (height, width, 3), as float32; an array of another shape is a ValueError."""
    shape = values.shape
    if len(shape) not in (2, 3) or shape[2:] not in ((), (3,)):
        raise ValueError(f"a .pfm file holds an array of (height, width) or (height, width, 3), not {shape}")
    kind = "Pf" if len(shape) == 2 else "PF"
    with np.errstate(over="ignore"):
        numbers = np.ascontiguousarray(values[::-1], dtype="<f4")
    return f"{kind}\n{shape[1]} {shape[0]}\n-1.0\n".encode() + numbers.tobytes()


def decode(data: bytes) -> NDArray[np.float64]:
    """Decode a file to a map, float64 (height, width) or (height, width, 3), row 0 at the top.

    Raises
    ------
    ValueError : it is none, or truncated.
    """
    header = _HEADER.match(data)
    if header is None:
        raise ValueError("is no .pfm file")
    width, height, scale = int(header[2]), int(header[3]), float(header[4])
    if width == 0 or height == 0 or scale == 0.0 or not math.isfinite(scale):
        raise ValueError("is a .pfm file without a size or a scale")
    channels = 3 if header[1] == b"PF" else 1
    count = width * height * channels
    if len(data) - header.end() < 4 * count:
        raise ValueError(f"is truncated: a .pfm file of {width} x {height} has {4 * count} bytes of numbers")
    numbers = np.frombuffer(data, "<f4" if scale < 0.0 else ">f4", count, header.end())
    shape = (height, width) if channels == 1 else (height, width, channels)
    # A signalling nan becomes a quiet one.
    with np.errstate(invalid="ignore"):
        return numbers.astype(np.float64).reshape(shape)[::-1]


def encode_image(image: "Image", layers: Layers) -> bytes:
    """Encode the radiance of an image; layers and settings are left out."""
    return encode(image.radiance)


def decode_image(data: bytes) -> NDArray[np.float64]:
    """Decode a file to linear values, float64 (height, width, 3); of a grey one all channels are equal."""
    values = decode(data)
    height, width = values.shape[:2]
    check_size(width, height, len(data))
    return values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=2)


FORMAT = ImageFormat((".pfm",), is_linear=True, encode=encode_image, encode_map=encode, decode=decode_image, order=110)
