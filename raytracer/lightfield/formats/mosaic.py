"""One picture of all views: side by side (`mosaic`), or pixel by pixel as under microlenses (`interleaved`).

In a mosaic, which is st-major, the pixel (t, s) of the view (v, u) is in row `v height + t` and column `u width + s`.
In an interleaved picture, which is uv-major as the raw picture behind microlenses and Lytro's ESLF files, it is in row
`t rows + v` and column `s columns + u`: each block of rows x columns pixels holds what one pixel of all views sees.

Pictures are written a few rows at a time, and read by parts where they are mapped into memory.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from raytracer.film.formats.registry import display_suffixes, image_suffixes
from raytracer.film.light_field.field import LightField
from raytracer.lightfield.formats import geometry
from raytracer.lightfield.formats.array import write_geometry_beside
from raytracer.lightfield.formats.base.import_geometry import find_geometry
from raytracer.lightfield.formats.base.light_field_format import (
    MEMORY,
    METRES,
    Exported,
    ExportOptions,
    ImportOptions,
    LightFieldFormat,
    note_left_out,
)
from raytracer.lightfield.formats.base.picture_rows import check_picture, count_rows, open_picture
from raytracer.lightfield.formats.base.stored_picture import LazyMosaic, StoredPicture, open_stored
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress


def read_mosaic(is_interleaved: bool, path: Path, options: ImportOptions) -> LightField:
    """Split one picture that shows all views into these; rows and columns as options or the file beside it say."""
    picture = _open(path)
    stated = geometry.read_layout(path)
    own = _name(is_interleaved)
    if stated is not None and stated.name not in (None, own):
        raise InputError(
            f"{geometry.beside(path)}: says that {path.name} is of the layout {stated.name}, and it is to be read as "
            f"{own}: leave out --layout, --interleaved, --rows and --columns"
        )
    rows = options.rows if stated is None else options.rows or stated.rows
    columns = options.columns if stated is None else options.columns or stated.columns
    if rows is None or columns is None:
        raise InputError(f"{path}: is one picture: say --rows and --columns of the views in it")
    height, width = picture.pixels.shape[:2]
    if height % rows or width % columns:
        raise InputError(
            f"{path}: {width} x {height} pixels do not divide into {columns} columns and {rows} rows of views"
        )
    radiance = LazyMosaic(picture, rows, columns, is_interleaved=is_interleaved)
    steps = geometry.regular_grid(rows, columns)
    views, units = find_geometry(path, steps, radiance.shape, options, beside=geometry.beside(path))
    return LightField(radiance, views, settings={"naming": "grid", **units})


def _name(is_interleaved: bool) -> str:
    return "interleaved" if is_interleaved else "mosaic"


def _open(path: Path) -> StoredPicture:
    """Open a picture; an InputError says that there is none."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.suffix.lower() == ".lf":
        raise InputError(f"{path}: is an .lf file already")
    return open_stored(path)


def check_mosaic(field: LightField, path: Path, options: ExportOptions) -> None:
    """Check that a picture of all views can be written: an InputError says why not."""
    views = field.views
    check_picture(path, views.columns * views.width, views.rows * views.height, options.bits)


def write_mosaic(
    is_interleaved: bool, field: LightField, path: Path, options: ExportOptions, update: Update | None
) -> Exported:
    """Write the picture, as many rows at a time as fit into memory, and its geometry beside it."""
    views = field.views
    width, height = views.columns * views.width, views.rows * views.height
    rows = count_rows(options.memory or MEMORY, width, height)
    bright = 0
    bands = list(_interleaved_bands(field, rows) if is_interleaved else _bands(field, rows))
    with open_picture(path, width, height, bits=options.bits or 8, dtype=field.radiance.dtype) as put:
        for index in report_progress(bands, update):
            band = np.asarray(field.radiance[index])
            # Of an interleaved band, (v, u, t, s): pixel by pixel; of one row of views, (u, t, s).
            order = (2, 0, 3, 1, 4) if is_interleaved else (1, 0, 2, 3)
            put(band.transpose(order).reshape(-1, width, 3))
            bright += int(np.count_nonzero(band > 1.0))
    share = bright / (3 * width * height) if path.suffix.lower() in display_suffixes() else 0.0
    files = [path, write_geometry_beside(field, path, _name(is_interleaved))]
    return Exported(files, share, note_left_out(field))


def _bands(field: LightField, rows: int) -> Iterator[tuple[Any, ...]]:
    """List the parts of the radiance that make some rows of a mosaic each."""
    views = field.views
    for v in range(views.rows):
        for top in range(0, views.height, rows):
            yield v, slice(None), slice(top, top + rows)


def _interleaved_bands(field: LightField, rows: int) -> Iterator[tuple[Any, ...]]:
    """List the parts of the radiance that make some rows of an interleaved picture each, whole rows of blocks."""
    views = field.views
    blocks = max(1, rows // views.rows)
    for top in range(0, views.height, blocks):
        yield slice(None), slice(None), slice(top, top + blocks)


def _is_interleaved(path: Path, options: ImportOptions) -> bool:
    return not path.is_dir() and (options.interleaved or geometry.stated_layout(path) == _name(True))


def _is_picture(path: Path) -> bool:
    return path.suffix.lower() in image_suffixes() and not path.is_dir()


FORMATS = (
    LightFieldFormat(
        _name(True),
        "one picture, the pixels of all views beside each other",
        is_input=_is_interleaved,
        read=partial(read_mosaic, True),
        is_output=lambda path: False,
        check=check_mosaic,
        write=partial(write_mosaic, True),
        takes=frozenset({"bits", "memory"}),
        import_takes=METRES | {"rows", "columns", "interleaved"},
        order=25,
    ),
    LightFieldFormat(
        _name(False),
        "one picture, all views side by side",
        # Whatever no other format takes: its message says what is missing.
        is_input=lambda path, options: not path.is_dir(),
        read=partial(read_mosaic, False),
        is_output=_is_picture,
        check=check_mosaic,
        write=partial(write_mosaic, False),
        takes=frozenset({"bits", "memory"}),
        import_takes=METRES | {"rows", "columns"},
        order=90,
    ),
)
