"""Pixels of raw pictures as Lytro's cameras pack them.

References: J. Kucera (miloush), "The File Format", http://optics.miloush.net/lytro/TheFileFormat.aspx (12 bits);
D. Dansereau, LFToolbox, LFReadRaw; imageio, plugin lytro (10 bits).
"""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.util.safe_open import BrokenFileError

_BYTE = 8

_GROUPS = {_BYTE: (1, 1), 10: (5, 4), 12: (3, 2), 16: (2, 1)}
"""Bytes that hold so many pixels, by the bits of a pixel."""


def unpack_pixels(data: bytes, width: int, height: int, bits: int, endianness: str) -> NDArray[np.uint16]:
    """Unpack the codes of the pixels, (height, width), row by row from the top left.

    12 bits, big-endian (F01): two pixels in three bytes, the first in the higher bits.  10 bits, little-endian (Illum):
    four pixels in five bytes, the higher eight bits of each, and in the fifth their lower two, the first lowest.
    8 and 16 bits: as they are.

    Raises
    ------
    BrokenFileError : the packing is not known, or there are too few bytes.
    """
    count = width * height
    if bits not in (_BYTE, 16) and (bits, endianness) not in ((12, "big"), (10, "little")):
        raise BrokenFileError(
            f"has pixels of {bits} bits, {endianness}-endian: known are 12, big (F01), 10, little (Illum), 8 and 16"
        )
    group, pixels = _GROUPS[bits]
    groups = math.ceil(count / pixels)
    if len(data) < group * groups:
        raise BrokenFileError(
            f"has {len(data):,} bytes of pixels, and {width} x {height} of {bits} bits take {group * groups:,}"
        )
    if bits in (_BYTE, 16):
        order = ">" if endianness == "big" else "<"
        codes = np.frombuffer(data, f"{order}u{bits // _BYTE}", count)
        return codes.astype(np.uint16).reshape(height, width)
    part = np.frombuffer(data, np.uint8, group * groups).reshape(groups, group)
    codes = np.empty((groups, pixels), np.uint16)
    if bits == 12:
        middle = part[:, 1].astype(np.uint16)
        codes[:, 0] = part[:, 0].astype(np.uint16) << 4 | middle >> 4
        codes[:, 1] = (middle & 15) << 8 | part[:, 2]
    else:
        for pixel in range(pixels):
            codes[:, pixel] = part[:, pixel].astype(np.uint16) << 2 | part[:, 4] >> (2 * pixel) & 3
    return codes.reshape(-1)[:count].reshape(height, width)
