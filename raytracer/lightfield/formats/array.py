"""One array of all views, .npy: (rows, columns, height, width, 3)."""

from pathlib import Path

import numpy as np

from raytracer.film.light_field.field import LightField
from raytracer.lightfield.formats import geometry
from raytracer.lightfield.formats.base.import_geometry import find_geometry
from raytracer.lightfield.formats.base.lazy_views import LazyNpy
from raytracer.lightfield.formats.base.light_field_format import (
    METRES,
    Exported,
    ExportOptions,
    ImportOptions,
    LightFieldFormat,
    note_left_out,
)
from raytracer.util.atomic_write import atomic_write, wrap_os_errors, write_bytes
from raytracer.util.progress import Update, report_progress

_NAME, _NPY = "array", ".npy"


def _is_array(path: Path) -> bool:
    return path.suffix.lower() == _NPY and not path.is_dir()


def _is_input(path: Path, options: ImportOptions) -> bool:
    """Return True for an array of views; with rows and columns it is a picture of all of them, if no file says."""
    if not _is_array(path):
        return False
    is_picture = options.rows is not None and options.columns is not None
    return not is_picture if (stated := geometry.stated_layout(path)) is None else stated == _NAME


def read_array(path: Path, options: ImportOptions) -> LightField:
    """Read an array, which is mapped into memory."""
    radiance = LazyNpy(path)
    steps = geometry.regular_grid(*radiance.shape[:2])
    views, units = find_geometry(path, steps, radiance.shape, options, beside=geometry.beside(path))
    return LightField(radiance, views, settings={"naming": "grid", **units})


def write_array(field: LightField, path: Path, options: ExportOptions, update: Update | None) -> Exported:
    """Write the radiance as one array view by view, and its geometry beside it."""
    del options
    dtype = np.dtype(field.radiance.dtype).newbyteorder("<")
    header = {"descr": dtype.str, "fortran_order": False, "shape": tuple(np.shape(field.radiance))}
    with atomic_write(path) as aside, wrap_os_errors(path), aside.open("wb") as file:
        np.lib.format.write_array_header_2_0(file, header)
        for view in report_progress(list(np.ndindex(field.views.rows, field.views.columns)), update):
            file.write(np.ascontiguousarray(field.radiance[view], dtype=dtype).tobytes())
    return Exported([path, write_geometry_beside(field, path, _NAME)], notes=note_left_out(field))


def write_geometry_beside(field: LightField, path: Path, layout: str) -> Path:
    """Write the geometry of the views, and the layout that they have in a file, beside it: `NAME.geometry.json`."""
    stated = {"layout": layout, "suffix": path.suffix.lower()}
    write_bytes(geometry.beside(path), geometry.to_json(field.views, field.settings.get("units"), stated))
    return geometry.beside(path)


FORMATS = (
    LightFieldFormat(
        _NAME,
        "an array, .npy",
        is_input=_is_input,
        read=read_array,
        is_output=_is_array,
        check=lambda field, path, options: None,
        write=write_array,
        takes=frozenset(),
        import_takes=METRES,
        order=40,
    ),
)
