"""Who renders which tile and when: threads that take tiles from a queue, passes that grow, and an end by the clock.

A tile is only ever with one thread and its samples are added in order, so the picture has the same bits whoever adds
them and however they are split into passes; be it a thread elsewhere, which is sent what the tile has gathered so far.
"""

import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.accumulation import FilmView
from raytracer.embree import PACKET
from raytracer.errands import Errand, Haul, arrays_of, brought, collected
from raytracer.errors import OutputError
from raytracer.integrator import Scene, render_tile
from raytracer.noise import Estimate, Tally
from raytracer.paths import Workspace, workspace
from raytracer.scene.spec import SceneSpec

Item = TypeVar("Item")

TILE = 16
"""Edge of the square of pixels that one thread takes at a time."""

FIRST_PASS = PACKET
"""Samples that every tile gets before any gets more."""

# Samples that one call adds to each pixel of a tile, and seconds that it takes by the last one's pace: never so many
# that Ctrl-C, a time limit or a checkpoint has to wait.
_LONGEST_PASS = 32 * PACKET
_LONGEST_PASS_SECONDS = 0.25

_WAKE_UP_SECONDS = 0.1

# Work sent elsewhere in one go: so many seconds of one thread, for what every errand costs (15 ms of the processors of
# client and scheduler together) to be little of it; at most so many tiles, 4 MB of film.  The last ones are short, so
# that all threads end together.
_LONGEST_ERRAND = 2.0
_SHORTEST_ERRAND = 0.1
_MOST_TILES = 256

# How many errands a thread elsewhere has ahead of it, work that waits here included.
_ERRANDS_AHEAD = 4

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
    failure : why work that was sent elsewhere has ended before its time; None if it has not.
    """

    def __init__(self, threads: int, tick: Callable[[], None] | None = None, *, solids: int = 0) -> None:
        """Make a crew that calls `tick` ten times a second while it works; its workspaces have so many `solids`."""
        self.threads = threads
        self.interrupted = False
        self.failure: str | None = None
        self._tick, self._solids = tick, solids
        self._stopped = threading.Event()
        self._gate = threading.Condition()
        self._passes, self._rests = 0, False

    @property
    def stopped(self) -> bool:
        """Whether work is to end as soon as it can."""
        return self._stopped.is_set()

    @contextmanager
    def heeding(self) -> Iterator[None]:
        """Take a KeyboardInterrupt in the `with` block as the end of all work, and go on after the block.

        Raises
        ------
        KeyboardInterrupt : it is not the first.
        """
        try:
            yield
        except KeyboardInterrupt:
            self._stopped.set()
            if self.interrupted:
                raise
            self.interrupted = True

    @contextmanager
    def working(self) -> Iterator[None]:
        """Change the film in the `with` block, once nobody looks at it."""
        with self._gate:
            self._gate.wait_for(lambda: not self._rests)
            self._passes += 1
        try:
            yield
        finally:
            with self._gate:
                self._passes -= 1
                self._gate.notify_all()

    @contextmanager
    def resting(self) -> Iterator[None]:
        """Look at the film in the `with` block, while nobody changes it; by one thread that does not work itself."""
        with self._gate:
            self._rests = True
            self._gate.wait_for(lambda: self._passes == 0)
        try:
            yield
        finally:
            with self._gate:
                self._rests = False
                self._gate.notify_all()

    def tick(self) -> None:
        """Call the function that is to be called about ten times a second."""
        if self._tick is not None:
            self._tick()

    def send(
        self,
        elsewhere: "Elsewhere",
        draw: "Callable[[], Errand | None]",
        bring: "Callable[[Errand, Haul], object]",
        deadline: float | None = None,
    ) -> None:
        """Have others do the work; after an interrupt, or once they are lost, this and all later calls return at once.

        Parameters
        ----------
        draw : the next errand; None if there is none for now.
        bring : told of each that is done, before `draw` is called again.
        deadline : a time of `now`, after which what is not back is forgotten.
        """
        if self.stopped:
            return
        try:
            with self.heeding():
                elsewhere.run(draw, bring, self, deadline)
        except OutputError as error:
            self.failure = str(error)
            self._stopped.set()
        except BaseException:
            self._stopped.set()
            raise

    def run(self, items: Iterable[Item], work: Callable[[Workspace, Item], Item | None]) -> None:
        """Do `work` on all items, begun in their order; what it returns goes to the end of the queue.

        After an interrupt the items in work are finished and this returns, and so does every later call at once.

        Raises
        ------
        BaseException : what `work` has raised.
        """
        if self.stopped:
            return
        queue = deque(items)
        failures: list[BaseException] = []

        def labour() -> None:
            room = workspace(solids=self._solids)
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
                        self.tick()
        except BaseException:
            self._stopped.set()
            raise
        finally:
            for worker in workers:
                if worker.ident is not None:
                    worker.join()
        if failures:
            raise failures[0]


class Elsewhere(Protocol):
    """Others who take samples of one scene."""

    @property
    def threads(self) -> int:
        """How many of them work at once, by what is known now; at least 1."""

    @property
    def workers(self) -> Sequence[str]:
        """What those are called who have brought something."""

    def run(
        self,
        draw: Callable[[], Errand | None],
        bring: Callable[[Errand, Haul], object],
        crew: Crew,
        deadline: float | None,
    ) -> None:
        """Have errands done until `draw` has none, and all are back; or the crew is stopped, or the deadline past.

        `draw` and `bring` are called by the caller's thread, and `crew.tick` about ten times a second.

        Raises
        ------
        OutputError : they are lost.
        """


class Workforce(Protocol):
    """Whoever can take samples of any scene."""

    def engage(
        self,
        spec: SceneSpec,
        *,
        aovs: Sequence[str],
        denoise: bool,
        warn: Callable[[str], object] | None,
        strict: bool,
    ) -> Elsewhere:
        """Have them make a scene ready, while the caller does something else.

        Parameters
        ----------
        spec : with its seed and samples per pixel.
        aovs, denoise : what is gathered besides radiance.
        warn, strict : see `rendering.render`.

        Raises
        ------
        InputError : there is nobody, or who is there cannot render the same picture.
        """


class Canvas:
    """A film under way, tile by tile.

    Attributes
    ----------
    windows : the tiles, row by row.
    columns : how many are in a row.
    crew : who works on it.
    elsewhere : who does so in their place, if not None.
    mean : float64 (height, width, 3), the picture so far.
    pixels : int64 (tiles,), of each.
    counts : int64 (tiles,), samples that each pixel of a tile has.
    rays : int64 (tiles,), traced so far.
    pace : float64 (tiles,), seconds that one thread takes for a sample in every pixel, by the last pass.
    """

    def __init__(
        self,
        scene: Scene,
        target: FilmView,
        windows: Sequence[Window],
        crew: Crew,
        tally: Tally,
        elsewhere: Elsewhere | None = None,
    ) -> None:
        """A film for a crew to work on, or for others if there are any, with whom the crew then stays in touch."""
        self._scene, self._target, self.crew, self._tally = scene, target, crew, tally
        self.elsewhere = elsewhere
        self.windows = windows
        self.columns = sum(window.top == windows[0].top for window in windows)
        self.mean = target.mean
        self.pixels = np.array([window.pixels for window in windows], dtype=np.int64)
        self.counts = np.zeros(len(windows), dtype=np.int64)
        self.rays = np.zeros(len(windows), dtype=np.int64)
        self.pace = np.zeros(len(windows))

    @property
    def threads(self) -> int:
        """How many work on it."""
        return self.crew.threads if self.elsewhere is None else self.elsewhere.threads

    @property
    def done(self) -> int:
        """Samples over all pixels."""
        return int(self.pixels @ self.counts)

    @property
    def samples(self) -> float:
        """Mean number of samples over pixels."""
        return self.done / int(self.pixels.sum())

    def gathered(self) -> dict[str, NDArray[Any]]:
        """All that was gathered, by name, from which another canvas of the same tiles goes on.

        The film's arrays are (height, width, ...), those of tiles (tiles, ...).
        """
        film = {f"film/{number}": array for number, array in enumerate(arrays_of(self._target))}
        tally = {f"tally/{name}": array for name, array in self._tally.gathered().items()}
        return {**film, **tally, "counts": self.counts, "rays": self.rays, "pace": self.pace}

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
        if self.elsewhere is not None:
            self._send(self.elsewhere, np.full(len(self.windows), spp), deadline)
            return

        def work(room: Workspace, tile: int) -> int | None:
            # A slow tile takes its turn in several passes.
            end = pass_end(int(self.counts[tile]), spp)
            while self.counts[tile] < end and not self.crew.stopped:
                if not self._add_pass(room, tile, end, deadline):
                    return None
            return tile if self.counts[tile] < spp else None

        self.crew.run([tile for tile in range(len(self.windows)) if self.counts[tile] < spp], work)

    def bring_to(self, goals: NDArray[np.int64], deadline: float | None = None) -> None:
        """Bring each tile to its goal (tiles,) of samples; the longest work first, so that all threads end together.

        No pass is begun that would end after the `deadline`, a time of `now`.
        """
        if self.elsewhere is not None:
            self._send(self.elsewhere, goals, deadline)
            return

        def work(room: Workspace, tile: int) -> None:
            while self.counts[tile] < goals[tile] and not self.crew.stopped:
                if not self._add_pass(room, tile, int(goals[tile]), deadline):
                    return

        lacking = goals - self.counts
        order = np.argsort(-lacking * self.pace, kind="stable")
        self.crew.run([int(tile) for tile in order if lacking[tile] > 0], work)

    def soon(self, tile: int, begin: int, end: int) -> int:
        """Where a pass from sample `begin` to `end` is to end, lest it take long."""
        if self.pace[tile] * (end - begin) <= _LONGEST_PASS_SECONDS:
            return end
        return min(end, begin + _packets(_LONGEST_PASS_SECONDS / self.pace[tile]))

    def _add_pass(self, room: Workspace, tile: int, goal: int, deadline: float | None) -> bool:
        """Add the next samples to a tile; False if there is no time for any."""
        with self.crew.working():
            return self._passed(room, tile, goal, deadline)

    def _passed(self, room: Workspace, tile: int, goal: int, deadline: float | None) -> bool:
        begin, window = int(self.counts[tile]), self.windows[tile]
        end = self.soon(tile, begin, pass_end(begin, goal))
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

    # ---- Elsewhere

    def batch(self, waiting: deque[int], cost: Callable[[int], float], limit: float) -> list[int]:
        """Take as many tiles from a queue as are worth an errand.

        cost : seconds that a thread takes for a tile.
        limit : seconds for all; a single tile may take longer.
        """
        most = min(_MOST_TILES, math.ceil(len(waiting) / (_ERRANDS_AHEAD * self.threads)))
        taken: list[int] = []
        seconds = 0.0
        while waiting and len(taken) < most:
            seconds += cost(waiting[0])
            if taken and seconds > limit:
                break
            taken.append(waiting.popleft())
        return taken

    def errand_seconds(self, left: float) -> float:
        """How long an errand may take where so many seconds of one thread are left of all the work."""
        return min(max(left / (_ERRANDS_AHEAD * self.threads), _SHORTEST_ERRAND), _LONGEST_ERRAND)

    def _send(self, elsewhere: Elsewhere, goals: NDArray[np.int64], deadline: float | None) -> None:
        """Have others bring each tile to its goal, pass by pass over the picture, those first that lack most."""
        lacking = (goals - self.counts) * self.pace
        order = np.argsort(-lacking, kind="stable")
        waiting = deque(int(tile) for tile in order if goals[tile] > self.counts[tile])

        def draw() -> Errand | None:
            limit = self.errand_seconds(float(self.pace @ np.maximum(goals - self.counts, 0)))
            left = math.inf if deadline is None else deadline - now()
            if not waiting or PACKET * self.pace[waiting[0]] > left or left <= 0.0:
                return None
            limit = min(limit, left / _ERRANDS_AHEAD)

            def step(tile: int, begin: int) -> int:
                whole = pass_end(begin, int(goals[tile]))
                pace = float(self.pace[tile])
                return whole if pace * (whole - begin) <= limit else min(whole, begin + _packets(limit / pace))

            def cost(tile: int) -> float:
                begin = int(self.counts[tile])
                return float(self.pace[tile]) * (step(tile, begin) - begin)

            # Short passes go together.
            tiles = self.batch(waiting, cost, limit)
            begins = [int(self.counts[tile]) for tile in tiles]
            ends = begins
            while True:
                further = [step(tile, end) for tile, end in zip(tiles, ends, strict=True)]
                seconds = self.pace[tiles] @ (np.array(further) - begins)
                if further == ends or (ends != begins and seconds > limit):
                    break
                ends = further
            windows = tuple(self.windows[tile] for tile in tiles)
            marks = tuple(_powers_between(*ends_of) for ends_of in zip(begins, ends, strict=True))
            so_far = collected(self._target, windows) if any(begins) else None
            return Errand(tuple(tiles), windows, tuple(begins), tuple(ends), marks, self._scene.sampler, so_far)

        def bring(errand: Errand, haul: Haul) -> None:
            with self.crew.working():
                self._take_home(errand, haul)
            waiting.extend(tile for tile in errand.tiles if self.counts[tile] < goals[tile])

        self.crew.send(elsewhere, draw, bring, deadline)

    def _take_home(self, errand: Errand, haul: Haul) -> None:
        """Put what was brought onto the film."""
        arrays, left, top = arrays_of(self._target), self._target.left, self._target.top
        for number, (tile, found) in enumerate(zip(errand.tiles, brought(errand, haul), strict=True)):
            window, end = self.windows[tile], errand.ends[number]
            rows, columns = slice(window.top - top, window.bottom - top), slice(window.left - left, window.right - left)
            for array, values in zip(arrays, found.arrays, strict=True):
                array[rows, columns] = values
            for count, mean in (*found.noted, (end, self.mean[rows, columns])):
                self._tally.record(tile, mean, count)
            self.rays[tile] += haul.rays[number]
            self.pace[tile] = haul.seconds[number] / (end - errand.begins[number])
            self.counts[tile] = end


def _packets(samples: float) -> int:
    """Whole packets of samples, at least one, and no more than fit."""
    return PACKET * max(1, int(samples / PACKET))


def _powers_between(begin: int, end: int) -> tuple[int, ...]:
    """Powers of two that lie between, from the first pass on: where errors are looked at."""
    powers = (1 << exponent for exponent in range(FIRST_PASS.bit_length() - 1, end.bit_length()))
    return tuple(power for power in powers if begin < power < end)
