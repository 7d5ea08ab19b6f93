"""Names of views in folders: the file of each row and column, and the place of that view."""

import re
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.registry import display_suffixes, image_suffixes
from raytracer.lightfield.formats import geometry
from raytracer.util.errors import InputError

HCI = re.compile(r"input_Cam(\d+)")
"""Names of the benchmark of Konstanz and Heidelberg: number of the view, by rows."""

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
STANFORD = re.compile(rf"out_(\d+)_(\d+)_({_NUMBER})_({_NUMBER})_?")
"""Names of the (New) Stanford Light Field Archive: row, column, and Y and X of the camera, in this order (so the notes
on its calibration there), in an unknown scale."""

_PAIR = re.compile(r"(.*?)(\d+)(\D+)(\d+)(\D*)")
_SINGLE = re.compile(r"(.*?)(\d+)(\D*)")

_MOST_VIEWS = 1 << 20
"""Most images of a folder of views."""


Naming = Literal["grid", "stanford", "hci"]

NAMINGS: tuple[Naming, ...] = ("grid", "stanford", "hci")


class ViewFiles(NamedTuple):
    """Files of views, and the places of these.

    files : (rows, columns) in their order on the array.
    steps : right and up from the middle, in steps of one view, (rows, columns, 2).
    naming : one of `NAMINGS`.
    is_placed : True if the names give the places.
    """

    files: list[list[Path]]
    steps: NDArray[np.float64]
    naming: str
    is_placed: bool = False


def find_views(folder: Path, rows: int | None, columns: int | None, flip: str = "") -> ViewFiles:
    """Find the views in a folder.

    rows, columns : of the array, where names have one number only.
    flip : "x", "y" or both: axes along which the places in Stanford names run the other way (right to left; up).

    Raises InputError: the folder cannot be read, holds no views, lacks one, or has two for the same place.
    """
    try:
        paths = [
            path for path in sorted(folder.iterdir()) if path.suffix.lower() in image_suffixes() and path.is_file()
        ]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from error
    if not paths:
        raise InputError(f"{folder}: holds no views: files of images, {', '.join(image_suffixes())}")
    if len(paths) > _MOST_VIEWS:
        raise InputError(f"{folder}: holds {len(paths)} images, more than can be views of a light field")

    if named := {path: (int(match[1]),) for path in paths if (match := HCI.fullmatch(path.stem))}:
        return _arrange_by_number(folder, _one_format(named), rows, columns, "hci")
    if placed := {path: match for path in paths if (match := STANFORD.fullmatch(path.stem))}:
        return _find_stanford(folder, placed, flip)
    return _find_grid(folder, paths, rows, columns)


def _find_stanford(folder: Path, named: Mapping[Path, re.Match[str]], flip: str) -> ViewFiles:
    """Arrange the views of the Stanford archive by the places in their names."""
    numbers = {path: (int(match[1]), int(match[2])) for path, match in named.items()}
    files, _ = _arrange_by_row_and_column(folder, _one_format(numbers))

    # Images, and so places too, count down.
    signs = np.array([-1.0 if "x" in flip else 1.0, 1.0 if "y" in flip else -1.0])
    place = np.array([[(float(named[path][4]), float(named[path][3])) for path in row] for row in files]) * signs
    if not np.isfinite(place).all():
        raise InputError(f"{folder}: names of views must have finite places")
    files, place = _sort_by_place(files, place)
    rows, columns = place.shape[:2]
    across = (place[:, -1, 0] - place[:, 0, 0]).mean() / max(columns - 1, 1)
    down = (place[0, :, 1] - place[-1, :, 1]).mean() / max(rows - 1, 1)
    step = float(np.mean([n for n, k in ((across, columns), (down, rows)) if k > 1])) if rows * columns > 1 else 1.0
    if not step > 0.0:
        raise InputError(f"{folder}: all views are at the same place, by their names")
    middle = 0.5 * (place.min(axis=(0, 1)) + place.max(axis=(0, 1)))
    return ViewFiles(files, (place - middle) / step, "stanford", is_placed=True)


def _sort_by_place(files: list[list[Path]], place: NDArray[np.float64]) -> tuple[list[list[Path]], NDArray[np.float64]]:
    """Sort files and places into rows from the top and columns from the left, however they were numbered."""
    shape = place.shape[:2]
    rows = np.argsort(-place[..., 1].mean(axis=1), kind="stable").tolist()
    columns = np.argsort(place[..., 0].mean(axis=0), kind="stable").tolist()
    order = [(r, c) for r in rows for c in columns]
    sorted_places = place[rows][:, columns]
    if (np.diff(sorted_places[..., 0], axis=1) < 0.0).any() or (np.diff(sorted_places[..., 1], axis=0) > 0.0).any():
        # The numbers do not follow the places: views of equal height make a row, then.
        falling = sorted(np.ndindex(shape), key=lambda at: -place[at][1])
        parts = (falling[i : i + shape[1]] for i in range(0, len(falling), shape[1]))
        order = [(r, c) for part in parts for r, c in sorted(part, key=lambda at: place[at][0])]
        sorted_places = np.array([place[at] for at in order]).reshape(place.shape)
    arranged = [files[r][c] for r, c in order]
    return [arranged[i : i + shape[1]] for i in range(0, len(arranged), shape[1])], sorted_places


def _find_grid(folder: Path, paths: list[Path], rows: int | None, columns: int | None) -> ViewFiles:
    """Arrange views whose names begin alike and end in a row and a column, or in one number."""
    pairs: dict[tuple[str, str, str], dict[Path, tuple[int, ...]]] = defaultdict(dict)
    singles: dict[tuple[str, str, str], dict[Path, tuple[int, ...]]] = defaultdict(dict)
    for path in paths:
        kind = path.suffix.lower()
        if match := _PAIR.fullmatch(path.stem):
            pairs[match[1], match[3] + match[5], kind][path] = (int(match[2]), int(match[4]))
        elif match := _SINGLE.fullmatch(path.stem):
            singles[match[1], match[3], kind][path] = (int(match[2]),)
    if pairs:
        numbers = _largest_group(folder, pairs)
        if (rows, columns) != (None, None) and len({r for r, _ in numbers.values()}) != (
            rows or len(numbers) // (columns or 1)
        ):
            return _arrange_by_number(folder, numbers, rows, columns, "grid")
        files, steps = _arrange_by_row_and_column(folder, numbers)
        return ViewFiles(files, steps, "grid")
    if not singles:
        example = paths[0].name
        raise InputError(f"{folder}: names of views must end in row and column, as view_03_05.png; {example} does not")
    return _arrange_by_number(folder, _largest_group(folder, singles), rows, columns, "grid")


def _largest_group(
    folder: Path, groups: Mapping[tuple[str, str, str], dict[Path, tuple[int, ...]]]
) -> dict[Path, tuple[int, ...]]:
    """Choose the largest group of files that are named alike; of several formats the linear one."""
    order = sorted(groups.items(), key=lambda item: (len(item[1]), item[0][2] not in display_suffixes()), reverse=True)
    first = order[0]
    if len(order) > 1 and len(order[1][1]) == len(first[1]) and order[1][0][:2] != first[0][:2]:
        names = f"{next(iter(first[1])).name} and {next(iter(order[1][1])).name}"
        raise InputError(
            f"{folder}: holds more than one light field: names as {names}; put them into folders of their own"
        )
    return first[1]


def _one_format(numbers: Mapping[Path, tuple[int, ...]]) -> dict[Path, tuple[int, ...]]:
    """Choose, of views in several formats, those in the format that most are in, or the linear one."""
    kinds: dict[str, dict[Path, tuple[int, ...]]] = defaultdict(dict)
    for path, number in numbers.items():
        kinds[path.suffix.lower()][path] = number
    return max(kinds.items(), key=lambda item: (len(item[1]), item[0] not in display_suffixes()))[1]


def _arrange_by_number(
    folder: Path, numbers: Mapping[Path, tuple[int, ...]], rows: int | None, columns: int | None, naming: str
) -> ViewFiles:
    """Arrange views with one number each by rows."""
    count = len(numbers)
    if rows is None and columns is None:
        side = round(count**0.5)
        if side * side != count:
            raise InputError(f"{folder}: {count} views with one number each: say --rows or --columns")
        rows = columns = side
    rows = rows or count // (columns or 1)
    columns = columns or count // rows
    if rows * columns != count:
        raise InputError(f"{folder}: holds {count} views, not {rows} rows of {columns}")
    ordered = sorted(numbers, key=lambda path: (numbers[path], path))
    _refuse_duplicates(folder, numbers)
    files = [ordered[r * columns : (r + 1) * columns] for r in range(rows)]
    return ViewFiles(files, geometry.regular_grid(rows, columns), naming)


def _arrange_by_row_and_column(
    folder: Path, numbers: Mapping[Path, tuple[int, ...]]
) -> tuple[list[list[Path]], NDArray[np.float64]]:
    """Arrange views with row and column, and place them by these numbers."""
    _refuse_duplicates(folder, numbers)
    by_place = {place: path for path, place in numbers.items()}
    rows, columns = sorted({r for r, _ in by_place}), sorted({c for _, c in by_place})
    for place in ((r, c) for r in rows for c in columns):
        if place not in by_place:
            present = f"{len(by_place)} views of {len(rows)} rows and {len(columns)} columns"
            raise InputError(f"{folder}: the view of row {place[0]}, column {place[1]} is missing: there are {present}")
    right = np.array(columns, dtype=np.float64) - 0.5 * (columns[0] + columns[-1])
    up = 0.5 * (rows[0] + rows[-1]) - np.array(rows, dtype=np.float64)
    steps = np.stack(np.broadcast_arrays(right, up[:, None]), axis=-1)
    return [[by_place[r, c] for c in columns] for r in rows], steps


def _refuse_duplicates(folder: Path, numbers: Mapping[Path, tuple[int, ...]]) -> None:
    """Refuse two files with the same number."""
    seen: dict[tuple[int, ...], Path] = {}
    for path, place in numbers.items():
        if place in seen:
            raise InputError(f"{folder}: {seen[place].name} and {path.name} are both view {', '.join(map(str, place))}")
        seen[place] = path


def list_images(folder: Path) -> list[Path]:
    """List the image files of a folder, sorted; none if it cannot be read."""
    try:
        return [path for path in sorted(folder.iterdir()) if path.suffix.lower() in image_suffixes()]
    except OSError:
        return []
