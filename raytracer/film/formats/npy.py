"""NumPy files (.npy): float64, linear, every bit of the radiance."""

import io
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import ImageFormat, Layers
from raytracer.film.formats.base.limits import BrokenImageError, check_size
from raytracer.util import safe_open

if TYPE_CHECKING:
    from raytracer.film.image import Image


def encode_npy(image: "Image", layers: Layers) -> bytes:
    """Encode the radiance of an image as float64 (height, width, 3); layers and settings are left out."""
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(image.radiance, dtype=np.float64), allow_pickle=False)
    return buffer.getvalue()


def decode_npy(data: bytes) -> NDArray[np.float64]:
    """Decode a file to linear values, float64 (height, width, 3).

    Raises
    ------
    BrokenImageError, NpyError : it holds no numbers of that shape.
    """
    array = safe_open.parse_npy(data)
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise BrokenImageError("is no array of numbers of the shape (height, width, 3)")
    check_size(array.shape[1], array.shape[0], len(data))
    return np.asarray(array, dtype=np.float64)


FORMAT = ImageFormat((".npy",), encode=encode_npy, decode=decode_npy, order=5)
