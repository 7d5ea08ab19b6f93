"""Resampling of a picture behind microlenses to views: samples under every microlens, then square pixels.

Coordinates of the raw picture are in its pixels, right and down from its top left corner: the pixel in row i and column
j covers j to j + 1 and i to i + 1, and its middle is at j + 0.5, i + 0.5.  The picture is stored upright, which is the
sensor turned by 180 degrees, so that what is to the right of a sub-image's middle came through the right of the lens.

A view is what was recorded at one offset from the middle of every sub-image (Ng et al. 2005, "Light Field Photography
with a Hand-held Plenoptic Camera", sec. 3.1).  Offsets and views are in the axes of the sensor: that the microlenses
are turned against it, or lie on hexagons, is undone by an interpolation along rows of microlenses and then from row to
row (Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic Cameras",
sec. 3, resample hexagonal pictures in the same order).
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import SLACK, Lattice, LatticeRows, rows_within

FloatArray = NDArray[np.float64]

_MIN_WEIGHT = 1e-9
"""Below it, relative to the largest, a sum of weights is rounding and not light."""

_HALF = 0.5
"""Of a pixel, by its interpolation's weights: where less is lit, it is a guess."""


class ResampledView(NamedTuple):
    """One view.

    values : (height, width) or (height, width, channels).
    seen : bool (height, width), pixels with at least half of the weight of a linear interpolation on lit microlenses;
        others are extrapolated from the rest, or 0.
    samples : (n,) or (n, channels), under the microlenses, NaN where unlit.
    """

    values: FloatArray
    seen: NDArray[np.bool_]
    samples: FloatArray


@dataclass(frozen=True)
class Resampler:
    """Resampling of pictures of one size behind one lattice to views.

    lattice : of the sub-images.
    raw_width, raw_height (px) : of the raw picture.
    count : views in a row and in a column; default: the whole pixels of a pitch.

    Microlenses whose samples would lie outside the picture are left out.

    Raises ValueError: fewer than two microlenses a side are whole.
    """

    lattice: Lattice
    raw_width: int
    raw_height: int
    count: int = 0

    def __post_init__(self) -> None:
        if self.count < 1:
            object.__setattr__(self, "count", max(1, math.floor(self.lattice.pitch + SLACK)))
        if self.width < 2 or self.height < 2 or len(self._rows.first) < 2:
            raise ValueError(
                f"a picture of {self.raw_width} x {self.raw_height} pixels holds fewer than two whole "
                f"microlenses of {self.lattice.pitch:.4g} pixels a side"
            )

    @property
    def pixel(self) -> float:
        """Size of a view's pixel (raw px): of a square as large as a cell of the lattice."""
        return math.sqrt(self.lattice.area)

    @property
    def margin(self) -> float:
        """Smallest distance (raw px) of a microlens's middle from the picture's edge."""
        return 0.5 * self.count

    @property
    def first(self) -> tuple[float, float]:
        """Place of the top left pixel of the middle view (raw px): on the lattice, if pixels are spaced as it is."""
        x, y = self.lattice.origin
        right, down = self._inside
        return (
            x + self.pixel * math.ceil((right - x) / self.pixel),
            y + self.pixel * math.ceil((down - y) / self.pixel),
        )

    @property
    def width(self) -> int:
        """Pixels of a view."""
        return 1 + math.floor((self.raw_width - self._inside[0] - self.first[0]) / self.pixel)

    @property
    def height(self) -> int:
        """Pixels of a view."""
        return 1 + math.floor((self.raw_height - self._inside[1] - self.first[1]) / self.pixel)

    @property
    def _inside(self) -> tuple[float, float]:
        """Distance from the edges, across and down, from which on all places are between microlenses (raw px)."""
        along, across = np.asarray(self.lattice.along), np.asarray(self.lattice.across)
        steps = np.abs([along, across])
        # Rows of pixels that are rows of microlenses begin and end with them; others, where all four neighbours are.
        if (np.minimum(steps, np.abs(steps - self.pixel)) < SLACK).all():
            return self.margin - SLACK, self.margin - SLACK
        rest = across - along * (across @ along) / (along @ along)
        right, down = np.abs(along) + np.abs(rest)
        return self.margin + float(right), self.margin + float(down)

    @property
    def middle(self) -> tuple[float, float]:
        """Middle of the views (raw px), right and down."""
        x, y = self.first
        return x + 0.5 * (self.width - 1) * self.pixel, y + 0.5 * (self.height - 1) * self.pixel

    def offset(self, row: int, column: int) -> tuple[float, float]:
        """Compute the offset of a view's samples from the middles of sub-images (raw px), right and down."""
        middle = 0.5 * (self.count - 1)
        return column - middle, row - middle

    def view(self, picture: NDArray[Any], row: int, column: int, weight: NDArray[Any] | None = None) -> FloatArray:
        """Resample one view (height, width[, channels]) of a raw picture; 0 where unseen."""
        return self.weighted(picture, row, column, weight).values

    def weighted(
        self,
        picture: NDArray[Any],
        row: int,
        column: int,
        weight: NDArray[Any] | None = None,
        least: float = _MIN_WEIGHT,
    ) -> ResampledView:
        """Resample one view, and tell which of its pixels were seen.

        picture : (raw_height, raw_width) or (raw_height, raw_width, channels).
        weight : (raw_height, raw_width), of each raw pixel, 0 for one that is not used; equal by default.
        least : smallest weight of a sample that is used.
        """
        samples, weights = self._under_microlenses(picture, *self.offset(row, column), weight)
        good = weights >= max(least, _MIN_WEIGHT)
        flat = samples.reshape(len(samples), -1)
        shape = (self.height, self.width, *samples.shape[1:])
        sharp, soft = self._interpolations
        if good.all():
            return ResampledView((sharp @ flat).reshape(shape), np.ones(shape[:2], bool), samples)

        # Where a sample is missing, those that are there share its weight, which takes weights that are not negative.
        flat = np.where(good[:, None], flat, 0.0)
        values = sharp @ flat
        hole = self._touches @ (~good).astype(np.float64) > 0.0
        share = soft @ good.astype(np.float64)
        any_seen = share > _MIN_WEIGHT
        patched = (soft @ flat) / np.where(any_seen, share, 1.0)[:, None]
        values = np.where(hole[:, None], np.where(any_seen[:, None], patched, 0.0), values)
        samples = np.where(good.reshape(-1, *(1,) * (samples.ndim - 1)), samples, np.nan)
        return ResampledView(values.reshape(shape), (share >= _HALF).reshape(shape[:2]), samples)

    @property
    def is_direct(self) -> bool:
        """Tell if each pixel of a view is a microlens, so that nothing is interpolated between them."""
        return bool(self._touches.nnz == self.width * self.height)

    @property
    def places(self) -> FloatArray:
        """Places (n, 2) of the microlenses that views are made of: right and down, in pixels, from a view's first."""
        return np.asarray((self._rows.middles - np.asarray(self.first)) / self.pixel)

    # ---- samples under microlenses

    @cached_property
    def _rows(self) -> "LatticeRows":
        return rows_within(self.lattice, self.raw_width, self.raw_height, self.margin - SLACK)

    def _under_microlenses(
        self, picture: NDArray[Any], right: float, down: float, weight: NDArray[Any] | None
    ) -> tuple[FloatArray, FloatArray]:
        """Sample at an offset from all middles, bilinearly: values (n[, channels]), and weights (n,)."""
        height, width = self.raw_height, self.raw_width
        if picture.shape[:2] != (height, width):
            raise ValueError(f"the picture must have {width} x {height} pixels, got {picture.shape[1::-1]}")
        x = np.clip(self._rows.middles[:, 0] + (right - 0.5), 0.0, width - 1.0)
        y = np.clip(self._rows.middles[:, 1] + (down - 0.5), 0.0, height - 1.0)
        # Places that rounding has moved off the middle of a pixel are moved back, so that the next has no share.
        x, y = (np.where(np.abs(a - np.rint(a)) < SLACK, np.rint(a), a) for a in (x, y))
        left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        tx, ty = x - left, y - top
        right_of, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)

        flat = picture.reshape(height * width, *picture.shape[2:])
        flat_weight = None if weight is None else weight.reshape(-1)
        total = np.zeros((len(x), *flat.shape[1:]))
        weights = np.zeros(len(x))
        for rows, columns, share in (
            (top, left, (1.0 - ty) * (1.0 - tx)),
            (top, right_of, (1.0 - ty) * tx),
            (below, left, ty * (1.0 - tx)),
            (below, right_of, ty * tx),
        ):
            place = rows * width + columns
            counts = share if flat_weight is None else share * flat_weight[place]
            weights += counts
            values = flat[place]
            total += values * counts.reshape(-1, *(1,) * (values.ndim - 1))
        divisor = np.where(weights > _MIN_WEIGHT, weights, 1.0)
        return total / divisor.reshape(-1, *(1,) * (total.ndim - 1)), weights

    # ---- from the lattice to square pixels

    @cached_property
    def _interpolations(self) -> tuple[Any, Any]:
        """Sparse matrices (pixels, microlenses): a cubic interpolation, linear at the borders, and a linear one."""
        from scipy.sparse import csr_array, diags_array

        sharp, missing = self._matrix(_cubic, -1, 4)
        soft, _ = self._matrix(_linear, 0, 2)
        at_border = missing.astype(np.float64)
        return csr_array(diags_array(1.0 - at_border) @ sharp + diags_array(at_border) @ soft), soft

    @cached_property
    def _touches(self) -> Any:
        """Absolute values of the cubic matrix."""
        return abs(self._interpolations[0])

    def _matrix(self, kernel: Any, start: int, taps: int) -> tuple[Any, NDArray[np.bool_]]:
        """Build a sparse matrix (pixels, microlenses); also return which pixels lack a microlens (pixels,)."""
        from scipy.sparse import csr_array

        rows = self._rows
        along, across = np.asarray(self.lattice.along), np.asarray(self.lattice.across)
        first = self.first
        x = first[0] + self.pixel * np.arange(self.width)
        y = first[1] + self.pixel * np.arange(self.height)
        away = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) - self.lattice.origin

        # Rows of microlenses are lines; between them one goes straight across, at right angles to them.
        unit = along / self.lattice.pitch
        normal = np.array([-unit[1], unit[0]])
        spacing = float(across @ normal)
        row = _snap_to_integers(away @ normal / spacing)
        column = away @ unit / self.lattice.pitch
        shear = float(across @ unit) / self.lattice.pitch

        below = np.floor(row).astype(np.intp)
        row_weights = kernel(row - below)
        pixels, microlenses, weights = [], [], []
        number = np.arange(len(away))
        missing = np.zeros(len(away), bool)
        for i in range(taps):
            wanted_row = below + (start + i)
            r = np.clip(wanted_row - rows.top, 0, len(rows.first) - 1)
            c = _snap_to_integers(column - wanted_row * shear)
            left = np.floor(c).astype(np.intp)
            column_weights = kernel(c - left)
            for j in range(taps):
                wanted = left + (start + j) - rows.first[r]
                at = np.clip(wanted, 0, rows.number[r] - 1)
                weight = row_weights[i] * column_weights[j]
                used = weight != 0.0
                missing |= used & ((at != wanted) | (r + rows.top != wanted_row))
                pixels.append(number[used])
                microlenses.append((rows.start[r] + at)[used])
                weights.append(weight[used])
        entries = (np.concatenate(weights), (np.concatenate(pixels), np.concatenate(microlenses)))
        return csr_array(entries, shape=(len(away), len(rows.middles))), missing


def _snap_to_integers(index: FloatArray) -> FloatArray:
    """Round indices that are within rounding errors of integers."""
    whole = np.rint(index)
    return np.where(np.abs(index - whole) < SLACK, whole, index)


def _linear(t: FloatArray) -> tuple[FloatArray, ...]:
    """Compute the linear weights of the two neighbours of a place, `t` after the first."""
    return 1.0 - t, t


def _cubic(t: FloatArray) -> tuple[FloatArray, ...]:
    """Compute the cubic weights of the four neighbours of a place, `t` after the second.

    Exact for polynomials of the second degree (Keys 1981, "Cubic Convolution Interpolation for Digital Image
    Processing", eq. 15).
    """
    return (
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    )
