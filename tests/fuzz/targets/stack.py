"""Light fields as one array, .npy."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.lightfield.formats.importer import import_views
from tests.fuzz.targets.views import check

MAX_LENGTH = 2048
DICTIONARY = (b"\x93NUMPY", b"'descr': ", b"'fortran_order': True", b"'shape': (", b"'<f4'", b"'|O'", b"'|u1'")


def seeds() -> Iterator[bytes]:
    rng = np.random.default_rng(1)
    for shape in ((1, 2, 2, 3, 3), (2, 1, 2, 2), (1, 1, 2, 2, 1)):
        values = rng.random(shape)
        for array in (values, values.astype(">f4"), (255 * values).astype(np.uint8), np.asfortranarray(values)):
            held = io.BytesIO()
            np.save(held, array)
            yield held.getvalue()


def run(data: bytes, folder: Path) -> None:
    path = folder / "given.npy"
    path.write_bytes(data)
    check(import_views(path))
