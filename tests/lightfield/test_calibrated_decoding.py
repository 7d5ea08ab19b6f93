"""What a calibration is for: metres of raw pictures, of a camera whose data sheet is wrong.

Raw pictures are drawn from the camera's formulas, of a checkerboard and of a wall; the commands calibrate, and decode.
"""

import math

import numpy as np
import PIL.Image
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import erf

from raytracer.cli.base.app import main
from raytracer.film.light_field import lf
from raytracer.film.light_field.resampling import Resampler
from raytracer.lightfield.calibrating.bundle_adjustment import board_points
from raytracer.lightfield.calibrating.camera import read_camera
from raytracer.lightfield.decoding.microlens_grid import Grid, Optics
from raytracer.lightfield.depth.depth_map import depth_map
from tests.lightfield.analytic import waves
from tests.lightfield.lenslet_pictures import Camera, lattice

ROWS, COLUMNS, SQUARE = 5, 7, 0.025
"""Inner corners, and the edge of a square (m)."""

PITCH, VIEWS = 7.3, 3
CAMERA = Camera(lattice(PITCH, 0.4, (5.37, 4.18)), 800, 600)
GRID = Grid(CAMERA.lattice, CAMERA.width, CAMERA.height, diameter=2.0 * CAMERA.lit * PITCH)
RESAMPLER = Resampler(GRID.lattice, GRID.width, GRID.height, count=VIEWS)
TRUE = Optics(20.0, 50.0, 4.0, focus_distance=1.0).views(GRID, RESAMPLER)
"""Geometry of the views: pixels of 20 um, a lens of 50 mm at f/4, focused at 1 m."""

POSES = [
    ((25, 10, 3), (-0.01, 0.01, 0.75)),
    ((-25, 15, -8), (0.03, -0.02, 0.9)),
    ((12, -28, 5), (-0.04, -0.02, 1.3)),
    ((-12, -25, 12), (0.02, 0.02, 0.8)),
]
"""Turns of the board about three axes (degrees), and places of its middle (m): right, down and forward."""

WALL = 1.5
"""Distance of the wall (m)."""

PLACE, MIDDLE = CAMERA._parts(1)
WHITE = CAMERA.transmission(PLACE, MIDDLE)
START = (PLACE - MIDDLE) * TRUE.cell[0]
SLOPE = (MIDDLE - 0.5 * np.array([CAMERA.width, CAMERA.height])) * (TRUE.plane.pixel / RESAMPLER.pixel)
SLOPE = SLOPE - START * TRUE.inverse_focus
"""Rays of the raw picture's pixels: where they cross the plane of the views, right and down (m), and their slopes."""


def _board(turns, place):
    """Draw a board, whose edges are as blurred as by a microlens."""
    turn = Rotation.from_euler("xyz", turns, degrees=True)
    first = np.array(place) - turn.apply(board_points(ROWS, COLUMNS, SQUARE).mean(axis=0))
    right, down, normal = turn.apply(np.eye(3))
    start = np.concatenate([START, np.zeros_like(START[..., :1])], axis=-1)
    ahead = np.concatenate([SLOPE, np.ones_like(SLOPE[..., :1])], axis=-1)
    hit = start + ahead * (((first - start) @ normal) / (ahead @ normal))[..., None] - first
    blur = 0.5 * TRUE.plane.pixel * place[2]

    def side(at, last):
        edges = np.arange(-1, last + 1) * SQUARE
        signs = (-1.0) ** np.arange(len(edges))
        # 1 and -1 in turn, from square to square; 0 outside.
        steps = signs[:, None, None] * erf((at - edges[:, None, None]) / (math.sqrt(2.0) * blur))
        steps[0] *= 0.5
        steps[-1] *= 0.5
        return steps.sum(axis=0)

    return WHITE * (0.475 - 0.425 * side(hit @ right, COLUMNS) * side(hit @ down, ROWS))


def _wall():
    x, y = np.moveaxis(START + WALL * SLOPE, -1, 0)
    return WHITE * waves(3, 0.04)(x, -y)[..., 0]


def _save(path, light):
    """Write light as linear values of 16 bits."""
    PIL.Image.fromarray(np.rint(40000.0 * light.clip(0.0, 1.6)).astype(np.uint16)).save(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with white.png, board0.png ..., wall.png, and camera.json, which the command made of the boards."""
    folder = tmp_path_factory.mktemp("raw")
    _save(folder / "white.png", WHITE)
    _save(folder / "wall.png", _wall())
    boards = [folder / f"board{number}.png" for number in range(len(POSES))]
    for board, pose in zip(boards, POSES, strict=True):
        _save(board, _board(*pose))
    given = ["--white", str(folder / "white.png"), "--corners", f"{COLUMNS}x{ROWS}", "--square", "25mm"]
    given += ["--views", str(VIEWS), "--no-distortion", "-o", str(folder / "camera.json"), "--quiet"]
    assert main(["lightfield", "calibrate", *map(str, boards), *given]) == 0
    return folder


def test_raw_pictures_of_boards_tell_the_camera(folder):
    camera = read_camera(folder / "camera.json")
    assert camera.pixel == pytest.approx(TRUE.plane.pixel, rel=0.003)
    axis = -TRUE.plane.left / TRUE.plane.pixel, TRUE.plane.top / TRUE.plane.pixel
    # Four boards tell the axis least: 0.6 px off, as errors of one corner are alike in all views.
    assert camera.centre == pytest.approx(axis, abs=1.0)
    assert camera.spacing == pytest.approx(TRUE.cell, rel=0.015)
    assert camera.inverse_focus == pytest.approx(TRUE.inverse_focus, rel=0.003)


def test_a_wall_is_where_it_is_by_the_calibration(folder):
    def wall_distance(*given):
        output = folder / "wall.lf"
        arguments = [str(folder / "wall.png"), "--white", str(folder / "white.png"), "--views", str(VIEWS), *given]
        assert main(["lightfield", "decode", *arguments, "-o", str(output), "--quiet"]) == 0
        with lf.open(output) as field:
            found = depth_map(field, near=0.7, far=6.0, threads=2)
        return float(np.median(found.distance[found.confidence > 0.5]))

    # The plane of focus is told to be 5 % farther than it is.
    sheet = ["--pixel-pitch", "20um", "--f-number", "4", "--focal-length", "50mm", "--focus-distance", "1.05m"]
    nominal, calibrated = wall_distance(*sheet), wall_distance("--calibration", str(folder / "camera.json"))
    assert abs(calibrated - WALL) < 0.005 * WALL
    assert abs(nominal - WALL) > 0.04 * WALL
