"""Radiance RGBE files (.hdr): four bytes a pixel, three mantissas with one exponent, run-length encoded.

A pixel (r, g, b, e) with e > 0 stands for (r, g, b) 2^(e - 136), and (0, 0, 0, 0) for black; the values keep about
three decimal digits.  Radiance's own readers add half a step to every mantissa, because its writers cut off the
fraction; here the mantissa is rounded, for readers that add nothing, which most others are.  Settings are header lines,
`rt.NAME=VALUE`.

References: Ward 1991, "Real Pixels", Graphics Gems II, pp. 80-83; G. Ward, "Radiance File Formats", section "Picture
    File Format (.hdr)".
"""

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import ImageFormat, Layers, check_size, header_settings

if TYPE_CHECKING:
    from raytracer.film.image import Image

# The widths for which the run-length encoding is defined; other scanlines are written flat.
_NARROWEST, _WIDEST = 8, 0x7FFF

# A shorter run costs more as a packet of its own than inside a literal packet that it interrupts.
_SHORTEST_RUN = 4
_LONGEST_RUN, _LONGEST_LITERAL = 127, 128

# Two bytes make a run of 127 at most and a pixel needs four, so no file holds more pixels a byte.
_MAX_PIXELS_PER_BYTE = 16

# Bytes encoded or decoded at once: bounds the memory taken by the indices.
_BLOCK = 1 << 20

_LARGEST = 255 * 2.0 ** (127 - 8)


def to_rgbe(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Convert linear values (height, width, 3) to the nearest pixels (height, width, 4).

    NaN and negative values become 0, and values beyond 255 2^119 become that.
    """
    values = np.clip(np.where(np.isnan(linear), 0.0, linear), 0.0, _LARGEST)
    largest = values.max(axis=-1)
    exponent = np.frexp(largest)[1]

    # The largest mantissa may round up to 256, which takes the next exponent.
    exponent += np.rint(np.ldexp(largest, 8 - exponent)) > 255
    mantissa = np.rint(np.ldexp(values, (8 - exponent)[..., None]))

    pixels = np.empty((*largest.shape, 4), dtype=np.uint8)
    pixels[..., :3] = mantissa
    pixels[..., 3] = np.clip(exponent + 128, 0, 255)
    pixels[(largest == 0.0) | (exponent < -127)] = 0
    return pixels


def from_rgbe(pixels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Convert pixels (height, width, 4) to linear values (height, width, 3)."""
    exponent = pixels[..., 3:].astype(np.int32)
    return np.where(exponent > 0, np.ldexp(pixels[..., :3].astype(np.float64), exponent - 136), 0.0)


def encode_hdr(image: "Image", layers: Layers) -> bytes:
    """Encode the radiance and the settings of an image; layers are left out."""
    return encode(image.radiance, header_settings(image))


def _encode_rows(planes: NDArray[np.uint8]) -> bytes:
    """Run-length encode scanlines (rows, 4, width), whose components follow one another."""
    width = planes.shape[2]
    flat = planes.reshape(-1)

    # Cut the bytes into runs of equal ones; none crosses from one component to the next.
    changes = np.empty(flat.size, dtype=bool)
    np.not_equal(flat[1:], flat[:-1], out=changes[1:])
    changes[::width] = True
    starts = np.flatnonzero(changes)
    long = np.diff(starts, append=flat.size) >= _SHORTEST_RUN

    # Join neighbouring short runs of a component to one literal segment.
    joined = ~long
    joined[1:] &= ~long[:-1]
    joined[starts % width == 0] = False
    starts, long = starts[~joined], long[~joined]
    ends = np.append(starts[1:], flat.size)

    # Split the segments into packets that a length byte can count.
    limit = np.where(long, _LONGEST_RUN, _LONGEST_LITERAL)
    packets = -(-(ends - starts) // limit)
    segment = np.repeat(np.arange(starts.size), packets)
    nth = np.arange(segment.size) - np.repeat(np.cumsum(packets) - packets, packets)
    start = starts[segment] + nth * limit[segment]
    length = np.minimum(limit[segment], ends[segment] - start)
    is_run = long[segment]

    # Place the packets: a length byte and its payload each, and four bytes before those of a scanline.
    payload = np.where(is_run, 1, length)
    ahead = np.cumsum(payload) - payload
    place = ahead + np.arange(start.size) + 4 * (start // (4 * width) + 1)
    out = np.empty(payload.sum() + payload.size + 4 * len(planes), dtype=np.uint8)
    out[place] = np.where(is_run, 128 + length, length)
    byte = np.arange(payload.sum())
    out[byte + np.repeat(place + 1 - ahead, payload)] = flat[byte + np.repeat(start - ahead, payload)]
    heads = place[start % (4 * width) == 0] - 4
    out[heads[:, None] + np.arange(4)] = (2, 2, width >> 8, width & 255)
    return out.tobytes()


def encode(linear: NDArray[np.float64], settings: Mapping[str, str]) -> bytes:
    """Encode linear values (height, width, 3), with a header line for each setting."""
    height, width, _ = linear.shape
    lines = ["#?RADIANCE", "FORMAT=32-bit_rle_rgbe", "PRIMARIES=0.64 0.33 0.30 0.60 0.15 0.06 0.3127 0.3290"]
    lines += [" ".join(f"rt.{key}={value}".splitlines()) for key, value in settings.items()]
    header = "\n".join([*lines, "", f"-Y {height} +X {width}", ""]).encode()

    if not _NARROWEST <= width <= _WIDEST:
        return header + to_rgbe(linear).tobytes()
    step = max(1, _BLOCK // (4 * width))
    blocks = (np.ascontiguousarray(to_rgbe(linear[y : y + step]).transpose(0, 2, 1)) for y in range(0, height, step))
    return header + b"".join(_encode_rows(block) for block in blocks)


def _decode_row(data: bytes, at: int, row: bytearray) -> int:
    """Fill `row` with the packets from `at` on, and return where they end."""
    filled = 0
    while filled < len(row):
        code = data[at]
        if code > _LONGEST_LITERAL:
            count = code - 128
            row[filled : filled + count] = data[at + 1 : at + 2] * count
            at += 2
        else:
            count = code
            row[filled : filled + count] = data[at + 1 : at + 1 + count]
            at += 1 + count
        filled += count
        if count == 0 or filled != min(filled, len(row)) or at > len(data):
            raise ValueError("broken run-length packet")
    return at


def _apply_exposure(pixels: NDArray[np.uint8], exposure: float) -> NDArray[np.float64]:
    """Convert all rows (height, width, 4) to linear values, a few at a time, without a second array of that size."""
    values = np.empty((*pixels.shape[:2], 3))
    step = max(1, _BLOCK // (4 * pixels.shape[1]))
    with np.errstate(over="ignore"):
        for y in range(0, len(pixels), step):
            np.divide(from_rgbe(pixels[y : y + step]), exposure, out=values[y : y + step])
    return values


def decode(data: bytes) -> NDArray[np.float64]:
    """Decode a file to linear values (height, width, 3); its EXPOSURE lines are divided out.

    Raises
    ------
    ValueError, IndexError : the file is broken, ends early, or has another kind or orientation of pixels.
    """
    head = re.match(rb"#\?.*?\n\n-Y (\d+) \+X (\d+)\n", data, re.DOTALL)
    if head is None or b"\nFORMAT=32-bit_rle_rgbe" not in head[0]:
        raise ValueError("not a Radiance RGBE picture with its first row at the top")
    height, width = int(head[1]), int(head[2])
    check_size(width, height, len(data))
    exposure = math.prod(float(value) for value in re.findall(rb"\nEXPOSURE=\s*(\S+)", head[0]))
    if not 0.0 < exposure < math.inf:
        raise ValueError("the exposure is no factor")
    at = head.end()
    if height * width > _MAX_PIXELS_PER_BYTE * (len(data) - at):
        raise ValueError("the picture ends early")

    # A scanline that does not begin with 2, 2 and its width is flat, and so are then all.
    mark = bytes((2, 2, width >> 8, width & 255)) if _NARROWEST <= width <= _WIDEST else None
    if mark is None or data[at : at + 4] != mark:
        pixels = np.frombuffer(data, dtype=np.uint8, count=4 * height * width, offset=at)
        return _apply_exposure(pixels.reshape(height, width, 4), exposure)

    planes = np.empty((height, 4, width), dtype=np.uint8)
    row = bytearray(4 * width)
    for y in range(height):
        if data[at : at + 4] != mark:
            raise ValueError("a scanline does not begin as the others do")
        at = _decode_row(data, at + 4, row)
        planes[y] = np.frombuffer(row, dtype=np.uint8).reshape(4, width)
    return _apply_exposure(planes.transpose(0, 2, 1), exposure)


FORMAT = ImageFormat((".hdr",), is_linear=True, encode=encode_hdr, decode=decode, order=80)
