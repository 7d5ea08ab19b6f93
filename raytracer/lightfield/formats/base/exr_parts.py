"""Headers and channels of all parts of an OpenEXR file, by the OpenEXR library."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import wrap_decode_errors
from raytracer.film.formats.exr import check_parts, suppress_library_output
from raytracer.util import safe_open
from raytracer.util.safe_open import BrokenFileError

SUFFIX = ".exr"


class Header(NamedTuple):
    """The header of a part.

    names : of its channels, in their order in the file.
    window (px) : left, top, right and bottom of its data window, the last pixels included.
    attributes : all of the header, by name.
    """

    names: tuple[str, ...]
    window: tuple[int, int, int, int]
    attributes: Mapping[str, Any]

    @property
    def width(self) -> int:
        """Width of the data window (px)."""
        return self.window[2] - self.window[0] + 1

    @property
    def height(self) -> int:
        """Height of the data window (px)."""
        return self.window[3] - self.window[1] + 1


def _header(attributes: Mapping[str, Any]) -> Header:
    (left, top), (right, bottom) = (tuple(int(value) for value in corner) for corner in attributes["dataWindow"])
    names = tuple(channel.name for channel in attributes["channels"])
    return Header(names, (left, top, right, bottom), attributes)


def read_headers(path: Path) -> list[Header]:
    """Read the headers of all parts.

    Raises
    ------
    BrokenFileError : they cannot be read, or their sizes are none.
    OSError : the file cannot be read, or is no regular one.
    """
    import OpenEXR

    with safe_open.open_regular(path, _ANY_SIZE):
        pass
    with (
        wrap_decode_errors(SUFFIX),
        suppress_library_output(),
        OpenEXR.File(str(path), separate_channels=True, header_only=True) as file,
    ):
        headers = [_header(dict(part.header)) for part in file.parts]
    if any(header.width < 1 or header.height < 1 for header in headers):
        raise BrokenFileError("has no pixels")
    return headers


_ANY_SIZE = 2**62
"""Size of a file that is mapped: its pages are read as they are needed."""


class DecodedPart(NamedTuple):
    """A part that has been decoded.

    planes : channels (height, width) by name.
    """

    header: Header
    planes: dict[str, NDArray[Any]]


def read_parts(path: Path) -> list[DecodedPart]:
    """Read all parts with all channels.

    Raises
    ------
    BrokenFileError : they are broken, deep, or larger than files that are read; see `film.formats.exr.check_parts`.
    OSError : the file cannot be read, or is no regular one.
    """
    import OpenEXR

    data = safe_open.read_regular(path)
    with wrap_decode_errors(SUFFIX), suppress_library_output():
        with OpenEXR.File(io.BytesIO(data), separate_channels=True, header_only=True) as file:
            count = len(file.parts)
            check_parts([part.header for part in file.parts], len(data))
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            parts = [
                DecodedPart(
                    _header(dict(part.header)),
                    {name: np.asarray(channel.pixels) for name, channel in part.channels.items()},
                )
                for part in file.parts
            ]
    # The library leaves out parts that are broken, and says so on the terminal only.
    if len(parts) != count:
        raise BrokenFileError(f"broken, or no {SUFFIX} image")
    for part in parts:
        shape = (part.header.height, part.header.width)
        if any(plane.shape != shape or plane.dtype.kind not in "fu" for plane in part.planes.values()):
            raise BrokenFileError("holds channels that are no planes of numbers")
    return parts
