"""Samples that are taken elsewhere: the picture is the same to the last bit, in whatever order they come back."""

from collections import deque
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from raytracer.core.error_estimate.halves import ErrorEstimator
from raytracer.film.window import Window
from raytracer.kernel.aovs.base.layers import Aovs, CoverageLayer, MajorityLayer, MeanLayer
from raytracer.kernel.path_state import workspace
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering import tile_scheduler
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.film_region import empty_film, film_view
from raytracer.rendering.render import render, render_image
from raytracer.rendering.tile_job import TileJob, TileResult, extract_tiles, film_arrays, run_tile_job, split_by_tile
from raytracer.rendering.tile_scheduler import TileQueue, split_into_tiles
from raytracer.rendering.worker_pool import WorkerPool
from raytracer.util.errors import OutputError
from tests.rendering.halves import HEIGHT, SPP, WIDTH, assert_same, halves


class LocalExecutor:
    """A remote executor that is this very process; it merges the last of up to `ahead` jobs first.

    Raises `error` after some jobs.
    """

    threads = 3
    workers: Sequence[str] = ("one",)

    def __init__(self, ahead=1, error=None, after=5):
        self.ahead, self.error, self.left = ahead, error, after
        self.jobs: list[TileJob] = []

    def connect(self, spec, options, warn):
        self.prepared = compile_scene(spec)
        return self

    def run(self, next_job, merge, pool, deadline):
        out = deque()
        while not pool.is_stopped:
            while len(out) < self.ahead and (job := next_job()) is not None:
                out.append(job)
            if not out:
                return
            self.left -= 1
            if self.error is not None and self.left < 0:
                raise self.error
            job = out.pop()
            self.jobs.append(job)
            merge(job, self.take(job))
            pool.tick()

    def take(self, job):
        size = tile_scheduler.TILE_SIZE
        target = film_view(empty_film(self.prepared.scene, size, size))
        return run_tile_job(self.prepared.scene, target, workspace(self.prepared.scene), job)


@pytest.mark.parametrize(
    ("ahead", "keys"),
    [(1, {}), (4, {}), (2, {"crop": (5, 3, 40, 30)}), (3, {"spp": 2048, "noise": 0.04})],
    ids=["one by one", "ahead", "crop", "adaptive"],
)
def test_bits_do_not_depend_on_where_samples_are_taken(ahead, keys):
    executor = LocalExecutor(ahead)
    here, far = render(halves(), threads=2, **keys), render(halves(), cluster=executor, **keys)
    assert len(executor.jobs) > 4
    assert far.complete
    assert_same(far, here)
    assert (far.stats.threads, far.stats.workers) == (3, ["one"])
    is_adaptive = "noise" in keys
    assert any(job.mean_only for job in executor.jobs) == is_adaptive == (far.stats.pilot_samples > 0)


@pytest.mark.parametrize("error", [OutputError("the cable is cut"), KeyboardInterrupt()])
def test_what_has_come_back_is_kept_when_the_cluster_is_lost_or_work_interrupted(error, monkeypatch):
    found = render(halves(), cluster=LocalExecutor(error=error))
    is_lost = isinstance(error, OutputError)
    assert found.failure == ("the cable is cut" if is_lost else None)
    assert found.interrupted == (not is_lost)
    assert not found.complete
    assert 0 < found.stats.samples < WIDTH * HEIGHT * SPP
    monkeypatch.setattr("raytracer.rendering.render._warn", lambda sentence: None)
    if is_lost:
        with pytest.raises(OutputError, match="the cable is cut"):
            render_image(halves(), cluster=LocalExecutor(error=error))


# ---- Contents of a job


def film(seed=1, height=20, width=24):
    """A film with something of everything that a film may gather, from pixel (100, 50) on."""
    random = np.random.default_rng(seed)

    def counts():
        return random.integers(0, 100, (height, width))

    def values(channels):
        return random.normal(size=(height, width, channels))

    layers = Aovs(
        (MeanLayer(None, values(4), 2, 3), MajorityLayer(None, counts(), counts(), 5), CoverageLayer(values(2)))
    )
    return FilmView(values(3), values(3), counts(), counts(), 100, 50, layers, values(4))


def test_a_job_takes_along_the_whole_film_state():
    whole = film()
    windows = (Window(100, 50, 116, 66), Window(116, 50, 124, 66), Window(100, 66, 116, 70))
    job = TileJob((0, 1, 2), windows, (8, 8, 8), (16, 16, 16), ((), (), ()), None, extract_tiles(whole, windows))
    assert job.film_state is not None
    assert len(job.film_state) == len(film_arrays(whole)) == 9
    result = TileResult(job.film_state, np.zeros((0, 3)), np.zeros(3, dtype=np.int64), np.zeros(3))
    for window, found in zip(windows, split_by_tile(job, result), strict=True):
        rows, columns = slice(window.top - 50, window.bottom - 50), slice(window.left - 100, window.right - 100)
        for array, part in zip(film_arrays(whole), found.arrays, strict=True):
            np.testing.assert_array_equal(part, array[rows, columns])


def test_means_at_record_counts_come_back_with_their_tiles():
    windows = (Window(0, 0, 2, 1), Window(2, 0, 3, 2))
    job = TileJob((0, 1), windows, (0, 8), (32, 16), ((8, 16), ()), None, None, mean_only=True)
    recorded = np.arange(12.0).reshape(4, 3)
    result = TileResult((np.ones((4, 3)),), recorded, np.zeros(2, dtype=np.int64), np.zeros(2))
    first, second = split_by_tile(job, result)
    assert [mark for mark, _ in first.recorded_means] == [8, 16]
    np.testing.assert_array_equal(first.recorded_means[1][1], recorded[2:].reshape(1, 2, 3))
    assert second.recorded_means == ()


# ---- Size of jobs


class Clockwork(LocalExecutor):
    """An executor that claims so many seconds for a sample of a tile, and takes no samples at all."""

    def __init__(self, pace, threads):
        super().__init__(ahead=2 * threads)
        self.pace, self.threads = pace, threads

    def take(self, job):
        pixels = [(right - left) * (bottom - top) for left, top, right, bottom in job.windows]
        nothing, counts = np.zeros((sum(pixels), 3)), np.zeros(sum(pixels), dtype=np.int64)
        recorded = sum(size * len(marks) for size, marks in zip(pixels, job.record_counts, strict=True))
        samples = np.subtract(job.ends, job.begins)
        return TileResult((nothing, nothing, counts, counts), np.zeros((recorded, 3)), samples, self.pace * samples)


def make_queue(executor, width, height):
    """A film that gathers nothing, after its first pass."""
    blank, counts = np.zeros((height, width, 3)), np.zeros((height, width), dtype=np.int64)
    windows = split_into_tiles(Window(0, 0, width, height))
    film = FilmView(blank, blank, counts, counts, 0, 0, None)
    stub = SimpleNamespace(sampler=None)
    queue = TileQueue(stub, film, windows, WorkerPool(1), ErrorEstimator(windows), executor)
    queue.first_pass(1000)
    executor.jobs.clear()
    return queue


@pytest.mark.parametrize(
    ("pace", "threads", "width", "height"),
    [(1e-4, 1, 640, 360), (1e-4, 8, 640, 360), (1e-2, 4, 160, 90), (1, 4, 48, 32)],
)
def test_jobs_are_long_enough_and_the_last_ones_are_short(pace, threads, width, height):
    executor = Clockwork(pace, threads)
    queue = make_queue(executor, width, height)
    queue.render_passes(1000)
    assert np.all(queue.counts == 1000)
    np.testing.assert_array_equal(queue.rays, 1000)

    # Each tile goes on where it was, and its mean is known at every power of two.
    at = dict.fromkeys(range(len(queue.windows)), 8)
    seen = {tile: [8] for tile in at}
    for job in executor.jobs:
        for tile, begin, end, record_counts in zip(job.tiles, job.begins, job.ends, job.record_counts, strict=True):
            assert begin == at[tile] < end
            assert end == 1000 or end % 8 == 0
            at[tile] = end
            seen[tile] += [*record_counts, end]
    for stops in seen.values():
        assert {8, 16, 32, 64, 128, 256, 512} <= set(stops)

    seconds = [pace * float(np.subtract(job.ends, job.begins).sum()) for job in executor.jobs]
    packet = 8 * pace
    assert max(seconds) <= max(2.0, packet) + 1e-9
    assert all(len(job.tiles) <= 256 for job in executor.jobs)
    # The way costs 15 ms: that is to be little of the whole, where this takes more than some seconds.
    assert len(seconds) * 0.015 <= max(0.03 * sum(seconds), 1.0 * threads)
    assert max(seconds[-threads:]) <= max(0.2, packet)


def test_an_end_by_the_clock_sends_nothing_that_would_be_late(monkeypatch):
    time = 0.0
    monkeypatch.setattr(tile_scheduler, "now", lambda: time)
    executor = Clockwork(0.01, 2)
    executor.ahead = 1
    queue = make_queue(executor, 160, 90)
    take_all = executor.take

    def slowly(job):
        nonlocal time
        result = take_all(job)
        time += float(result.seconds.sum()) / executor.threads
        return result

    monkeypatch.setattr(executor, "take", slowly)
    queue.render_passes(10_000, deadline=30.0)
    assert 29.0 < time < 30.5
    assert queue.counts.min() > 8
