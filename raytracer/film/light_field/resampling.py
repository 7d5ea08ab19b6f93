"""From a picture behind microlenses to views: samples under every microlens, then square pixels.

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

Floats = NDArray[np.float64]

_SLACK = 1e-6
"""Of a raw pixel: what rounding may put a microlens beyond the edge of the picture."""

_LEAST_WEIGHT = 1e-9
"""Below it, relative to the largest, a sum of weights is rounding and not light."""

_HALF = 0.5
"""Of a pixel, by its interpolation's weights: where less is lit, it is a guess."""

_HEXAGONAL_COSINE = 0.25
"""Between those of 60 degrees (0.5) and 90 degrees (0)."""


@dataclass(frozen=True)
class Lattice:
    """Where the middles of the sub-images are: at `origin + c along + r across` for whole c and r.

    Attributes
    ----------
    origin, along, across : right and down, in pixels of the raw picture; `along` leads to the next microlens in a row,
        `across` to one in the next row, for hexagons half way along as well.

    Raises
    ------
    ValueError : numbers are not finite, or both steps lead the same way.
    """

    origin: tuple[float, float]
    along: tuple[float, float]
    across: tuple[float, float]

    def __post_init__(self) -> None:
        numbers = (*self.origin, *self.along, *self.across)
        if not all(map(math.isfinite, numbers)):
            raise ValueError("numbers of a lattice must be finite")
        if not self.area > 0.0:
            raise ValueError("the steps of a lattice must lead to different sides")

    @property
    def area(self) -> float:
        """Of the part of the picture that is one microlens's (square pixels)."""
        return abs(self.along[0] * self.across[1] - self.along[1] * self.across[0])

    @property
    def pitch(self) -> float:
        """Distance (pixels) of neighbours in a row."""
        return math.hypot(*self.along)

    @property
    def rotation(self) -> float:
        """Degrees by which rows are turned against those of pixels, counter-clockwise."""
        return math.degrees(math.atan2(-self.along[1], self.along[0]))

    @property
    def hexagonal(self) -> bool:
        """Whether rows are staggered, and each microlens has six neighbours."""
        dot = self.along[0] * self.across[0] + self.along[1] * self.across[1]
        return abs(dot) > _HEXAGONAL_COSINE * self.pitch * math.hypot(*self.across)

    def place(self, column: Any, row: Any) -> Floats:
        """Middles (..., 2), right and down (pixels)."""
        c, r = np.asarray(column, float)[..., None], np.asarray(row, float)[..., None]
        return np.asarray(self.origin + c * np.asarray(self.along) + r * np.asarray(self.across))

    def index(self, place: Any) -> Floats:
        """Column and row (..., 2), with fractions, of places (..., 2) in the picture (pixels)."""
        steps = np.column_stack([self.along, self.across])
        away = np.asarray(place, float) - self.origin
        return np.asarray(away @ np.linalg.inv(steps).T)

    def near(self, place: tuple[float, float]) -> "Lattice":
        """The same lattice, counted from the microlens nearest to `place` (pixels)."""
        column, row = np.rint(self.index(place))
        # The nearest by index of a lattice that is not square may be a neighbour of the nearest.
        around = np.array([(column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
        middles = self.place(around[:, 0], around[:, 1])
        x, y = middles[int(((middles - place) ** 2).sum(axis=1).argmin())]
        return Lattice((float(x), float(y)), self.along, self.across)


class Seen(NamedTuple):
    """One view: values (height, width) or (height, width, channels), which pixels were seen, and what by.

    A pixel is seen if at least half of what a linear interpolation takes is of microlenses that were lit; others are
    continued from what little there is, or 0.  samples (n,) or (n, channels): under the microlenses, nan where unlit.
    """

    values: Floats
    seen: NDArray[np.bool_]
    samples: Floats


@dataclass(frozen=True)
class Resampler:
    """What turns pictures of one size behind one lattice into views.

    Attributes
    ----------
    lattice : where the sub-images are.
    raw_width, raw_height : pixels of the raw picture.
    count : views in a row and in a column; default: as many whole pixels as a pitch has.
    step : raw pixels from one view to the next.
    pixel : edge of a view's pixel (raw pixels); default: that of a square as large as a microlens's part.

    Microlenses whose samples would lie outside the picture are left out.

    Raises
    ------
    ValueError : fewer than two microlenses a side are whole.
    """

    lattice: Lattice
    raw_width: int
    raw_height: int
    count: int = 0
    step: float = 1.0
    pixel: float = 0.0

    def __post_init__(self) -> None:
        if self.count < 1:
            object.__setattr__(self, "count", max(1, math.floor(self.lattice.pitch + _SLACK)))
        if not self.pixel > 0.0:
            object.__setattr__(self, "pixel", math.sqrt(self.lattice.area))
        if self.width < 2 or self.height < 2 or len(self._rows.first) < 2:
            raise ValueError(
                f"a picture of {self.raw_width} x {self.raw_height} pixels holds fewer than two whole "
                f"microlenses of {self.lattice.pitch:.4g} pixels a side"
            )

    @property
    def margin(self) -> float:
        """How far (raw pixels) a microlens's middle must be from the picture's edge."""
        return 0.5 * (self.count - 1) * self.step + 0.5

    @property
    def first(self) -> tuple[float, float]:
        """Where the top left pixel of the middle view is (raw pixels): on the lattice, if that is as the pixels are."""
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
        """How far from the edges, across and down, all is between microlenses (raw pixels)."""
        along, across = np.asarray(self.lattice.along), np.asarray(self.lattice.across)
        steps = np.abs([along, across])
        # Rows of pixels that are rows of microlenses begin and end with them; others, where all four neighbours are.
        if (np.minimum(steps, np.abs(steps - self.pixel)) < _SLACK).all():
            return self.margin - _SLACK, self.margin - _SLACK
        rest = across - along * (across @ along) / (along @ along)
        right, down = np.abs(along) + np.abs(rest)
        return self.margin + float(right), self.margin + float(down)

    @property
    def middle(self) -> tuple[float, float]:
        """Of the views (raw pixels, right and down)."""
        x, y = self.first
        return x + 0.5 * (self.width - 1) * self.pixel, y + 0.5 * (self.height - 1) * self.pixel

    def offset(self, row: int, column: int) -> tuple[float, float]:
        """Of a view's samples from the middles of sub-images (raw pixels, right and down)."""
        middle = 0.5 * (self.count - 1)
        return (column - middle) * self.step, (row - middle) * self.step

    def view(self, picture: NDArray[Any], row: int, column: int, weight: NDArray[Any] | None = None) -> Floats:
        """One view (height, width[, channels]) of a raw picture (raw_height, raw_width[, channels]); 0 where unseen."""
        return self.weighted(picture, row, column, weight).values

    def weighted(
        self,
        picture: NDArray[Any],
        row: int,
        column: int,
        weight: NDArray[Any] | None = None,
        least: float = _LEAST_WEIGHT,
    ) -> Seen:
        """One view, and which of its pixels were seen.

        Parameters
        ----------
        picture : (raw_height, raw_width) or (raw_height, raw_width, channels).
        weight : (raw_height, raw_width), what each raw pixel counts for, 0 for one that is not to be used; all alike
            by default.
        least : what a sample must count for to be used.
        """
        samples, weights = self._under_microlenses(picture, *self.offset(row, column), weight)
        good = weights >= max(least, _LEAST_WEIGHT)
        flat = samples.reshape(len(samples), -1)
        shape = (self.height, self.width, *samples.shape[1:])
        sharp, soft = self._interpolations
        if good.all():
            return Seen((sharp @ flat).reshape(shape), np.ones(shape[:2], bool), samples)

        # Where a sample is missing, those that are there share its weight, which takes weights that are not negative.
        flat = np.where(good[:, None], flat, 0.0)
        values = sharp @ flat
        hole = self._touches @ (~good).astype(np.float64) > 0.0
        share = soft @ good.astype(np.float64)
        any_seen = share > _LEAST_WEIGHT
        patched = (soft @ flat) / np.where(any_seen, share, 1.0)[:, None]
        values = np.where(hole[:, None], np.where(any_seen[:, None], patched, 0.0), values)
        samples = np.where(good.reshape(-1, *(1,) * (samples.ndim - 1)), samples, np.nan)
        return Seen(values.reshape(shape), (share >= _HALF).reshape(shape[:2]), samples)

    @property
    def is_direct(self) -> bool:
        """Tell if each pixel of a view is a microlens, so that nothing is interpolated between them."""
        return bool(self._touches.nnz == self.width * self.height)

    @property
    def places(self) -> Floats:
        """Places of the microlenses that views are made of (n, 2): right and down, in pixels, from a view's first."""
        return np.asarray((self._rows.middles - np.asarray(self.first)) / self.pixel)

    def prepare(self) -> None:
        """Make what all views need, which is otherwise made with the first."""
        assert self._touches is not None

    # ---- samples under microlenses

    @cached_property
    def _rows(self) -> "_Rows":
        return _rows_within(self.lattice, self.raw_width, self.raw_height, self.margin - _SLACK)

    def _under_microlenses(
        self, picture: NDArray[Any], right: float, down: float, weight: NDArray[Any] | None
    ) -> tuple[Floats, Floats]:
        """Samples (n[, channels]) at an offset from all middles, linear between four pixels, and weights (n,)."""
        height, width = self.raw_height, self.raw_width
        if picture.shape[:2] != (height, width):
            raise ValueError(f"the picture must have {width} x {height} pixels, got {picture.shape[1::-1]}")
        x = np.clip(self._rows.middles[:, 0] + (right - 0.5), 0.0, width - 1.0)
        y = np.clip(self._rows.middles[:, 1] + (down - 0.5), 0.0, height - 1.0)
        # What rounding moves off the middle of a pixel is put back, lest it takes a share of the next.
        x, y = (np.where(np.abs(a - np.rint(a)) < _SLACK, np.rint(a), a) for a in (x, y))
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
        divisor = np.where(weights > _LEAST_WEIGHT, weights, 1.0)
        return total / divisor.reshape(-1, *(1,) * (total.ndim - 1)), weights

    # ---- from the lattice to square pixels

    @cached_property
    def _interpolations(self) -> tuple[Any, Any]:
        """Sparse matrices (pixels, microlenses): a cubic one, linear at the borders, and one that is linear."""
        from scipy.sparse import csr_array, diags_array

        sharp, missing = self._matrix(_cubic, -1, 4)
        soft, _ = self._matrix(_linear, 0, 2)
        at_border = missing.astype(np.float64)
        return csr_array(diags_array(1.0 - at_border) @ sharp + diags_array(at_border) @ soft), soft

    @cached_property
    def _touches(self) -> Any:
        """Sparse matrix that is not 0 where the cubic one is not."""
        return abs(self._interpolations[0])

    def _matrix(self, kernel: Any, start: int, taps: int) -> tuple[Any, NDArray[np.bool_]]:
        """Sparse matrix (pixels, microlenses), and of which pixels microlenses are missing (pixels,)."""
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
        row = _settled(away @ normal / spacing)
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
            c = _settled(column - wanted_row * shear)
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


class _Rows(NamedTuple):
    """Microlenses, row by row.

    top, number of the first row; for each row the column of its first, how many it has, and the place of the first in
    `middles` (n, 2), right and down (raw pixels).
    """

    top: int
    first: NDArray[np.intp]
    number: NDArray[np.intp]
    start: NDArray[np.intp]
    middles: Floats


def _rows_within(lattice: Lattice, width: int, height: int, margin: float) -> _Rows:
    """All microlenses whose middles are at least `margin` from the edges of a picture."""
    box = np.array([(x, y) for x in (margin, width - margin) for y in (margin, height - margin)])
    numbers = lattice.index(box)
    r = np.arange(math.floor(numbers[:, 1].min()), math.ceil(numbers[:, 1].max()) + 1)

    # The part of each row's line that is inside: between its crossings of the edges.
    start = lattice.place(np.zeros(len(r)), r)
    low, high = np.full(len(r), -np.inf), np.full(len(r), np.inf)
    for axis, size in enumerate((width, height)):
        step = lattice.along[axis]
        if abs(step) < _SLACK / max(width, height):
            outside = (start[:, axis] < margin) | (start[:, axis] > size - margin)
            low[outside] = np.inf
            continue
        ends = np.stack([margin - start[:, axis], size - margin - start[:, axis]]) / step
        low, high = np.maximum(low, ends.min(axis=0)), np.minimum(high, ends.max(axis=0))
    there = np.isfinite(low) & np.isfinite(high) & (np.floor(high) >= np.ceil(low))
    if not there.any():
        empty = np.zeros(0, dtype=np.intp)
        return _Rows(0, empty, empty, empty, np.zeros((0, 2)))

    # Rows that have microlenses follow one another.
    inside = np.flatnonzero(there)
    r, low, high = r[inside], np.ceil(low[inside]).astype(np.intp), np.floor(high[inside]).astype(np.intp)
    number = high - low + 1
    offsets = np.concatenate([[0], np.cumsum(number)[:-1]])
    columns = np.arange(number.sum()) - np.repeat(offsets - low, number)
    return _Rows(int(r[0]), low, number, offsets, lattice.place(columns, np.repeat(r, number)))


def _settled(index: Floats) -> Floats:
    """Indices of which those that rounding has moved off whole numbers are whole."""
    whole = np.rint(index)
    return np.where(np.abs(index - whole) < _SLACK, whole, index)


def _linear(t: Floats) -> tuple[Floats, ...]:
    """Weights of the two neighbours of a place, `t` after the first."""
    return 1.0 - t, t


def _cubic(t: Floats) -> tuple[Floats, ...]:
    """Weights of the four neighbours of a place, `t` after the second.

    Exact for polynomials of the second degree (Keys 1981, "Cubic Convolution Interpolation for Digital Image
    Processing", eq. 15).
    """
    return (
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    )
