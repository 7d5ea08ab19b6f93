"""Packets of tev's protocol: those that make an image, and that change a part of it.

A packet is its length in bytes, which counts itself, a byte for the operation, and the operation's fields.  Integers
and floats are little endian; strings are UTF-8 and end with a zero byte.

References: https://github.com/Tom94/tev, README, "Over the Network", and the declarations in include/tev/Ipc.h.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

CHANNELS = ("R", "G", "B")

_CREATE_IMAGE, _UPDATE_IMAGE_V3 = 4, 6


def create_image(name: str, width: int, height: int, channels: Sequence[str] = CHANNELS) -> bytes:
    """Make the packet that has tev show a new image, in place of one that has its name."""
    fields = struct.pack("<iii", width, height, len(channels))
    return _packet(_CREATE_IMAGE, b"\1", _text(name), fields, *map(_text, channels))


def update_image(name: str, x: int, y: int, pixels: NDArray[np.float32], channels: Sequence[str] = CHANNELS) -> bytes:
    """Make the packet that changes a rectangle of an image, and leaves what tev shows.

    x, y : place of the first pixel.
    pixels : float32 (height, width, channels).
    """
    height, width, count = pixels.shape
    window = struct.pack("<iiii", x, y, width, height)
    # Channel c of pixel i is number c + count * i of the data.
    layout = struct.pack(f"<{2 * count}q", *range(count), *[count] * count)
    names = map(_text, channels)
    data = pixels.astype("<f4", copy=False).tobytes()
    return _packet(_UPDATE_IMAGE_V3, b"\0", _text(name), struct.pack("<i", count), *names, window, layout, data)


def _packet(operation: int, *fields: bytes) -> bytes:
    body = b"".join((bytes([operation]), *fields))
    return struct.pack("<I", 4 + len(body)) + body


def _text(text: str) -> bytes:
    return text.replace("\0", "").encode("utf-8", "replace") + b"\0"
