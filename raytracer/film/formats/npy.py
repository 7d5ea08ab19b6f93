"""NumPy files (.npy): float64, linear, every bit of the radiance."""

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import ImageFormat, Layers, StoredImage, check_size, to_single
from raytracer.util import safe_open
from raytracer.util.safe_open import BrokenFileError

if TYPE_CHECKING:
    from raytracer.film.image import Image

_MOST_UINT16 = 65535.0


def encode_npy(image: "Image", layers: Layers) -> bytes:
    """Encode the radiance of an image as float64 (height, width, 3); layers and settings are left out."""
    return encode_array(np.asarray(image.radiance, dtype=np.float64))


def encode_array(array: NDArray[Any]) -> bytes:
    """Encode an array of numbers as it is."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()


def decode_npy(data: bytes) -> NDArray[np.float64]:
    """Decode a file to linear values, float64 (height, width, 3), equal ones for one channel.

    Raises BrokenFileError: it holds something else.
    """
    array = safe_open.parse_npy(data)
    if array.ndim == 2:
        array = array[..., None]
    if array.ndim != 3 or array.shape[2] not in (1, 3) or array.dtype.kind not in "fiu":
        raise BrokenFileError("is no array of numbers of the shape (height, width, 3) or (height, width)")
    check_size(array.shape[1], array.shape[0], len(data))
    values = np.asarray(array, dtype=np.float64)
    return values if values.shape[2] == 3 else np.repeat(values, 3, axis=2)


def decode_npy_stored(data: bytes) -> StoredImage:
    """Decode one to four channels of floats, or uint8 and uint16 as of a PNG file; else raise a BrokenFileError."""
    stored = safe_open.parse_npy(data)
    shape, dtype = stored.shape, stored.dtype
    if len(shape) not in (2, 3) or (len(shape) == 3 and not 1 <= shape[2] <= 4):
        raise BrokenFileError(f"must be of shape (height, width) or (height, width, 1 to 4), and is of {shape}")
    if dtype.kind != "f" and dtype not in (np.uint8, np.uint16):
        raise BrokenFileError(f"must hold floats, uint8 or uint16, and holds {dtype}")
    check_size(shape[1], shape[0], len(data))
    texels = stored.reshape(shape[0], shape[1], -1)
    if dtype == np.uint8:
        return StoredImage(texels, True)
    is_deep = dtype == np.uint16
    return StoredImage(to_single(texels / _MOST_UINT16 if is_deep else texels), is_deep)


FORMAT = ImageFormat(
    (".npy",),
    is_linear=True,
    encode=encode_npy,
    encode_map=encode_array,
    decode=decode_npy,
    decode_stored=decode_npy_stored,
    order=90,
)
