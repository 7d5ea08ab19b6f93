"""Grids of densities; the first byte says whether the header's length is put right."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.scene.assets import read_grid
from tests.fuzz.targets._parts import npy, with_header

MAX_LENGTH = 1024
DICTIONARY = (
    b"'descr'",
    b"'fortran_order'",
    b"'shape'",
    b"'<f8'",
    b"'|O'",
    b"'>f2'",
    b"'|b1'",
    b"True",
    b"999999999999",
    b"(",
    b"[",
)


def seeds() -> Iterator[bytes]:
    values = np.arange(24.0).reshape(2, 3, 4)
    for array in (values, values.astype(np.float32), values.astype(np.uint8), values > 3, values.astype(">i2")):
        yield b"\x00" + npy(array)
    yield b"\x00" + npy(values, "F")
    for dtype in ("<f2", "<f8"):
        yield f"\x01{{'descr': '{dtype}', 'fortran_order': False, 'shape': (1, 2, 3), }}\x00".encode() + bytes(48)


def run(data: bytes, folder: Path) -> None:
    kind, data = data[:1], data[1:]
    path = folder / "a.npy"
    if kind in (b"\x01", b"\x02"):
        data = with_header(*data.partition(b"\x00")[::2], version=kind[0])
    path.write_bytes(data)
    grid = read_grid(path)
    assert grid.dtype == np.float32
    assert grid.ndim == 3
    assert grid.size > 0
    assert np.isfinite(grid).all()
    assert (grid >= 0).all()
