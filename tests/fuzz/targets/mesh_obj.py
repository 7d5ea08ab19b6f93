"""Meshes in the format of Wavefront."""

from collections.abc import Iterator
from pathlib import Path

import raytracer.scene.assets.obj  # noqa: F401
from tests.fuzz.targets import _meshes

MAX_LENGTH = 1024
DICTIONARY = (
    b"v ",
    b"vt ",
    b"vn ",
    b"f ",
    b"/",
    b"//",
    b"-1",
    b"usemtl ",
    b"mtllib ",
    b"o ",
    b"g ",
    b"\\\n",
    b"nan",
    b"1e999",
)


def seeds() -> Iterator[bytes]:
    square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\n"
    yield square + b"f 1 2 3\nf 1 3 4\n"
    yield square + b"vt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\n"
    yield square + b"vn 0 0 1\nf 1//1 2//1 3//1\nf -4 -3 -2 -1\n"
    yield square + b"vt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1 3 4\n# end\n"
    yield b"o one\n" + square + b"g part\nf 1 2 \\\n3 4\nv 2 2 2 1 1 1\nf 1 2 5\n"


def run(data: bytes, folder: Path) -> None:
    _meshes.load(folder / "a.obj", data)
