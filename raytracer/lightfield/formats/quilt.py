"""Quilts of the Looking Glass displays: one picture of a single row of views, in columns and rows.

View 0, the leftmost, is at the bottom left; the views go to the right, then up.  The name says the layout:
`NAME_qs8x6a0.75.png` has 8 columns and 6 rows, of views whose shape on the display is 0.75 as wide as high, whatever
their pixels are.  Where columns and rows do not divide the picture, its right and its top stay empty.

References: Looking Glass Factory, "Quilts" (docs.lookingglassfactory.com/keyconcepts/quilts: order, names, and the
table of settings by device) and the HoloPlay Core SDK's guide to quilts (margins); view cones: the device templates of
the Looking Glass toolkit.
"""

import contextlib
import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film import image_file
from raytracer.film.formats.registry import display_suffixes, image_suffixes, picture_suffixes
from raytracer.film.image import Image
from raytracer.film.light_field.field import DEPTH_LAYER, LightField
from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats import geometry
from raytracer.lightfield.formats.array import write_geometry_beside
from raytracer.lightfield.formats.base.import_geometry import find_geometry
from raytracer.lightfield.formats.base.light_field_format import (
    METRES,
    Exported,
    ExportOptions,
    ImportOptions,
    LightFieldFormat,
)
from raytracer.lightfield.formats.base.picture_rows import ROW_SUFFIXES, open_picture
from raytracer.lightfield.formats.base.quilt_plan import NAME, PIXEL_ASPECT, QuiltPlan, plan_quilt
from raytracer.lightfield.formats.base.stored_picture import LazyMosaic, open_stored
from raytracer.report.wording import format_percent
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress

if TYPE_CHECKING:
    from raytracer.lightfield.depth.depth_map import Depth

_NAME = "quilt"


def check_quilt(field: LightField, path: Path, options: ExportOptions) -> None:
    """Check that a quilt can be written; an InputError says why not."""
    suffix = path.suffix.lower()
    if suffix not in picture_suffixes():
        known = ", ".join(picture_suffixes())
        raise InputError(f"{path}: unknown suffix {path.suffix!r} for a quilt; known: {known}")
    if options.bits is not None and suffix != ".png":
        raise InputError(f"{path}: --bits are of .png")
    if options.memory is not None and not options.depth:
        raise InputError(f"{path}: --memory is that of --depth")
    plan_quilt(field, path, options)


def write_quilt(field: LightField, path: Path, options: ExportOptions, update: Update | None) -> Exported:
    """Write a quilt, one row of its views at a time, and its geometry beside it; the name gets what it has to say."""
    plan = plan_quilt(field, path, options)
    if NAME.fullmatch(path.stem) is None:
        path = path.with_name(f"{path.stem}_qs{plan.columns}x{plan.rows}a{_format_aspect(plan.aspect)}{path.suffix}")
    depth = _find_depth(field, plan, options.memory) if options.depth else None
    bands = _bands(field, plan, depth, update)
    suffix = path.suffix.lower()
    bright = 0
    if suffix in ROW_SUFFIXES:
        bits, dtype = options.bits or 8, np.dtype(field.radiance.dtype)
        with open_picture(path, *plan.size, bits=bits, dtype=dtype) as put:
            for band in bands:
                put(band)
                bright += int(np.count_nonzero(band > 1.0))
    else:
        whole = np.concatenate(list(bands))
        image_file.save(Image(whole), path)
        bright = int(np.count_nonzero(whole > 1.0))
    shown = LightField(
        np.broadcast_to(np.float32(0.0), (1, len(plan.places), plan.tile[1], plan.tile[0], 3)),
        _quilt_views(field.views, plan),
        settings={key: value for key, value in field.settings.items() if key == "units"},
    )
    files = [path, write_geometry_beside(shown, path, _NAME)]
    pixels = 3 * plan.size[0] * plan.size[1]
    cropped = 1.0 - plan.box[2] * plan.box[3] / (field.views.width * field.views.height)
    notes = (
        (f"views are cropped by {format_percent(cropped)}, to what all of them see in the quilt's aspect",)
        if cropped > 0.0
        else ()
    )
    return Exported(files, bright / pixels if suffix in display_suffixes() else 0.0, notes)


def _format_aspect(aspect: float) -> str:
    """Write an aspect as names have it, with at most four digits behind the point."""
    return f"{aspect:.4f}".rstrip("0").rstrip(".")


def _find_depth(field: LightField, plan: QuiltPlan, memory: int | None) -> "Depth":
    """Get the depth of the view in the middle of the row: from the layer `depth`, or estimated from the views.

    memory : bytes that estimating may take; None for as many as other work may.
    """
    from raytracer.lightfield.depth.depth_map import Depth, depth_map
    from raytracer.lightfield.memory import memory_limit

    row, column = field.views.nearest(*plan.places.mean(axis=0))
    layer = field.layers.get(DEPTH_LAYER)
    if layer is None or not field.is_metric:
        with contextlib.nullcontext() if memory is None else memory_limit(memory):
            return depth_map(field, row=row, column=column)
    distance = np.asarray(layer[row, column], dtype=np.float64)
    is_known = np.isfinite(distance) & (distance > 0.0)
    # What no ray has met is far away.
    inverse = np.divide(1.0, distance, out=np.zeros_like(distance), where=is_known)
    return Depth(inverse, np.where(is_known, 1.0, 0.0), row, column)


def _bands(
    field: LightField, plan: QuiltPlan, depth: "Depth | None", update: Update | None
) -> Iterator[NDArray[np.float64]]:
    """Make the rows of the quilt from the top down: an empty margin, then one row of views after the other."""
    width, height = plan.size
    tile_width, tile_height = plan.tile
    if margin := height - plan.rows * tile_height:
        yield np.zeros((margin, width, 3))
    order = [(row, column) for row in reversed(range(plan.rows)) for column in range(plan.columns)]
    for row, column in report_progress(order, update):
        if column == 0:
            band = np.zeros((tile_height, width, 3))
        number = row * plan.columns + column
        band[:, column * tile_width : (column + 1) * tile_width] = _tile(field, plan, number, depth)
        if column == plan.columns - 1:
            yield band


def _tile(field: LightField, plan: QuiltPlan, number: int, depth: "Depth | None") -> NDArray[np.float64]:
    """Make one view of the quilt, (height, width, 3)."""
    from raytracer.lightfield.views.synthesis import view_at

    right, up = plan.places[number]
    distance = math.inf if plan.inverse_convergence == 0.0 else 1.0 / plan.inverse_convergence
    view = view_at(field, float(right), float(up), depth=depth, distance=None if depth else distance)
    left, top, width, height = plan.box
    moved_right, moved_down = plan.shift[number].tolist()
    return resample(view, plan.tile, (left + moved_right, top + moved_down, width, height))


def resample(
    picture: NDArray[np.float64], size: tuple[int, int], box: tuple[float, float, float, float]
) -> NDArray[np.float64]:
    """Resample a part of a picture to a size in pixels, by Lanczos' filter of the wider of both pixels.

    box (px) : left, top, width and height of the part.

    Pixels that are only moved by whole ones keep all their digits.
    """
    import PIL.Image

    left, top, width, height = box
    if size == (round(width), round(height)) and all(value == round(value) for value in box):
        return picture[round(top) : round(top + height), round(left) : round(left + width)]
    # Rounding may put an edge beyond the picture, which Pillow refuses.
    edges = (
        max(left, 0.0),
        max(top, 0.0),
        min(left + width, float(picture.shape[1])),
        min(top + height, float(picture.shape[0])),
    )
    planes = [PIL.Image.fromarray(np.ascontiguousarray(picture[..., channel], np.float32)) for channel in range(3)]
    scaled = [plane.resize(size, PIL.Image.Resampling.LANCZOS, box=edges) for plane in planes]
    return np.stack([np.asarray(plane, dtype=np.float64) for plane in scaled], axis=-1)


def _quilt_views(views: Views, plan: QuiltPlan) -> Views:
    """Make the geometry of a quilt's views."""
    left, top, width, height = plan.box
    pixel = views.plane.pixel * width / plan.tile[0]
    # The middle of the height stays, whatever a pixel's height is; and where the row is, all of it was moved alike.
    up = float(plan.places[:, 1].mean())
    middle = views.plane.top - views.plane.pixel * (top + 0.5 * height)
    middle += (plan.inverse_convergence - views.inverse_focus) * up
    plane = Plane(pixel, views.plane.left + views.plane.pixel * left, middle + 0.5 * pixel * plan.tile[1])
    return dataclasses.replace(
        views,
        position=plan.places[None],
        plane=plane,
        width=plan.tile[0],
        height=plan.tile[1],
        inverse_focus=plan.inverse_convergence,
        cell=None,
    )


# ---- Import


def _is_input(path: Path, options: ImportOptions) -> bool:
    del options
    is_named = path.suffix.lower() in image_suffixes() and NAME.fullmatch(path.stem) is not None
    return is_named and not path.is_dir() and geometry.stated_layout(path) in (None, _NAME)


def read_quilt(path: Path, options: ImportOptions) -> LightField:
    """Read a quilt as one row of views, decoded as they are read; columns and rows as options or the name say."""
    named = NAME.fullmatch(path.stem)
    columns, rows = (
        asked or (int(named[number]) if named else 0) for asked, number in ((options.columns, 1), (options.rows, 2))
    )
    if not columns or not rows:
        raise InputError(
            f"{path}: its name does not say columns and rows (NAME_qs8x6a0.75.png): say --columns and --rows"
        )
    picture = open_stored(path)
    height, width = picture.pixels.shape[:2]
    if height < rows or width < columns:
        raise InputError(f"{path}: {width} x {height} pixels have no room for {columns} x {rows} views")
    radiance = LazyQuilt(LazyMosaic(picture, rows, columns, top=height % rows))
    steps = geometry.regular_grid(1, columns * rows)
    views, units = find_geometry(path, steps, radiance.shape, options, beside=geometry.beside(path))
    settings: dict[str, str | float] = {"naming": "quilt", **units}
    if named and float(named[3]) > 0.0:
        pixel_aspect = float(named[3]) * views.height / views.width
        # Names have two to four digits.
        if abs(pixel_aspect - 1.0) * views.width > 1.0:
            settings[PIXEL_ASPECT] = pixel_aspect
    return LightField(radiance, views, settings=settings)


class LazyQuilt(LazyArray):
    """Array of the views of a quilt as one row, (1, views, height, width, 3), read as they are asked for."""

    def __init__(self, mosaic: LazyMosaic) -> None:
        self._mosaic = mosaic
        rows, columns, *within = mosaic.shape
        super().__init__((1, rows * columns, *within), mosaic.dtype)

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        row, numbers, *within = (range(size)[part] for part, size in zip(ahead, self.shape, strict=True))
        rows, columns = self._mosaic.shape[:2]
        # View 0 is at the bottom left.
        views = [self._mosaic[rows - 1 - n // columns, n % columns][ahead[2:]] for _ in row for n in numbers]
        return np.array(views, dtype=self.dtype).reshape([len(row), len(numbers), *map(len, within)])


FORMATS = (
    LightFieldFormat(
        _NAME,
        "one picture for a Looking Glass display",
        is_input=_is_input,
        read=read_quilt,
        is_output=lambda path: NAME.fullmatch(path.stem) is not None and path.suffix.lower() in image_suffixes(),
        check=check_quilt,
        write=write_quilt,
        takes=frozenset(
            {
                *("bits", "device", "columns", "rows", "size", "aspect"),
                *("row", "baseline", "view_cone", "convergence", "depth", "memory"),
            }
        ),
        import_takes=METRES | {"rows", "columns"},
        order=20,
    ),
)
