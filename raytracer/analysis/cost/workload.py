"""Planning of how many tiles and samples are rendered in a given time."""

from collections.abc import Sequence
from typing import NamedTuple

from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import TILE_SIZE

REPLICATES = 4
"""Independent renders of the scene, from which its error is estimated."""

# Samples of a run, and the number of tiles from which on it is preferred to a run of fewer samples on more tiles.
_RUNS = ((4096, 1024), (1024, 256), (256, 16), (64, 8), (16, 2))

FIRST_LEVEL_SPP = 16
"""Samples per pixel at which the error is looked at first."""

# The same for one round of a variant, whose means are kept in memory.
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


def plan_workload(
    windows: Sequence[Window],
    samples: float,
    runs: Sequence[tuple[int, int]],
    tiles: int | None = None,
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
    return plan_workload(windows, seconds * pace / REPLICATES, _RUNS, tiles)


def round_workload(windows: Sequence[Window], seconds: float, pace: float, tiles: int | None, turns: int) -> Workload:
    """Plan a workload that one variant renders in about so many seconds, a fraction of one or one.

    turns : number of means that are kept in memory, of all variants in all rounds: the more, the fewer tiles.
    """
    least, most = _ROUND_SECONDS
    most_tiles = max(1, min(_MOST_TILES, _MOST_BYTES // (turns * _BYTES_OF_TILE)))
    tile_count = None if tiles is None else min(tiles, most_tiles)
    size = plan_workload(windows, min(max(seconds, least), most) * pace, _ROUND_RUNS, tile_count)
    return size._replace(tiles=min(size.tiles, most_tiles))


def sample_levels(spp: int, is_progressive: bool) -> tuple[int, ...]:
    """Choose the samples per pixel at which the error is measured on the way to `spp`.

    Powers of two; powers of four if each level is a render of its own.
    """
    last = spp.bit_length() - 1
    first = min(FIRST_LEVEL_SPP.bit_length() - 1, last - 1)
    return tuple(1 << k for k in range(last, first - 1, -1 if is_progressive else -2))[::-1]
