"""Calibration by pictures of a checkerboard, light fields or raw, and the JSON file that holds it."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.lightfield.calibrating.bundle_adjustment import Calibration, calibrate_camera
from raytracer.lightfield.calibrating.corners import find_corners
from raytracer.util.errors import InputError

MOST_CORNERS = 100
"""Most corners of a board a side."""


def calibrate(
    pictures: Sequence[str | Path],
    corners: tuple[int, int],
    square: float,
    *,
    decode: Callable[[str | Path], LightField] | None = None,
    distorted: bool = True,
) -> Calibration:
    """Estimate the intrinsics of a camera by pictures of one checkerboard, which are taken from anywhere.

    Parameters
    ----------
    pictures : light fields (.lf), or raw pictures, which `decode` makes light fields of.
    corners : inner corners of the board in a row, and rows of them.
    square : edge of its squares (m).
    distorted : False to keep the lens's distortion 0.

    Raises
    ------
    InputError : files are missing or broken, or of several cameras; the board is not seen, or does not tell enough.
    """
    columns, rows = corners
    if not (min(corners) >= 3 and max(corners) <= MOST_CORNERS):
        raise InputError(f"a board must have 3 to {MOST_CORNERS} inner corners a side, got {columns} x {rows}")
    boards, kinds = [], {}
    field: LightField
    for picture in pictures:
        if Path(picture).suffix.lower() == lf.SUFFIX:
            with lf.open(picture) as opened:
                field = opened
                boards.append(find_corners(field, rows, columns, str(picture)))
        elif decode is not None:
            field = decode(picture)
            boards.append(find_corners(field, rows, columns, str(picture)))
        else:
            raise InputError(f"{picture}: is no light field, which are {lf.SUFFIX} files")
        views = field.views
        kinds[views.rows, views.columns, views.width, views.height] = str(picture)
        if len(kinds) > 1:
            first, other = (f"{c} x {r} views of {w} x {h} pixels" for r, c, w, h in kinds)
            raise InputError(f"{picture}: has {other}, and those before have {first}: all must be of one camera")
    if not kinds:
        raise InputError("no pictures of a board are given")
    row_count, column_count, width, height = next(iter(kinds))
    return calibrate_camera(boards, square, (row_count, column_count), (width, height), distorted)


def as_dict(found: Calibration) -> dict[str, Any]:
    """Convert a calibration to JSON values."""
    names = ("pixel", "centre", "centre", "spacing", "spacing", "inverse_focus", "distortion", "distortion")
    errors: dict[str, Any] = {}
    for name, value in zip(names, found.errors.tolist(), strict=True):
        errors.setdefault(name, []).append(value)
    return {
        **found.camera.as_dict(),
        "standard_errors": {name: value if len(value) > 1 else value[0] for name, value in errors.items()},
        "residual_pixels": found.residual,
        "residual_metres": found.residual_rays,
        "corners": found.corners,
        "poses": found.poses.tolist(),
    }


def to_json(found: Calibration) -> bytes:
    """Write a calibration as JSON (UTF-8)."""
    return (json.dumps(as_dict(found), indent=1, allow_nan=False) + "\n").encode()
