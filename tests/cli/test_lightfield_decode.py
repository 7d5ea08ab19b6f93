"""`rt lightfield decode`."""

import json

import numpy as np
import pytest
from PIL import Image

from raytracer.film.light_field import lf
from tests.lightfield.lenslet_pictures import Camera, lattice, texture


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("raws")
    camera = Camera(lattice(11.3, 0.7, (5.3, 9.1), hexagonal=True), 300, 240)
    white = np.rint(60_000.0 * camera.picture()).astype(np.uint16)
    raw = np.rint(60_000.0 * camera.picture(lambda x, y: texture(x, y, 120.0)[..., :1])[..., 0]).astype(np.uint16)
    Image.fromarray(white).save(path / "white.png")
    Image.fromarray(raw).save(path / "raw.tif")
    Image.fromarray((white >> 8).astype(np.uint8)).save(path / "white8.png")
    np.save(path / "dark.npy", np.zeros((240, 300), np.float32))
    return path


@pytest.fixture(autouse=True)
def _inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_decode_writes_a_light_field(tmp_path, rt):
    out = tmp_path / "shot.lf"
    told = rt(f"lightfield decode raw.tif --white white.png --dark dark.npy -o {out}")
    assert "hexagonal, 11.3" in told.out
    assert "pixels from view to view" in told.err
    with lf.open(out) as field:
        assert (field.views.rows, field.views.columns) == (11, 11)
        assert field.settings["units"] == "views"
        assert 0.1 < field.view(5, 5).mean() < 0.9


def test_metres_where_the_camera_is_known(tmp_path, rt):
    out = tmp_path / "shot.lf"
    camera = "--pixel-pitch 10um --focal-length 50mm --f-number 4 --focus-distance 2m"
    rt(f"lightfield decode raw.tif --white white.png -o {out} {camera}")
    with lf.open(out) as field:
        assert "units" not in field.settings
        assert field.views.focus_distance == 2.0
        assert field.views.aperture == pytest.approx(12.5e-3)


def test_grid_is_printed_and_read_again(tmp_path, rt):
    printed = rt("lightfield decode raw.tif --white white8.png --json --quiet").out
    grid = json.loads(printed)
    assert grid["layout"] == "hexagonal"
    assert grid["pitch"] == pytest.approx(11.3, abs=0.02)
    file = tmp_path / "grid.json"
    file.write_text(printed)
    again = rt(f"lightfield decode raw.tif --grid {file} --json -q")
    assert json.loads(again.out)["along"] == grid["along"]
    assert again.err == ""
