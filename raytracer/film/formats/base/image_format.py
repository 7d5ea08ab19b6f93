"""The record by which a module declares an image format."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from raytracer.film.formats.base.stored_image import StoredImage
    from raytracer.film.image import Image

Layers = Mapping[str, NDArray[np.floating[Any]]]
"""Arrays by name, (height, width) or (height, width, 3), that are written besides an image's own layers."""

DecodedLayers = tuple[dict[str, NDArray[np.float64]], dict[str, str]]
"""Layers and settings of a file; see `raytracer.film.image_file.load_layers`."""

_UNORDERED = 1000


@dataclass(frozen=True)
class ImageFormat:
    """A format of image files: its suffixes, what it holds, and how it is written and read.

    A decoder takes the bytes of a file, and may raise anything for a broken one.  What a format cannot do is None.

    suffixes : in lower case, with the dot, the usual one first.
    is_linear : it holds linear light, and not what a display shows.
    has_layers : it holds the layers of an image besides its radiance.
    is_lossy : it does not keep 8-bit pixels as they are.
    media_type : of formats that browsers show.
    encode : the bytes of a file with an image, and further layers if the format has any.
    write : writes a file by itself, in place of `encode`.
    encode_pixels : the bytes of a file with pixels for a display, uint8 (height, width) or (height, width, 3).
    encode_map : the bytes of a file with a number for each pixel, (height, width).
    encode_frames : the bytes of an animation: frames uint8 (height, width, 3), milliseconds a frame, and whether to go
        back from the last frame to the first.
    decode : linear values, float64 (height, width, 3), row 0 at the top.
    decode_display : sRGB-encoded values as the file holds them, of the same shape, in 0..1; None for a linear format.
    decode_layers : layers and settings, of all layers or of those that are named.
    decode_stored : an image as textures read it, where that is more than `decode` tells: bytes, grey, or opacity.
    order : place among the formats in messages, ascending; formats without one come last, by suffix.
    """

    suffixes: tuple[str, ...]
    is_linear: bool
    has_layers: bool = False
    is_lossy: bool = False
    media_type: str = ""
    encode: Callable[["Image", Layers], bytes] | None = None
    write: Callable[["Image", Path], None] | None = None
    encode_pixels: Callable[[NDArray[np.uint8]], bytes] | None = None
    encode_map: Callable[[NDArray[np.floating[Any]]], bytes] | None = None
    encode_frames: Callable[[Sequence[NDArray[np.uint8]], int, bool], bytes] | None = None
    decode: Callable[[bytes], NDArray[np.float64]] | None = None
    decode_display: Callable[[bytes], NDArray[np.float64]] | None = None
    decode_layers: Callable[[bytes, Collection[str] | None], DecodedLayers] | None = None
    decode_stored: Callable[[bytes], "StoredImage"] | None = None
    order: int = _UNORDERED


def header_settings(image: "Image") -> dict[str, str]:
    """List what a header holds, as strings: no format's own numbers hold a float64 or a 64-bit seed."""
    return {**{key: str(value) for key, value in image.settings.items()}, "samples": str(image.samples)}
