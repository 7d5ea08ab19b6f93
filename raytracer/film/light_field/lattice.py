"""The lattice on which microlenses stand, in pixels of the raw picture."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SLACK = 1e-6
"""Tolerance (raw pixels) for a microlens that rounding has put beyond the edge of the picture."""

_HEXAGONAL_COSINE = 0.25
"""A cosine between those of 60 degrees (0.5) and 90 degrees (0), which tells hexagons from squares."""


@dataclass(frozen=True)
class Lattice:
    """Lattice of the middles of the sub-images: `origin + c along + r across` for integers c and r.

    Vectors are right and down, in pixels of the raw picture.

    origin (px) : the middle of one sub-image.
    along (px) : step to the next microlens in a row.
    across (px) : step to a microlens in the next row, for hexagons half way along as well.

    Raises ValueError: numbers are not finite, or both steps lead the same way.
    """

    origin: tuple[float, float]
    along: tuple[float, float]
    across: tuple[float, float]

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.origin, *self.along, *self.across))):
            raise ValueError("numbers of a lattice must be finite")
        if not self.area > 0.0:
            raise ValueError("the steps of a lattice must lead to different sides")

    @property
    def area(self) -> float:
        """Area of the part of the picture that belongs to one microlens (px2)."""
        return abs(self.along[0] * self.across[1] - self.along[1] * self.across[0])

    @property
    def pitch(self) -> float:
        """Distance of neighbours in a row (px)."""
        return math.hypot(*self.along)

    @property
    def rotation(self) -> float:
        """Angle of the rows against those of pixels (deg), counter-clockwise."""
        return math.degrees(math.atan2(-self.along[1], self.along[0]))

    @property
    def hexagonal(self) -> bool:
        """Return True if rows are staggered, so that each microlens has six neighbours."""
        dot = self.along[0] * self.across[0] + self.along[1] * self.across[1]
        return abs(dot) > _HEXAGONAL_COSINE * self.pitch * math.hypot(*self.across)

    def place(self, column: Any, row: Any) -> FloatArray:
        """Find the middles (..., 2), right and down (px), of microlenses by column and row."""
        c, r = np.asarray(column, float)[..., None], np.asarray(row, float)[..., None]
        return np.asarray(self.origin + c * np.asarray(self.along) + r * np.asarray(self.across))

    def index(self, place: Any) -> FloatArray:
        """Find column and row (..., 2), with fractions, of places (..., 2) in the picture (px)."""
        steps = np.column_stack([self.along, self.across])
        away = np.asarray(place, float) - self.origin
        return np.asarray(away @ np.linalg.inv(steps).T)

    def near(self, place: tuple[float, float]) -> "Lattice":
        """Return the same lattice, counted from the microlens nearest to `place` (px)."""
        column, row = np.rint(self.index(place))
        # The nearest by index of a lattice that is not square may be a neighbour of the nearest.
        around = np.array([(column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
        middles = self.place(around[:, 0], around[:, 1])
        x, y = middles[int(((middles - place) ** 2).sum(axis=1).argmin())]
        return Lattice((float(x), float(y)), self.along, self.across)


class LatticeRows(NamedTuple):
    """Microlenses, row by row.

    top : number of the first row.
    first : int (rows,), column of each row's first microlens.
    number : int (rows,), microlenses of each row.
    start : int (rows,), index of each row's first in `middles`.
    middles (px) : float64 (n, 2), right and down in the raw picture.
    """

    top: int
    first: NDArray[np.intp]
    number: NDArray[np.intp]
    start: NDArray[np.intp]
    middles: FloatArray


def rows_within(lattice: Lattice, width: int, height: int, margin: float) -> LatticeRows:
    """List all microlenses whose middles are at least `margin` (px) from the edges of a picture."""
    box = np.array([(x, y) for x in (margin, width - margin) for y in (margin, height - margin)])
    numbers = lattice.index(box)
    r = np.arange(math.floor(numbers[:, 1].min()), math.ceil(numbers[:, 1].max()) + 1)

    # The part of each row's line that is inside: between its crossings of the edges.
    start = lattice.place(np.zeros(len(r)), r)
    low, high = np.full(len(r), -np.inf), np.full(len(r), np.inf)
    for axis, size in enumerate((width, height)):
        step = lattice.along[axis]
        if abs(step) < SLACK / max(width, height):
            outside = (start[:, axis] < margin) | (start[:, axis] > size - margin)
            low[outside] = np.inf
            continue
        ends = np.stack([margin - start[:, axis], size - margin - start[:, axis]]) / step
        low, high = np.maximum(low, ends.min(axis=0)), np.minimum(high, ends.max(axis=0))
    there = np.isfinite(low) & np.isfinite(high) & (np.floor(high) >= np.ceil(low))
    if not there.any():
        empty = np.zeros(0, dtype=np.intp)
        return LatticeRows(0, empty, empty, empty, np.zeros((0, 2)))

    # Rows that have microlenses follow one another.
    inside = np.flatnonzero(there)
    r, low, high = r[inside], np.ceil(low[inside]).astype(np.intp), np.floor(high[inside]).astype(np.intp)
    number = high - low + 1
    offsets = np.concatenate([[0], np.cumsum(number)[:-1]])
    columns = np.arange(number.sum()) - np.repeat(offsets - low, number)
    return LatticeRows(int(r[0]), low, number, offsets, lattice.place(columns, np.repeat(r, number)))
