"""Who renders which tile and when: threads that take tiles from a queue, passes that grow, and an end by the clock.

A tile is only ever with one thread and its samples are added in order, so the picture has the same bits whoever adds
them and however they are split into passes.
"""

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.embree import PACKET
from raytracer.integrator import FilmView, Scene, render_tile
from raytracer.noise import Estimate, Tally
from raytracer.paths import Workspace, workspace

Item = TypeVar("Item")

TILE = 16
"""Edge of the square of pixels that one thread takes at a time."""

FIRST_PASS = PACKET
"""Samples that every tile gets before any gets more."""

# Samples that one call adds to each pixel of a tile: never so many that Ctrl-C or a time limit has to wait.
_LONGEST_PASS = 32 * PACKET

_WAKE_UP_SECONDS = 0.1

now: Callable[[], float] = time.perf_counter
"""The clock of all limits, in seconds."""


class Window(NamedTuple):
    """Pixels left <= x < right, top <= y < bottom of the picture."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def pixels(self) -> int:
        """How many they are."""
        return (self.right - self.left) * (self.bottom - self.top)


def tiles(window: Window) -> list[Window]:
    """The window cut into squares, row by row; those at its right and its bottom may be smaller."""
    return [
        Window(left, top, min(left + TILE, window.right), min(top + TILE, window.bottom))
        for top in range(window.top, window.bottom, TILE)
        for left in range(window.left, window.right, TILE)
    ]


def available_threads() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def pass_end(begin: int, goal: int) -> int:
    """Where the pass that starts at sample `begin` ends: at 8, 16, 32, ... 256, and from there on 256 later each time.

    From a `begin` between powers of two it goes no farther than to the next one, where errors are looked at.
    """
    return min(goal, max(FIRST_PASS, 1 << begin.bit_length()), begin + _LONGEST_PASS)


class Crew:
    """Threads that take work from a queue.

    Attributes
    ----------
    threads : how many, at most.
    interrupted : whether a KeyboardInterrupt has ended the work.
    """

    def __init__(self, threads: int, tick: Callable[[], None] | None = None) -> None:
        """A crew that calls `tick` about ten times a second while it works."""
        self.threads = threads
        self.interrupted = False
        self._tick = tick
        self._stopped = threading.Event()

    @property
    def stopped(self) -> bool:
        """Whether work is to end as soon as it can."""
        return self._stopped.is_set()

    @contextmanager
    def heeding(self) -> Iterator[None]:
        """Take a KeyboardInterrupt in the `with` block as the end of all work, and go on after the block."""
        try:
            yield
        except KeyboardInterrupt:
            self.interrupted = True
            self._stopped.set()

    def run(self, items: Iterable[Item], work: Callable[[Workspace, Item], Item | None]) -> None:
        """Do `work` on all items, begun in their order; what it returns goes to the end of the queue.

        After an interrupt the items in work are finished and this returns, and so does every later call at once.

        Raises
        ------
        BaseException : what `work` has raised.
        """
        queue = deque(items)
        failures: list[BaseException] = []

        def labour() -> None:
            room = workspace()
            while not self.stopped:
                try:
                    item = queue.popleft()
                except IndexError:
                    return
                try:
                    rest = work(room, item)
                except BaseException as error:  # noqa: BLE001
                    # Raised where the threads are waited for.
                    failures.append(error)
                    self._stopped.set()
                    return
                if rest is not None:
                    queue.append(rest)

        workers = [threading.Thread(target=labour, daemon=True) for _ in range(min(self.threads, len(queue)))]
        try:
            with self.heeding():
                for worker in workers:
                    worker.start()
                for worker in workers:
                    while worker.is_alive():
                        worker.join(_WAKE_UP_SECONDS)
                        if self._tick is not None:
                            self._tick()
        except BaseException:
            self._stopped.set()
            raise
        finally:
            for worker in workers:
                if worker.ident is not None:
                    worker.join()
        if failures:
            raise failures[0]


class Canvas:
    """A film under way, tile by tile.

    Attributes
    ----------
    windows : the tiles, row by row.
    columns : how many are in a row.
    crew : who works on it.
    mean : float64 (height, width, 3), the picture so far.
    pixels : int64 (tiles,), of each.
    counts : int64 (tiles,), samples that each pixel of a tile has.
    rays : int64 (tiles,), traced so far.
    pace : float64 (tiles,), seconds that one thread takes for a sample in every pixel, by the last pass.
    """

    def __init__(self, scene: Scene, target: FilmView, windows: Sequence[Window], crew: Crew, tally: Tally) -> None:
        self._scene, self._target, self.crew, self._tally = scene, target, crew, tally
        self.windows = windows
        self.columns = sum(window.top == windows[0].top for window in windows)
        self.mean = target.mean
        self.pixels = np.array([window.pixels for window in windows], dtype=np.int64)
        self.counts = np.zeros(len(windows), dtype=np.int64)
        self.rays = np.zeros(len(windows), dtype=np.int64)
        self.pace = np.zeros(len(windows))

    @property
    def done(self) -> int:
        """Samples over all pixels."""
        return int(self.pixels @ self.counts)

    @property
    def samples(self) -> float:
        """Mean number of samples over pixels."""
        return self.done / int(self.pixels.sum())

    def estimate(self) -> Estimate | None:
        """The error of the picture so far; None if that is not known.  Only while nobody works on it."""
        self._tally.settle(self.mean)
        return self._tally.estimate(self.counts)

    def first_pass(self, spp: int) -> None:
        """Give every tile the first samples, at most `spp`, however long that takes."""
        self.bring_to(np.full(len(self.windows), min(spp, FIRST_PASS)))

    def by_turns(self, spp: int, deadline: float | None = None) -> None:
        """Bring all tiles to `spp` samples, pass by pass over the picture, so that an early end leaves them alike.

        No pass is begun that would end after the `deadline`, a time of `now`.
        """

        def work(room: Workspace, tile: int) -> int | None:
            return tile if self._add_pass(room, tile, spp, deadline) and self.counts[tile] < spp else None

        self.crew.run([tile for tile in range(len(self.windows)) if self.counts[tile] < spp], work)

    def bring_to(self, goals: NDArray[np.int64], deadline: float | None = None) -> None:
        """Bring each tile to its goal (tiles,) of samples; the longest work first, so that all threads end together.

        No pass is begun that would end after the `deadline`, a time of `now`.
        """

        def work(room: Workspace, tile: int) -> None:
            while self.counts[tile] < goals[tile] and not self.crew.stopped:
                if not self._add_pass(room, tile, int(goals[tile]), deadline):
                    return

        lacking = goals - self.counts
        order = np.argsort(-lacking * self.pace, kind="stable")
        self.crew.run([int(tile) for tile in order if lacking[tile] > 0], work)

    def _add_pass(self, room: Workspace, tile: int, goal: int, deadline: float | None) -> bool:
        """Add the next samples to a tile; False if there is no time for any."""
        begin, window = int(self.counts[tile]), self.windows[tile]
        end = pass_end(begin, goal)
        start = now()
        if deadline is not None:
            left = deadline - start
            if left <= 0.0:
                return False
            if self.pace[tile] * (end - begin) > left:
                end = begin + PACKET * int(left / (PACKET * self.pace[tile]))
            if end <= begin:
                return False
        self.rays[tile] += render_tile(self._scene, self._target, room, *window, begin, end)
        self.pace[tile] = (now() - start) / (end - begin)
        self.counts[tile] = end

        left, top = self._target.left, self._target.top
        rows, columns = slice(window.top - top, window.bottom - top), slice(window.left - left, window.right - left)
        self._tally.record(tile, self.mean[rows, columns], end)
        return True
