"""OBJ meshes: the polygons of all objects, groups and materials in a file as one mesh.

References: Wavefront Technologies, "Object Files (.obj)", Advanced Visualizer Manual, appendix B1.
"""

import re
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raytracer.assets.polygons import BrokenMeshError, Floats, Integers, Parts, fan, parse_floats, parse_integers

_NO_NORMAL = -1

# Faces whose corners are all written alike, and how: numbers a corner, and which of them is the normal.
_FORMS = (
    (re.compile(rb"(?:-?\d+\s*+)*+"), 1, None),
    (re.compile(rb"(?:-?\d+/-?\d+\s*+)*+"), 2, None),
    (re.compile(rb"(?:-?\d+//-?\d+\s*+)*+"), 2, 1),
    (re.compile(rb"(?:-?\d+/-?\d+/-?\d+\s*+)*+"), 3, 2),
)


def _statements(keyword: bytes) -> re.Pattern[bytes]:
    """Lines of a kind; the group is what follows the keyword, up to a comment."""
    return re.compile(rb"^[ \t]*" + keyword + rb"[ \t]+([^#\n]*)", re.MULTILINE)


_VERTEX, _NORMAL, _FACE = _statements(b"v"), _statements(b"vn"), _statements(b"f")


def _numbers(rows: list[bytes]) -> Floats:
    """The first three numbers of each row, float64 (n, 3); what follows is a weight or a colour."""
    widths = set(map(len, map(bytes.split, rows)))
    if not widths:
        return np.empty((0, 3))
    if min(widths) < 3:
        raise BrokenMeshError("has a vertex or normal with fewer than 3 coordinates")
    if len(widths) > 1:
        rows, widths = [b" ".join(row.split()[:3]) for row in rows], {3}
    numbers = parse_floats(b" ".join(rows))
    return numbers.reshape(len(rows), widths.pop())[:, :3]


def _indices(rows: list[bytes], corners: int) -> tuple[Integers, Integers]:
    """Vertex and normal of each of the `corners`, as they are written: from 1, or negative; 0 for no normal."""
    text = b" ".join(rows)
    for form, columns, normal in _FORMS:
        if form.fullmatch(text):
            table = parse_integers(text.replace(b"/", b" ")).reshape(corners, columns)
            return table[:, 0], np.zeros(corners, dtype=np.int64) if normal is None else table[:, normal]

    # Faces that are written in different ways are taken apart one by one.
    parts = [[*corner.split(b"/"), b"", b""] for corner in chain.from_iterable(map(bytes.split, rows))]
    table = np.array([(int(part[0]), int(part[2] or 0)) for part in parts], dtype=np.int64)
    return table[:, 0], table[:, 1]


def _starts(pattern: re.Pattern[bytes], data: bytes) -> Integers:
    return np.array([match.start() for match in pattern.finditer(data)], dtype=np.int64)


def _resolve(written: Integers, counts: Integers, statement: re.Pattern[bytes], data: bytes) -> Integers:
    """Indices from 0 of those `written`; negative ones count back from what `statement` gave before their face."""
    if np.all(written >= 0):
        return written - 1
    before = np.searchsorted(_starts(statement, data), _starts(_FACE, data))
    return np.where(written < 0, np.repeat(before, counts) + written, written - 1)


def _split_by_normal(
    vertices: Floats, corners: Integers, normals: Floats, corner_normals: Integers
) -> tuple[Floats, Integers, Floats]:
    """Give every vertex one normal; a vertex that has different ones in its corners becomes several."""
    of_vertex: NDArray[np.int64] = np.full(len(vertices), _NO_NORMAL)
    of_vertex[corners] = corner_normals
    if not np.array_equal(of_vertex[corners], corner_normals):
        kinds = len(normals) + 1
        pairs, corners = np.unique(corners * kinds + (corner_normals - _NO_NORMAL), return_inverse=True)
        vertices, of_vertex = vertices[pairs // kinds], pairs % kinds + _NO_NORMAL
    return vertices, corners, np.append(normals, np.zeros((1, 3)), axis=0)[of_vertex]


def read(path: Path) -> Parts:
    """Vertices, triangles, and normals if any corner has one; a corner without takes (0, 0, 0).

    Texture coordinates are left out, so that their seams leave no trace.

    Raises
    ------
    BrokenMeshError : the file is broken or has no faces.
    OSError : the file cannot be read.
    """
    data = path.read_bytes()
    if b"\\" in data:
        data = re.sub(rb"\\\r?\n", b" ", data)
    rows = _FACE.findall(data)
    if not rows:
        raise BrokenMeshError("has no faces")
    counts = np.fromiter(map(len, map(bytes.split, rows)), dtype=np.int64, count=len(rows))
    written, written_normals = _indices(rows, int(counts.sum()))
    vertices = _numbers(_VERTEX.findall(data))

    corners = _resolve(written, counts, _VERTEX, data)
    outside = (corners < 0) | (corners >= len(vertices))
    if np.any(outside):
        raise BrokenMeshError(f"has a face with the vertex {written[outside][0]}, and {len(vertices)} vertices")
    if not np.any(written_normals):
        return Parts(vertices, fan(counts, corners), None)

    normals = _numbers(_NORMAL.findall(data))
    corner_normals = _resolve(written_normals, counts, _NORMAL, data)
    outside = (corner_normals < _NO_NORMAL) | (corner_normals >= len(normals))
    outside |= (corner_normals == _NO_NORMAL) & (written_normals != 0)
    if np.any(outside):
        raise BrokenMeshError(f"has a face with the normal {written_normals[outside][0]}, and {len(normals)} normals")
    vertices, corners, normals = _split_by_normal(vertices, corners, normals, corner_normals)
    return Parts(vertices, fan(counts, corners), normals)
