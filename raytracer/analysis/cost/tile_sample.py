"""Random sampling of tiles to measure, since all would take as long as the render that is to be predicted.

Tiles are those of the full-size picture, so time per sample, edges and caches are its own.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import TILE_SIZE

Array = NDArray[np.float64]


class TileSample(NamedTuple):
    """T tiles of a picture, with P pixels.

    windows : the tiles.
    weight : float64 (T,), number of tiles of the picture that each stands for: one over the probability of drawing it.
    inside : bool (T, 16, 16), True for a pixel of the tile that lies within the film.
    """

    windows: tuple[Window, ...]
    weight: Array
    inside: NDArray[np.bool_]

    @classmethod
    def of(cls, windows: Sequence[Window], weight: ArrayLike) -> "TileSample":
        """Make a sample of tiles with their weights."""
        right, bottom = (np.array([[w.right - w.left, w.bottom - w.top] for w in windows]).T)[:, :, None, None]
        rows, columns = np.mgrid[:TILE_SIZE, :TILE_SIZE]
        return cls(tuple(windows), np.asarray(weight, dtype=np.float64), (columns < right) & (rows < bottom))

    @property
    def owner(self) -> NDArray[np.int64]:
        """Index of the tile of each pixel: (P,)."""
        return np.asarray(np.nonzero(self.inside)[0])

    @property
    def pixels(self) -> NDArray[np.int64]:
        """Number of pixels of each tile: (T,)."""
        return np.asarray(self.inside.sum(axis=(1, 2)))

    def flat(self, values: Array) -> Array:
        """Return the pixels' values (P, ...) of an array (T, 16, 16, ...)."""
        return values[self.inside]

    def spread(self, values: Array, onto: Array) -> None:
        """Write values of pixels (P, ...) into a picture (height, width, ...)."""
        end = np.cumsum(self.pixels)
        for window, part in zip(self.windows, np.split(values, end[:-1]), strict=True):
            rows, columns = window.bottom - window.top, window.right - window.left
            onto[window.top : window.bottom, window.left : window.right] = part.reshape(rows, columns, *onto.shape[2:])


def morton_order(windows: Sequence[Window]) -> NDArray[np.int64]:
    """Order tiles along a Morton curve, on which neighbours are near each other in the picture.

    References: Morton 1966, "A Computer Oriented Geodetic Data Base and a New Technique in File Sequencing".
    """
    code = np.zeros(len(windows), dtype=np.int64)
    for axis, edge in enumerate(np.array([(w.left, w.top) for w in windows]).T // TILE_SIZE):
        for bit in range(20):
            code |= ((edge >> bit) & 1) << (2 * bit + axis)
    return np.argsort(code, kind="stable")


def inclusion_probabilities(size: ArrayLike, count: int) -> Array:
    """Compute probabilities in proportion to `size` (all > 0), at most 1, that add up to `count` (at most as many)."""
    size = np.asarray(size, dtype=np.float64)
    sure = np.zeros(size.shape, dtype=bool)
    while True:
        rest = size[~sure].sum()
        probability = np.where(sure, 1.0, size * ((count - sure.sum()) / rest if rest else 0.0))
        above = ~sure & (probability >= 1.0)
        if not above.any():
            return probability
        sure |= above


def choose_tiles(
    windows: Sequence[Window], count: int, rng: np.random.Generator, size: ArrayLike | None = None
) -> TileSample:
    """Draw a systematic sample of tiles along a curve through the picture: random, but evenly spread.

    Parameters
    ----------
    count : number of tiles; all if there are no more.
    size : (tiles,) > 0, in proportion to which tiles are drawn; evenly if None.

    References: Madow 1949, "On the Theory of Systematic Sampling, II", Annals of Mathematical Statistics 20(3).
    """
    if count >= len(windows):
        return TileSample.of(windows, np.ones(len(windows)))
    probability = inclusion_probabilities(np.ones(len(windows)) if size is None else size, count)
    drawn = _draw_systematic(windows, count, rng, probability)
    return TileSample.of([windows[tile] for tile in drawn], 1.0 / probability[drawn])


def choose_subset(tiles: TileSample, count: int, rng: np.random.Generator) -> tuple[TileSample, NDArray[np.bool_]]:
    """Draw an even sample of tiles that have been drawn, and mark which of their pixels (P,) are in it."""
    whole = len(tiles.windows)
    if count >= whole:
        return tiles, np.ones(len(tiles.owner), dtype=bool)
    drawn = _draw_systematic(tiles.windows, count, rng, np.full(whole, count / whole))
    weight = tiles.weight[drawn] * (whole / count)
    return TileSample.of([tiles.windows[tile] for tile in drawn], weight), np.isin(tiles.owner, drawn)


def _draw_systematic(
    windows: Sequence[Window], count: int, rng: np.random.Generator, probability: Array
) -> NDArray[np.int64]:
    """Draw `count` rising indices of windows, each with its probability."""
    order = morton_order(windows)
    along = np.concatenate([[0.0], np.cumsum(probability[order])])
    # The sum of probabilities is an integer but for rounding.
    steps = np.floor(along * (count / along[-1]) + rng.random())
    return np.sort(order[np.diff(steps) > 0.0])
