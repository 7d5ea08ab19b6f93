"""Frames of a `transforms.json`, parsed and checked, and the geometry of views that they are.

References: Mildenhall et al. 2020, "NeRF" (the synthetic scenes' files: `camera_angle_x`, `transform_matrix`);
nerfstudio, "Data conventions" (keys, camera axes, pixels counted from the corner); instant-ngp, "Tips for training NeRF
models with Instant Neural Graphics Primitives".
"""

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.posed_views import ORTHONORMAL_SLACK, PosedViews
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.util.errors import InputError, abbreviate
from raytracer.util.safe_open import read_json

_LARGEST = 1 << 27
"""Most bytes of a file: 800 for each of the most frames."""

_MOST_FRAMES = 1 << 17

_PINHOLES = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
"""Camera models whose distortion is given by the keys below, and is none without them."""

_DISTORTIONS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")

_OTHER_CONVENTIONS = {
    "is_fisheye": "is of a fisheye",
    "from_na": "has its axes turned (from_na)",
    "rolling_shutter": "has a rolling shutter",
}
"""Keys that make the numbers mean something else, unless they are 0 or false."""

_PIXEL_SLACK = 0.01
"""Pixels by which principal points may differ from those of views in one plane: less is the rounding of files."""

_SQUARE_SLACK = 0.5
"""Pixels at the edge of a picture by which pixels that are not square may displace it."""


class Frame(NamedTuple):
    """A picture and its camera.

    file, depth_file : names, relative to the folder of the file; no depth if None.
    matrix : camera to world, float64 (4, 4); the camera's axes are right, up and backward.
    focal (px) : focal lengths across and down, None if the file gives angles or nothing.
    angle (radians) : horizontal field of view.
    center (px) : principal point from the left and top edge; None for the middle.
    size (px) : width and height; None if not given.
    """

    file: str
    depth_file: str | None
    matrix: NDArray[np.float64]
    focal: tuple[float | None, float | None]
    angle: float | None
    center: tuple[float | None, float | None]
    size: tuple[float | None, float | None]


class Transforms(NamedTuple):
    """Contents of a file.

    frames : in their order.
    own : what this program wrote besides: see `transforms`.
    depth_scale : metres of one unit of the depth files.
    """

    frames: list[Frame]
    own: Mapping[str, Any]
    depth_scale: float


_MILLIMETRES = 1e-3
"""Unit of depth files by nerfstudio's default (`depth_unit_scale_factor`), in metres."""


def read_transforms(path: Path) -> Transforms:
    """Read and check a file; an InputError says what is wrong with it, or what is not supported."""
    values = read_json(path, _LARGEST)
    frames = values.get("frames") if isinstance(values, dict) else None
    if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
        raise InputError(f"{path}: has no frames: a list of pictures with file_path and transform_matrix")
    if len(frames) > _MOST_FRAMES:
        raise InputError(f"{path}: has {len(frames)} frames, and at most {_MOST_FRAMES} are read")
    shared = {key: value for key, value in values.items() if key != "frames"}
    own = shared.get("rt")
    scale = _number(f"{path}", shared, "integer_depth_scale")
    parsed = [_frame(f"{path}: frame {number}", {**shared, **frame}) for number, frame in enumerate(frames)]
    return Transforms(parsed, own if isinstance(own, dict) else {}, _MILLIMETRES if scale is None else scale)


def _number(where: str, values: Mapping[str, Any], key: str) -> float | None:
    value = values.get(key)
    if value is None:
        return None
    # Integers of JSON have any number of digits.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= sys.float_info.max:
        raise InputError(f"{where}: {key} must be a finite number")
    return float(value)


def _frame(where: str, values: Mapping[str, Any]) -> Frame:
    """Parse a frame, with what all have in common."""
    model = values.get("camera_model", _PINHOLES[0])
    if model not in _PINHOLES:
        raise InputError(f"{where}: camera_model {abbreviate(str(model))} is not read: {', '.join(_PINHOLES)} are")
    for key in _DISTORTIONS:
        if _number(where, values, key):
            raise InputError(f"{where}: has distortion, {key} = {values[key]:g}: undistort the pictures first")
    for key, problem in _OTHER_CONVENTIONS.items():
        value = values.get(key)
        if any(value) if isinstance(value, list) else value:
            raise InputError(f"{where}: {problem}, which is not read")
    names = {key: values.get(key) for key in ("file_path", "depth_file_path")}
    if not isinstance(names["file_path"], str) or not isinstance(names["depth_file_path"], str | None):
        raise InputError(f"{where}: file_path must be the name of a picture, and depth_file_path that of a file")

    def pair(across: str, down: str) -> tuple[float | None, float | None]:
        return _number(where, values, across), _number(where, values, down)

    return Frame(
        names["file_path"],
        names["depth_file_path"],
        _matrix(where, values.get("transform_matrix")),
        pair("fl_x", "fl_y"),
        _number(where, values, "camera_angle_x"),
        pair("cx", "cy"),
        pair("w", "h"),
    )


def _matrix(where: str, value: Any) -> NDArray[np.float64]:
    """Parse the matrix of a camera, which must turn and move it alone."""
    try:
        matrix = np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{where}: transform_matrix must be 4 rows of 4 numbers") from error
    if matrix.shape not in ((4, 4), (3, 4)) or not np.isfinite(matrix).all():
        raise InputError(f"{where}: transform_matrix must be 4 rows of 4 finite numbers")
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    turn = matrix[:3, :3]
    is_rigid = np.abs(turn.T @ turn - np.eye(3)).max() <= ORTHONORMAL_SLACK and np.linalg.det(turn) > 0.0
    if not is_rigid or (matrix[3] != [0.0, 0.0, 0.0, 1.0]).any():
        raise InputError(f"{where}: transform_matrix must turn and move the camera, without scaling or mirroring it")
    return matrix


def make_posed_views(path: Path, frames: list[Frame], width: int, height: int, rows: int) -> PosedViews:
    """Make the geometry of frames, row by row; an InputError says what the pictures do not fit to."""
    poses, planes = [], []
    for number, frame in enumerate(frames):
        where = f"{path}: frame {number}"
        for stated, size, key in zip(frame.size, (width, height), "wh", strict=True):
            if stated is not None and stated != size:
                raise InputError(f"{where}: {key} is {stated:g}, and the picture has {size} pixels there")
        across, down = frame.focal
        if across is None and frame.angle is not None and 0.0 < frame.angle < math.pi:
            across = 0.5 * width / math.tan(0.5 * frame.angle)
        across = down if across is None else across
        if across is None:
            raise InputError(f"{where}: has no field of view: fl_x (px), or camera_angle_x (radians)")
        down = across if down is None else down
        if not (across > 0.0 and down > 0.0):
            raise InputError(f"{where}: fl_x and fl_y must be greater than 0")
        if abs(across / down - 1.0) * 0.5 * height > _SQUARE_SLACK:
            raise InputError(f"{where}: its pixels are not square: fl_x is {across:g}, fl_y {down:g}")
        center = [0.5 * size if c is None else c for c, size in zip(frame.center, (width, height), strict=True)]
        right, up, backward = frame.matrix[:3, :3].T
        poses.append([frame.matrix[:3, 3], right, up, -backward])
        planes.append([1.0 / across, -center[0] / across, center[1] / across])
    columns = len(frames) // rows
    try:
        return PosedViews(
            np.array(poses).reshape(rows, columns, 4, 3), np.array(planes).reshape(rows, columns, 3), width, height
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def find_plane(posed: PosedViews) -> Views | None:
    """Find the plane in which views stand that look along one axis; None if they do not.

    Their principal points may move with their places: the image planes of views that are sheared to converge.
    """
    pose, plane = posed.pose, posed.plane
    axes = pose[0, 0, 1:]
    if np.abs(pose[..., 1:, :] - axes).max() > ORTHONORMAL_SLACK:
        return None
    away = (pose[..., 0, :] - pose[0, 0, 0]) @ axes.T
    largest = max(np.abs(pose[..., 0, :]).max(), np.abs(away).max())
    pixel = float(plane[..., 0].mean())
    is_flat = np.abs(away[..., 2]).max() <= ORTHONORMAL_SLACK * largest
    if not is_flat or np.abs(plane[..., 0] / pixel - 1.0).max() > ORTHONORMAL_SLACK:
        return None
    middle = 0.5 * (away[..., :2].min(axis=(0, 1)) + away[..., :2].max(axis=(0, 1)))
    position = away[..., :2] - middle
    # The edge of an image plane is at `edge - w0 u`: the slope by least squares, for both axes.
    edges = plane[..., 1:]
    edge = edges.mean(axis=(0, 1))
    spread = position - position.mean(axis=(0, 1))
    total = float((spread**2).sum())
    inverse = -float((spread * (edges - edge)).sum()) / total if total > 0.0 else 0.0
    first = (edges + inverse * position).mean(axis=(0, 1))
    if np.abs(edges + inverse * position - first).max() > _PIXEL_SLACK * pixel:
        return None
    # Slopes that are rounding are those of parallel views.
    if abs(inverse) * np.abs(spread).max() <= ORTHONORMAL_SLACK * pixel:
        inverse = 0.0
    origin = pose[0, 0, 0] + middle @ axes[:2]
    image = Plane(pixel, float(first[0]), float(first[1]))
    return Views(position, image, posed.width, posed.height, inverse, pose=Pose.of([origin, *axes]))


def arrange(posed: PosedViews) -> list[list[int]]:
    """Arrange views of one plane in rows from the top, and those of each from the left: their numbers.

    One row where they are in no rows of equally many.
    """
    axes = posed.pose[0, 0, 1:3]
    right, up = (posed.pose[..., 0, :].reshape(-1, 3) @ axes.T).T
    order = np.argsort(-up, kind="stable")
    gaps = -np.diff(up[order])
    parts = [order]
    if len(gaps) and np.ptp(up) > ORTHONORMAL_SLACK * max(np.ptp(right), float(np.abs(up).max())):
        # Within a row heights differ by less than from row to row.
        parts = np.split(order, np.flatnonzero(gaps > 0.5 * gaps.max()) + 1)
    if len({len(part) for part in parts}) > 1:
        parts = [order]
    return [part[np.argsort(right[part], kind="stable")].tolist() for part in parts]
