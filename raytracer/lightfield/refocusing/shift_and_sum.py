"""Refocusing by shift-and-sum: the mean of all views, each shifted for a plane of focus at right angles to the axis.

For a tilted plane each pixel of a view is moved by its own distance of focus.

References: Isaksen, McMillan, Gortler 2000, "Dynamically Reparameterized Light Fields"; Ng et al. 2005, "Light Field
Photography with a Hand-held Plenoptic Camera", sec. 3; of the interpolation between pixels: Keys 1981, "Cubic
Convolution Interpolation for Digital Image Processing"; Duchon 1979, "Lanczos Filtering in One and Two Dimensions";
Unser 1999, "Splines: A Perfect Fit for Signal and Image Processing".
"""

import math
from collections import defaultdict
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LIT_LAYER, LightField
from raytracer.film.light_field.focusing import FocusPlane
from raytracer.film.light_field.views import Views
from raytracer.film.window import Window
from raytracer.lightfield.coverage import extrapolate_unlit, lit_at_nearest, lit_view
from raytracer.util.progress import Update

FloatArray = NDArray[np.float64]

Interpolation: TypeAlias = Literal["linear", "cubic", "lanczos"]

INTERPOLATIONS: tuple[Interpolation, ...] = ("linear", "cubic", "lanczos")

# Parameter of Keys's family of kernels: this one reproduces parabolas.
_KEYS = -0.5

_LANCZOS_LOBES = 3


def interpolation_taps(interpolation: Interpolation, fraction: float) -> tuple[FloatArray, int]:
    """Compute weights of pixels at `fraction` of the way from one to the next, 0 <= fraction < 1; they sum to 1.

    Returns the weights, and the index of the first pixel, from the place rounded down.
    """
    if fraction == 0.0:
        return np.ones(1), 0
    if interpolation == "linear":
        return np.array([1.0 - fraction, fraction]), 0
    reach = 2 if interpolation == "cubic" else _LANCZOS_LOBES
    away = np.abs(fraction - np.arange(1 - reach, reach + 1))
    if interpolation == "cubic":
        near = ((_KEYS + 2.0) * away - (_KEYS + 3.0)) * away**2 + 1.0
        far = _KEYS * (((away - 5.0) * away + 8.0) * away - 4.0)
        weights = np.where(away <= 1.0, near, far)
    else:
        weights = np.sinc(away) * np.sinc(away / reach)
    return weights / weights.sum(), 1 - reach


class AxisShift(NamedTuple):
    """Shift along one axis of a view: its values at the places begin + shift ... end - 1 + shift.

    low : first pixel that is read; it may be outside of the view.
    high : one after the last pixel that is read.
    weights : of neighbouring pixels.
    seen : (end - begin,) bool, True for places within the view.
    """

    low: int
    high: int
    weights: FloatArray
    seen: NDArray[np.bool_]

    def apply(self, block: FloatArray, start: int, axis: int) -> FloatArray:
        """Interpolate pixels that begin at `start` along an axis; beyond the edge the last pixel is repeated."""
        stop = start + block.shape[axis]
        before, after = max(0, start - self.low), max(0, self.high - stop)
        if before or after:
            pad = [(0, 0)] * block.ndim
            pad[axis] = (before, after)
            block = np.pad(block, pad, mode="edge")
        first, size = self.low - start + before, self.high - self.low - len(self.weights) + 1
        total: FloatArray | None = None
        for number, weight in enumerate(self.weights):
            if weight != 0.0:
                part = block[(*(slice(None),) * axis, slice(first + number, first + number + size))]
                total = weight * part if total is None else total + weight * part
        assert total is not None
        return total


def make_shift(shift: float, begin: int, end: int, size: int, interpolation: Interpolation) -> AxisShift:
    """Make the shift of a view of `size` pixels by `shift` pixels, for the places from `begin` to before `end`."""
    whole = math.floor(shift)
    weights, first = interpolation_taps(interpolation, shift - whole)
    low = begin + whole + first
    places = np.arange(begin, end) + shift
    seen = (places >= -0.5) & (places <= size - 0.5)
    return AxisShift(low, low + (end - begin) + len(weights) - 1, weights, seen)


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
        (shift, _), window = self._shift[row, column], self._window
        return make_shift(shift, window.left, window.right, self._views.width, self._interpolation)

    def shift_rows(self, row: int, column: int) -> AxisShift:
        """Make the vertical shift of a view."""
        (_, shift), window = self._shift[row, column], self._window
        return make_shift(shift, window.top, window.bottom, self._views.height, self._interpolation)

    def start_level(self, first: int, last: int) -> None:
        """Begin with views of another height, of which the rows first <= row < last of pixels are given."""
        width = self._window.right - self._window.left
        self._rows, self._count = np.zeros((last - first, width, 3)), np.zeros(width)

    def add(self, weight: float, columns: AxisShift, block: FloatArray, start: int) -> None:
        """Add a view, of which columns of pixels from `start` on are given, shifted horizontally."""
        if columns.seen.any():
            self._rows += (weight * columns.seen)[:, None] * columns.apply(block, start, 1)
            self._count += weight * columns.seen

    def finish_level(self, rows: AxisShift, first: int, light: FloatArray | None = None) -> None:
        """Shift the views of this height, rows of pixels from `first` on, vertically, and add them by their light."""
        if rows.seen.any():
            moved, seen = rows.seen[:, None, None] * rows.apply(self._rows, first, 0), np.outer(rows.seen, self._count)
            self._sum += moved if light is None else light[..., None] * moved
            self._seen += seen if light is None else light * seen

    def light(self, row: int, column: int, light: FloatArray) -> FloatArray:
        """Look up the light of the window's pixels in a view, whose own pixels received `light`."""
        right, down = self._shift[row, column]
        rows = np.arange(self._window.top, self._window.bottom) + down
        columns = np.arange(self._window.left, self._window.right) + right
        return lit_at_nearest(light, rows[:, None], columns[None, :])

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
            light = field.light(row, column)
            if light is not None:
                block = extrapolate_unlit(block, light[first:last, start:stop] > 0.0)
            for picture, columns in zip(sums, column_shifts, strict=True):
                picture.add(weights[row, column], columns, block, start)
            done += 1
            if update is not None:
                update(done, len(used_views))
        for picture, rows in zip(sums, row_shifts, strict=True):
            picture.finish_level(rows, first, None if light is None else picture.light(*places[0], light))
    return [picture.mean() for picture in sums]


def _span(shifts: list[AxisShift], size: int) -> tuple[int, int]:
    """Return the range of the pixels 0 ... size - 1 that any of the shifts reads: first, and one after the last."""
    first = min(max(min(shift.low for shift in shifts), 0), size - 1)
    return first, max(min(max(shift.high for shift in shifts), size), first + 1)


def warp_and_sum(
    field: LightField, plane: FocusPlane, weights: FloatArray, interpolation: Interpolation, window: Window
) -> FloatArray:
    """Focus on a tilted plane: float64 (height, width, 3) of the window."""
    from scipy.ndimage import map_coordinates

    views, order = field.views, 1 if interpolation == "linear" else 3
    x, y = np.meshgrid(np.arange(window.left, window.right), np.arange(window.top, window.bottom))
    right = views.plane.left + views.plane.pixel * (x + 0.5)
    up = views.plane.top - views.plane.pixel * (y + 0.5)
    moved = (views.inverse_focus - plane.middle - plane.right * right - plane.up * up) / views.plane.pixel
    total, seen = np.zeros((*x.shape, 3)), np.zeros(x.shape)
    for row, column in np.argwhere(weights > 0.0):
        place_x = x + views.position[row, column, 0] * moved
        place_y = y - views.position[row, column, 1] * moved
        within = (np.abs(place_x - 0.5 * (views.width - 1)) <= 0.5 * views.width) & (
            np.abs(place_y - 0.5 * (views.height - 1)) <= 0.5 * views.height
        )
        if not within.any():
            continue
        view, _ = lit_view(field, row, column)
        light = field.light(row, column)
        counts = weights[row, column] * within
        if light is not None:
            counts *= lit_at_nearest(light, place_y, place_x)
        for channel in range(3):
            values = map_coordinates(view[..., channel], [place_y, place_x], order=order, mode="nearest")
            total[..., channel] += counts * values
        seen += counts
    return np.divide(total, seen[..., None], out=total, where=seen[..., None] > 0.0)
