"""Calibration of cameras that `light_field` rendered, before checkerboards: intrinsics and poses are what they are."""

import dataclasses
import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import raytracer as rt
from raytracer.film.light_field.field import LightField
from raytracer.lightfield.calibrating.bundle_adjustment import _homography, board_points, calibrate_camera
from raytracer.lightfield.calibrating.checkerboard import find_board
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
    return found, poses, fields, boards


def _middles(poses):
    """Where the middles of the boards are."""
    middle = board_points(ROWS, COLUMNS, SQUARE).mean(axis=0)
    return np.array([Rotation.from_rotvec(pose[:3]).apply(middle) + pose[3:] for pose in poses])


def _off_a_plane(corners):
    """Root mean square distance (px) of a view's corners from where a homography of the board has them."""
    points = np.column_stack([board_points(ROWS, COLUMNS, SQUARE)[:, :2], np.ones(ROWS * COLUMNS)])
    corners = corners.reshape(-1, 2)
    seen = points @ _homography(points[:, :2], corners).T
    return float(np.sqrt(((seen[:, :2] / seen[:, 2:] - corners) ** 2).sum(axis=1).mean()))


def test_intrinsics_of_a_thin_lens(tmp_path):
    lens = "sensor: {width: 24 mm, height: 18 mm}, focal_length: 50 mm, f_number: 2, microlenses: {pixels: 5}"
    found, poses, fields, _ = _calibrate(tmp_path, lens, 0.8)
    camera, true = found.camera, fields[0].views
    print(found.camera, found.errors, found.residual, found.residual_rays)
    print(_middles(found.poses) - _middles(poses))
    assert found.residual < 0.06
    assert camera.pixel == pytest.approx(true.plane.pixel, rel=0.003)
    assert camera.spacing == pytest.approx((true.position[2, 3, 0], true.position[1, 2, 1]), rel=0.005)
    assert camera.inverse_focus == pytest.approx(true.inverse_focus, rel=0.005)
    assert camera.centre == pytest.approx(
        (-true.plane.left / true.plane.pixel, true.plane.top / true.plane.pixel), abs=0.4
    )
    assert _middles(found.poses) == pytest.approx(_middles(poses), abs=0.004)


def test_distortion_of_a_lens_of_glass_is_found_and_undone(tmp_path):
    shutil.copy(ROOT / "scenes" / "lenses" / "wide-22mm.yaml", tmp_path)
    lens = "lens: wide-22mm.yaml, sensor: {width: 24 mm, height: 18 mm}, microlenses: {pixels: 5}"
    found, poses, fields, boards = _calibrate(tmp_path, lens, 0.4, (1.5, 1.5, 0.5))
    camera, nominal = found.camera, fields[0].views
    print(found.camera, found.errors, found.residual, found.residual_rays)
    print(nominal.plane, nominal.inverse_focus, nominal.position[2, 3])
    print(_middles(found.poses) - _middles(poses))
    bent, straight = [], []
    for field, board in zip(fields, boards, strict=True):
        middle = int(np.flatnonzero((board.steps == 0.0).all(axis=1))[0])
        rectified = camera.rectify(field.view(2, 2))
        again = find_board(np.sqrt(np.maximum(0.0, rectified.mean(axis=2))), ROWS, COLUMNS)
        bent.append(_off_a_plane(board.corners[middle]))
        straight.append(_off_a_plane(again) if again is not None else np.nan)
    print(bent, straight)
    # The board that faces the camera, by the depth of its middle.
    middle = _middles(poses)[4]
    column, row = (int(x) for x in camera.project(middle[None], np.zeros((1, 2)))[0, 0])
    views = camera.views()
    radiance = np.stack([[camera.rectify(fields[4].view(i, j)) for j in range(1, 4)] for i in range(1, 4)])
    whole = dataclasses.replace(views, position=views.position[1:4, 1:4])
    raw = dataclasses.replace(nominal, position=nominal.position[1:4, 1:4], aperture=None)
    for geometry, light in ((whole, radiance), (raw, np.asarray(fields[4].radiance)[1:4, 1:4])):
        depth = rt.lightfield.depth_map(LightField(light, geometry), near=0.3, far=1.5, threads=1)
        part = (slice(row - 8, row + 9), slice(column - 8, column + 9))
        print(np.median(depth.distance[part][depth.confidence[part] > 0.5]), middle)
