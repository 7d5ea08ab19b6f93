"""`rt lightfield calibrate`, and `rt lightfield decode --calibration`."""

import json

import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.calibrating.bundle_adjustment import view_steps
from raytracer.lightfield.calibrating.camera import CameraModel
from tests.lightfield.lenslet_pictures import Camera, lattice, texture
from tests.lightfield.test_calibrating import CAMERA, COLUMNS, DISTANCES, ROWS, TURNS, draw_board, place_board


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("boards")
    straight = CameraModel(**{**CAMERA.__dict__, "distortion": (0.0, 0.0)})
    views = Views(view_steps(3, 5), Plane(1.0, -80.0, 60.0), 160, 120)
    for number, (turns, distance) in enumerate(zip(TURNS[:4], DISTANCES, strict=False)):
        radiance = draw_board(straight, place_board(turns, distance), 3).astype(np.float32)
        lf.write(path / f"board{number}.lf", LightField(radiance, views))
    camera = Camera(lattice(11.3, 0.7, (5.3, 9.1)), 300, 240)
    np.save(path / "white.npy", camera.picture())
    np.save(path / "raw.npy", camera.picture(lambda x, y: texture(x, y, 120.0)[..., :1])[..., 0])
    return path


@pytest.fixture(autouse=True)
def _inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_light_fields_of_a_board_give_the_camera(tmp_path, rt):
    boards = " ".join(f"board{number}.lf" for number in range(4))
    options = f"--corners {COLUMNS}x{ROWS} --square 14mm --no-distortion"
    told = rt(f"lightfield calibrate {boards} {options} -o {tmp_path / 'camera.json'}")
    assert "in 4 pictures" in told.out
    camera = json.loads((tmp_path / "camera.json").read_text())
    assert camera["pixel"] == pytest.approx(CAMERA.pixel, rel=0.01)
    assert camera["spacing"] == pytest.approx(CAMERA.spacing, rel=0.02)
    assert camera["inverse_focus"] == pytest.approx(CAMERA.inverse_focus, rel=0.02)
    assert camera["distortion"] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("board0.lf --corners 7 --square 14mm", "--corners 7: must be two numbers"),
        ("board0.lf --corners 2x5 --square 14mm", "3 to 100 inner corners a side"),
        ("board0.lf --corners 7x5 --square 14mm", "at least 2 pictures"),
        ("board0.lf board1.lf --corners 9x5 --square 14mm", "board0.lf: shows no whole checkerboard of 9 x 5"),
        ("nowhere.lf --corners 7x5 --square 14mm", "nowhere.lf: no such file"),
        ("raw.npy --white white.npy --memory 1MB --corners 7x5 --square 14mm", "memory: decoding raw.npy, 300 x 240"),
        ("raw.npy --white . --corners 7x5 --square 14mm", ".: folders, archives and containers of white pictures go"),
        ("board0.lf --corners 7x5 --square 0mm", "--square 0mm: must be greater than 0"),
    ],
)
def test_what_is_no_calibration(arguments, told, rt):
    assert told in rt(f"lightfield calibrate {arguments}", status=2).err


def test_a_calibration_gives_metres_and_straightens_views(tmp_path, rt):
    rt(f"lightfield decode raw.npy --white white.npy -o {tmp_path / 'plain.lf'} --views 5 -q")
    with lf.open(tmp_path / "plain.lf") as field:
        size = (field.views.width, field.views.height)
        plain = field.view(2, 2)
    camera = CameraModel(5, 5, *size, 0.01, (0.5 * size[0], 0.5 * size[1]), (1e-3, 1e-3), 0.5, (-1.0, 0.0))
    (tmp_path / "camera.json").write_text(json.dumps(camera.as_dict()))
    decode = f"lightfield decode raw.npy --white white.npy --calibration {tmp_path / 'camera.json'}"
    told = rt(f"{decode} --views 5 -o {tmp_path / 'shot.lf'}")
    assert "metres would need" not in told.err
    with lf.open(tmp_path / "shot.lf") as field:
        assert "units" not in field.settings
        assert field.views.focus_distance == pytest.approx(2.0)
        assert field.views.position[2, 3] == pytest.approx((1e-3, 0.0))
        assert np.abs(field.view(2, 2) - camera.rectify(plain))[2:-2, 2:-2].max() < 1e-3
        assert np.abs(field.view(2, 2) - plain).max() > 0.01
        # One channel is grey.
        assert np.array_equal(field.view(2, 2)[..., 0], field.view(2, 2)[..., 2])
    assert "--calibration: is of a camera with 5 x 5 views" in rt(f"{decode} --views 7", status=2).err
    for option in ("--f-number 2", "--focus-distance 2m"):
        assert "exclude each other" in rt(f"{decode} {option}", status=2).err
