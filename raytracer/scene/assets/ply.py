"""Read PLY files, of bytes in either order or of text, with all elements, properties and lists that a header declares.

What a list of properties says is alike in most files for all rows of an element: then they are one table; else they are
read row by row.

Reference: G. Turk, "The PLY Polygon File Format", 1994.
"""

import re
import struct
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.scene.assets.raw_mesh import Polygons, RawMesh, parse_numbers, triangulate
from raytracer.util.safe_open import BrokenFileError

_LONGEST_HEADER = 1 << 16

_HEADER = re.compile(
    rb"ply\r?\nformat (ascii|binary_little_endian|binary_big_endian) 1\.0[ \t\r]*\n.*?\nend_header\r?\n", re.DOTALL
)

# As NumPy and `struct` both name them.
_INTEGERS = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"}
_INTEGERS |= {"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"}
_TYPES = {**_INTEGERS, "float": "f", "double": "d", "float32": "f", "float64": "d"}

_CORNERS = ("vertex_index", "vertex_indices")
_COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))

Columns = Mapping[str, NDArray[Any] | Polygons]


class _Property(NamedTuple):
    """A property of an element: its type, and that of its length if it is a list."""

    name: str
    kind: str
    length: str | None


class _Element(NamedTuple):
    """An element of a file: its rows, and what each of them has."""

    name: str
    rows: int
    properties: list[_Property]


def read_ply(file: BinaryIO) -> RawMesh:
    """Read the vertices and faces of a file.

    Raises
    ------
    BrokenFileError : the file ends early, or its faces are none.
    Exception : whatever else a broken header or text leads to.
    """
    head = _HEADER.match(file.read(_LONGEST_HEADER))
    if head is None:
        raise BrokenFileError("does not begin as a PLY file does")
    file.seek(head.end())
    body = file.read()
    elements = _elements(head[0].decode("latin-1"), ">" if head[1] == b"binary_big_endian" else "<")
    try:
        tables = dict(_tables(body, elements, is_text=head[1] == b"ascii"))
    except (EOFError, struct.error):
        raise BrokenFileError("ends early") from None

    # A list that is all that faces have may have any name.
    face = tables.get("face", {})
    polygons = next((face[name] for name in (face if len(face) == 1 else _CORNERS) if name in face), None)
    if not isinstance(polygons, Polygons):
        raise BrokenFileError("has no faces")
    if polygons.values.dtype.kind not in "iu":
        raise BrokenFileError("has faces whose corners are not integers")
    vertex = tables["vertex"]
    vertices = _stack(vertex, ("x", "y", "z"))
    normals, uv = (
        next((_stack(vertex, names) for names in choices if all(name in vertex for name in names)), None)
        for choices in ([("nx", "ny", "nz")], _COORDINATES)
    )
    return RawMesh(vertices, triangulate(polygons), normals, uv)


def _stack(columns: Columns, names: tuple[str, ...]) -> NDArray[np.float64]:
    return np.stack([np.asarray(columns[name], np.float64) for name in names], axis=1)


def _elements(header: str, order: str) -> list[_Element]:
    """Parse the elements that a header declares."""
    elements: list[_Element] = []
    for line in header.split("\n"):
        match line.split():
            case ["element", name, count]:
                elements.append(_Element(name, max(0, int(count)), []))
            case ["property", "list", length, kind, name]:
                elements[-1].properties.append(_Property(name, order + _TYPES[kind], order + _INTEGERS[length]))
            case ["property", kind, name]:
                elements[-1].properties.append(_Property(name, order + _TYPES[kind], None))
    return elements


def _tables(body: bytes, elements: list[_Element], *, is_text: bool) -> Iterator[tuple[str, Columns]]:
    """Read the columns of all elements that have any.

    Raises
    ------
    EOFError, struct.error : the file ends early.
    """
    ends = np.flatnonzero(np.frombuffer(body.rstrip() + b"\n", np.uint8) == ord("\n")) + 1 if is_text else None
    if (len(body) if ends is None else len(ends)) < sum(element.rows for element in elements):
        raise EOFError
    start = row = 0
    for element in elements:
        if not (element.rows and element.properties):
            row += element.rows
        elif ends is None:
            columns, start = _columns(body, start, element)
            yield element.name, columns
        else:
            first, row = row, row + element.rows
            yield element.name, _text_columns(body[ends[first - 1] if first else 0 : ends[row - 1]], element)


# ---- Rows of an element


def _columns(body: bytes, start: int, element: _Element) -> tuple[Columns, int]:
    """Read the rows of an element from a position on: its columns, and where they end.

    Raises
    ------
    EOFError, struct.error : they end early.
    """
    first, end = _row_by_row(body, start, element._replace(rows=1))
    fields: list[tuple[Any, ...]] = []
    for name, kind, length in element.properties:
        column = first[name]
        if isinstance(column, Polygons):
            fields += [(f"length of {name}", length), (name, kind, column.values.shape)]
        else:
            fields.append((name, kind))
    end = start + element.rows * (end - start)
    if end > len(body):
        return _row_by_row(body, start, element)
    table = np.frombuffer(body, fields, element.rows, start)
    columns: dict[str, NDArray[Any] | Polygons] = {}
    for name, _, length in element.properties:
        columns[name] = table[name]
        if length:
            sizes = table[f"length of {name}"]
            if (sizes != table[name].shape[1]).any():
                return _row_by_row(body, start, element)
            columns[name] = Polygons(table[name].reshape(-1), sizes.astype(np.int32))
    return columns, end


def _row_by_row(body: bytes, start: int, element: _Element) -> tuple[Columns, int]:
    """Read an element whose lists may have different lengths; see `_columns`."""
    pieces: list[list[bytes]] = [[] for _ in element.properties]
    layout = [
        (column, np.dtype(kind).itemsize, struct.Struct(length) if length else None)
        for column, (_, kind, length) in zip(pieces, element.properties, strict=True)
    ]
    for _ in range(element.rows):
        for column, width, packed in layout:
            size = width
            if packed:
                size *= int(packed.unpack_from(body, start)[0])
                start += packed.size
                if size < 0:
                    raise BrokenFileError("has a face with fewer than 3 corners, or a list of a negative length")
            column.append(body[start : start + size])
            start += size
        if start > len(body):
            raise EOFError
    columns: dict[str, NDArray[Any] | Polygons] = {}
    for (name, kind, length), column in zip(element.properties, pieces, strict=True):
        values = np.frombuffer(b"".join(column), kind)
        sizes = np.fromiter(map(len, column), np.int64, len(column)) // values.itemsize
        columns[name] = Polygons(values, sizes) if length else values
    return columns, start


def _text_columns(text: bytes, element: _Element) -> Columns:
    """Read the rows of an element of a text: as bytes, once its numbers are parsed."""
    numbers = parse_numbers(text).tobytes()
    parsed = [_Property(name, "d", length and "d") for name, _, length in element.properties]
    try:
        columns, end = _columns(numbers, 0, element._replace(properties=parsed))
    except (EOFError, struct.error):
        end = -1
    if end != len(numbers):
        raise ValueError("a row has more or fewer numbers than it says")
    return {name: columns[name].astype(np.dtype(kind)) for name, kind, _ in element.properties}
