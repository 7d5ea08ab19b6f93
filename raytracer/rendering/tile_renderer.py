"""Chosen tiles of a picture, rendered by themselves on a warm scene: for measurements and predictions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.sampling import SAMPLERS
from raytracer.film.window import Window
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.compilation import CompiledScene
from raytracer.rendering.film_region import empty_film
from raytracer.rendering.tile_scheduler import TILE_SIZE, now
from raytracer.rendering.worker_pool import WorkerPool


class RenderedTiles(NamedTuple):
    """Some tiles of a picture, T of them.

    mean : float64 (T, TILE, TILE, 3).
    count : int64 (T, TILE, TILE), samples, 0 beyond the edges of a smaller tile.
    rays : int64 (T,), rays traced.
    busy (s) : float64 (T,), time of the thread that rendered the tile.
    seconds (s) : wall-clock time for all tiles.
    nan_samples : samples dropped because they were not finite.
    levels : by a number of samples, the means (T, TILE, TILE, 3) after so many.
    """

    mean: NDArray[np.float64]
    count: NDArray[np.int64]  # type: ignore[assignment]  # takes the place of tuple.count
    rays: NDArray[np.int64]
    busy: NDArray[np.float64]
    seconds: float
    nan_samples: int
    levels: dict[int, NDArray[np.float64]]


def render_tiles(
    prepared: CompiledScene, windows: Sequence[Window], spp: int, seed: int, threads: int, keep: Sequence[int] = ()
) -> RenderedTiles:
    """Render some tiles of a picture; the pixels are those of the whole picture with that seed and spp.

    windows : of at most TILE x TILE pixels each.
    keep : multiples of 8 up to `spp`, numbers of samples after which to keep the means, too.

    Raises
    ------
    KeyboardInterrupt : as soon as the tiles in work are finished.
    """
    scene = prepared.scene._replace(sampler=SAMPLERS[prepared.spec.render.sampler](seed, spp))
    shape = (len(windows), TILE_SIZE, TILE_SIZE)
    mean, m2 = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    count, bad = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    levels = {n: np.zeros((*shape, 3)) for n in keep}
    rays, busy = np.zeros(len(windows), dtype=np.int64), np.zeros(len(windows))

    def work(workspace: Workspace, tile: int) -> None:
        window = windows[tile]
        removed = empty_film(scene, TILE_SIZE, TILE_SIZE).removed
        target = FilmView(mean[tile], m2[tile], count[tile], bad[tile], window.left, window.top, None, removed)
        begin = 0
        for end in sorted({*keep, spp}):
            start = now()
            rays[tile] += render_tile(scene, target, workspace, *window, begin, end)
            busy[tile] += now() - start
            if end in levels:
                levels[end][tile] = mean[tile]
            begin = end

    pool = WorkerPool(threads, scene=scene)
    start = now()
    pool.run(range(len(windows)), work)
    if pool.interrupted:
        raise KeyboardInterrupt
    return RenderedTiles(mean, count, rays, busy, now() - start, int(bad.sum()), levels)
