"""Read placements of instances from files."""

import csv
import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raytracer.util.errors import InputError, abbreviate, format_value, one_line, suggest_name
from raytracer.util.safe_open import name_read_errors, parse_npy, read_regular

_PLACE = ("x", "y", "z")
_SCALE = ("scale_x", "scale_y", "scale_z")
_AXIS = ("axis_x", "axis_y", "axis_z")
_COLUMNS = (*_PLACE, "scale", *_SCALE, "angle", *_AXIS)

Rows = NDArray[np.float64]


def read_placements(path: str | Path) -> Rows:
    """Read the transforms of a .npy or .csv file: float64 (n, 4, 4), n >= 1, each invertible and finite as float32.

    A .npy file holds matrices for column vectors, (n, 4, 4) or (n, 3, 4).  A .csv file names its columns in its first
    line: x, y, z (m); scale, or scale_x, scale_y, scale_z; angle (deg) about the axis axis_x, axis_y, axis_z.  What it
    places is scaled, then turned, then moved.

    Raises
    ------
    InputError : the file is missing, unreadable or broken, of an unknown suffix, or holds what is no placement.
    """
    path = Path(path)
    readers = {".npy": _read_npy, ".csv": _read_csv}
    if path.suffix.lower() not in readers:
        raise InputError(f"{path}: unknown suffix {path.suffix!r} for placements; known: {', '.join(readers)}")
    try:
        with name_read_errors(path), np.errstate(all="ignore"):
            poses = readers[path.suffix.lower()](path)
    except (ValueError, csv.Error) as error:
        raise InputError(one_line(f"{path}: {error}")) from error
    if not len(poses):
        raise InputError(f"{path}: holds no placements")
    with np.errstate(invalid="ignore"):
        usable = (np.abs(poses) <= np.finfo(np.float32).max).all(axis=(1, 2))
    # Normalised columns, so that their directions decide and not their scale.
    linear = np.where(usable[:, None, None], poses[:, :3, :3], 1.0)
    size = np.abs(linear).max(axis=1, keepdims=True)
    with np.errstate(all="ignore"):
        usable &= np.linalg.matrix_rank(linear / np.where(size > 0.0, size, 1.0)) == 3
    if not usable.all():
        bad = int(np.argmin(usable))
        raise InputError(f"{path}: placement {bad} (counted from 0) is not finite, or flattens what it places")
    return poses


def _read_npy(path: Path) -> Rows:
    array = parse_npy(read_regular(path))
    if array.dtype.kind not in "fiu":
        raise ValueError("holds no array of numbers")
    if array.ndim != 3 or array.shape[1:] not in ((4, 4), (3, 4)):
        raise ValueError(f"must hold an array of shape (n, 4, 4) or (n, 3, 4), got {array.shape}")
    poses = np.zeros((len(array), 4, 4))
    poses[:, : array.shape[1]] = array
    if array.shape[1] == 4 and (poses[:, 3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise ValueError("must have 0, 0, 0, 1 as the last row of each matrix")
    poses[:, 3, 3] = 1.0
    return poses


def _read_csv(path: Path) -> Rows:
    from scipy.spatial.transform import Rotation

    lines = list(csv.reader(io.StringIO(read_regular(path).decode("utf-8-sig"), newline="")))
    names = [name.strip() for name in lines[0]] if lines else []
    for name in names:
        if name not in _COLUMNS:
            raise ValueError(
                f"unknown column {format_value(name)}; {suggest_name(abbreviate(name), _COLUMNS, 'columns')}"
            )
        if names.count(name) > 1:
            raise ValueError(f"has the column {name!r} twice")
    if missing := [name for name in _PLACE if name not in names]:
        raise ValueError(f"lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
    if "scale" in names and set(_SCALE) & set(names):
        raise ValueError("has a column scale, and scale_x, scale_y or scale_z besides")
    values = np.empty((len(lines) - 1, len(names)))
    for number, line in enumerate(lines[1:]):
        if len(line) != len(names):
            raise ValueError(f"line {number + 2} has {len(line)} values, and there are {len(names)} columns")
        for column, text in enumerate(line):
            try:
                values[number, column] = float(text)
            except ValueError:
                raise ValueError(
                    f"line {number + 2}: {names[column]} must be a number, got {format_value(text)}"
                ) from None
    table = dict(zip(names, values.T, strict=True))

    def columns(wanted: tuple[str, ...], defaults: tuple[float, float, float]) -> Rows:
        return np.stack(
            [table.get(name, np.full(len(values), value)) for name, value in zip(wanted, defaults, strict=True)], axis=1
        )

    scale = np.tile(table["scale"][:, None], 3) if "scale" in table else columns(_SCALE, (1.0, 1.0, 1.0))
    given = any(name in table for name in _AXIS)
    axis = columns(_AXIS, (0.0, 0.0, 0.0) if given else (0.0, 1.0, 0.0))
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    if not length.all():
        raise ValueError(f"line {int(np.argmin(length)) + 2}: the axis must not be the zero vector")
    angle = np.radians(table.get("angle", np.zeros(len(values))))[:, None]
    poses = np.zeros((len(values), 4, 4))
    poses[:, :3, :3] = Rotation.from_rotvec(angle * axis / length).as_matrix() * scale[:, None, :]
    poses[:, :3, 3] = columns(_PLACE, (0.0, 0.0, 0.0))
    poses[:, 3, 3] = 1.0
    return poses
