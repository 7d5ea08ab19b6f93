"""Warming up, and a first look at the whole picture that tells where its noise is."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import Purpose, Subject, seeds
from raytracer.analysis.cost.tile_sample import TileSample, choose_tiles
from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.metric import error_weights, mean_scale, mse_by_tile
from raytracer.film.window import Window

Array = NDArray[np.float64]

# Least duration of the first measurement of the pace (s).
_WARM_SECONDS = 0.25

# Part of the time for the prediction that the pilot may take, and samples per pixel of each of its two pictures.
_PILOT_SHARE = 0.2
_PILOT_SPP = 8

# Tiles are drawn half evenly, half by the pilot's error: a tile that the pilot misjudges counts at most twice as much.
_EVEN_SHARE = 0.5


def warm_up(subject: Subject, windows: Sequence[Window], seed: int) -> float:
    """Measure the samples per second of all threads, once caches are warm.

    Renders ever more of the picture, until its time can be measured.
    """
    rng = np.random.default_rng(seed)
    count, spp = 1, PACKET
    while True:
        tiles = choose_tiles(windows, count, rng)
        patch = subject.render(tiles.windows, spp, seed)
        if patch.busy.sum() >= _WARM_SECONDS * subject.threads:
            return float(tiles.pixels.sum() * spp * subject.threads / patch.busy.sum())
        # Four times the work: more of the picture first, then more samples.
        more = min(4 * count, len(windows))
        count, spp = more, spp * max(1, (4 * count) // more)


class Pilot(NamedTuple):
    """A first look at the whole picture, at few samples.

    tiles : all tiles of the picture.
    mean : (P, 3), means of the pixels.
    scale : mean of the picture.
    squares : (T,), squared error of each tile.
    rays : rays of one sample in every pixel.
    """

    tiles: TileSample
    mean: Array
    scale: float
    squares: Array
    rays: float


def run_pilot(subject: Subject, windows: Sequence[Window], seconds: float, pace: float, seed: int) -> Pilot | None:
    """Render two pictures of a few samples; None if that takes too much of the given seconds."""
    tiles = choose_tiles(windows, len(windows), np.random.default_rng(seed))
    if 2 * _PILOT_SPP * tiles.pixels.sum() / pace > _PILOT_SHARE * seconds:
        return None
    patches = [subject.render(windows, _PILOT_SPP, own) for own in seeds(seed, Purpose.PILOT, 2)]
    pictures = np.stack([tiles.flat(patch.mean) for patch in patches])
    mean = pictures.mean(axis=0)
    scale = mean_scale(mean)
    squares = mse_by_tile(pictures, error_weights(mean, scale), tiles.owner).sums
    return Pilot(tiles, mean, scale, squares, sum(float(patch.rays.sum()) for patch in patches) / (2 * _PILOT_SPP))


def draw_tiles(windows: Sequence[Window], count: int, first_look: Pilot | None, seed: int) -> TileSample:
    """Draw `count` tiles, most where the pilot saw most noise."""
    size = None
    if first_look is not None and (total := float(first_look.squares.sum())) > 0.0:
        size = _EVEN_SHARE / len(windows) + (1.0 - _EVEN_SHARE) * first_look.squares / total
    return choose_tiles(windows, count, np.random.default_rng(seed), size)
