"""parameters.cfg of the 4D Light Field Benchmark."""

import math
from collections.abc import Iterator
from pathlib import Path

from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.lightfield.formats import geometry, hci

PARSERS = ("configparser",)
DICTIONARY = (b"[intrinsics]", b"[extrinsics]", b"[DEFAULT]", b"num_cams_x = ", b"baseline_mm = ", b"1e308", b"1e-320")


def seeds() -> Iterator[bytes]:
    turned = Pose((0.0, 1.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
    for pose in (None, turned):
        views = Views(0.1 * geometry.regular_grid(2, 2), Plane(0.1, -0.2, 0.2), 4, 4, 0.5, pose=pose)
        yield hci.to_cfg(views, "seed", None)


def run(data: bytes, folder: Path) -> None:
    path = folder / hci.FILE
    path.write_bytes(data)
    said = hci.read(path)
    assert min(said.rows, said.columns, said.width, said.height) >= 1
    assert said.known.pixel is not None
    assert 0.0 < said.known.pixel < math.inf
    if said.pose is not None:
        assert all(math.isfinite(number) for triple in said.pose for number in triple)
