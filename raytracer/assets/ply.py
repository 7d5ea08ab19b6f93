"""PLY meshes, ASCII or binary of either byte order.

References: G. Turk, "The PLY Polygon File Format", 1994.
"""

import re
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.assets.polygons import BrokenMeshError, Floats, Integers, Parts, fan, parse_floats

_OLD_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
_NEW_TYPES = {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES = _OLD_TYPES | _NEW_TYPES | {"float32": "f4", "double": "f8", "float64": "f8"}
_BYTE_ORDERS: dict[str, Literal["<", ">"] | None] = {
    "ascii": None,
    "binary_little_endian": "<",
    "binary_big_endian": ">",
}
_LONGEST_HEADER = 1 << 20
_CORNER_LISTS = ("vertex_indices", "vertex_index")

_EARLY_END = "ends early"


class _Property(NamedTuple):
    name: str
    type: np.dtype[Any]
    count_type: np.dtype[Any] | None
    """Type of a list's length; None for a single value."""


class _Element(NamedTuple):
    name: str
    rows: int
    properties: list[_Property]


class _Column(NamedTuple):
    """One property of all rows of an element: its values, and how many of them are each row's."""

    values: NDArray[Any]
    counts: Integers


_Columns = dict[str, _Column]


def _parse_header(text: str) -> tuple[bool, list[_Element]]:
    """Whether the body is text, and the elements in it, whose types are then all float64."""
    kind = ""
    order: Literal["<", ">"] | None = None
    elements: list[_Element] = []

    def typed(name: str) -> np.dtype[Any]:
        code = _TYPES[name]
        return np.dtype(np.float64) if order is None else np.dtype(code).newbyteorder(order)

    for line in text.splitlines()[1:]:
        match line.split():
            case ["format", name, _] if name in _BYTE_ORDERS:
                kind, order = name, _BYTE_ORDERS[name]
            case ["element", name, rows] if rows.isdecimal():
                elements.append(_Element(name, int(rows), []))
            case ["property", "list", count, value, name] if elements and count in _TYPES and value in _TYPES:
                elements[-1].properties.append(_Property(name, typed(value), typed(count)))
            case ["property", value, name] if elements and value in _TYPES:
                elements[-1].properties.append(_Property(name, typed(value), None))
            case [] | ["comment" | "obj_info" | "end_header", *_]:
                pass
            case _:
                raise BrokenMeshError(f"has an unknown line in its header: {line[:60]!r}")
    if not kind:
        raise BrokenMeshError("has no format line in its header")
    return order is None, elements


def _shortest_row(element: _Element) -> int:
    """Bytes of a row whose lists are empty."""
    return sum((p.type if p.count_type is None else p.count_type).itemsize for p in element.properties)


def _count_at(body: NDArray[np.uint8], at: int, count_type: np.dtype[Any]) -> int:
    if at + count_type.itemsize > len(body):
        raise BrokenMeshError(_EARLY_END)
    count = int(np.frombuffer(body, count_type, count=1, offset=at)[0])
    if count < 0:
        raise BrokenMeshError("has a list of negative length")
    return count


def _read_even(element: _Element, body: NDArray[np.uint8]) -> tuple[_Columns, int] | None:
    """Columns of `element` and its size in bytes, if all its lists are as long as those of its first row."""
    fields: list[tuple[str, np.dtype[Any]] | tuple[str, np.dtype[Any], tuple[int]]] = []
    lengths: dict[str, int] = {}
    at = 0
    for i, p in enumerate(element.properties):
        length = 1
        if p.count_type is not None:
            length = lengths[p.name] = _count_at(body, at, p.count_type) if element.rows else 0
            fields.append((f"count {i}", p.count_type))
            at += p.count_type.itemsize
        fields.append((f"value {i}", p.type, (length,)))
        at += length * p.type.itemsize

    # A body that is too short may still hold rows that are shorter than the first.
    if element.rows * at > len(body):
        return None
    rows = np.frombuffer(body, np.dtype(fields), count=element.rows if at else 0)
    columns: _Columns = {}
    for i, p in enumerate(element.properties):
        length = lengths.get(p.name, 1)
        if p.count_type is not None and np.any(rows[f"count {i}"] != length):
            return None
        columns[p.name] = _Column(rows[f"value {i}"].reshape(-1), np.broadcast_to(np.int64(length), len(rows)))
    return columns, element.rows * at


def _read_uneven(element: _Element, body: NDArray[np.uint8]) -> tuple[_Columns, int]:
    """Columns of `element` and its size in bytes, row by row: only the lists of one tell where the next begins."""
    starts = np.empty((len(element.properties), element.rows), dtype=np.int64)
    counts = np.ones_like(starts)
    at = 0
    for row in range(element.rows):
        for i, p in enumerate(element.properties):
            if p.count_type is not None:
                counts[i, row] = _count_at(body, at, p.count_type)
                at += p.count_type.itemsize
            starts[i, row] = at
            at += int(counts[i, row]) * p.type.itemsize
    if at > len(body):
        raise BrokenMeshError(_EARLY_END)

    columns: _Columns = {}
    for p, start, count in zip(element.properties, starts, counts, strict=True):
        size = p.type.itemsize
        first = np.repeat(start - size * (np.cumsum(count) - count), count) + size * np.arange(count.sum())
        values = np.empty((len(first), size), dtype=np.uint8)
        for byte in range(size):
            values[:, byte] = body[first + byte]
        columns[p.name] = _Column(values.reshape(-1).view(p.type), count)
    return columns, at


def _stack(columns: _Columns, names: str) -> Floats | None:
    """The single values `names` side by side, float64 (rows, len(names)), or None where one is missing."""
    if any(name not in columns for name in names.split()):
        return None
    return np.stack([columns[name].values for name in names.split()], axis=1, dtype=np.float64, casting="unsafe")


def read(path: Path) -> Parts:
    """Vertices, triangles, and the normals of the vertices where the file has them.

    Raises
    ------
    BrokenMeshError : the file is broken, ends early, or holds no vertices or faces.
    OSError : the file cannot be read.
    """
    # Mapped, not read: the file of a large mesh is as large as the mesh.
    data = np.memmap(path, dtype=np.uint8, mode="r")
    head = re.match(rb"ply\r?\n.*?\nend_header\r?\n", data[:_LONGEST_HEADER].tobytes(), re.DOTALL)
    if head is None:
        raise BrokenMeshError("is not a PLY file")
    is_text, elements = _parse_header(head[0].decode("latin-1"))
    body: NDArray[np.uint8] = data[head.end() :]
    if is_text:
        # Numbers of one type throughout, so that text is read as the binary formats are.
        body = parse_floats(body.tobytes()).view(np.uint8)

    found: dict[str, _Columns] = {}
    for element in elements:
        if element.rows * _shortest_row(element) > len(body):
            raise BrokenMeshError(_EARLY_END)
        found[element.name], size = _read_even(element, body) or _read_uneven(element, body)
        body = body[size:]
        if {"vertex", "face"} <= found.keys():
            break

    vertices = _stack(found.get("vertex", {}), "x y z")
    corners = next((column for name, column in found.get("face", {}).items() if name in _CORNER_LISTS), None)
    if vertices is None:
        raise BrokenMeshError("has no vertices with x, y and z")
    if corners is None:
        raise BrokenMeshError("has no faces")
    return Parts(vertices, fan(corners.counts, corners.values), _stack(found["vertex"], "nx ny nz"))
