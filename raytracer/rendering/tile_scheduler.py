"""The order in which tiles get their samples: passes over the picture that grow, and an end by the clock.

A tile is with one thread at a time and its samples are added in order, so the picture has the same bits whoever adds
them and however they are split into passes.  A worker on another machine is therefore sent what its tiles hold so far.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.halves import ErrorEstimate, ErrorEstimator
from raytracer.film.window import Window
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.tile_job import TileJob, TileResult, extract_tiles, film_arrays, split_by_tile
from raytracer.rendering.worker_pool import RemoteExecutor, WorkerPool

TILE_SIZE = 16
"""Edge of the square of pixels that one thread takes at a time."""

FIRST_PASS = PACKET
"""Samples that every tile gets before any gets more."""

# Samples that one call adds to each pixel of a tile, and seconds that it takes by the last one's pace: never so many
# that Ctrl-C, a time limit or a checkpoint has to wait.
_MAX_PASS_SPP = 32 * PACKET
_MAX_PASS_SECONDS = 0.25

# A job sent to a cluster: so many seconds of one thread, for the cost of every job (15 ms of the processors of client
# and scheduler together) to be little of it; at most so many tiles, 4 MB of film.  The last ones are short, so that all
# threads end together.
_MAX_JOB_SECONDS = 2.0
_MIN_JOB_SECONDS = 0.1
_MAX_JOB_TILES = 256

# Jobs that a thread of a cluster has ahead of it, those that wait here included.
_JOBS_IN_FLIGHT = 4

now: Callable[[], float] = time.perf_counter
"""The clock of all limits, in seconds."""


def split_into_tiles(window: Window) -> list[Window]:
    """Split a window into squares, row by row; those at its right and its bottom may be smaller."""
    return [
        Window(left, top, min(left + TILE_SIZE, window.right), min(top + TILE_SIZE, window.bottom))
        for top in range(window.top, window.bottom, TILE_SIZE)
        for left in range(window.left, window.right, TILE_SIZE)
    ]


def pass_end(begin: int, goal: int) -> int:
    """Return the sample at which the pass from `begin` ends: 8, 16, 32, ... 256, and from there on 256 later each time.

    From a `begin` between powers of two it goes no farther than to the next one, where errors are estimated.
    """
    return min(goal, max(FIRST_PASS, 1 << begin.bit_length()), begin + _MAX_PASS_SPP)


class TileQueue:
    """A film that is being rendered, tile by tile.

    windows : the tiles, row by row.
    columns : tiles in a row.
    pool : the threads that render.
    remote : the cluster that renders in their place, if not None.
    mean : float64 (height, width, 3), the picture so far.
    pixels : int64 (tiles,), pixels of each tile.
    counts : int64 (tiles,), samples that each pixel of a tile has.
    rays : int64 (tiles,), rays traced so far.
    seconds_per_sample (s) : float64 (tiles,), time of one thread for a sample in every pixel, by the last pass.
    max_pass_seconds (s) : longest pass over a tile, for which whoever stops the pool has to wait.
    """

    def __init__(
        self,
        scene: Scene,
        target: FilmView,
        windows: Sequence[Window],
        pool: WorkerPool,
        estimator: ErrorEstimator,
        remote: RemoteExecutor | None = None,
    ) -> None:
        """Make the queue of an empty film, for a pool to render, or for a cluster on its behalf."""
        self._scene, self._target, self.pool, self._estimator = scene, target, pool, estimator
        self.remote = remote
        self.windows = windows
        self.columns = sum(window.top == windows[0].top for window in windows)
        self.mean = target.mean
        self.pixels = np.array([window.pixels for window in windows], dtype=np.int64)
        self.counts = np.zeros(len(windows), dtype=np.int64)
        self.rays = np.zeros(len(windows), dtype=np.int64)
        self.seconds_per_sample = np.zeros(len(windows))
        self.max_pass_seconds = _MAX_PASS_SECONDS

    @property
    def threads(self) -> int:
        """Count the threads that render."""
        return self.pool.threads if self.remote is None else self.remote.threads

    @property
    def done(self) -> int:
        """Count the samples over all pixels."""
        return int(self.pixels @ self.counts)

    @property
    def samples(self) -> float:
        """Return the mean number of samples of a pixel."""
        return self.done / int(self.pixels.sum())

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that another queue of the same tiles needs to go on from here, by name.

        The film's arrays are (height, width, ...), those of tiles (tiles, ...).
        """
        film = {f"film/{number}": array for number, array in enumerate(film_arrays(self._target))}
        estimator = {f"tally/{name}": array for name, array in self._estimator.state_arrays().items()}
        return {**film, **estimator, "counts": self.counts, "rays": self.rays, "pace": self.seconds_per_sample}

    def estimate(self) -> ErrorEstimate | None:
        """Estimate the error of the picture so far; None if it is not known.  Only while no thread renders."""
        self._estimator.set_scale(self.mean)
        return self._estimator.estimate(self.counts)

    def first_pass(self, spp: int) -> None:
        """Give every tile the first samples, at most `spp`, however long that takes."""
        self.render_to(np.full(len(self.windows), min(spp, FIRST_PASS)))

    def render_passes(self, spp: int, deadline: float | None = None) -> None:
        """Render all tiles to `spp` samples, pass by pass over the picture, so that an early end leaves them alike.

        No pass is begun that would end after the `deadline`, a time of `now`.
        """
        self._render(np.full(len(self.windows), spp), range(len(self.windows)), deadline, in_passes=True)

    def render_to(self, goals: NDArray[np.int64], deadline: float | None = None) -> None:
        """Render each tile to its goal (tiles,) of samples; the longest work first, so that all threads end together.

        No pass is begun that would end after the `deadline`, a time of `now`.
        """
        order = np.argsort((self.counts - goals) * self.seconds_per_sample, kind="stable")
        self._render(goals, order.tolist(), deadline, in_passes=False)

    def _render(
        self, goals: NDArray[np.int64], order: Sequence[int], deadline: float | None, *, in_passes: bool
    ) -> None:
        """Render tiles to their goals, begun in this order, each by one pass a turn or by all of them."""
        if self.remote is not None:
            self._render_remotely(self.remote, goals, deadline)
            return

        def work(workspace: Workspace, tile: int) -> int | None:
            goal = int(goals[tile])
            # A slow tile takes its turn in several passes.
            end = pass_end(int(self.counts[tile]), goal) if in_passes else goal
            while self.counts[tile] < end and not self.pool.is_stopped:
                with self.pool.film_write_lock():
                    if not self._add_pass(workspace, tile, end, deadline):
                        return None
            return tile if self.counts[tile] < goal else None

        self.pool.run([tile for tile in order if self.counts[tile] < goals[tile]], work)

    def limit_pass_end(self, tile: int, begin: int, end: int) -> int:
        """Shorten a pass from sample `begin` to `end` that would take too long, and return its end."""
        if self.seconds_per_sample[tile] * (end - begin) <= self.max_pass_seconds:
            return end
        return min(end, begin + _round_to_packets(self.max_pass_seconds / self.seconds_per_sample[tile]))

    def _add_pass(self, workspace: Workspace, tile: int, goal: int, deadline: float | None) -> bool:
        """Add the next samples to a tile; return False if there is no time for any."""
        begin, window = int(self.counts[tile]), self.windows[tile]
        end = self.limit_pass_end(tile, begin, pass_end(begin, goal))
        start = now()
        if deadline is not None:
            left = deadline - start
            if left <= 0.0:
                return False
            if self.seconds_per_sample[tile] * (end - begin) > left:
                end = begin + PACKET * int(left / (PACKET * self.seconds_per_sample[tile]))
            if end <= begin:
                return False
        self.rays[tile] += render_tile(self._scene, self._target, workspace, *window, begin, end)
        self.seconds_per_sample[tile] = (now() - start) / (end - begin)
        self.counts[tile] = end

        left, top = self._target.left, self._target.top
        rows, columns = slice(window.top - top, window.bottom - top), slice(window.left - left, window.right - left)
        self._estimator.record(tile, self.mean[rows, columns], end)
        return True

    # ---- Rendering on a cluster

    def take_batch(self, waiting: deque[int], cost: Callable[[int], float], limit: float) -> list[int]:
        """Pop as many tiles from a queue as make up a job.

        cost : returns the seconds that one thread takes for a tile.
        limit (s) : for all tiles; a single one may take longer.
        """
        max_tiles = min(_MAX_JOB_TILES, math.ceil(len(waiting) / (_JOBS_IN_FLIGHT * self.threads)))
        taken: list[int] = []
        seconds = 0.0
        while waiting and len(taken) < max_tiles:
            seconds += cost(waiting[0])
            if taken and seconds > limit:
                break
            taken.append(waiting.popleft())
        return taken

    def job_seconds(self, left: float) -> float:
        """Limit the seconds that a job may take where so many seconds of one thread are left of all the work."""
        return min(max(left / (_JOBS_IN_FLIGHT * self.threads), _MIN_JOB_SECONDS), _MAX_JOB_SECONDS)

    def _render_remotely(self, remote: RemoteExecutor, goals: NDArray[np.int64], deadline: float | None) -> None:
        """Have a cluster render each tile to its goal, pass by pass over the picture, those first that lack most."""
        lacking = (goals - self.counts) * self.seconds_per_sample
        order = np.argsort(-lacking, kind="stable")
        waiting = deque(int(tile) for tile in order if goals[tile] > self.counts[tile])

        def next_job() -> TileJob | None:
            limit = self.job_seconds(float(self.seconds_per_sample @ np.maximum(goals - self.counts, 0)))
            left = math.inf if deadline is None else deadline - now()
            if not waiting or PACKET * self.seconds_per_sample[waiting[0]] > left or left <= 0.0:
                return None
            return self._make_job(waiting, goals, min(limit, left / _JOBS_IN_FLIGHT))

        def merge(job: TileJob, result: TileResult) -> None:
            with self.pool.film_write_lock():
                self._merge_result(job, result)
            waiting.extend(tile for tile in job.tiles if self.counts[tile] < goals[tile])

        self.pool.run_remote(remote, next_job, merge, deadline)

    def _make_job(self, waiting: deque[int], goals: NDArray[np.int64], limit: float) -> TileJob:
        """Make a job of the tiles that wait first, of about `limit` seconds of one thread."""

        def step(tile: int, begin: int) -> int:
            end = pass_end(begin, int(goals[tile]))
            pace = float(self.seconds_per_sample[tile])
            return end if pace * (end - begin) <= limit else min(end, begin + _round_to_packets(limit / pace))

        def cost(tile: int) -> float:
            begin = int(self.counts[tile])
            return float(self.seconds_per_sample[tile]) * (step(tile, begin) - begin)

        # Short passes go together.
        tiles = self.take_batch(waiting, cost, limit)
        begins = [int(self.counts[tile]) for tile in tiles]
        ends = begins
        while True:
            further = [step(tile, end) for tile, end in zip(tiles, ends, strict=True)]
            seconds = self.seconds_per_sample[tiles] @ (np.array(further) - begins)
            if further == ends or (ends != begins and seconds > limit):
                break
            ends = further
        windows = tuple(self.windows[tile] for tile in tiles)
        record_counts = tuple(_powers_between(*samples) for samples in zip(begins, ends, strict=True))
        film_state = extract_tiles(self._target, windows) if any(begins) else None
        return TileJob(
            tuple(tiles), windows, tuple(begins), tuple(ends), record_counts, self._scene.sampler, film_state
        )

    def _merge_result(self, job: TileJob, result: TileResult) -> None:
        """Merge the result of a job into the film."""
        arrays, left, top = film_arrays(self._target), self._target.left, self._target.top
        for number, (tile, output) in enumerate(zip(job.tiles, split_by_tile(job, result), strict=True)):
            window, end = self.windows[tile], job.ends[number]
            rows, columns = slice(window.top - top, window.bottom - top), slice(window.left - left, window.right - left)
            for array, values in zip(arrays, output.arrays, strict=True):
                array[rows, columns] = values
            for count, mean in (*output.recorded_means, (end, self.mean[rows, columns])):
                self._estimator.record(tile, mean, count)
            self.rays[tile] += result.rays[number]
            self.seconds_per_sample[tile] = result.seconds[number] / (end - job.begins[number])
            self.counts[tile] = end


def _round_to_packets(samples: float) -> int:
    """Round samples down to whole packets, but to one at least."""
    return PACKET * max(1, int(samples / PACKET))


def _powers_between(begin: int, end: int) -> tuple[int, ...]:
    """List the powers of two in between, from the first pass on: samples at which errors are estimated."""
    powers = (1 << exponent for exponent in range(FIRST_PASS.bit_length() - 1, end.bit_length()))
    return tuple(power for power in powers if begin < power < end)
