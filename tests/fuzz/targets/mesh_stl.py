"""Meshes in the format of stereolithography; the first byte says whether the count of facets is put right."""

import struct
from collections.abc import Iterator
from pathlib import Path

import raytracer.scene.assets.stl  # noqa: F401
from tests.fuzz.targets import _meshes
from tests.fuzz.targets._parts import CORNERS, TRIANGLES

MAX_LENGTH = 1024
DICTIONARY = (
    b"solid ", b"endsolid\n", b"facet normal ", b"endfacet\n", b"outer loop\n", b"endloop\n", b"vertex ", b"nan",
)  # fmt: skip

_RIGHT = b"\x01"
_HEADER, _FACET = 84, 50


def seeds() -> Iterator[bytes]:
    facets = b"".join(struct.pack("<12fH", 0, 0, 1, *CORNERS[face].reshape(-1), 0) for face in TRIANGLES)
    yield _RIGHT + bytes(_HEADER) + facets
    yield b"\x00" + bytes(_HEADER - 4) + struct.pack("<I", 2) + facets
    corners = "".join("vertex {} {} {}\n".format(*corner) for corner in CORNERS[:3])
    facet = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
    yield f"\x00solid a\n{facet}{facet}endsolid a\n".encode()
    yield f"\x00solid a\n{facet}endsolid a\nsolid b\n{facet}endsolid b\n".encode()


def run(data: bytes, folder: Path) -> None:
    given, data = data[:1], data[1:]
    if given == _RIGHT and len(data) >= _HEADER:
        count = (len(data) - _HEADER) // _FACET
        data = data[: _HEADER - 4] + struct.pack("<I", count) + data[_HEADER : _HEADER + _FACET * count]
    _meshes.load(folder / "a.stl", data)
