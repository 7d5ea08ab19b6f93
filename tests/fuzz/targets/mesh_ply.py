"""Meshes in the format of Stanford: text, bytes in both orders, faces of one size and of several."""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import raytracer.scene.assets.ply  # noqa: F401
from tests.fuzz.targets import _meshes
from tests.fuzz.targets._parts import CORNERS

MAX_LENGTH = 1024
DICTIONARY = (
    b"element ", b"vertex ", b"face ", b"property ", b"list ", b"uchar ", b"int ", b"uint ", b"float ", b"double ",
    b"vertex_indices", b"vertex_index", b"ascii", b"binary_little_endian", b"binary_big_endian", b"end_header\n", b"nx",
    b"comment ", b"999999999999", b"-1", b"red", b"texnumber", b"s\n", b"t\n",
)  # fmt: skip


def _file(kind: str, properties: str, faces: int, body: bytes, name: str = "vertex_indices") -> bytes:
    head = f"ply\nformat {kind} 1.0\nelement vertex 4\n{properties}element face {faces}\n"
    return f"{head}property list uchar int {name}\nend_header\n".encode() + body


def seeds() -> Iterator[bytes]:
    places = "property float x\nproperty float y\nproperty float z\n"
    text = b"0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n"
    yield _file("ascii", places, 2, text + b"3 0 1 2\n3 0 2 3\n")
    yield _file("ascii", places, 2, text + b"3 0 1 2\n4 0 1 2 3\n", "vertex_index")
    for kind, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        corners = CORNERS.astype(f"{order}f4").tobytes()
        one, two, quad = (struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in ((0, 1, 2), (0, 2, 3), (0, 1, 2, 3)))
        yield _file(kind, places, 2, corners + one + two)
        yield _file(kind, places, 2, corners + quad + one)
        more = "".join(f"property float {name}\n" for name in ("nx", "ny", "nz", "s", "t"))
        table = np.hstack([CORNERS, CORNERS, CORNERS[:, :2]]).astype(f"{order}f4").tobytes()
        yield _file(kind, places + more, 2, table + one + two)
        yield _file(kind, places + more, 2, table + two + quad)


def run(data: bytes, folder: Path) -> None:
    _meshes.load(folder / "a.ply", data)
