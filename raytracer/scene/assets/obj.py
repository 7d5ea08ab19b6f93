"""Read Wavefront OBJ files: vertices, texture coordinates, normals and faces; all else is left out.

Lines of one kind that follow one another are found at once by a regular expression, gathered, and parsed a megabyte at
a time, so that memory holds the file and the mesh, and no Python object for each line.

Reference: Wavefront Technologies, "Object Files (.obj)", Advanced Visualizer Manual, appendix B1.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from raytracer.scene.assets.raw_mesh import Integers, Polygons, RawMesh, parse_numbers, triangulate
from raytracer.util.errors import format_value
from raytracer.util.safe_open import BrokenFileError

# No face that a program writes has as many corners as fit in a line of this length.
_LONGEST_LINE = 1 << 20

# Bytes of lines that are parsed at once.
_BATCH = 1 << 20

# What of a line of each keyword is read: weights, colours and depths of textures are left out.
_NUMBERS = {"v": 3, "vt": 2, "vn": 3}
_ROWS = {"v": "vertex", "vn": "normal"}

# A vertex alone, or with texture coordinates, a normal, or both; an index has up to 18 digits, as 64 bits hold.
_INDEX = r"-?\d{1,18}+"
_CORNERS = {
    "f": (["v"], [_INDEX]),
    "f_": (["v"], [_INDEX, ""]),
    "f__": (["v"], [_INDEX, "", ""]),
    "ft": (["v", "vt"], [_INDEX, _INDEX]),
    "ft_": (["v", "vt"], [_INDEX, _INDEX, ""]),
    "fn": (["v", "vn"], [_INDEX, "", _INDEX]),
    "ftn": (["v", "vt", "vn"], [_INDEX, _INDEX, _INDEX]),
}

# Runs of lines of one kind, which is the name of the group.  Groups are atomic and not possessive: before Python 3.11.5
# `(?:...)++` matches wrongly where something in it may be optional (gh-106052).
_LINES = {keyword: rf"{keyword}(?=\s)[^\n]*+" for keyword in _NUMBERS}
_LINES |= {form: rf"f(?>(?:[^\S\n]++{'/'.join(parts)}){{3,}})[^\S\n]*+" for form, (_, parts) in _CORNERS.items()}
_RUN = re.compile(
    "|".join(rf"(?P<{kind}>(?>(?:[^\S\n]*+{line}\n){{1,32768}}))" for kind, line in _LINES.items()).encode()
    + rb"|[^\n]*+\n"
)


def read_obj(file: BinaryIO) -> RawMesh:
    """Read all groups of a file into one mesh; missing normals and texture coordinates are 0 where others have some.

    Raises
    ------
    BrokenFileError : a line is none that the format has, or the file has no faces.
    IndexError : a face has a vertex that is not there.
    Exception : whatever else a broken file leads to.
    """
    rows: dict[str, list[NDArray[np.float64]]] = {keyword: [] for keyword in _NUMBERS}
    faces: dict[str, list[Polygons]] = {}
    for kind, text, before in _batches(_lines(file.read())):
        if kind in rows:
            rows[kind].append(_parse_rows(kind, text))
        else:
            faces.setdefault(kind, []).append(_parse_faces(text, np.array(before)))
    if not faces:
        raise BrokenFileError("has no faces")
    tables = {keyword: np.concatenate([np.empty((0, _NUMBERS[keyword])), *rows.pop(keyword)]) for keyword in _NUMBERS}
    return _assemble(tables, faces)


def _lines(text: bytes) -> bytes:
    """Remove comments and carriage returns, and join lines that are continued."""
    if not text.endswith(b"\n"):
        text += b"\n"
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"#" in text or b"\\" in text:
        text = re.sub(rb"\\\n|#[^\n]*", b" ", text)
    longest = np.diff(np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n")), prepend=-1).max() - 1
    if longest > _LONGEST_LINE:
        raise BrokenFileError(f"has a line of {longest:,} characters, and at most {_LONGEST_LINE:,} are read")
    return text


def _batches(text: bytes) -> Iterator[tuple[str, bytes, list[tuple[int, ...]]]]:
    """Gather lines of one kind: the kind, the lines, and of each run of faces its lines and the rows before it.

    The first run of each kind comes alone, so that kinds come in the order of the file.
    """
    counts = dict.fromkeys(_NUMBERS, 0)
    waiting: dict[str, tuple[list[bytes], list[tuple[int, ...]]]] = {}
    room = dict.fromkeys(_LINES, 0)
    for match in _RUN.finditer(text):
        if (kind := match.lastgroup) is not None:
            runs, before = waiting.setdefault(kind, ([], []))
            runs.append(match[0])
            lines = match[0].count(b"\n")
            if kind in counts:
                counts[kind] += lines
            else:
                before.append((lines, *(counts[name] for name in _CORNERS[kind][0])))
            room[kind] -= len(match[0])
            if room[kind] <= 0:
                yield kind, b"".join(runs), before
                del waiting[kind]
                room[kind] = _BATCH
        elif (words := match[0].split())[:1] == [b"f"]:
            if len(words) < 4:
                raise BrokenFileError("has a face with fewer than 3 corners")
            line = format_value(match[0].decode("latin-1").strip())
            raise BrokenFileError(f"has a face whose corners are no indices of one kind: {line}")
    yield from ((kind, b"".join(runs), before) for kind, (runs, before) in waiting.items())


def _parse_rows(keyword: str, text: bytes) -> NDArray[np.float64]:
    """Parse the first two or three numbers of lines."""
    width = _NUMBERS[keyword]
    lines = text.count(b"\n")
    with suppress(ValueError, DeprecationWarning):
        # Each line begins with NaN in place of its keyword; if there is no other, the lines have one length.
        table = parse_numbers(text.replace(keyword.encode(), b"nan")).reshape(lines, -1)
        is_keyword = np.isnan(table)
        if table.shape[1] > width and is_keyword[:, 0].all() and not is_keyword[:, 1:].any():
            return table[:, 1 : 1 + width]
    rows = [line.split()[1 : 1 + width] for line in text.split(b"\n")[:-1]]
    if keyword == "vt":
        # A texture coordinate without a v has 0 there.
        rows = [row + [b"0"] * (width - len(row)) for row in rows]
    if any(len(row) < width for row in rows):
        raise BrokenFileError(f"has a {_ROWS[keyword]} without 3 coordinates")
    return parse_numbers(b" ".join(word for row in rows for word in row)).reshape(lines, width)


def _parse_faces(text: bytes, before: Integers) -> Polygons:
    """Parse faces of one form: numbers of what the corners refer to (k, 1 to 3), counted from 0.

    before : of each run of lines, how many they are, and how many rows there are before it of what they refer to.
    """
    numbers = parse_numbers(text.replace(b"f", b"nan").replace(b"/", b" "))
    is_keyword = np.isnan(numbers)
    kinds = before.shape[1] - 1
    sizes = (np.diff(np.flatnonzero(is_keyword), append=numbers.size) - 1) // kinds
    indices = numbers[~is_keyword].astype(np.int64).reshape(-1, kinds)
    absolute = indices - 1
    if absolute.min() < 0:
        counts = np.repeat(np.repeat(before[:, 1:], before[:, 0], axis=0), sizes, axis=0)
        absolute = np.where(indices < 0, indices + counts, absolute)
        if (absolute < 0).any():
            bad = np.unravel_index(np.argmax(absolute < 0), absolute.shape)
            raise BrokenFileError(f"has a face with the index {indices[bad]}, after {counts[bad]} that it could mean")
    # No file has as many rows as 32 bits count; what is beyond stays so.
    return Polygons(np.minimum(absolute, np.iinfo(np.int32).max).astype(np.int32), sizes.astype(np.int32))


def _assemble(tables: Mapping[str, NDArray[np.float64]], faces: dict[str, list[Polygons]]) -> RawMesh:
    """Make one mesh, with a vertex for each combination of position, texture coordinates and normal that a corner has.

    faces : by the form in which they are written; those of the last form come first.
    """
    parts: dict[str, list[NDArray[np.float64]]] = {keyword: [] for keyword in tables}
    triangles: list[Integers] = []
    has_rows = dict.fromkeys(tables, False)
    offset = 0
    for form in reversed(faces):
        names, _ = _CORNERS[form]
        corners, sizes = map(np.concatenate, zip(*faces[form], strict=True))
        # What refers to texture coordinates or normals that are not there has none; vertices have to be.
        is_there = {name: bool(corners[:, k].max() < len(tables[name])) for k, name in enumerate(names)}
        if not is_there["v"]:
            raise IndexError(f"index {corners[:, 0].max()} is out of bounds for axis 0 with size {len(tables['v'])}")
        rows, vertex = _combine(corners, [len(tables[name]) for name in names])
        triangles.append(triangulate(Polygons(vertex, sizes), by_size=bool((sizes == sizes[0]).all())) + offset)
        offset += len(rows)
        for keyword, table in tables.items():
            if is_there.get(keyword):
                has_rows[keyword] = True
                parts[keyword].append(table[rows[:, names.index(keyword)]])
            else:
                parts[keyword].append(np.zeros((len(rows), table.shape[1])))
    vertices, uv, normals = (np.concatenate(parts[name]) if has_rows[name] else None for name in ("v", "vt", "vn"))
    assert vertices is not None
    return RawMesh(vertices, np.concatenate(triangles), normals, uv)


def _combine(corners: Integers, counts: list[int]) -> tuple[Integers, Integers]:
    """Find the different rows of `corners` (k, 1 to 3), and which of them each corner is (k,).

    counts : how many of each there may be; indices beyond are taken as one.
    """
    kind = corners[:, 0]
    for column, count in zip(corners.T[1:], counts[1:], strict=True):
        # Numbers of combinations stay below the square of what a file of 4 GiB holds.
        _, kind = np.unique(kind.astype(np.int64) * (count + 1) + np.minimum(column, count), return_inverse=True)
    first = np.full(int(kind.max()) + 1, -1, np.int32)
    first[kind] = np.arange(len(kind), dtype=np.int32)
    used = first >= 0
    return corners[first[used]], (np.cumsum(used, dtype=np.int32) - 1)[kind]
