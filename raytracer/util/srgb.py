"""The sRGB transfer function, from linear to encoded values and back.

References: IEC 61966-2-1:1999, with amendment 1 (2003), section 5.2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

_LINEAR_END, _ENCODED_END = 0.0031308, 0.04045
"""Ends of the linear part of the function, in linear and in encoded values."""


def encode(linear: ArrayLike) -> NDArray[np.float64]:
    """Encode `linear` values of any shape, clipped to 0..1, to values in 0..1."""
    x = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(x <= _LINEAR_END, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def decode(encoded: ArrayLike) -> NDArray[np.float64]:
    """Decode `encoded` values in 0..1, of any shape, to linear values."""
    x = np.asarray(encoded, dtype=np.float64)
    # The bracket is kept from below 0, where the other branch is taken anyway.
    return np.where(x <= _ENCODED_END, x / 12.92, (np.maximum(x + 0.055, 0.0) / 1.055) ** 2.4)


def to_uint8(linear: ArrayLike) -> NDArray[np.uint8]:
    """Encode `linear` values of any shape to the nearest of 0..255; NaN becomes 0.

    255 times the encoded value is rounded to the nearest integer, a tie to the even one.
    """
    encoded = encode(linear)
    return np.rint(np.where(np.isnan(encoded), 0.0, 255.0 * encoded)).astype(np.uint8)
