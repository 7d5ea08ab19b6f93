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

from raytracer.scene.assets.raw_mesh import BrokenMeshError, Floats, Polygons, RawMesh, parse_numbers, triangulate

_LONGEST_HEADER = 1 << 16

_HEADER = re.compile(
    rb"ply\r?\nformat (ascii|binary_little_endian|binary_big_endian) 1\.0[ \t\r]*\n.*?\nend_header\r?\n", re.DOTALL
)

_INTEGERS = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_INTEGERS |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES = {**_INTEGERS, "float": "f4", "double": "f8", "float32": "f4", "float64": "f8"}

_CORNERS = ("vertex_index", "vertex_indices")
_COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))

Columns = Mapping[str, NDArray[Any] | Polygons]


class _Property(NamedTuple):
    """A property of an element: its type, and that of its length if it is a list."""

    name: str
    kind: np.dtype[Any]
    length: np.dtype[Any] | None


class _Element(NamedTuple):
    """An element of a file: its rows, and what each of them has."""

    name: str
    rows: int
    properties: list[_Property]


def read_ply(file: BinaryIO) -> RawMesh:
    """Read the vertices and faces of a file.

    Raises
    ------
    BrokenMeshError : the file ends early, or its faces are none.
    Exception : whatever else a broken header or text leads to.
    """
    head = _HEADER.match(file.read(_LONGEST_HEADER))
    if head is None:
        raise BrokenMeshError("does not begin as a PLY file does")
    file.seek(head.end())
    body = file.read()
    elements = list(_elements(head[0].decode("latin-1"), ">" if head[1] == b"binary_big_endian" else "<"))
    is_text = head[1] == b"ascii"
    if (body.rstrip().count(b"\n") + 1 if is_text else len(body)) < sum(element.rows for element in elements):
        raise BrokenMeshError("ends early")
    tables = dict(_text_tables(body + b"\n", elements) if is_text else _binary_tables(body, elements))

    # A list that is all that faces have may have any name.
    face = tables.get("face", {})
    polygons = next((face[name] for name in (face if len(face) == 1 else _CORNERS) if name in face), None)
    if not isinstance(polygons, Polygons):
        raise BrokenMeshError("has no faces")
    if polygons.values.dtype.kind not in "iu":
        raise BrokenMeshError("has faces whose corners are not integers")
    vertex = tables["vertex"]
    vertices = _stack(vertex, ("x", "y", "z"))
    normals = ("nx", "ny", "nz")
    uv = next((names for names in _COORDINATES if all(name in vertex for name in names)), None)
    return RawMesh(
        vertices,
        triangulate(polygons),
        _stack(vertex, normals) if all(name in vertex for name in normals) else None,
        None if uv is None else _stack(vertex, uv),
    )


def _stack(columns: Columns, names: tuple[str, ...]) -> NDArray[np.float64]:
    return np.stack([np.asarray(columns[name], np.float64) for name in names], axis=1)


def _elements(header: str, order: str) -> Iterator[_Element]:
    """Parse the elements that a header declares."""
    element: _Element | None = None
    for line in header.split("\n"):
        match line.split():
            case ["element", name, count]:
                if element is not None:
                    yield element
                element = _Element(name, max(0, int(count)), [])
            case ["property", *types, name] if element is not None:
                kind = np.dtype(order + _TYPES[types[-1]])
                length = np.dtype(order + _INTEGERS[types[1]]) if types[0] == "list" else None
                element.properties.append(_Property(name, kind, length))
    if element is not None:
        yield element


# ---- Bytes


def _binary_tables(body: bytes, elements: list[_Element]) -> Iterator[tuple[str, Columns]]:
    start = 0
    for element in elements:
        if element.rows and element.properties:
            columns, start = _binary_columns(body, start, element)
            yield element.name, columns


def _binary_columns(body: bytes, start: int, element: _Element) -> tuple[Columns, int]:
    """Read the rows of an element from a position on: its columns, and where they end.

    Raises
    ------
    BrokenMeshError : they end early.
    """
    # A table whose lists are as long as those of the first row.
    fields: list[tuple[Any, ...]] = []
    sizes: dict[str, int] = {}
    end = start
    for name, kind, length in element.properties:
        size = 1
        if length is not None:
            size = sizes[name] = _list_length(body, end, length)
            fields.append((f"length of {name}", length))
            end += length.itemsize
        fields.append((name, kind) if length is None else (name, kind, (size,)))
        end += size * kind.itemsize
    end = start + element.rows * (end - start)
    if end > len(body):
        return _uneven_binary_columns(body, start, element)
    table = np.frombuffer(body, np.dtype(fields), element.rows, start)
    if any((table[f"length of {name}"] != size).any() for name, size in sizes.items()):
        return _uneven_binary_columns(body, start, element)
    lists = {name: Polygons(table[name].reshape(-1), np.full(len(table), size)) for name, size in sizes.items()}
    return {name: lists.get(name, table[name]) for name, *_ in element.properties}, end


def _list_length(body: bytes, at: int, kind: np.dtype[Any]) -> int:
    if at + kind.itemsize > len(body):
        raise BrokenMeshError("ends early")
    return max(0, int(np.frombuffer(body, kind, 1, at)[0]))


def _uneven_binary_columns(body: bytes, start: int, element: _Element) -> tuple[Columns, int]:
    """Read an element whose lists have different lengths, row by row."""
    lengths = [
        None if length is None else struct.Struct(length.str[0].replace("|", "<") + length.char)
        for _, _, length in element.properties
    ]
    pieces: list[list[bytes]] = [[] for _ in element.properties]
    layout = list(zip(pieces, lengths, (kind.itemsize for _, kind, _ in element.properties), strict=True))
    for _ in range(element.rows):
        for column, packed, width in layout:
            size = width
            if packed is not None:
                if start + packed.size > len(body):
                    raise BrokenMeshError("ends early")
                size *= max(0, packed.unpack_from(body, start)[0])
                start += packed.size
            column.append(body[start : start + size])
            start += size
        if start > len(body):
            raise BrokenMeshError("ends early")
    columns: dict[str, NDArray[Any] | Polygons] = {}
    for (name, kind, length), column in zip(element.properties, pieces, strict=True):
        values = np.frombuffer(b"".join(column), kind)
        sizes = np.fromiter(map(len, column), np.int64, len(column)) // kind.itemsize
        columns[name] = values if length is None else Polygons(values, sizes)
    return columns, start


# ---- Text


def _text_tables(body: bytes, elements: list[_Element]) -> Iterator[tuple[str, Columns]]:
    ends = np.flatnonzero(np.frombuffer(body, np.uint8) == ord("\n")) + 1
    row = start = 0
    for element in elements:
        if element.rows:
            row += element.rows
            yield element.name, _text_columns(body[start : ends[row - 1]], element)
            start = ends[row - 1]


def _text_columns(text: bytes, element: _Element) -> Columns:
    """Parse the rows of an element, a line each."""
    numbers = parse_numbers(text)
    width, rest = divmod(numbers.size, element.rows)
    columns: dict[str, NDArray[Any] | Polygons] = {}
    at = 0
    if rest == 0:
        table = numbers.reshape(element.rows, width)
        for name, kind, length in element.properties:
            if at >= width:
                return columns
            if length is None:
                columns[name] = table[:, at].astype(kind)
                at += 1
                continue
            size = max(0, int(table[0, at]))
            if (table[:, at] != size).any():
                break
            values = table[:, at + 1 : at + 1 + size]
            columns[name] = Polygons(values.reshape(-1).astype(kind), np.full(len(values), values.shape[1]))
            at += 1 + size
        else:
            return columns
    return _uneven_text_columns(text, element)


def _uneven_text_columns(text: bytes, element: _Element) -> Columns:
    """Parse an element whose lists have different lengths, row by row."""
    pieces: list[list[Floats]] = [[] for _ in element.properties]
    for row in map(parse_numbers, text.split(b"\n")[: element.rows]):
        at = 0
        for column, (_, _, length) in zip(pieces, element.properties, strict=True):
            size = 1
            if length is not None:
                size = max(0, int(row[at]))
                at += 1
            column.append(row[at : at + size])
            at += size
    columns: dict[str, NDArray[Any] | Polygons] = {}
    for (name, kind, length), column in zip(element.properties, pieces, strict=True):
        values = np.concatenate(column).astype(kind)
        columns[name] = values if length is None else Polygons(values, np.array([len(piece) for piece in column]))
    return columns
