"""OpenEXR files written a few rows at a time, and mapped into memory: uncompressed scan lines of one or more parts.

The OpenEXR library for Python writes and reads whole files only, which do not fit into memory where all views of a
light field do not.  Rendered noise does not compress, so that the files lose nothing by their form.

References: Academy Software Foundation, "OpenEXR File Layout" (headers, offset tables, scan-line blocks) and "Storing
Multi-View Images in OpenEXR Files".
"""

import contextlib
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.exr import CHROMATICITIES
from raytracer.util.atomic_write import atomic_write, wrap_os_errors

_MAGIC, _VERSION, _LONG_NAMES, _MULTI_PART = 20000630, 2, 0x400, 0x1000

_LONGEST_SHORT_NAME = 31

_PIXEL_TYPES = {"u4": 0, "f2": 1, "f4": 2}

_WIDEST_ROW = 2**31 - 1 - 3 * 4
"""Most bytes of the channels of a row: NumPy has no longer types than 2^31 - 1, with the numbers before the row."""


class Part(NamedTuple):
    """A part of a file.

    name : of the part, and of its view; "" in a file of one part.
    channels : types of the channels by name, float16, float32 or uint32.
    attributes : strings by name.
    """

    name: str
    channels: Mapping[str, "np.dtype[Any]"]
    attributes: Mapping[str, str] = {}


def row_type(part: Part, width: int, *, is_single: bool) -> "np.dtype[Any]":
    """Return the type of a block, which holds one row: its number, its size, and its channels, by name."""
    head = [("y", "<i4"), ("size", "<i4")] if is_single else [("part", "<i4"), ("y", "<i4"), ("size", "<i4")]
    channels = [(f"channel {name}", part.channels[name].newbyteorder("<"), (width,)) for name in sorted(part.channels)]
    return np.dtype([*head, *channels])


class ScanlineWriter:
    """Writer of rows, part after part, and from the top down."""

    def __init__(self, file: BinaryIO, parts: Sequence[Part], width: int, height: int) -> None:
        self._file, self._parts, self._width, self._height = file, parts, width, height
        self._is_single = len(parts) == 1
        self._types = [row_type(part, width, is_single=self._is_single) for part in parts]
        names = [name for part in parts for name in (part.name, *part.channels, *part.attributes)]
        flags = 0 if self._is_single else _MULTI_PART
        flags |= _LONG_NAMES if max(len(name.encode()) for name in names) > _LONGEST_SHORT_NAME else 0
        headers = b"".join(self._header(part) for part in parts) + (b"" if self._is_single else b"\0")
        file.write(struct.pack("<ii", _MAGIC, _VERSION | flags) + headers)
        # Blocks stand one after the other behind the tables of where they are.
        place = file.tell() + np.dtype("<u8").itemsize * height * len(parts)
        for kind in self._types:
            file.write((place + kind.itemsize * np.arange(height, dtype="<u8")).tobytes())
            place += kind.itemsize * height

    def put(self, part: int, top: int, planes: Mapping[str, NDArray[Any]]) -> None:
        """Write rows of a part from `top` on: each channel (rows, width)."""
        kind = self._types[part]
        rows = len(next(iter(planes.values())))
        blocks = np.zeros(rows, kind)
        if not self._is_single:
            blocks["part"] = part
        blocks["y"] = np.arange(top, top + rows)
        blocks["size"] = sum(kind[name].itemsize for name in kind.names or () if name.startswith("channel "))
        for name, plane in planes.items():
            # What the type of a channel cannot hold becomes inf, as it should.
            with np.errstate(over="ignore"):
                blocks[f"channel {name}"] = plane
        self._file.write(blocks.tobytes())

    def _header(self, part: Part) -> bytes:
        channels = b"".join(
            name.encode() + b"\0" + struct.pack("<iiii", _PIXEL_TYPES[part.channels[name].str[1:]], 0, 1, 1)
            for name in sorted(part.channels)
        )
        window = struct.pack("<iiii", 0, 0, self._width - 1, self._height - 1)
        attributes = [
            ("channels", "chlist", channels + b"\0"),
            ("chromaticities", "chromaticities", struct.pack("<8f", *CHROMATICITIES)),
            ("compression", "compression", b"\0"),
            ("dataWindow", "box2i", window),
            ("displayWindow", "box2i", window),
            ("lineOrder", "lineOrder", b"\0"),
            ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
            ("screenWindowCenter", "v2f", struct.pack("<ff", 0.0, 0.0)),
            ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
            *((name, "string", value.encode()) for name, value in part.attributes.items()),
        ]
        if not self._is_single:
            attributes += [("chunkCount", "int", struct.pack("<i", self._height))]
            attributes += [(name, "string", part.name.encode()) for name in ("name", "view")]
            attributes += [("type", "string", b"scanlineimage")]
        packed = (
            name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
            for name, kind, value in attributes
        )
        return b"".join(packed) + b"\0"


@contextlib.contextmanager
def open_writer(path: Path, parts: Sequence[Part], width: int, height: int) -> Iterator[ScanlineWriter]:
    """Open a writer of a file, which appears when all is written; an OutputError says that it cannot be."""
    with atomic_write(path) as aside, wrap_os_errors(path), aside.open("wb") as file:
        yield ScanlineWriter(file, parts, width, height)


def map_parts(path: Path, parts: Sequence[Part], width: int, height: int) -> list[NDArray[Any]] | None:
    """Map the blocks of a file that `ScanlineWriter` wrote into memory, a structured array (height,) for each part.

    None if the file is not in this form, or not of these parts: its tables must be those that the writer writes.
    """
    # As integers of any size, before there is a type of rows: a header of a small file may claim any size.
    size = path.stat().st_size
    widths = [width * sum(kind.itemsize for kind in part.channels.values()) for part in parts]
    if height * sum(widths) > size or max(widths) > _WIDEST_ROW:
        return None
    types = [row_type(part, width, is_single=len(parts) == 1) for part in parts]
    table_bytes = np.dtype("<u8").itemsize * height * len(parts)
    start = size - height * sum(kind.itemsize for kind in types)
    if start < table_bytes:
        return None
    tables = np.fromfile(path, "<u8", height * len(parts), offset=start - table_bytes).reshape(len(parts), height)
    # One map for all parts: each takes a file descriptor.
    data = np.memmap(path, np.uint8, "r")
    arrays: list[NDArray[Any]] = []
    for kind, table in zip(types, tables, strict=True):
        if not np.array_equal(table, start + kind.itemsize * np.arange(height, dtype="<u8")):
            return None
        arrays.append(np.ndarray((height,), kind, buffer=data, offset=start))
        start += kind.itemsize * height
    return arrays
