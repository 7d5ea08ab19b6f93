"""Images as their files store them, which textures are read from."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film import srgb


class StoredImage(NamedTuple):
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


def to_single(array: NDArray[np.generic]) -> NDArray[np.float32]:
    """Convert to float32; a float64 that it cannot hold becomes inf, which is refused with all that is not finite."""
    with np.errstate(over="ignore"):
        return array.astype(np.float32)
