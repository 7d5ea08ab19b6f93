"""Light fields of other programs: folders of views, one picture of all views, and arrays.

| | names | geometry |
|---|---|---|
| `grid` | `view_03_05.png`: row and column, or one number by rows | `geometry.json`, if it is there |
| `stanford` | `out_03_05_Y_X_.png` | places by the names; `geometry.json` |
| `hci` | `input_Cam032.png` | `parameters.cfg`; `gt_depth_lowres.pfm`, `gt_disp_lowres.pfm`; `geometry.json` |
| .npy | (rows, columns, height, width, 3) | `NAME.geometry.json`, if it is there |

What is said by whoever imports comes before what files say.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.film import output, pfm
from raytracer.film.image import Image
from raytracer.lightfield.foreign import folders, geometry, hci
from raytracer.lightfield.foreign.folders import Found
from raytracer.lightfield.foreign.geometry import Known, Optics
from raytracer.lightfield.foreign.pictures import Maps, Pictures, Stack, montage
from raytracer.plenoptic import lf
from raytracer.plenoptic.field import LightField
from raytracer.plenoptic.views import Views
from raytracer.units import METRES_PER_MILLIMETRE
from raytracer.untrusted import contents
from raytracer.wholefiles import told, whole

Naming = Literal["grid", "stanford", "hci"]

NAMINGS: tuple[Naming, ...] = ("grid", "stanford", "hci")

_NPY = ".npy"
_DEPTH = "depth"
_DISPARITY = "disp"


# ---- Import


def import_views(
    path: str | Path,
    *,
    rows: int | None = None,
    columns: int | None = None,
    spacing: float | tuple[float, float] | None = None,
    focus_distance: float | None = None,
    vfov: float | None = None,
    focal_length: float | None = None,
    sensor: float | None = None,
    flip: str = "",
    interleaved: bool = False,
) -> LightField:
    """A light field of another program; its views are read as they are asked for.

    Metres need `spacing`, `focus_distance`, and `vfov` or `focal_length` with `sensor`, or files that say as much.
    Without them places are in steps of one view and `settings["units"]` is "views".

    Parameters
    ----------
    path : a folder of views, an array (.npy), or a picture that shows all views.
    rows, columns : of views, where names do not say them.
    spacing : from view to view (m), or that to the right and that down.
    focus_distance : of the plane in which all views see the same (m); inf for parallel ones.
    vfov : vertical field of view of a view (degrees).
    focal_length, sensor : of a view, and the width of its sensor (mm).
    flip : "x", "y", "xy": places in Stanford names run to the left, or up.
    interleaved : whether the pixels of one picture go from view to view, as under microlenses.

    Raises
    ------
    InputError : files are missing, broken, of different sizes or not views, or what is said is not enough for metres.
    """
    path = Path(path)
    optics = Optics(vfov, focal_length, sensor)
    said = _said(spacing, focus_distance, optics)
    layers: dict[str, Maps] = {}
    parameters: hci.Parameters | None = None
    radiance: Any
    if path.is_dir():
        parameters = _parameters(path) if (rows, columns) == (None, None) else None
        if parameters is not None:
            rows, columns = parameters.rows, parameters.columns
        found = folders.find(path, rows, columns, flip)
        radiance = Pictures(found.files)
        beside = path / geometry.FILE
    elif path.suffix.lower() == _NPY:
        radiance = Stack(path)
        beside = path.with_suffix(f".{geometry.FILE}")
        found = Found([], geometry.regular(*radiance.shape[:2]), "grid")
    else:
        if rows is None or columns is None:
            _check_picture(path)
            raise InputError(f"{path}: is one picture: say --rows and --columns of the views in it")
        radiance = montage(path, rows, columns, interleaved=interleaved)
        beside = path.with_suffix(f".{geometry.FILE}")
        found = Found([], geometry.regular(rows, columns), "grid")

    height, width = radiance.shape[2:4]
    settings = {"naming": found.naming}
    if said:
        known = _known(path, spacing, focus_distance, optics.pixel(width, height), found)
        views, units = _placed(path, found.steps, width, height, known)
    elif beside.exists():
        views, units = geometry.read(beside)
        _same(beside, views, radiance.shape)
    elif parameters is not None:
        views, units = _by_parameters(path / hci.FILE, parameters, radiance.shape), {}
    else:
        views, units = _placed(path, found.steps, width, height, Known())
    if found.naming == "hci" and not units:
        layers = _truth(path, views)
    return LightField(radiance, views, layers, settings={**settings, **units})


def _said(spacing: object, focus_distance: object, optics: Optics) -> bool:
    return any(value is not None for value in (spacing, focus_distance, *optics))


def _check_picture(path: Path) -> None:
    """Tell first of a file that is not there, or no picture."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.suffix.lower() == ".lf":
        raise InputError(f"{path}: is an .lf file already")
    output.load(path)


def _known(
    path: Path, spacing: float | tuple[float, float] | None, distance: float | None, pixel: float | None, found: Found
) -> Known:
    missing = [
        name
        for name, value in (
            ("--spacing", spacing),
            ("--focus-distance (inf for parallel views)", distance),
            ("--vfov, or --focal-length with --sensor", pixel),
        )
        if value is None
    ]
    if spacing is None or distance is None or pixel is None:
        raise InputError(
            f"{path}: metres need also {' and '.join(missing)}; without any of them, places are in steps of one view"
        )
    both = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    if found.is_placed and both[0] != both[1]:
        raise InputError(
            f"{path}: names say where views are: --spacing is one length, that from view to view on average"
        )
    return Known(both, distance, pixel)


def _same(path: Path, views: Views, shape: Sequence[int]) -> None:
    said = (views.rows, views.columns, views.height, views.width)
    if said != tuple(shape[:4]):
        raise InputError(
            f"{path}: is the geometry of views (rows, columns, height, width) {said}; there are {tuple(shape[:4])}"
        )


def _parameters(folder: Path) -> hci.Parameters | None:
    """What the benchmark's file says of views that are named as the benchmark's."""
    named = any(folders.HCI.fullmatch(path.stem) for path in _pictures(folder))
    return hci.read(folder / hci.FILE) if named and (folder / hci.FILE).exists() else None


def _by_parameters(path: Path, said: hci.Parameters, shape: Sequence[int]) -> Views:
    if (said.height, said.width) != tuple(shape[2:4]):
        height, width = shape[2:4]
        raise InputError(f"{path}: says {said.width} x {said.height} pixels a view; they have {width} x {height}")
    views, _ = _placed(path, geometry.regular(said.rows, said.columns), said.width, said.height, said.known)
    return dataclasses.replace(views, pose=said.pose)


def _placed(
    path: Path, steps: NDArray[np.float64], width: int, height: int, known: Known
) -> tuple[Views, dict[str, str]]:
    try:
        return geometry.views(steps, width, height, known)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _truth(folder: Path, views: Views) -> dict[str, Maps]:
    """The depths of all views, nan where they are not known, if there are any."""
    step: float | None = None
    # Between views that are on no grid disparities say nothing.
    with contextlib.suppress(ValueError):
        step = hci.spacing(views)
    kinds = (_DEPTH,) if step is None else (_DEPTH, _DISPARITY)
    known: dict[tuple[int, int], NDArray[np.float64]] = {}
    middle = views.rows * views.columns // 2
    for number in range(views.rows * views.columns):
        ends = [f"_Cam{number:03d}.pfm"] + ([".pfm"] if number == middle else [])
        for name in (f"gt_{kind}_lowres{end}" for end in ends for kind in kinds):
            path = folder / name
            if not path.exists():
                continue
            values = _map(path, views)
            known[divmod(number, views.columns)] = (
                values if step is None or _DEPTH in name else hci.depth(values, views, step)
            )
            break
    return {_DEPTH: Maps(known, (views.rows, views.columns, views.height, views.width))} if known else {}


def _map(path: Path, views: Views) -> NDArray[np.float64]:
    try:
        values = np.asarray(pfm.decode(contents(path)), dtype=np.float64)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: is truncated, or no .pfm file") from error
    if values.shape != (views.height, views.width):
        raise InputError(
            f"{path}: must be of {views.width} x {views.height} pixels as the views are, is {values.shape}"
        )
    return values


# ---- Export


class Exported(NamedTuple):
    """Files that were written, and the share of values that are brighter than their format holds."""

    files: list[Path]
    clipped: float


def check_export(field: LightField, folder: str | Path, naming: Naming, suffix: str = ".png") -> None:
    """Make sure, before anything is written, that views can be exported.

    Raises
    ------
    InputError : the naming cannot tell the geometry, the format is not known, or the folder holds other views.
    """
    folder = Path(folder)
    if naming not in NAMINGS:
        raise InputError(f"{folder}: naming must be one of {', '.join(NAMINGS)}, got {naming!r}")
    known = [each for each in output.SUFFIXES if each != lf.SUFFIX]
    if suffix not in known:
        raise InputError(f"{folder}: unknown suffix {suffix!r} for views; known: {', '.join(known)}")
    if naming == "hci":
        if not field.is_metric:
            raise InputError(f"{folder}: parameters.cfg needs metres, which this light field has not: export as grid")
        try:
            hci.spacing(field.views)
        except ValueError as error:
            raise InputError(f"{folder}: {error}: export as stanford or grid") from None
    own = {name for row in _names(field.views, naming, suffix) for name in row}
    strange = next((path for path in _pictures(folder) if path.name not in own), None)
    if strange is not None:
        raise InputError(f"{folder}: holds other pictures ({strange.name}), which would be mixed up with the views")


def export_views(
    field: LightField,
    folder: str | Path,
    *,
    naming: Naming = "grid",
    suffix: str = ".png",
    update: Callable[[float, float], object] | None = None,
) -> Exported:
    """Write views into a folder, a picture each, with what tells their geometry.

    Parameters
    ----------
    naming : see this module's table.
    suffix : of the pictures: .exr and .npy keep linear light, .png and .jpg what a display shows.
    update : told of the progress: views that are written, and all.

    Raises
    ------
    InputError : see `check_export`.
    OutputError : a file cannot be written.
    """
    folder = Path(folder)
    check_export(field, folder, naming, suffix)
    views = field.views
    written: list[Path] = []
    bright = 0
    for row, names in enumerate(_names(views, naming, suffix)):
        for column, name in enumerate(names):
            seen = field.view(row, column)
            output.save(Image(seen), folder / name)
            bright += int(np.count_nonzero(seen > 1.0))
            written.append(folder / name)
            if update is not None:
                update(len(written), views.rows * views.columns)
    if naming == "hci":
        written += _write_truth(field, folder)
    units = str(field.settings["units"]) if "units" in field.settings else None
    output.write_bytes(folder / geometry.FILE, geometry.text(views, units))
    written.append(folder / geometry.FILE)
    is_clipped = suffix in output.DISPLAY_SUFFIXES
    values = views.rows * views.columns * views.height * views.width * 3
    return Exported(written, bright / values if is_clipped else 0.0)


def export_array(field: LightField, path: str | Path) -> list[Path]:
    """Write the radiance as one array, .npy, view by view, and its geometry beside it.

    Raises
    ------
    OutputError : a file cannot be written.
    """
    path = Path(path)
    dtype = np.dtype(field.radiance.dtype).newbyteorder("<")
    header = {"descr": dtype.str, "fortran_order": False, "shape": tuple(np.shape(field.radiance))}
    with whole(path) as aside, told(path), aside.open("wb") as file:
        np.lib.format.write_array_header_2_0(file, header)
        for row in range(field.views.rows):
            for column in range(field.views.columns):
                file.write(np.ascontiguousarray(field.radiance[row, column], dtype=dtype).tobytes())
    beside = path.with_suffix(f".{geometry.FILE}")
    units = str(field.settings["units"]) if "units" in field.settings else None
    output.write_bytes(beside, geometry.text(field.views, units))
    return [path, beside]


def _names(views: Views, naming: Naming, suffix: str) -> list[list[str]]:
    if naming == "hci":
        return [
            [f"input_Cam{r * views.columns + c:03d}{suffix}" for c in range(views.columns)] for r in range(views.rows)
        ]
    if naming == "grid":
        return [[f"view_{r:02d}_{c:02d}{suffix}" for c in range(views.columns)] for r in range(views.rows)]
    return [
        [
            f"out_{r:02d}_{c:02d}_{-up / METRES_PER_MILLIMETRE:.6f}_{right / METRES_PER_MILLIMETRE:.6f}_{suffix}"
            for c, (right, up) in enumerate(row)
        ]
        for r, row in enumerate(views.position.tolist())
    ]


def _pictures(folder: Path) -> list[Path]:
    try:
        return [path for path in sorted(folder.iterdir()) if path.suffix.lower() in output.SUFFIXES]
    except OSError:
        return []


def _write_truth(field: LightField, folder: Path) -> list[Path]:
    """Depths and disparities, if they are known, and the parameters."""
    views, written = field.views, []
    step = hci.spacing(views)
    middle = None
    number_in_middle = views.rows * views.columns // 2
    for number in range(views.rows * views.columns if _DEPTH in field.layers else 0):
        row, column = divmod(number, views.columns)
        depth = np.asarray(field.layers[_DEPTH][row, column], dtype=np.float64)
        if depth.ndim != 2 or not np.isfinite(depth).any():
            continue
        maps = {_DEPTH: depth, _DISPARITY: hci.disparity(depth, views, step)}
        if number == number_in_middle:
            middle = maps[_DISPARITY]
        for kind, values in maps.items():
            ends = [f"_Cam{number:03d}", ""] if number == number_in_middle else [f"_Cam{number:03d}"]
            for path in (folder / f"gt_{kind}_lowres{end}.pfm" for end in ends):
                output.write_bytes(path, pfm.encode(values))
                written.append(path)
    output.write_bytes(folder / hci.FILE, hci.text(views, folder.resolve().name, middle))
    return [*written, folder / hci.FILE]
