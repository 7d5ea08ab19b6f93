"""geometry.json: where views are."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.lightfield.formats import geometry

DICTIONARY = (b'"position"', b'"pose"', b'"cell"', b'"origin"', b"NaN", b"Infinity", b"1e999", b"[[[", b"null")


def seeds() -> Iterator[bytes]:
    for rows, columns, rest in ((2, 2, {}), (1, 3, {"cell": (0.1, 0.2), "aperture": 0.3, "focal_length": 50.0})):
        pose = Pose((0.0, 1.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
        views = Views(geometry.regular_grid(rows, columns), Plane(0.1, -0.2, 0.2), 4, 4, 0.5, pose=pose, **rest)
        for units in (None, "views"):
            yield geometry.to_json(views, units)


def run(data: bytes, folder: Path) -> None:
    path = folder / geometry.FILE
    path.write_bytes(data)
    views, settings = geometry.read(path)
    assert views.width >= 1
    assert views.height >= 1
    assert np.isfinite(views.position).all()
    assert views.position.shape == (views.rows, views.columns, 2)
    assert set(settings) <= {"units"}
    # What was read can be written, and read again.
    path.write_bytes(geometry.to_json(views, settings.get("units")))
    again, _ = geometry.read(path)
    assert np.array_equal(again.position, views.position)
    assert again.plane == views.plane
