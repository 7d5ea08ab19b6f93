"""Jobs of a cluster's workers: tiles to take samples of, the results, and the function that runs a job.

Adding a packet to a pixel's running mean is not associative, so results of workers cannot be added up in any order.  A
job therefore takes along the film of its tiles so far, and goes on from there: the picture has the bits that it has
where all of its samples are taken on one machine.
"""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView


class TileJob(NamedTuple):
    """Samples to take of some tiles.

    tiles : their numbers, T of them.
    windows (px) : (T,), left, top, right and bottom of each.
    begins, ends : (T,), samples begin .. end - 1 of each pixel.
    record_counts : (T,), numbers of samples in between, rising, at which the mean is to be recorded.
    sampler : a packed one.
    film_state : the tiles' film so far: for each of a film's arrays (`film_arrays`) one of shape (pixels, ...), tile
        after tile; None where it is empty.
    mean_only : True if only the mean is to be returned.
    """

    tiles: tuple[int, ...]
    windows: tuple[tuple[int, int, int, int], ...]
    begins: tuple[int, ...]
    ends: tuple[int, ...]
    record_counts: tuple[tuple[int, ...], ...]
    sampler: Any
    film_state: tuple[NDArray[Any], ...] | None
    mean_only: bool = False


class TileResult(NamedTuple):
    """The result of a job.

    film_state : as the job's, with the samples added; only the mean where no more was asked for.
    recorded_means : float64 (n, 3), means of the pixels at the job's `record_counts`, tile after tile and count after
        count.
    rays : int64 (T,), rays traced.
    seconds (s) : float64 (T,), time that each tile took.
    """

    film_state: tuple[NDArray[Any], ...]
    recorded_means: NDArray[np.float64]
    rays: NDArray[np.int64]
    seconds: NDArray[np.float64]


class TileOutput(NamedTuple):
    """The result for one tile: a film's arrays (height, width, ...), and its means at numbers of samples."""

    arrays: tuple[NDArray[Any], ...]
    recorded_means: tuple[tuple[int, NDArray[np.float64]], ...]


def film_arrays(film: FilmView) -> tuple[NDArray[Any], ...]:
    """List all arrays (height, width, ...) that samples are added to; the first is the mean."""
    arrays = [film.mean, film.m2, film.count, film.bad]
    if film.removed is not None:
        arrays.append(film.removed)
    layers = () if film.aovs is None else film.aovs.layers
    return (*arrays, *(part for layer in layers for part in layer if isinstance(part, np.ndarray)))


def window_shape(window: Sequence[int]) -> tuple[int, int]:
    """Return height and width of a window."""
    left, top, right, bottom = window
    return bottom - top, right - left


def extract_tiles(film: FilmView, windows: Sequence[Sequence[int]]) -> tuple[NDArray[Any], ...]:
    """Copy some windows of a film, as a job takes them along."""
    x, y = film.left, film.top
    return tuple(
        np.concatenate(
            [
                array[top - y : bottom - y, left - x : right - x].reshape(-1, *array.shape[2:])
                for left, top, right, bottom in windows
            ]
        )
        for array in film_arrays(film)
    )


def split_by_tile(job: TileJob, result: TileResult) -> list[TileOutput]:
    """Split the result of a job by tile."""
    outputs = []
    first = first_mean = 0
    for window, counts in zip(job.windows, job.record_counts, strict=True):
        height, width = window_shape(window)
        size = height * width
        arrays = tuple(
            array[first : first + size].reshape(height, width, *array.shape[1:]) for array in result.film_state
        )
        means = result.recorded_means[first_mean : first_mean + size * len(counts)]
        means = means.reshape(len(counts), height, width, 3)
        outputs.append(TileOutput(arrays, tuple(zip(counts, means, strict=True))))
        first, first_mean = first + size, first_mean + size * len(counts)
    return outputs


def run_tile_job(scene: Scene, scratch: FilmView, workspace: Workspace, job: TileJob) -> TileResult:
    """Render the samples of a job.

    scratch : a film of the largest tile's size to work on, of the same type as the picture's.
    """
    scene = scene._replace(sampler=job.sampler)
    arrays = film_arrays(scratch)
    returned = arrays[:1] if job.mean_only else arrays
    parts: list[tuple[NDArray[Any], ...]] = []
    recorded = [np.zeros((0, 3))]
    rays, seconds = np.zeros(len(job.windows), dtype=np.int64), np.zeros(len(job.windows))
    first = 0
    for tile, window in enumerate(job.windows):
        started = time.perf_counter()
        height, width = window_shape(window)
        size = height * width
        film = scratch._replace(left=window[0], top=window[1])
        for number, array in enumerate(arrays):
            if job.film_state is None:
                array.fill(0)
            else:
                so_far = job.film_state[number][first : first + size]
                array[:height, :width] = so_far.reshape(height, width, *array.shape[2:])
        begin = job.begins[tile]
        for end in (*job.record_counts[tile], job.ends[tile]):
            rays[tile] += render_tile(scene, film, workspace, *window, begin, end)
            if end != job.ends[tile]:
                recorded.append(scratch.mean[:height, :width].reshape(-1, 3).copy())
            begin = end
        parts.append(tuple(array[:height, :width].reshape(-1, *array.shape[2:]).copy() for array in returned))
        seconds[tile] = time.perf_counter() - started
        first += size
    film_state = tuple(np.concatenate([part[number] for part in parts], axis=0) for number in range(len(returned)))
    return TileResult(film_state, np.concatenate(recorded, axis=0), rays, seconds)
