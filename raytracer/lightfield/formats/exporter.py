"""Export of light fields to the layouts of other programs: folders of views and arrays."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from raytracer.film import image_file
from raytracer.film.formats import pfm
from raytracer.film.formats.registry import display_suffixes, picture_suffixes
from raytracer.film.image import Image
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats import geometry, hci
from raytracer.lightfield.formats.folders import NAMINGS, Naming, list_images
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.util.atomic_write import atomic_write, wrap_os_errors, write_bytes
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress


class Exported(NamedTuple):
    """Result of an export.

    files : all that were written.
    clipped : share of the values that are brighter than their format holds.
    """

    files: list[Path]
    clipped: float


def check_export(field: LightField, folder: str | Path, naming: Naming, suffix: str = ".png") -> None:
    """Check, before anything is written, that views can be exported.

    Raises InputError: the naming cannot tell the geometry, the format is not known, or the folder holds other views.
    """
    folder = Path(folder)
    if naming not in NAMINGS:
        raise InputError(f"{folder}: naming must be one of {', '.join(NAMINGS)}, got {naming!r}")
    known = [each for each in picture_suffixes() if each != lf.SUFFIX]
    if suffix not in known:
        raise InputError(f"{folder}: unknown suffix {suffix!r} for views; known: {', '.join(known)}")
    if naming == "hci":
        if not field.is_metric:
            raise InputError(f"{folder}: parameters.cfg needs metres, which this light field has not: export as grid")
        try:
            hci.grid_spacing(field.views)
        except ValueError as error:
            raise InputError(f"{folder}: {error}: export as stanford or grid") from None
    own_names = {name for row in _view_names(field.views, naming, suffix) for name in row}
    other = next((path for path in list_images(folder) if path.name not in own_names), None)
    if other is not None:
        raise InputError(f"{folder}: holds other pictures ({other.name}), which would be mixed up with the views")


def export_views(
    field: LightField,
    folder: str | Path,
    *,
    naming: Naming = "grid",
    suffix: str = ".png",
    update: Update | None = None,
) -> Exported:
    """Write views into a folder, a picture each, and files of their geometry.

    Parameters
    ----------
    naming : see the table of this package.
    suffix : of the pictures: .exr and .npy keep linear light, .png and .jpg what a display shows.
    update : called with the number of views that are written, and of all.

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
    names = _view_names(views, naming, suffix)
    for row, column in report_progress(list(np.ndindex(views.rows, views.columns)), update):
        radiance = field.view(row, column)
        written.append(folder / names[row][column])
        image_file.save(Image(radiance), written[-1])
        bright += int(np.count_nonzero(radiance > 1.0))
    if naming == "hci":
        written += _write_ground_truth(field, folder)
    write_bytes(folder / geometry.FILE, geometry.to_json(views, field.settings.get("units")))
    written.append(folder / geometry.FILE)
    values = views.rows * views.columns * views.height * views.width * 3
    return Exported(written, bright / values if suffix in display_suffixes() else 0.0)


def export_array(field: LightField, path: str | Path) -> list[Path]:
    """Write the radiance as one array, .npy, view by view, and its geometry beside it.

    Raises
    ------
    OutputError : a file cannot be written.
    """
    path = Path(path)
    dtype = np.dtype(field.radiance.dtype).newbyteorder("<")
    header = {"descr": dtype.str, "fortran_order": False, "shape": tuple(np.shape(field.radiance))}
    with atomic_write(path) as aside, wrap_os_errors(path), aside.open("wb") as file:
        np.lib.format.write_array_header_2_0(file, header)
        for view in np.ndindex(field.views.rows, field.views.columns):
            file.write(np.ascontiguousarray(field.radiance[view], dtype=dtype).tobytes())
    beside = path.with_suffix(f".{geometry.FILE}")
    write_bytes(beside, geometry.to_json(field.views, field.settings.get("units")))
    return [path, beside]


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
    for number in range(views.rows * views.columns if hci.DEPTH_LAYER in field.layers else 0):
        depth = np.asarray(field.layers[hci.DEPTH_LAYER][divmod(number, views.columns)], dtype=np.float64)
        if depth.ndim != 2 or not np.isfinite(depth).any():
            continue
        maps = {hci.DEPTH_LAYER: depth, hci.DISPARITY_MAP: hci.depth_to_disparity(depth, views, step)}
        if number == number_in_middle:
            middle = maps[hci.DISPARITY_MAP]
        for kind, values in maps.items():
            ends = [f"_Cam{number:03d}", ""] if number == number_in_middle else [f"_Cam{number:03d}"]
            for path in (folder / f"gt_{kind}_lowres{end}.pfm" for end in ends):
                write_bytes(path, pfm.encode(values))
                written.append(path)
    write_bytes(folder / hci.FILE, hci.to_cfg(views, folder.resolve().name, middle))
    return [*written, folder / hci.FILE]
