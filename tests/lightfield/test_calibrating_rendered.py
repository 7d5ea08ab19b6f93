"""Calibration of cameras that `light_field` rendered, before checkerboards: intrinsics and poses are what they are."""

import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import raytracer as rt
from raytracer.lightfield.calibrating.bundle_adjustment import board_points, calibrate_camera
from raytracer.lightfield.calibrating.corners import find_corners
from tests.repository import ROOT

pytestmark = pytest.mark.slow

ROWS, COLUMNS, SQUARE = 6, 8, 0.02
"""Inner corners, and the edge of a square (m)."""

SCENE = """\
camera: {{type: light_field, look_from: [0, 0, 0], look_at: [0, 0, -1], focus_distance: {focus}, {lens}}}
film: {{width: 750, height: 560}}
render: {{spp: {spp}, max_depth: 1}}
environment: {{type: constant, radiance: [0.4, 0.4, 0.4]}}
textures: {{pattern: {{type: image, file: board.npy, encoding: linear}}}}
materials: {{glowing: {{type: emitter, radiance: pattern}}}}
objects: [{{type: quad, corner: {corner}, edges: {edges}, material: glowing}}]
"""

POSES = [
    ((25, 10, 3), (-0.02, 0.02, 0.55)),
    ((-25, 15, -8), (0.06, -0.04, 0.7)),
    ((12, -28, 5), (-0.09, -0.05, 0.9)),
    ((-10, -25, 12), (0.03, 0.03, 0.6)),
    ((3, 2, 0), (0.1, 0.1, 1.2)),
    ((30, -20, 30), (-0.04, 0.05, 0.8)),
]
"""Turns about three axes (degrees), and places (m): right, down and forward."""


def _board_picture():
    """White around, and squares: their number is that of the inner corners and one."""
    row, column = np.mgrid[: ROWS + 1, : COLUMNS + 1]
    board = np.pad(np.where((row + column) % 2 == 0, 0.05, 0.9), 1, constant_values=0.9)
    return np.repeat(np.kron(board, np.ones((16, 16)))[..., None], 3, axis=2).astype(np.float32)


def _pose(turns, place):
    """Turn a board about the middle of its corners, and move that to a place: (6,), right, down and forward."""
    turn = Rotation.from_euler("xyz", turns, degrees=True)
    middle = board_points(ROWS, COLUMNS, SQUARE).mean(axis=0)
    return np.concatenate([turn.as_rotvec(), np.array(place) - turn.apply(middle)])


def _render(folder, pose, lens, focus, spp):
    place = Rotation.from_rotvec(pose[:3])
    world = np.array([1.0, -1.0, -1.0])
    # Two squares more to each side than there are corners: one of the board, and the white around.
    size = (COLUMNS + 3) * SQUARE, (ROWS + 3) * SQUARE
    left_bottom = place.apply([-2 * SQUARE, -2 * SQUARE + size[1], 0.0]) + pose[3:]
    edges = place.apply([[size[0], 0.0, 0.0], [0.0, -size[1], 0.0]])
    values = {"corner": (left_bottom * world).tolist(), "edges": (edges * world).tolist()}
    path = folder / "scene.yaml"
    path.write_text(SCENE.format(lens=lens, focus=focus, spp=spp, **values))
    image = rt.render(rt.load(path), threads=2)
    return image.layout.light_field(image)


def _calibrate(folder, lens, focus, scale=(1.0, 1.0, 1.0), spp=16):
    np.save(folder / "board.npy", _board_picture())
    poses = np.array([_pose(turns, np.multiply(place, scale)) for turns, place in POSES])
    fields = [_render(folder, pose, lens, focus, spp) for pose in poses]
    views = fields[0].views
    boards = [find_corners(field, ROWS, COLUMNS, f"board {i}") for i, field in enumerate(fields)]
    found = calibrate_camera(boards, SQUARE, (views.rows, views.columns), (views.width, views.height))
    return found, poses, fields


def _middles(poses):
    """Where the middles of the boards are."""
    middle = board_points(ROWS, COLUMNS, SQUARE).mean(axis=0)
    return np.array([Rotation.from_rotvec(pose[:3]).apply(middle) + pose[3:] for pose in poses])


def test_intrinsics_of_a_thin_lens(tmp_path):
    lens = "sensor: {width: 24 mm, height: 18 mm}, focal_length: 50 mm, f_number: 2, microlenses: {pixels: 5}"
    found, poses, fields = _calibrate(tmp_path, lens, 0.8)
    camera, true = found.camera, fields[0].views
    assert found.residual < 0.06
    assert camera.pixel == pytest.approx(true.plane.pixel, rel=0.003)
    assert camera.spacing == pytest.approx((true.position[2, 3, 0], true.position[1, 2, 1]), rel=0.005)
    assert camera.inverse_focus == pytest.approx(true.inverse_focus, rel=0.005)
    assert camera.centre == pytest.approx(
        (-true.plane.left / true.plane.pixel, true.plane.top / true.plane.pixel), abs=0.4
    )
    assert _middles(found.poses) == pytest.approx(_middles(poses), abs=0.004)


def test_a_lens_of_glass_with_barrel_distortion(tmp_path):
    shutil.copy(ROOT / "scenes" / "lenses" / "wide-22mm.yaml", tmp_path)
    lens = "lens: wide-22mm.yaml, sensor: {width: 24 mm, height: 18 mm}, microlenses: {pixels: 5}"
    found, poses, fields = _calibrate(tmp_path, lens, 0.4, (1.5, 1.5, 0.5))
    camera, paraxial = found.camera, fields[0].views
    assert found.residual < 0.08
    assert camera.pixel == pytest.approx(paraxial.plane.pixel, rel=0.005)
    # What the lens has by its paraxial formula is not all: its field is curved, and its pupil moves.
    assert camera.spacing == pytest.approx((paraxial.position[2, 3, 0], paraxial.position[1, 2, 1]), rel=0.03)
    assert camera.inverse_focus == pytest.approx(paraxial.inverse_focus, rel=0.05)
    assert camera.distortion[0] < -10.0 * found.errors[6]
    assert _middles(found.poses) == pytest.approx(_middles(poses), abs=0.001)
