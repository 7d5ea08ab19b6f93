"""Bands: the parts of all views that are rendered at a time, as many as fit into memory.

A band is as many rows of views as fit, or as many views of one row.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from raytracer.film.light_field.layout import Layout, Mosaic
from raytracer.film.light_field.views import Views
from raytracer.film.white_balance import AUTO
from raytracer.film.window import Window
from raytracer.kernel.aovs.base.recording import per_sample_aovs, unique_aovs
from raytracer.rendering.memory_budget import ERROR_ESTIMATOR_BYTES, picture_memory
from raytracer.rendering.prepared_scene import PreparedScene
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError

_GIGABYTE = 1e9


class ViewBand(NamedTuple):
    """Band of views: the rows `row` <= r < `row_end`, and the columns `column` <= c < `column_end`."""

    row: int
    row_end: int
    column: int
    column_end: int

    def window(self, views: Views) -> Window:
        """Return the window of the picture that these views cover."""
        width, height = views.width, views.height
        return Window(self.column * width, self.row * height, self.column_end * width, self.row_end * height)

    def layout(self, views: Views) -> Mosaic:
        """Return the layout of this band's picture."""
        return Mosaic(replace(views, position=views.position[self.row : self.row_end, self.column : self.column_end]))


def split_into_bands(views: Views, most: int) -> list[ViewBand]:
    """Split all views into bands of at most `most`, 1 or more: of about equal numbers of rows, or parts of a row."""
    rows, columns = views.rows, views.columns
    if most >= columns:
        return [ViewBand(begin, end, 0, columns) for begin, end in _split_row(rows, most // columns)]
    return [ViewBand(row, row + 1, begin, end) for row in range(rows) for begin, end in _split_row(columns, most)]


def _split_row(count: int, most: int) -> list[tuple[int, int]]:
    """Split a row into as few parts as possible of at most `most` each, of nearly equal size: begin and end of each."""
    parts = math.ceil(count / most)
    return list(pairwise(count * part // parts for part in range(parts + 1)))


def bytes_per_pixel(prepared: PreparedScene, *, keeps: bool = False) -> int:
    """Bound the bytes of a pixel, from its first sample to the end of its development; without those of a denoiser.

    keeps : True if checkpoints are written, for which the film and the error estimator are copied.

    A picture and its layers are no larger than the film that they are made of: measured by the process's
    peak, 158 of 176 bytes for plain radiance, 265 of 336 with three AOVs, 490 of 506 with a simulated sensor.
    """
    picture = picture_memory(prepared.packed, 1, None, prepared.options.aovs, denoise=prepared.options.denoise)
    return 2 * picture.film + (1 + keeps) * ERROR_ESTIMATOR_BYTES + picture.photograph


def choose_bands(
    spec: SceneSpec, layout: Layout, pixel_bytes: int, memory: int, aovs: Sequence[str]
) -> list[ViewBand] | None:
    """Choose the bands for a memory (bytes) and the bytes of a pixel; None for a picture that is no mosaic of views.

    Raises
    ------
    InputError : not even a view fits into the memory, or the picture has to be seen as a whole and does not.
    """
    views = layout.views
    width, height = spec.picture()
    whole, view = pixel_bytes * width * height, pixel_bytes * views.width * views.height
    if whole <= memory:
        return [ViewBand(0, views.rows, 0, views.columns)] if layout.is_by_view else None
    reason = _whole_picture_reason(spec, layout, aovs)
    if reason is not None:
        raise InputError(f"memory: {reason}, for which {_gigabytes(whole)} are needed, and {_gigabytes(memory)} given")
    if view > memory:
        size = f"{views.width} x {views.height}"
        raise InputError(
            f"memory: must be at least what a view of {size} pixels takes, {_gigabytes(view)}, got {_gigabytes(memory)}"
        )
    return split_into_bands(views, memory // view)


def _whole_picture_reason(spec: SceneSpec, layout: Layout, aovs: Sequence[str]) -> str | None:
    """Return the reason for which a picture cannot be rendered in parts; None if it can."""
    if not layout.is_by_view:
        return f"the picture of a {spec.camera.type} camera holds all views in all of its parts"
    if spec.camera.exposure is not None:
        return "camera.exposure measures the whole picture"
    if spec.film.white_balance == AUTO:
        return "film.white_balance: auto measures the whole picture"
    whole_aovs = per_sample_aovs(unique_aovs(aovs))
    return f"the AOV {whole_aovs[0]} is kept of the whole picture" if whole_aovs else None


def _gigabytes(size: float) -> str:
    return f"{size / _GIGABYTE:.3g} GB"
