"""Portable pixmaps (.ppm): an image format as an exercise, complete in one file.

To try it, put this file into `raytracer/film/formats/`: `rt render scene.yaml -o picture.ppm` writes it, `rt compare`
reads it, and messages list its suffix.  Nothing else changes: formats are found by looking into that package.

References: Netpbm, "PPM Format Specification" (type P6, 8 bits a sample).
"""

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import ImageFormat, Layers, check_size
from raytracer.util import srgb
from raytracer.util.safe_open import BrokenFileError

if TYPE_CHECKING:
    from raytracer.film.image import Image

_HEADER = re.compile(rb"P6\s+(\d{1,9})\s+(\d{1,9})\s+255\s")


def encode_ppm(image: "Image", layers: Layers) -> bytes:
    """Encode an image as a display shows it; the format has no place for layers and settings."""
    # The image applies its tone curve and the sRGB transfer function: uint8 (height, width, 3), row 0 at the top.
    pixels = image.display()
    height, width, _ = pixels.shape
    return f"P6\n{width} {height}\n255\n".encode() + pixels.tobytes()


def decode_ppm_display(data: bytes) -> NDArray[np.float64]:
    """Decode a file to sRGB-encoded values in 0..1, float64 (height, width, 3)."""
    # Whatever is raised here becomes one sentence; the text of this error is that sentence's end.
    header = _HEADER.match(data)
    if header is None:
        raise BrokenFileError("is no .ppm file of type P6 with 8 bits a sample")
    width, height = int(header[1]), int(header[2])
    check_size(width, height, len(data))
    pixels = np.frombuffer(data, np.uint8, 3 * width * height, header.end())
    return pixels.reshape(height, width, 3) / 255.0


def decode_ppm(data: bytes) -> NDArray[np.float64]:
    """Decode a file to linear values, float64 (height, width, 3)."""
    return srgb.decode(decode_ppm_display(data))


# The record that the registry looks for.  A linear format leaves out `decode_display`.
FORMAT = ImageFormat(
    (".ppm",), is_linear=False, encode=encode_ppm, decode=decode_ppm, decode_display=decode_ppm_display
)
