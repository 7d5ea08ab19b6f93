"""Calibration of a light-field camera: intrinsics and poses that fit the corners of a checkerboard in all views.

Closed forms give a first guess: the focal length by the homographies of the middle view (Zhang 2000, "A Flexible New
Technique for Camera Calibration", sec. 3.1, with the axis in the middle and square pixels), the boards' poses by the
same homographies, and the spacing and the plane of focus by a line through the disparities over one over the distances.
Least squares over all corners in all views then refine all of them, and the distortion, at once (Dansereau, Pizarro,
Williams 2013, sec. 4, where the distance of rays to corners is minimized: here that of their pixels).
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.calibrating.camera import CameraModel
from raytracer.lightfield.formats.geometry import regular_grid
from raytracer.util.errors import InputError

Floats = NDArray[np.float64]

_INTRINSICS = 8
"""Numbers of a `CameraModel` that are fitted."""

_STEP = 1e-6
"""Step of the numeric derivatives, of logarithms, pixels, metres, radians and 1/m."""

_MOST_STEPS = 40
"""Steps of the fit, of which boards that tell the intrinsics need about five; what others end at has large errors."""

_OUTLIER = 1.0
"""Distance of a corner (px) from which on it counts by its distance, and not by the square: found at a wrong place."""

_UNKNOWN = 0.05
"""Standard error of the focal length, as a share, from which on the boards do not tell it."""

FEWEST_VIEWS = 3
"""Views of one corner, of which fewer do not tell how it moves from view to view."""

_FEWEST_CORNERS = 4
"""Corners of a board, of which fewer do not tell how it is seen."""

_FEWEST_BOARDS = 2
"""Pictures of boards: one alone fixes the focal length by its perspective only."""


class BoardView(NamedTuple):
    """Corners of one board in the views of one light field.

    name : of the light field, for messages.
    steps : of the views, right and down from the middle one (v, 2).
    corners : right and down from the top left corner of a view (px), (v, rows, columns, 2); nan where not seen.
    """

    name: str
    steps: Floats
    corners: Floats


class Calibration(NamedTuple):
    """Result of a calibration.

    camera : its intrinsics.
    errors : standard errors of pixel, centre (2), spacing (2), inverse_focus and distortion (2), as a share of the
        first and of the spacing, else in the same units.
    residual : root mean square distance of corners from where they are expected (px).
    residual_rays : the same, of rays from corners at the board (m).
    poses : of the boards: rotation vector and translation (m), (boards, 6); right, down and forward.
    corners : number of corners, in all views.
    """

    camera: CameraModel
    errors: Floats
    residual: float
    residual_rays: float
    poses: Floats
    corners: int


def board_points(rows: int, columns: int, square: float) -> Floats:
    """Return the inner corners of a board with `square` m a side: (rows columns, 3), right, down, and 0."""
    down, right = np.mgrid[:rows, :columns].reshape(2, -1) * square
    return np.column_stack([right, down, np.zeros(right.size)])


def view_steps(rows: int, columns: int) -> Floats:
    """Return the places of views, right and down from the middle in steps of one view: (rows, columns, 2)."""
    return regular_grid(rows, columns) * (1.0, -1.0)


def calibrate_camera(
    boards: list[BoardView], square: float, counts: tuple[int, int], size: tuple[int, int], distorted: bool = True
) -> Calibration:
    """Estimate the intrinsics of a camera.

    Parameters
    ----------
    square : edge of the board's squares (m).
    counts : rows and columns of views.
    size : width and height of a view (px).
    distorted : False to keep the distortion 0.

    Raises
    ------
    InputError : too few boards, or boards that do not tell the intrinsics.
    """
    if len(boards) < _FEWEST_BOARDS:
        raise InputError(
            f"at least {_FEWEST_BOARDS} pictures of the board are needed, and it was found in {len(boards)}"
        )
    rows, columns = boards[0].corners.shape[1:3]
    points = board_points(rows, columns, square)
    camera, poses = _first_guess(boards, points, counts, size)
    return _adjust(camera, poses, boards, points, distorted)


def _first_guess(
    boards: list[BoardView], points: Floats, counts: tuple[int, int], size: tuple[int, int]
) -> tuple[CameraModel, Floats]:
    """Guess intrinsics and poses in closed form."""
    centre = 0.5 * np.array(size)
    middles, slopes = zip(*(_middle_and_slopes(board) for board in boards), strict=True)
    for board, slope in zip(boards, slopes, strict=True):
        if np.count_nonzero(np.isfinite(slope)) < _FEWEST_CORNERS:
            raise InputError(f"{board.name}: fewer than {_FEWEST_CORNERS} corners are seen in {FEWEST_VIEWS} views")
    homographies = [_homography(points[:, :2], middle - centre) for middle in middles]
    rows = []
    for h in homographies:
        # The board's axes are at right angles, and of one length.
        (a, b), (c, d) = h[:2, :2].T, h[2, :2]
        rows += [(a @ b, c * d), (a @ a - b @ b, c * c - d * d)]
    left, right = np.array(rows).T
    inverse_squared = -float(left @ right) / float(left @ left)
    if not inverse_squared > 0.0:
        raise InputError(
            "the boards do not tell the focal length: tilt them, to different sides, by 20 degrees and more"
        )
    pixel = math.sqrt(inverse_squared)
    poses = np.array([_pose(h, pixel) for h in homographies])
    # Disparities from view to view are -(spacing / pixel) (1 / Z - w0).
    inverse = np.concatenate([1.0 / _place(points, pose)[:, 2] for pose in poses])
    disparity = -pixel * np.concatenate(slopes)
    good = np.isfinite(disparity)
    rise, start = np.polyfit(inverse[good], disparity[good], 1)
    if not rise > 0.0:
        raise InputError("the boards do not tell the spacing of the views: put them at different distances")
    (row_count, column_count), (width, height) = counts, size
    camera = CameraModel(
        row_count,
        column_count,
        width,
        height,
        pixel,
        (float(centre[0]), float(centre[1])),
        (float(rise), float(rise)),
        float(-start / rise),
    )
    return camera, poses


def _middle_and_slopes(board: BoardView) -> tuple[Floats, Floats]:
    """Fit lines to a board's corners over the views: where they are in the middle (n, 2), and pixels a view (n,)."""
    corners = board.corners.reshape(len(board.steps), -1, 2)
    middle, slope = np.empty(corners.shape[1:]), np.empty(corners.shape[1])
    for index in range(corners.shape[1]):
        seen = np.isfinite(corners[:, index, 0])
        steps, places = board.steps[seen], corners[seen, index]
        count = len(steps)
        if count < FEWEST_VIEWS:
            middle[index], slope[index] = np.nan, np.nan
            continue
        # One slope for both axes.
        design = np.zeros((2 * count, 3))
        design[:count, 0], design[count:, 1] = 1.0, 1.0
        design[:count, 2], design[count:, 2] = steps.T
        fit = np.linalg.lstsq(design, places.T.reshape(-1), rcond=None)[0]
        middle[index], slope[index] = fit[:2], fit[2]
    return middle, slope


def _homography(points: Floats, pixels: Floats) -> Floats:
    """Find the homography (3, 3) from a plane's points (n, 2) to pixels (n, 2), by the direct linear transform."""
    good = np.isfinite(pixels).all(axis=1)
    points, pixels = points[good], pixels[good]

    def normal(values: Floats) -> Floats:
        mean = values.mean(axis=0)
        scale = math.sqrt(2.0) / float(np.hypot(*(values - mean).T).mean())
        return np.array([[scale, 0.0, -scale * mean[0]], [0.0, scale, -scale * mean[1]], [0.0, 0.0, 1.0]])

    before, after = normal(points), normal(pixels)
    x, y = (np.column_stack([points, np.ones(len(points))]) @ before.T)[:, :2].T
    u, v = (np.column_stack([pixels, np.ones(len(pixels))]) @ after.T)[:, :2].T
    zero, one = np.zeros_like(x), np.ones_like(x)
    rows = [np.column_stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u])]
    rows += [np.column_stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v])]
    h = np.linalg.inv(after) @ np.linalg.svd(np.vstack(rows))[2][-1].reshape(3, 3) @ before
    return np.asarray(h / np.linalg.norm(h))


def _pose(homography: Floats, pixel: float) -> Floats:
    """Find the pose (6,) of a board by its homography."""
    from scipy.spatial.transform import Rotation

    columns = np.diag([pixel, pixel, 1.0]) @ homography
    columns = columns / np.sqrt(np.linalg.norm(columns[:, 0]) * np.linalg.norm(columns[:, 1]))
    # The board is in front of the camera.
    columns = columns * math.copysign(1.0, columns[2, 2])
    turn = np.column_stack([columns[:, 0], columns[:, 1], np.cross(columns[:, 0], columns[:, 1])])
    u, _, v = np.linalg.svd(turn)
    return np.concatenate([Rotation.from_matrix(u @ v).as_rotvec(), columns[:, 2]])


def _place(points: Floats, pose: Floats) -> Floats:
    """Move points (n, 3) of a board to where a pose puts it."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(pose[:3]).apply(points) + pose[3:])


def _standard_errors(jacobian: Floats, weighted: Floats, residuals: Floats, corner: NDArray[np.intp]) -> Floats:
    """Compute the standard errors (k,) of fitted numbers, where a corner's errors are alike in all views.

    What moves a corner of a picture, as the pixels do that its squares fall on, moves it in the next view as well, so
    that many views of it tell hardly more than one: sums over corners take the place of those over all rows (Liang,
    Zeger 1986, "Longitudinal Data Analysis Using Generalized Linear Models").

    weighted : `jacobian` (2n, k) with what outliers count less, whose square is the curvature.
    residuals (px) : (n, 2).
    corner : which of all boards' corners each is (n,).
    """
    counted = residuals / np.maximum(np.abs(residuals) / _OUTLIER, 1.0)
    slopes = np.zeros((int(corner.max()) + 1, jacobian.shape[1]))
    np.add.at(slopes, corner, np.einsum("nik,ni->nk", jacobian.reshape(*residuals.shape, -1), counted))
    inverse = np.linalg.pinv(weighted.T @ weighted)
    # As many are fitted away.
    free = 2 * len(np.unique(corner))
    scale = free / max(1, free - jacobian.shape[1])
    return np.asarray(np.sqrt(scale * np.diag(inverse @ (slopes.T @ slopes) @ inverse)))


def _adjust(first: CameraModel, poses: Floats, boards: list[BoardView], points: Floats, distorted: bool) -> Calibration:
    """Refine all numbers by least squares over all corners in all views."""
    from scipy.optimize import least_squares

    seen = [np.isfinite(board.corners[..., 0].reshape(len(board.steps), -1)) for board in boards]
    observed = [board.corners.reshape(len(board.steps), -1, 2)[mask] for board, mask in zip(boards, seen, strict=True)]
    number = _INTRINSICS if distorted else _INTRINSICS - 2

    def camera_of(values: Floats) -> CameraModel:
        pixel, spacing = first.pixel * math.exp(values[0]), np.array(first.spacing) * np.exp(values[3:5])
        centre = values[1:3] + first.centre
        k = (float(values[6]), float(values[7])) if distorted else (0.0, 0.0)
        return replace(
            first,
            pixel=float(pixel),
            centre=(float(centre[0]), float(centre[1])),
            spacing=(float(spacing[0]), float(spacing[1])),
            inverse_focus=float(values[5]),
            distortion=k,
        )

    def differences(values: Floats) -> list[Floats]:
        camera = camera_of(values)
        return [
            camera.project(_place(points, pose), board.steps)[mask] - places
            for pose, board, mask, places in zip(values[number:].reshape(-1, 6), boards, seen, observed, strict=True)
        ]

    def jacobian(values: Floats) -> Floats:
        # A board's pose moves its own corners only, so that the poses of all are varied at once.
        matrix = np.zeros((2 * sum(map(len, observed)), len(values)))
        ends = np.cumsum([0, *(2 * len(each) for each in observed)])
        for index in range(number + 6):
            step = np.zeros(len(values))
            step[index if index < number else slice(index, None, 6)] = _STEP
            up, down = differences(values + step), differences(values - step)
            for board, (one, other) in enumerate(zip(up, down, strict=True)):
                column = index if index < number else index + 6 * board
                matrix[ends[board] : ends[board + 1], column] = (one - other).reshape(-1) / (2.0 * _STEP)
        return matrix

    start = np.concatenate([np.zeros(5), [first.inverse_focus], np.zeros(number - 6), poses.reshape(-1)])
    fit = least_squares(
        lambda values: np.concatenate(differences(values)).reshape(-1),
        start,
        jacobian,
        loss="huber",
        f_scale=_OUTLIER,
        x_scale="jac",
        max_nfev=_MOST_STEPS,
    )
    camera = camera_of(fit.x)
    total = np.concatenate(differences(fit.x))
    residual = float(np.sqrt((total**2).sum(axis=1).mean()))
    corner = np.concatenate([np.nonzero(mask)[1] + index * len(points) for index, mask in enumerate(seen)])
    errors = np.zeros(_INTRINSICS)
    errors[:number] = _standard_errors(jacobian(fit.x), fit.jac, total, corner)[:number]
    # Where nothing tells a number, the fit wanders along it without an end.
    if not fit.success or not errors[0] < _UNKNOWN:
        raise InputError(
            "the boards do not tell the focal length: tilt them, to different sides, by 20 degrees and more"
        )
    adjusted = fit.x[number:].reshape(-1, 6)
    depths = [
        np.broadcast_to(_place(points, pose)[:, 2], mask.shape)[mask] for pose, mask in zip(adjusted, seen, strict=True)
    ]
    at_board = np.concatenate(depths)[:, None] * camera.pixel * total
    rays = float(np.sqrt((at_board**2).sum(axis=1).mean()))
    return Calibration(camera, errors, residual, rays, adjusted, len(total))
