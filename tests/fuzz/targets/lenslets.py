"""Grids of microlenses in JSON, as decoding prints them and takes them."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

from raytracer.film.light_field.lattice import Lattice
from raytracer.lightfield.decoding.microlens_grid import Grid, read_grid

DICTIONARY = (b'"offset"', b'"along"', b'"across"', b'"width"', b'"diameter"', b"NaN", b"Infinity", b"1e999")


def seeds() -> Iterator[bytes]:
    for across in ((0.1, 10.0), (5.0, 8.66)):
        yield json.dumps(Grid(Lattice((3.0, 4.0), (10.0, 0.0), across), 100, 80).as_dict()).encode()


def run(data: bytes, folder: Path) -> None:
    path = folder / "grid.json"
    path.write_bytes(data)
    grid = read_grid(path)
    assert grid.lattice.pitch >= 1.0
    assert math.isfinite(grid.lattice.area)
    assert math.isfinite(grid.lattice.rotation)
    assert math.isfinite(grid.diameter)
    json.dumps(grid.as_dict(), allow_nan=False)
