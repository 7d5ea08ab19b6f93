"""Depths and disparities as portable float maps (.pfm), of light fields of other programs."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.film.formats import pfm
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats import geometry, hci
from raytracer.lightfield.formats.importer import import_views
from tests.fuzz.targets.views import SIDE, picture

MAX_LENGTH = 256
DICTIONARY = (b"PF\n", b"Pf\n", b"-1.0\n", b"2 2\n", b"999999999 999999999\n")


def seeds() -> Iterator[bytes]:
    values = np.array([[1.0, -2.0], [np.nan, np.inf]])
    yield pfm.encode(values)
    yield b"Pf\n2 2\n1.0\n" + values.astype(">f4").tobytes()


def run(data: bytes, folder: Path) -> None:
    for number in range(4):
        (folder / f"input_Cam{number:03d}.npy").write_bytes(picture(".npy"))
    views = Views(0.1 * geometry.regular_grid(2, 2), Plane(0.1, -0.1, 0.1), SIDE, SIDE, 0.5)
    (folder / hci.FILE).write_bytes(hci.to_cfg(views, "given", None))
    (folder / "gt_disp_lowres.pfm").write_bytes(data)
    (folder / "gt_depth_lowres_Cam000.pfm").write_bytes(data)
    field = import_views(folder)
    depth = np.asarray(field.layers["depth"])
    assert depth.shape == (2, 2, SIDE, SIDE)
    assert depth.dtype == np.float64
    assert np.isnan(depth[0, 1]).all()
