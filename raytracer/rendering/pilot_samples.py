"""Take pilot samples, which measure the noise and the rays of each tile and are then thrown away."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.error_estimate import ErrorEstimator
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.tile_job import TileJob, TileResult, split_by_tile
from raytracer.rendering.tile_scheduler import TileQueue


class PilotSetup(NamedTuple):
    """The means to take pilot samples, which are thrown away.

    scene : returns the scene with a sampler for a seed and spp.
    scratch : makes a film of one tile, of the same type as the picture's.
    estimator : makes an empty error estimator for the picture's tiles.
    seed : the picture's, which is below 2^32.
    """

    scene: Callable[[int, int], Scene]
    scratch: Callable[[], FilmView]
    estimator: Callable[[], ErrorEstimator]
    seed: int


def pilot_seed(seed: int, number: int) -> int:
    """Return the seed of pilot 1, 2, ...: none that a picture has, whose seeds are below 2^32."""
    return seed + (number << 32)


def take_pilot_samples(
    queue: TileQueue, pilots: PilotSetup, number: int, spp: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Render pilot samples of every pixel, which are not added to the picture.

    Parameters
    ----------
    number : of the pilot, from 1.
    spp : samples a pixel, a power of two from 16 on.

    Returns
    -------
    By tile (tiles,), float64 and int64: the relative squared error of so many samples, up to a factor; the rays traced;
    and the samples taken, which are fewer after an interrupt.
    """
    scene, estimator = pilots.scene(pilot_seed(pilots.seed, number), spp), pilots.estimator()
    taken, rays = np.zeros((2, len(queue.windows)), dtype=np.int64)
    films: deque[FilmView] = deque()
    waiting, seconds = deque(range(len(queue.windows))), queue.seconds_per_sample * spp

    def work(workspace: Workspace, tile: int) -> None:
        window, film = queue.windows[tile], films.pop()
        film = film._replace(left=window.left, top=window.top)
        for array in (film.mean, film.m2, film.count, film.bad):
            array.fill(0)
        mean = film.mean[: window.bottom - window.top, : window.right - window.left]
        begin = 0
        while begin < spp and not queue.pool.is_stopped:
            end = queue.limit_pass_end(tile, begin, spp // 2 if begin < spp // 2 else spp)
            rays[tile] += render_tile(scene, film, workspace, *window, begin, end)
            if end in (spp // 2, spp):
                estimator.record(tile, mean, end)
            taken[tile] = begin = end
        films.append(film)

    def next_job() -> TileJob | None:
        limit = queue.job_seconds(float(seconds[list(waiting)].sum()))
        tiles = tuple(queue.take_batch(waiting, lambda tile: float(seconds[tile]), limit))
        if not tiles:
            return None
        windows, every = tuple(queue.windows[tile] for tile in tiles), len(tiles)
        counts = ((spp // 2,),) * every
        return TileJob(tiles, windows, (0,) * every, (spp,) * every, counts, scene.sampler, None, mean_only=True)

    def merge(job: TileJob, result: TileResult) -> None:
        for place, (tile, output) in enumerate(zip(job.tiles, split_by_tile(job, result), strict=True)):
            for count, mean in (*output.recorded_means, (spp, output.arrays[0])):
                estimator.record(tile, mean, count)
            rays[tile], taken[tile] = result.rays[place], spp

    if queue.remote is None:
        films.extend(pilots.scratch() for _ in range(queue.pool.threads))
        queue.pool.run(range(len(queue.windows)), work)
    else:
        queue.pool.run_remote(queue.remote, next_job, merge)
    estimator.set_scale(queue.mean)
    return np.nan_to_num(estimator.tile_mse(np.full(len(queue.windows), spp))), rays, taken
