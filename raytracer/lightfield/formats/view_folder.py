"""Folders of views, a picture each: any that end in row and column, the Stanford archive's and the HCI benchmark's.

Layouts `grid`, `stanford` and `hci` differ in the names of the pictures, and in what tells the geometry.
"""

import contextlib
import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats import pfm
from raytracer.film.formats.registry import display_suffixes, image_suffixes, picture_suffixes
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import DEPTH_LAYER, LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats import folders, geometry, hci
from raytracer.lightfield.formats.base.import_geometry import find_geometry
from raytracer.lightfield.formats.base.lazy_views import LazyPictures, PartialLayer
from raytracer.lightfield.formats.base.light_field_format import (
    METRES,
    AnyField,
    Exported,
    ExportOptions,
    ImportOptions,
    LightFieldFormat,
    note_left_out,
)
from raytracer.lightfield.formats.base.picture_rows import save_view
from raytracer.lightfield.formats.folders import Naming, list_images
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress
from raytracer.util.safe_open import read_regular


def read_folder(path: Path, options: ImportOptions) -> LightField:
    """Read a folder of views, whichever of the three layouts its names are of."""
    parameters = _parameters(path) if (options.rows, options.columns) == (None, None) else None
    if parameters is not None:
        options = dataclasses.replace(options, rows=parameters.rows, columns=parameters.columns)
    files = folders.find_views(path, options.rows, options.columns, options.flip)
    radiance = LazyPictures(files.files)
    beside = path / geometry.FILE
    _check_names_take(path, options, files, beside)
    views, units = find_geometry(
        path,
        files.steps,
        radiance.shape,
        options,
        beside=beside,
        stated=None if parameters is None else partial(_hci_views, path / hci.FILE, parameters, radiance.shape),
        is_placed=files.is_placed,
    )
    layers = _ground_truth_layers(path, views) if files.naming == "hci" and not units else {}
    return LightField(radiance, views, layers, settings={"naming": files.naming, **units})


def _check_names_take(path: Path, options: ImportOptions, files: folders.ViewFiles, beside: Path) -> None:
    """Refuse options that the names of the views have no use for."""
    if options.flip and not files.is_placed:
        raise InputError(f"{path}: --flip is of places in Stanford names, and these names say none")
    if options.flip and beside.exists():
        raise InputError(f"{path}: --flip is of places in names, and {beside.name} says where views are")
    rows, columns = len(files.files), len(files.files[0])
    if (options.rows or rows, options.columns or columns) != (rows, columns):
        raise InputError(f"{path}: names say {rows} rows of {columns} views, not --rows and --columns")


def _parameters(folder: Path) -> hci.HciParameters | None:
    """Read the benchmark's file of parameters, if views are named as the benchmark's and there is one."""
    named = any(folders.HCI.fullmatch(path.stem) for path in list_images(folder))
    return hci.read(folder / hci.FILE) if named and (folder / hci.FILE).exists() else None


def _hci_views(path: Path, stated: hci.HciParameters, shape: Sequence[int]) -> tuple[Views, dict[str, str]]:
    """Make the geometry of the benchmark's parameters, and refuse those of another image size."""
    if (stated.height, stated.width) != tuple(shape[2:4]):
        height, width = shape[2:4]
        raise InputError(f"{path}: says {stated.width} x {stated.height} pixels a view; they have {width} x {height}")
    steps = geometry.regular_grid(stated.rows, stated.columns)
    views, units = geometry.make_views(path, steps, stated.width, stated.height, stated.known)
    return dataclasses.replace(views, pose=stated.pose), units


def _ground_truth_layers(folder: Path, views: Views) -> dict[str, PartialLayer]:
    """Read the benchmark's ground truth as the layer `depth`, nan in views without any; no layer if there is none."""
    step: float | None = None
    # Between views that are on no grid disparities say nothing.
    with contextlib.suppress(ValueError):
        step = hci.grid_spacing(views)
    kinds = (DEPTH_LAYER,) if step is None else (DEPTH_LAYER, hci.DISPARITY_MAP)
    known: dict[tuple[int, int], NDArray[np.float64]] = {}
    middle = views.rows * views.columns // 2
    for number in range(views.rows * views.columns):
        ends = [f"_Cam{number:03d}.pfm"] + ([".pfm"] if number == middle else [])
        for name in (f"gt_{kind}_lowres{end}" for end in ends for kind in kinds):
            path = folder / name
            if not path.exists():
                continue
            values = _read_map(path, views)
            known[divmod(number, views.columns)] = (
                values if step is None or DEPTH_LAYER in name else hci.disparity_to_depth(values, views, step)
            )
            break
    return {DEPTH_LAYER: PartialLayer(known, (views.rows, views.columns, views.height, views.width))} if known else {}


def _read_map(path: Path, views: Views) -> NDArray[np.float64]:
    """Read a .pfm file of one number a pixel of a view."""
    try:
        values = np.asarray(pfm.decode(read_regular(path)), dtype=np.float64)
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


def check_folder_export(naming: Naming, field: LightField, folder: Path, options: ExportOptions) -> None:
    """Check, before anything is written, that views can be exported.

    Raises InputError: the naming cannot tell the geometry, the format is not known, or the folder holds other views.
    """
    suffix = _suffix(options)
    check_view_suffix(folder, suffix, options)
    if naming == "hci":
        if not field.is_metric:
            raise InputError(f"{folder}: parameters.cfg needs metres, which this light field has not: export as grid")
        try:
            hci.grid_spacing(field.views)
        except ValueError as error:
            raise InputError(f"{folder}: {error}: export as stanford or grid") from None
    check_no_others(folder, {name for row in _view_names(field.views, naming, suffix) for name in row})


def check_view_suffix(folder: Path, suffix: str, options: ExportOptions) -> None:
    """Refuse a suffix that views cannot have, and 16 bits where it is not .png."""
    known = [each for each in picture_suffixes() if each != lf.SUFFIX]
    if suffix not in known:
        raise InputError(f"{folder}: unknown suffix {suffix!r} for views; known: {', '.join(known)}")
    if options.bits is not None and suffix != ".png":
        raise InputError(f"{folder}: --bits are of .png, and views are {suffix}")


def check_no_others(folder: Path, own_names: set[str]) -> None:
    """Refuse a folder that holds pictures of other names."""
    other = next((path for path in list_images(folder) if path.name not in own_names), None)
    if other is not None:
        raise InputError(f"{folder}: holds other pictures ({other.name}), which would be mixed up with the views")


def write_folder(
    naming: Naming, field: LightField, folder: Path, options: ExportOptions, update: Update | None
) -> Exported:
    """Write the views, a picture each, and files of their geometry."""
    suffix = _suffix(options)
    names = _view_names(field.views, naming, suffix)
    written, clipped = write_views(field, folder, names, options, update)
    if naming == "hci":
        written += _write_ground_truth(field, folder)
    write_bytes(folder / geometry.FILE, geometry.to_json(field.views, field.settings.get("units")))
    kept = [DEPTH_LAYER] if naming == "hci" else []
    return Exported([*written, folder / geometry.FILE], clipped, note_left_out(field, kept))


def write_views(
    field: AnyField, folder: Path, names: list[list[str]], options: ExportOptions, update: Update | None
) -> tuple[list[Path], float]:
    """Write the views into files of these names: all files, and the share of values that their format clips."""
    views = field.views
    written: list[Path] = []
    bright = 0
    for row, column in report_progress(list(np.ndindex(views.rows, views.columns)), update):
        radiance = field.view(row, column)
        written.append(folder / names[row][column])
        save_view(radiance, written[-1], options.bits)
        bright += int(np.count_nonzero(radiance > 1.0))
    values = views.rows * views.columns * views.height * views.width * 3
    return written, bright / values if written[0].suffix in display_suffixes() else 0.0


def _suffix(options: ExportOptions) -> str:
    return options.suffix or ".png"


def _view_names(views: Views, naming: Naming, suffix: str) -> list[list[str]]:
    """Make the file names of all views, by row and column."""

    def name(row: int, column: int) -> str:
        if naming == "hci":
            return f"input_Cam{row * views.columns + column:03d}{suffix}"
        if naming == "grid":
            return f"view_{row:02d}_{column:02d}{suffix}"
        right, up = views.position[row, column] / METRES_PER_MILLIMETRE
        return f"out_{row:02d}_{column:02d}_{-up:.6f}_{right:.6f}_{suffix}"

    return [[name(row, column) for column in range(views.columns)] for row in range(views.rows)]


def _write_ground_truth(field: LightField, folder: Path) -> list[Path]:
    """Write maps of depth and disparity in the benchmark's files, if they are known, and its file of parameters."""
    views, written = field.views, []
    step = hci.grid_spacing(views)
    middle = None
    number_in_middle = views.rows * views.columns // 2
    for number in range(views.rows * views.columns if DEPTH_LAYER in field.layers else 0):
        depth = np.asarray(field.layers[DEPTH_LAYER][divmod(number, views.columns)], dtype=np.float64)
        if not np.isfinite(depth).any():
            continue
        maps = {DEPTH_LAYER: depth, hci.DISPARITY_MAP: hci.depth_to_disparity(depth, views, step)}
        if number == number_in_middle:
            middle = maps[hci.DISPARITY_MAP]
        for kind, values in maps.items():
            ends = [f"_Cam{number:03d}", ""] if number == number_in_middle else [f"_Cam{number:03d}"]
            for path in (folder / f"gt_{kind}_lowres{end}.pfm" for end in ends):
                write_bytes(path, pfm.encode(values))
                written.append(path)
    write_bytes(folder / hci.FILE, hci.to_cfg(views, folder.resolve().name, middle))
    return [*written, folder / hci.FILE]


def _make_format(naming: Naming, order: int, summary: str) -> LightFieldFormat:
    return LightFieldFormat(
        naming,
        summary,
        is_input=lambda path, options: path.is_dir(),
        read=read_folder,
        is_output=lambda path: naming == "grid" and path.suffix.lower() not in (*image_suffixes(), ".json", lf.SUFFIX),
        check=partial(check_folder_export, naming),
        write=partial(write_folder, naming),
        takes=frozenset({"suffix", "bits"}),
        import_takes=METRES | {"rows", "columns", "flip"},
        folder=lambda path: path,
        order=order,
    )


FORMATS = (
    _make_format("grid", 50, "a folder of view_ROW_COLUMN.png"),
    _make_format("stanford", 51, "a folder of out_ROW_COLUMN_Y_X_.png"),
    _make_format("hci", 52, "a folder of input_Cam032.png with parameters.cfg"),
)
