"""Calibration by checkerboards: corners of drawn boards, and intrinsics of corners that a formula gives."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.calibrating.bundle_adjustment import BoardView, board_points, calibrate_camera, view_steps
from raytracer.lightfield.calibrating.calibrate import as_dict
from raytracer.lightfield.calibrating.camera import CameraModel, camera_from_dict
from raytracer.lightfield.calibrating.checkerboard import find_board
from raytracer.lightfield.calibrating.corners import find_corners
from raytracer.util.errors import InputError

CAMERA = CameraModel(3, 5, 160, 120, 1.7e-3, (81.3, 58.9), (1.1e-3, 1.13e-3), 1.25, (-0.6, 1.4))
ROWS, COLUMNS, SQUARE = 5, 7, 0.014
POINTS = board_points(ROWS, COLUMNS, SQUARE)
TURNS = [(25, 10, 3), (-25, 15, -8), (12, -28, 5), (-10, -25, 12), (30, -20, 30)]
DISTANCES = (0.4, 0.5, 0.7, 0.45, 0.9)
NOISES = ({"noise": 0.05}, {"noise": 0.01, "alike": 0.05})
"""Of corners, in each view its own, or alike in all (px)."""


def place_board(turns, distance):
    turn = Rotation.from_euler("xyz", turns, degrees=True)
    return turn.apply(POINTS - POINTS.mean(axis=0)) + np.array([0.0, 0.0, distance])


def _boards(camera, noise=0.0, turns=TURNS, alike=0.0, seed=0):
    """Boards with noise of each corner in each view, and with that which is alike in all of them (px)."""
    rng = np.random.default_rng(seed)
    steps = view_steps(camera.rows, camera.columns).reshape(-1, 2)
    boards = []
    for each, distance in zip(turns, DISTANCES, strict=False):
        seen = camera.project(place_board(each, distance), steps)
        seen += rng.normal(0.0, noise, seen.shape) if noise else 0.0
        seen += rng.normal(0.0, alike, seen.shape[1:]) if alike else 0.0
        boards.append(BoardView("board", steps, seen.reshape(len(steps), ROWS, COLUMNS, 2)))
    return boards


def test_intrinsics_of_exact_corners_are_exact():
    found = calibrate_camera(_boards(CAMERA), SQUARE, (3, 5), (160, 120))
    camera = found.camera
    assert camera.pixel == pytest.approx(CAMERA.pixel, rel=1e-6)
    assert camera.centre == pytest.approx(CAMERA.centre, abs=1e-3)
    assert camera.spacing == pytest.approx(CAMERA.spacing, rel=1e-6)
    assert camera.inverse_focus == pytest.approx(CAMERA.inverse_focus, rel=1e-6)
    assert camera.distortion == pytest.approx(CAMERA.distortion, rel=1e-3)
    assert found.residual < 1e-5
    true = np.array([place_board(*each)[0] for each in zip(TURNS, DISTANCES, strict=True)])
    assert found.poses[:, 3:] == pytest.approx(true, abs=1e-6)


def test_errors_are_as_large_as_they_are_said_to_be():
    # Noise of 0.05 pixels, and a corner at a wrong place, which must not matter.
    boards = _boards(CAMERA, 0.05)
    boards[1].corners[3, 2, 2] += 8.0
    found = calibrate_camera(boards, SQUARE, (3, 5), (160, 120))
    away = [found.camera.pixel / CAMERA.pixel - 1.0, *np.subtract(found.camera.centre, CAMERA.centre)]
    away += [*(np.divide(found.camera.spacing, CAMERA.spacing) - 1.0), found.camera.inverse_focus - 1.25]
    assert (np.abs(away) < 4.0 * found.errors[:6]).all()
    assert found.errors[0] < 0.01


def test_many_views_of_what_is_off_in_all_of_them_tell_no_more_than_one():
    apart, alike = (calibrate_camera(_boards(CAMERA, **noise), SQUARE, (3, 5), (160, 120)).errors for noise in NOISES)
    # Of 15 views, whose own noise is less by the root of that.
    assert ((alike / apart)[:3] > 2.5).all()


@pytest.mark.slow
@pytest.mark.parametrize("noise", NOISES)
def test_errors_are_those_that_are_said(noise):
    # Over many sets of boards, also where a corner is off by the same in all views.
    away, said = [], []
    for seed in range(24):
        found = calibrate_camera(_boards(CAMERA, **noise, seed=seed), SQUARE, (3, 5), (160, 120))
        away.append([found.camera.pixel / CAMERA.pixel - 1.0, *np.subtract(found.camera.centre, CAMERA.centre)])
        said.append(found.errors[:3])
    true, expected = (np.sqrt(np.mean(np.square(each), axis=0)) for each in (away, said))
    # 24 samples know their deviation to 15 %.
    assert (true < 1.6 * expected).all()
    assert (true > 0.6 * expected).all()


def test_rays_of_the_matrix_meet_in_the_point_that_is_seen():
    # Without distortion, the rays through a point's pixels in all views cross at it: Dansereau's H.
    camera = CameraModel(**{**CAMERA.__dict__, "distortion": (0.0, 0.0)})
    point = np.array([[0.02, -0.03, 0.6]])
    for row, column in np.ndindex(3, 5):
        step = view_steps(3, 5)[row, column]
        pixel = camera.project(point, step[None])[0, 0] - 0.5
        s, t, u, v, one = camera.matrix @ (column, row, *pixel, 1.0)
        assert (s + u * 0.6, t + v * 0.6, one) == pytest.approx((0.02, -0.03, 1.0), abs=1e-12)


def test_rectified_views_show_points_where_a_pinhole_does():
    y, x = np.mgrid[:120, :160] + 0.5
    slopes = (np.stack([x, y], axis=-1) - CAMERA.centre) * CAMERA.pixel
    # What the lens shows at a pixel is the scene, here a wave, at the slope that its distortion takes there.
    places = CAMERA.to_pixels(slopes)

    def wave(at):
        return np.sin(at[..., 0] / 9.0) * np.cos(at[..., 1] / 11.0)

    seen, expected = wave(np.stack([x, y], axis=-1)), wave(places)
    inside = (slice(4, -4), slice(4, -4))
    assert np.abs(CAMERA.rectify(seen) - expected)[inside].max() < 2e-3
    assert np.abs(seen - expected)[inside].max() > 0.1


def draw_board(camera, place, oversampling=4):
    """Draw all views of a board, by the ray of each part of a pixel."""
    fine = (np.arange(camera.width * oversampling) + 0.5) / oversampling
    x, y = np.meshgrid(fine, fine[: camera.height * oversampling])
    slope = (np.stack([x, y], axis=-1) - camera.centre) * camera.pixel
    origin, right, down = place[0], place[1] - place[0], place[COLUMNS] - place[0]
    views = np.empty((camera.rows, camera.columns, camera.height, camera.width, 3))
    for at in np.ndindex(camera.rows, camera.columns):
        u = view_steps(camera.rows, camera.columns)[at] * camera.spacing
        start = np.append(u, 0.0)
        ahead = np.concatenate([slope - u * camera.inverse_focus, np.ones((*slope.shape[:2], 1))], axis=-1)
        normal = np.cross(right, down)
        hit = start + ahead * ((origin - start) @ normal / (ahead @ normal))[..., None] - origin
        column, row = (np.floor(hit @ axis / (axis @ axis)) for axis in (right, down))
        light = np.where((column + row) % 2 == 0, 0.05, 0.9)
        outside = (column < -1) | (column >= COLUMNS) | (row < -1) | (row >= ROWS)
        light[outside] = 0.9
        shape = (camera.height, oversampling, camera.width, oversampling)
        views[at] = light.reshape(shape).mean(axis=(1, 3))[..., None]
    return views


def test_corners_of_a_drawn_board_are_found_in_all_views():
    camera = CameraModel(**{**CAMERA.__dict__, "distortion": (0.0, 0.0)})
    place = place_board((25, 10, 20), 0.7)
    radiance = draw_board(camera, place)
    plane = Plane(1.0, -80.0, 60.0)
    field = LightField(radiance, Views(view_steps(3, 5), plane, 160, 120))
    found = find_corners(field, ROWS, COLUMNS, "board")
    assert len(found.steps) == 15
    true = camera.project(place, found.steps).reshape(found.corners.shape)
    # Which corner is the first is not told by a board of an odd number of squares.
    away = min(np.sqrt(((found.corners - each) ** 2).mean()) for each in (true, true[:, ::-1, ::-1]))
    # Pixels of 4 x 4 parts: edges are drawn at places of a quarter of a pixel.
    assert away < 0.06
    with pytest.raises(InputError, match="shows no whole checkerboard of 9 x 5"):
        find_corners(field, ROWS, 9, "board")
    assert find_board(np.random.default_rng(1).random((120, 160)), ROWS, COLUMNS) is None


def test_boards_that_do_not_tell():
    with pytest.raises(InputError, match="at least 2 pictures"):
        calibrate_camera(_boards(CAMERA)[:1], SQUARE, (3, 5), (160, 120))
    facing = _boards(CAMERA, 0.02, [(0.0, 0.0, 0.0)] * 3)
    with pytest.raises(InputError, match="do not tell"):
        calibrate_camera(facing, SQUARE, (3, 5), (160, 120))
    boards = _boards(CAMERA)
    boards[1].corners[2:] = np.nan
    with pytest.raises(InputError, match="board: fewer than 4 corners are seen in 3 views"):
        calibrate_camera(boards, SQUARE, (3, 5), (160, 120))
    few = LightField(
        np.zeros((1, 2, 120, 160, 3), np.float32), Views(view_steps(1, 2), Plane(1.0, -80.0, 60.0), 160, 120)
    )
    with pytest.raises(InputError, match=r"few\.lf: has 2 x 1 views, and a calibration needs at least 3"):
        find_corners(few, ROWS, COLUMNS, "few.lf")


def test_a_camera_in_a_file_is_the_same_camera():
    found = calibrate_camera(_boards(CAMERA, 0.02), SQUARE, (3, 5), (160, 120))
    assert camera_from_dict(json.loads(json.dumps(as_dict(found))), "c.json") == found.camera


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"pixel": 0.0}, "must be greater than 0"),
        ({"rows": 2.5}, "rows: must be a whole number"),
        ({"width": 10**9}, "width: must be a whole number"),
        ({"centre": [1.0]}, "centre: must be two numbers"),
        ({"spacing": ["a", 1]}, "spacing: must be a number"),
        ({"distortion": None}, "distortion: must be two numbers"),
    ],
)
def test_a_camera_in_a_wrong_file(change, told):
    with pytest.raises(InputError, match=f"c.json: .*{told}"):
        camera_from_dict({**CAMERA.as_dict(), **change}, "c.json")
    with pytest.raises(InputError, match="pixel is missing"):
        camera_from_dict({key: value for key, value in CAMERA.as_dict().items() if key != "pixel"}, "c.json")
