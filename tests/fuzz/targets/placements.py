"""Placements of instances; the first byte chooses the format, and whether a header's length is put right."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.scene.assets import read_placements
from tests.fuzz.targets._parts import npy, with_header

MAX_LENGTH = 1024
DICTIONARY = (
    b"x,y,z", b"scale", b"scale_x", b"angle", b"axis_x", b",", b'"', b"\n", b"1e308", b"nan", b"inf", b"-0",
    b"\xef\xbb\xbf", b"'descr'", b"'<f8'", b"'|O'",
)  # fmt: skip


def seeds() -> Iterator[bytes]:
    poses = np.tile(np.eye(4), (2, 1, 1))
    yield b"\x00" + npy(poses)
    yield b"\x00" + npy(poses[:, :3].astype(np.float32))
    yield (
        b"\x01{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3, 4), }\x00" + np.eye(3, 4, dtype="<f4").tobytes()
    )
    yield b"\x02x,y,z\n1,2,3\n4,5,6\n"
    yield b"\x02x,y,z,scale,angle,axis_x,axis_y,axis_z\n1,2,3,2,90,1,1,0\n"
    yield b"\x02\xef\xbb\xbfx, y ,z,scale_x,scale_z\r\n1,2,3,4,5\r\n"


def run(data: bytes, folder: Path) -> None:
    kind, data = data[0] % 3 if data else 0, data[1:]
    path = folder / ("a.csv" if kind == 2 else "a.npy")
    path.write_bytes(with_header(*data.partition(b"\x00")[::2]) if kind == 1 else data)
    poses = read_placements(path)
    assert poses.dtype == np.float64
    assert poses.shape == (len(poses), 4, 4)
    assert len(poses) >= 1
    assert np.isfinite(poses).all()
