"""Lens tables of pbrt."""

from collections.abc import Iterator
from pathlib import Path

from raytracer.scene.assets import read_lens
from tests.fuzz.targets.lens import check

DICTIONARY = (b"# ", b"radius", b"axpos", b"1e308", b"nan", b"inf", b"-0", b"1_0")

_TABLE = b"""\
# double Gauss
# from nowhere
# radius\tthickness\tindex\taperture
58.950\t7.520\t1.670\t50.4
169.660\t0.240\t1\t50.4
0\t9\t0\t34.2
-34.07\t6.5\t1.8\t40
-40.1\t61\t1\t40
"""


def seeds() -> Iterator[bytes]:
    yield _TABLE
    yield _TABLE.replace(b"thickness", b"axpos")
    yield _TABLE.replace(b"\n", b"\r\n")
    yield _TABLE.decode().encode("utf-16")


def run(data: bytes, folder: Path) -> None:
    path = folder / "lens.dat"
    path.write_bytes(data)
    check(read_lens(path))
