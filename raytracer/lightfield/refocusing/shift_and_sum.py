"""Refocusing by shift-and-sum: the mean of all views, each shifted for a plane of focus at right angles to the axis.

References: Isaksen, McMillan, Gortler 2000, "Dynamically Reparameterized Light Fields"; Ng et al. 2005, "Light Field
Photography with a Hand-held Plenoptic Camera", sec. 3.
"""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LIT_LAYER, LightField
from raytracer.film.light_field.views import Views
from raytracer.film.window import Window
from raytracer.lightfield.coverage import extrapolate_unlit, lit_at_nearest
from raytracer.lightfield.refocusing.pixel_interpolation import AxisShift, Interpolation, make_shift
from raytracer.util.progress import Update

FloatArray = NDArray[np.float64]


class _ViewSum:
    """Weighted sum of shifted views.

    Views at the same height are moved sideways first, and their sum is then moved up or down: one shift along each axis
    in place of two for each view.
    """

    def __init__(self, views: Views, inverse: float, interpolation: Interpolation, window: Window) -> None:
        self._views, self._interpolation, self._window = views, interpolation, window
        self._shift = views.shift(inverse)
        width, height = window.right - window.left, window.bottom - window.top
        self._sum, self._seen = np.zeros((height, width, 3)), np.zeros((height, width))

    def shift_columns(self, row: int, column: int) -> AxisShift:
        """Make the horizontal shift of a view."""
        shift = self._shift[row, column, 0]
        return make_shift(shift, self._window.left, self._window.right, self._views.width, self._interpolation)

    def shift_rows(self, row: int, column: int) -> AxisShift:
        """Make the vertical shift of a view."""
        shift = self._shift[row, column, 1]
        return make_shift(shift, self._window.top, self._window.bottom, self._views.height, self._interpolation)

    def start_level(self, first: int, last: int) -> None:
        """Begin with views of another height, of which the rows first <= row < last of pixels are given."""
        width = self._window.right - self._window.left
        self._rows, self._count = np.zeros((last - first, width, 3)), np.zeros(width)

    def add(self, weight: float, columns: AxisShift, block: FloatArray, start: int) -> None:
        """Add a view, of which columns of pixels from `start` on are given, shifted horizontally."""
        if columns.seen.any():
            self._rows += (weight * columns.seen)[:, None] * columns.apply(block, start, 1)
            self._count += weight * columns.seen

    def finish_level(self, rows: AxisShift, first: int, lit: NDArray[np.bool_] | None = None) -> None:
        """Shift the views of this height, rows of pixels from `first` on, vertically, and add them where `lit`."""
        if rows.seen.any():
            moved, seen = rows.seen[:, None, None] * rows.apply(self._rows, first, 0), np.outer(rows.seen, self._count)
            self._sum += moved if lit is None else np.where(lit[..., None], moved, 0.0)
            self._seen += seen if lit is None else np.where(lit, seen, 0.0)

    def lit(self, row: int, column: int, lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Look up which pixels of the window are lit in a view, whose mask is `lit`."""
        right, down = self._shift[row, column]
        rows = np.arange(self._window.top, self._window.bottom) + down
        return lit_at_nearest(lit, rows[:, None], (np.arange(self._window.left, self._window.right) + right)[None, :])

    def mean(self) -> FloatArray:
        """Return the picture: the weighted mean of the views that see each pixel, 0 where none does."""
        seen = self._seen[..., None]
        return np.divide(self._sum, seen, out=self._sum, where=seen > 0.0)


def shift_and_sum(
    field: LightField,
    inverses: list[float],
    weights: FloatArray,
    interpolation: Interpolation,
    window: Window,
    update: Update | None,
) -> list[FloatArray]:
    """Focus at one over each of `inverses` (1/m): float64 (height, width, 3) of the window, for each."""
    views = field.views
    sums = [_ViewSum(views, inverse, interpolation, window) for inverse in inverses]
    levels: defaultdict[tuple[float, ...], list[tuple[int, int]]] = defaultdict(list)
    used_views, done = np.argwhere(weights > 0.0), 0
    for row, column in used_views:
        # Masks of lit pixels differ from view to view, so that each view is moved up or down by itself.
        own_level = (row, column) if LIT_LAYER in field.layers else ()
        levels[(float(views.position[row, column, 1]), *own_level)].append((int(row), int(column)))
    for places in levels.values():
        row_shifts = [picture.shift_rows(*places[0]) for picture in sums]
        first, last = _span(row_shifts, views.height)
        for picture in sums:
            picture.start_level(first, last)
        for row, column in places:
            # Read only the part of the view that any of the pictures needs.
            column_shifts = [picture.shift_columns(row, column) for picture in sums]
            start, stop = _span(column_shifts, views.width)
            block = np.asarray(field.radiance[row, column, first:last, start:stop], dtype=np.float64)
            lit = field.lit(row, column)
            if lit is not None:
                block = extrapolate_unlit(block, lit[first:last, start:stop])
            for picture, columns in zip(sums, column_shifts, strict=True):
                picture.add(weights[row, column], columns, block, start)
            done += 1
            if update is not None:
                update(done, len(used_views))
        for picture, rows in zip(sums, row_shifts, strict=True):
            picture.finish_level(rows, first, None if lit is None else picture.lit(*places[0], lit))
    return [picture.mean() for picture in sums]


def _span(shifts: list[AxisShift], size: int) -> tuple[int, int]:
    """Return the range of the pixels 0 ... size - 1 that any of the shifts reads: first, and one after the last."""
    first = min(max(min(shift.low for shift in shifts), 0), size - 1)
    return first, max(min(max(shift.high for shift in shifts), size), first + 1)
