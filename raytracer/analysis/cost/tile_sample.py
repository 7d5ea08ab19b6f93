"""Choice of the tiles and samples to measure, since all would take as long as the render that is to be predicted.

A workload is what can be rendered in a given time, and its tiles are drawn at random.  They are those of the full-size
picture, so time per sample, edges and caches are its own.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import TILE_SIZE

Array = NDArray[np.float64]

REPLICATES = 4
"""Independent renders of the scene, from which its error is estimated."""

FIRST_LEVEL_SPP = 16
"""Samples per pixel at which the error is looked at first."""

# Samples of a run, and the number of tiles from which on it is preferred to a run of fewer samples on more tiles: of
# replicates, and of one round of a variant, whose means are kept in memory.
_RUNS = ((4096, 1024), (1024, 256), (256, 16), (64, 8), (16, 2))
_ROUND_RUNS = ((1024, 64), (256, 64), (64, 16), (32, 16), (16, 8), (8, 2))
_MOST_TILES = 192
_MOST_BYTES = 2**30
_BYTES_OF_TILE = 3 * 8 * TILE_SIZE * TILE_SIZE

# Least and most seconds of a round of one variant.
_ROUND_SECONDS = (0.2, 1.0)


class Workload(NamedTuple):
    """Samples of each pixel, and number of tiles."""

    spp: int
    tiles: int


def _plan_workload(
    windows: Sequence[Window], samples: float, runs: Sequence[tuple[int, int]], tiles: int | None
) -> Workload:
    """Divide a number of samples into tiles and samples per pixel: tiles first, then more samples in each.

    Parameters
    ----------
    runs : samples per pixel, falling, each with the number of tiles that it takes.
    tiles : number of tiles, if the user gave it.
    """
    pixels = sum((w.right - w.left) * (w.bottom - w.top) for w in windows) / len(windows)
    for spp, enough in runs:
        affordable = int(samples / (spp * pixels))
        if affordable >= min(enough if tiles is None else tiles, len(windows)):
            break
    return Workload(spp, min(max(affordable, enough) if tiles is None else tiles, len(windows)))


def replicate_workload(windows: Sequence[Window], seconds: float, pace: float, tiles: int | None) -> Workload:
    """Plan a workload that all replicates together render in about so many seconds."""
    return _plan_workload(windows, seconds * pace / REPLICATES, _RUNS, tiles)


def round_workload(windows: Sequence[Window], seconds: float, pace: float, tiles: int | None, turns: int) -> Workload:
    """Plan a workload that one variant renders in about so many seconds, a fraction of one or one.

    turns : number of means that are kept in memory, of all variants in all rounds: the more, the fewer tiles.
    """
    least, most = _ROUND_SECONDS
    most_tiles = max(1, min(_MOST_TILES, _MOST_BYTES // (turns * _BYTES_OF_TILE)))
    tile_count = None if tiles is None else min(tiles, most_tiles)
    size = _plan_workload(windows, min(max(seconds, least), most) * pace, _ROUND_RUNS, tile_count)
    return size._replace(tiles=min(size.tiles, most_tiles))


def sample_levels(spp: int, is_progressive: bool) -> tuple[int, ...]:
    """Choose the samples per pixel at which the error is measured on the way to `spp`.

    Powers of two; powers of four if each level is a render of its own.
    """
    last = spp.bit_length() - 1
    first = min(FIRST_LEVEL_SPP.bit_length() - 1, last - 1)
    return tuple(1 << k for k in range(last, first - 1, -1 if is_progressive else -2))[::-1]


# ---- Drawing of tiles


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
