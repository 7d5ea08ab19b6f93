"""The record by which a module declares an image format."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from raytracer.film.image import Image

Layers = Mapping[str, NDArray[np.floating[Any]]]
"""Arrays by name, (height, width) or (height, width, 3), that are written besides an image's own layers."""

DecodedLayers = tuple[dict[str, NDArray[np.float64]], dict[str, str]]
"""Layers and settings of a file; see `raytracer.film.image_file.load_layers`."""

_UNORDERED = 1000


@dataclass(frozen=True)
class ImageFormat:
    """A format of image files: its suffixes, and how it is written and read.

    A decoder takes the bytes of a file, and may raise anything for a broken one.  What a format cannot do is None.

    Attributes
    ----------
    suffixes : in lower case, with the dot, the usual one first.
    encode : the bytes of a file with an image, and further layers if the format has any.
    decode : linear values, float64 (height, width, 3), row 0 at the top.
    decode_display : sRGB-encoded values as the file holds them, of the same shape, in 0..1; None for a linear format.
    decode_layers : layers and settings, of all layers or of those that are named.
    write : writes a file by itself, in place of `encode`.
    order : place among the formats in messages, ascending; formats without one come last, by suffix.
    """

    suffixes: tuple[str, ...]
    encode: Callable[["Image", Layers], bytes] | None = None
    decode: Callable[[bytes], NDArray[np.float64]] | None = None
    decode_display: Callable[[bytes], NDArray[np.float64]] | None = None
    decode_layers: Callable[[bytes, Collection[str] | None], DecodedLayers] | None = None
    write: Callable[["Image", Path], None] | None = None
    order: int = _UNORDERED


def header_settings(image: "Image") -> dict[str, str]:
    """List what a header holds, as strings: no format's own numbers hold a float64 or a 64-bit seed."""
    return {**{key: str(value) for key, value in image.settings.items()}, "samples": str(image.samples)}
