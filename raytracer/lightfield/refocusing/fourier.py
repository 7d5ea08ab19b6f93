"""Refocusing by Fourier slices: a light field is transformed once, and each photograph is a slice of its spectrum.

The spectrum of the photograph focused at 1 / w is that of the light field on a plane through the origin: at the
frequency k of the picture, and at k times the shift from view to view in the direction of the views.  What lies there
between the frequencies of a discrete transform is interpolated by a Kaiser-Bessel kernel, over a spectrum that is finer
than the views call for, and the views are weighted beforehand by one over the kernel's own transform.

References: Ng 2005, "Fourier Slice Photography", sec. 4 and 5; Fessler, Sutton 2003, "Nonuniform Fast Fourier
Transforms Using Min-Max Interpolation"; Beatty, Nishimura, Pauly 2005, "Rapid Gridding Reconstruction With a Minimal
Oversampling Ratio", eq. 5 (the kernel's shape).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.focusing import refocusable
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import lit_view
from raytracer.lightfield.memory import require_memory
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.util.errors import InputError

# Frequencies that the kernel reads along each axis of the views, and the oversampling of these.  The error is
# then 7e-4 of the picture at most: exp(-4 pi sqrt(1 - 1 / 1.5)).
_KERNEL, _OVERSAMPLING = 4, 1.5

# Largest distance of views from a regular grid, of the step between them.
_OFF_GRID = 1e-6

# Pixels beyond the largest shift, so that nothing that matters wraps around.
_MARGIN = 4

# Rows of the spectrum that are transformed along the views at once: some 10 MB.
_ROWS_AT_ONCE = 16

# Default range of focus, as a multiple of that for which the views are close enough together.
_BEYOND = 2.0

_Spectrum = NDArray[np.complex64]


class FourierRefocuser:
    """Spectrum of a light field, ready to be focused anywhere within a range.

    It is kept in single precision, whose rounding is a thousandth of the kernel's error: 8 bytes for each of three
    channels, some 2.5 times the views, and half of the frequencies, 0.7 GB for 9 x 9 views of 512 x 384 pixels.

    Views are mirrored at their borders.  So nearer to the border of the picture than a view is shifted, it differs from
    that of shift-and-sum, which takes only the views that see there.

    Parameters
    ----------
    field : a light field whose views are on a regular grid.
    inverses : one over the distances (1/m) that it may be focused at, at least the least and the greatest; by default
        twice what `focusing.refocusable` gives, to both sides.
    weights : of the views, (rows, columns); default: `cell_weights`.

    Raises
    ------
    InputError : the views are not on a grid along their rows and columns, or their spectrum takes more memory than
        `lightfield.memory.memory_limit` gives.
    """

    def __init__(
        self, field: LightField, inverses: Sequence[float] | None = None, weights: NDArray[np.float64] | None = None
    ) -> None:
        from scipy import fft

        views = field.views
        self._views, self._steps = views, _grid_steps(views)
        weights = cell_weights(views) if weights is None else weights
        weights = weights / weights.sum()
        self._least, self._most = _focus_range(views, inverses)

        # Views wrap around at the ends of the transform, so pad them by the largest shift.
        shifts = np.abs([views.shift(inverse) for inverse in (self._least, self._most)])
        shifts = np.where(weights[..., None] > 0.0, shifts, 0.0)
        self._pad = (math.ceil(shifts[..., 1].max()) + _MARGIN, math.ceil(shifts[..., 0].max()) + _MARGIN)
        height, width = (size + 2 * pad for size, pad in zip((views.height, views.width), self._pad, strict=True))
        self._size = (fft.next_fast_len(height, real=True), fft.next_fast_len(width, real=True))
        self._axes = (_Axis(views.rows), _Axis(views.columns))

        frequencies = self._size[0] * (self._size[1] // 2 + 1)
        grids = views.rows * views.columns + self._axes[0].size * self._axes[1].size
        size = 3 * frequencies * grids * np.dtype(np.complex64).itemsize
        require_memory(size, "the spectrum of the views", "the method shift takes less")

        # Transform each view, then all of them along the grid.
        parts = self._size[1] // 2 + 1
        spectra = np.zeros((3, views.rows, views.columns, self._size[0], parts), np.complex64)
        for row, column in np.argwhere(weights > 0.0):
            view = lit_view(field, int(row), int(column))[0].astype(np.float32)
            pad = [(pad, size - pad - old) for pad, size, old in zip(self._pad, self._size, view.shape, strict=False)]
            padded = np.pad(np.moveaxis(view, 2, 0), [(0, 0), *pad], mode="symmetric")
            share = weights[row, column] * self._axes[0].deapodization[row] * self._axes[1].deapodization[column]
            spectra[:, row, column] = np.float32(share) * fft.rfft2(padded)
        down, across = (axis.size for axis in self._axes)
        self._spectrum: _Spectrum = np.empty((3, self._size[0], down, across, parts), np.complex64)
        for first in range(0, self._size[0], _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            block = spectra[:, :, :, rows]
            transformed = fft.ifft2(block, (down, across), axes=(1, 2), norm="forward")
            self._spectrum[:, rows] = np.moveaxis(transformed, 3, 1)

    def picture(self, inverse: float) -> NDArray[np.float64]:
        """Focus at one over `inverse` (1/m), within the range that this was made for: float64 (height, width, 3)."""
        from scipy import fft

        if not self._least <= inverse <= self._most:
            planes = f"1/{self._most:g} to 1/{self._least:g} m"
            raise InputError(f"made for planes of focus from {planes}, got 1/{inverse:g}")
        views = self._views
        step = (self._views.inverse_focus - inverse) / views.plane.pixel
        along = fft.rfftfreq(self._size[1]), fft.fftfreq(self._size[0])
        (first, across), (top, down) = self._steps
        taps_x, weights_x = self._axes[1].kernel(step * across * along[0])
        taps_y, weights_y = self._axes[0].kernel(-step * down * along[1])

        # Interpolate along the rows of views, then along the columns.
        parts = np.arange(len(along[0]))
        sliced = np.zeros((3, *self._size[:1], len(parts)), np.complex64)
        for row, (taps, weights) in enumerate(zip(taps_y, weights_y, strict=True)):
            mixed = np.einsum("j,cjup->cup", weights, self._spectrum[:, row, taps])
            sliced[:, row] = sum(weights_x[:, i] * mixed[:, taps_x[:, i], parts] for i in range(_KERNEL))

        # Shift by that of the view in the middle of the grid, and cut the borders off.
        turn_x = np.exp(2j * np.pi * step * (first + across * self._axes[1].middle) * along[0])
        turn_y = np.exp(-2j * np.pi * step * (top + down * self._axes[0].middle) * along[1])
        whole = fft.irfft2(sliced * (turn_y[:, None] * turn_x).astype(np.complex64), self._size)
        (above, left), height, width = self._pad, views.height, views.width
        part = whole[:, above : above + height, left : left + width]
        return np.asarray(np.moveaxis(part, 0, 2), dtype=np.float64)


class _Axis:
    """One axis of the views, transformed: the kernel by which its spectrum is interpolated.

    size : number of frequencies.
    middle : the view that shifts are counted from.
    deapodization : (views,), weights of the views, one over the kernel's transform.
    """

    def __init__(self, views: int) -> None:
        from scipy import fft

        self.size = max(fft.next_fast_len(math.ceil(_OVERSAMPLING * views)), _KERNEL)
        self.middle = views // 2
        finer = self.size / views
        self._shape = math.pi * math.sqrt(max(0.0, (_KERNEL / finer * (finer - 0.5)) ** 2 - 0.8))
        away = (np.arange(views) - self.middle) / self.size
        root = np.sqrt(self._shape**2 - (math.pi * _KERNEL * away) ** 2)
        self.deapodization = root / (_KERNEL * np.sinh(root))

    def kernel(self, frequency: NDArray[np.float64]) -> tuple[NDArray[np.int64], _Spectrum]:
        """Compute the indices (n, 4) into the spectrum and their weights (n, 4), for frequencies (n,) in 1/view."""
        place = self.size * frequency
        first = np.ceil(place - 0.5 * _KERNEL).astype(np.int64)
        taps = first[:, None] + np.arange(_KERNEL)
        away = np.clip(2.0 * (place[:, None] - taps) / _KERNEL, -1.0, 1.0)
        weights = np.i0(self._shape * np.sqrt(1.0 - away**2))
        # Frequencies count from the view in the middle.
        turn = np.exp(-2j * np.pi * self.middle * taps / self.size)
        return taps % self.size, (weights * turn).astype(np.complex64)


def _grid_steps(views: Views) -> tuple[tuple[float, float], tuple[float, float]]:
    """Measure the grid of the views: first column and step to the next, first row and step down to the next (m)."""
    position = views.position
    columns, rows = position[..., 0].mean(axis=0), position[..., 1].mean(axis=1)
    (across, first), (down, top) = (
        np.polyfit(np.arange(len(places)), places, 1) if len(places) > 1 else (0.0, float(places[0]))
        for places in (columns, rows)
    )
    off = position - np.stack(
        np.meshgrid(first + across * np.arange(views.columns), top + down * np.arange(views.rows)), axis=-1
    )
    if np.abs(off).max() > _OFF_GRID * max(abs(across), abs(down)):
        raise InputError("views that are not on a regular grid have no slices: refocus by shift")
    return (float(first), float(across)), (float(top), float(down))


def _focus_range(views: Views, inverses: Sequence[float] | None) -> tuple[float, float]:
    """Return the least and the greatest of one over the distances (1/m)."""
    if inverses is not None:
        return min(inverses), max(inverses)
    near = refocusable(views)[0]
    reach = _BEYOND * (1.0 / near - views.inverse_focus)
    return views.inverse_focus - reach, views.inverse_focus + reach
