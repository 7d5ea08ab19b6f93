"""Folders of views of other programs, and what tells their geometry.

An input is a list of files: after a zero byte comes a name, up to the next one, and after that what is in the file;
nothing stands for a small picture.
"""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import PIL.Image

from raytracer.film.formats import pfm
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.lightfield.formats import geometry, hci
from raytracer.lightfield.formats.importer import import_views

MAX_LENGTH = 4096
PARSERS = ("configparser",)
DICTIONARY = (
    b"geometry.json",
    b"parameters.cfg",
    b"input_Cam000.png",
    b"out_00_00_",
    b"view_00_00.npy",
    b"gt_disp_lowres",
)

SIDE = 2
_MOST_FILES, _LONGEST_NAME = 32, 64


def picture(suffix: str) -> bytes:
    held = io.BytesIO()
    values = np.arange(SIDE * SIDE * 3).reshape(SIDE, SIDE, 3)
    if suffix == ".npy":
        np.save(held, values / values.size)
    else:
        PIL.Image.fromarray(values.astype(np.uint8)).save(held, "PNG")
    return held.getvalue()


def _joined(files: dict[str, bytes]) -> bytes:
    return b"".join(b"\0" + name.encode() + b"\0" + content for name, content in files.items())


def _views() -> Views:
    pose = Pose((0.0, 1.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
    position = 0.1 * geometry.regular_grid(2, 2)
    return Views(position, Plane(0.1, -0.1, 0.1), SIDE, SIDE, 0.5, (0.1, 0.1), 0.3, 50.0, pose)


def seeds() -> Iterator[bytes]:
    grid = {f"view_{row:02d}_{column:02d}.png": b"" for row in range(2) for column in range(2)}
    yield _joined(grid)
    yield _joined({name.replace(".png", ".npy"): b"" for name in grid})
    yield _joined({**grid, geometry.FILE: geometry.to_json(_views(), None)})
    yield _joined({f"{number}.png": b"" for number in range(4)})
    places = ((0, 0), (0, 12.5), (-3.25e1, 0), (-32.5, 12.5))
    yield _joined({f"out_{i // 2:02d}_{i % 2:02d}_{y}_{x}_.png": b"" for i, (y, x) in enumerate(places)})
    cameras = {f"input_Cam{number:03d}.png": b"" for number in range(4)}
    cfg = hci.to_cfg(_views(), "seed", None)
    yield _joined(cameras)
    # The file has no zero bytes, which stand between names.
    depths = pfm.encode(np.full((SIDE, SIDE), 2.1))
    yield _joined({**cameras, hci.FILE: cfg, "gt_disp_lowres.pfm": depths, "gt_depth_lowres_Cam000.pfm": depths})


def _written(data: bytes, folder: Path) -> None:
    parts = data.split(b"\0")[1:]
    for name, content in list(zip(parts[::2], parts[1::2], strict=False))[:_MOST_FILES]:
        text = name.decode("utf-8", "replace").replace("/", "_")
        if text in ("", ".", "..") or len(name) > _LONGEST_NAME:
            continue
        (folder / text).write_bytes(content or picture(Path(text).suffix))


def check(field: LightField) -> None:
    views = field.views
    assert tuple(field.radiance.shape) == (views.rows, views.columns, views.height, views.width, 3)
    assert views.rows * views.columns <= _MOST_FILES * 1024
    assert np.isfinite(views.position).all()
    assert views.plane.pixel > 0.0
    assert np.asarray(field.radiance[-1, -1]).shape == (views.height, views.width, 3)
    for layer in field.layers.values():
        assert np.asarray(layer[0, 0]).shape == (views.height, views.width)
    # What was read can be written again.
    geometry.to_json(views, None)


def run(data: bytes, folder: Path) -> None:
    _written(data, folder)
    check(import_views(folder))
