"""Read Wavefront OBJ files: vertices, texture coordinates, normals and faces; all else is left out.

Lines of one kind that follow one another are found at once by a regular expression, gathered, and parsed a megabyte at
a time, so that memory holds the file and the mesh, and no Python object for each line.

Reference: Wavefront Technologies, "Object Files (.obj)", Advanced Visualizer Manual, appendix B1.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.scene.assets.raw_mesh import BrokenMeshError, Integers, Polygons, RawMesh, parse_numbers, triangulate
from raytracer.util.errors import format_value

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
    "f": ("v", [_INDEX]),
    "f_": ("v", [_INDEX + "/"]),
    "f__": ("v", [_INDEX + "//"]),
    "ft": ("v vt", [_INDEX, _INDEX]),
    "ft_": ("v vt", [_INDEX, _INDEX + "/"]),
    "fn": ("v vn", [_INDEX, "", _INDEX]),
    "ftn": ("v vt vn", [_INDEX, _INDEX, _INDEX]),
}
_REFERENCES = {form: names.split() for form, (names, _) in _CORNERS.items()}

# Runs of lines of one kind, which is the name of the group.
_LINES = {keyword: rf"{keyword}(?=\s)[^\n]*+" for keyword in _NUMBERS}
_LINES |= {form: rf"f(?:[^\S\n]++{'/'.join(parts)}){{3,}}+[^\S\n]*+" for form, (_, parts) in _CORNERS.items()}
_RUN = re.compile(
    "|".join(rf"(?P<{kind}>(?:[^\S\n]*+{line}\n){{1,32768}}+)" for kind, line in _LINES.items()).encode()
    + rb"|[^\n]*+\n"
)


class _Faces(NamedTuple):
    """Faces whose corners are written in one form.

    corners : numbers of what the corners refer to (k, 1 to 3), counted from 0.
    sizes : how many corners the faces have (m,).
    """

    corners: Integers
    sizes: Integers


class _Batches:
    """Lines of each kind, gathered until they are parsed."""

    def __init__(self) -> None:
        self.counts = dict.fromkeys(_NUMBERS, 0)
        self._rows: dict[str, list[NDArray[np.float64]]] = {keyword: [] for keyword in _NUMBERS}
        self._faces: dict[str, list[_Faces]] = {}
        self._waiting: dict[str, list[bytes]] = {kind: [] for kind in _LINES}
        self._before: dict[str, list[tuple[int, ...]]] = {form: [] for form in _CORNERS}
        self._bytes = dict.fromkeys(_LINES, 0)

    def add(self, kind: str, run: bytes) -> None:
        """Add a run of lines of one kind."""
        if kind in self.counts:
            self.counts[kind] += run.count(b"\n")
        else:
            self._faces.setdefault(kind, [])
            self._before[kind].append((run.count(b"\n"), *(self.counts[name] for name in _REFERENCES[kind])))
        self._waiting[kind].append(run)
        self._bytes[kind] += len(run)
        if self._bytes[kind] > _BATCH:
            self._parse(kind)

    def _parse(self, kind: str) -> None:
        text = b"".join(self._waiting[kind])
        self._waiting[kind].clear()
        self._bytes[kind] = 0
        if kind in self._rows:
            self._rows[kind].append(_parse_rows(kind, text))
        else:
            self._faces[kind].append(_parse_faces(text, np.array(self._before[kind])))
            self._before[kind].clear()

    def rows(self, keyword: str) -> NDArray[np.float64]:
        """Return the numbers of all lines with a keyword (n, 2 or 3)."""
        if self._waiting[keyword]:
            self._parse(keyword)
        return np.concatenate([np.empty((0, _NUMBERS[keyword])), *self._rows.pop(keyword)])

    def faces(self) -> Iterator[tuple[list[str], _Faces]]:
        """Return all faces, of each form at once, the last form first, and what their corners refer to."""
        for form in reversed(list(self._faces)):
            if self._waiting[form]:
                self._parse(form)
            yield _REFERENCES[form], _Faces(*map(np.concatenate, zip(*self._faces.pop(form), strict=True)))


def read_obj(file: BinaryIO) -> RawMesh:
    """Read all groups of a file into one mesh; missing normals and texture coordinates are 0 where others have some.

    Raises
    ------
    BrokenMeshError : a line is none that the format has, or the file has no faces.
    IndexError : a face has a vertex that is not there.
    Exception : whatever else a broken file leads to.
    """
    text = file.read()
    if not text.endswith(b"\n"):
        text += b"\n"
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"#" in text or b"\\" in text:
        text = re.sub(rb"\\\n|#[^\n]*", b" ", text)
    _check_lines(text)
    batches = _Batches()
    for match in _RUN.finditer(text):
        if match.lastgroup is not None:
            batches.add(match.lastgroup, match[0])
        elif (words := match[0].split())[:1] == [b"f"]:
            if len(words) < 4:
                raise BrokenMeshError("has a face with fewer than 3 corners")
            line = format_value(match[0].decode("latin-1").strip())
            raise BrokenMeshError(f"has a face whose corners are no indices of one kind: {line}")
    del text
    return _assemble(batches)


def _check_lines(text: bytes) -> None:
    """Reject a text with a line that is too long."""
    start = 0
    while (end := text.find(b"\n", start)) >= 0:
        if end - start > _LONGEST_LINE:
            raise BrokenMeshError(f"has a line of {end - start:,} characters, and at most {_LONGEST_LINE:,} are read")
        start = text.rfind(b"\n", end, end + _LONGEST_LINE) + 1


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
        raise BrokenMeshError(f"has a {_ROWS[keyword]} without 3 coordinates")
    return parse_numbers(b" ".join(word for row in rows for word in row)).reshape(lines, width)


def _parse_faces(text: bytes, before: Integers) -> _Faces:
    """Parse faces of one form.

    before : of each run of lines, how many they are, and how many rows there are before it of what they refer to.

    Raises
    ------
    BrokenMeshError : an index is 0, or counts back to what is not there.
    """
    numbers = parse_numbers(text.replace(b"f", b"nan").replace(b"/", b" "))
    is_keyword = np.isnan(numbers)
    kinds = before.shape[1] - 1
    sizes = (np.diff(np.flatnonzero(is_keyword), append=numbers.size) - 1) // kinds
    indices = numbers[~is_keyword].astype(np.int64).reshape(-1, kinds)
    if indices.min() > 0:
        return _compact(indices - 1, sizes)
    counts = np.repeat(np.repeat(before[:, 1:], before[:, 0], axis=0), sizes, axis=0)
    absolute = np.where(indices < 0, indices + counts, indices - 1)
    if (absolute < 0).any():
        bad = np.unravel_index(np.argmax(absolute < 0), absolute.shape)
        raise BrokenMeshError(f"has a face with the index {indices[bad]}, after {counts[bad]} that it could mean")
    return _compact(absolute, sizes)


def _compact(corners: Integers, sizes: Integers) -> _Faces:
    """Keep faces in as little memory as their numbers allow."""
    is_small = corners.max() <= np.iinfo(np.int32).max
    return _Faces(corners.astype(np.int32) if is_small else corners, sizes.astype(np.int32))


# ---- One mesh of all faces


def _assemble(batches: _Batches) -> RawMesh:
    """Make a vertex of each combination of position, texture coordinates and normal that a corner has."""
    tables = {keyword: batches.rows(keyword) for keyword in _NUMBERS}
    parts: dict[str, list[NDArray[np.float64]]] = {keyword: [] for keyword in _NUMBERS}
    faces: list[Integers] = []
    has_rows = dict.fromkeys(_NUMBERS, False)
    offset = 0
    for names, (corners, sizes) in batches.faces():
        if (last := corners[:, 0].max()) >= (count := len(tables["v"])):
            raise IndexError(f"index {last} is out of bounds for axis 0 with size {count}")
        rows, vertex = _combine(corners, [len(tables[name]) for name in names])
        is_even = bool((sizes == sizes[0]).all())
        faces.append(triangulate(Polygons(vertex, sizes), by_size=is_even) + offset)
        offset += len(rows)
        for keyword, table in tables.items():
            own = rows[:, names.index(keyword)] if keyword in names else None
            # What refers to texture coordinates or normals that are not there has none.
            if own is None or own.max() >= len(table):
                parts[keyword].append(np.zeros((len(rows), _NUMBERS[keyword])))
            else:
                parts[keyword].append(table[own])
                has_rows[keyword] = True
    if not faces:
        raise BrokenMeshError("has no faces")
    vertices, uv, normals = (np.concatenate(parts[name]) if has_rows[name] else None for name in ("v", "vt", "vn"))
    assert vertices is not None
    return RawMesh(vertices, np.concatenate(faces), normals, uv)


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
