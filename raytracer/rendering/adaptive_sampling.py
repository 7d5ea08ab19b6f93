"""Samples where the error is: rounds over the picture until it is as good as was asked for, or the time is up.

Before a round, pilot samples tell how noisy each tile is and how many rays it takes.  They have a seed of their own and
are thrown away: an average over samples that had a say in how many they are is biased, since pixels that look quiet by
chance are left at that.  What the picture's own samples decide is one number for all tiles, how far its error is from
what was asked for.

The squared error sum_t p_t v_t / n_t of tiles t of p_t pixels falls the most for a number of rays sum_t p_t c_t n_t if
the samples n_t are in proportion to sqrt(v_t / c_t).

References: Kirk, Arvo 1991, "Unbiased Sampling Techniques for Image Synthesis", SIGGRAPH '91 (pilots that are thrown
away); Cochran 1977, "Sampling Techniques", 3rd ed., section 5.5 (the best shares where strata differ in cost).
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.accumulation import FilmView
from raytracer.embree import PACKET
from raytracer.errands import Errand, Haul, brought
from raytracer.integrator import Scene, render_tile
from raytracer.noise import Estimate, Tally
from raytracer.paths import Workspace
from raytracer.scheduling import FIRST_PASS, Canvas, Elsewhere, now

Array = NDArray[np.float64]

# Samplers count to 2^32.
_MOST = 2**31

# Samples that every pixel gets: two differences, that an estimate may rest on.
_FEWEST = 4 * FIRST_PASS

# A round brings the picture to at most so many times its samples, since what is known so far may mislead; and to at
# least so many times, since an estimate that is looked at often enough will be low once.
_LONGEST_ROUND = 4.0
_SHORTEST_ROUND = 1.05

# Pilots of `_SMALLEST_PILOT` samples may take the first part of the samples that the picture is expected to end with,
# and larger ones the second.  To the same error, shares by 16 samples take 0.85, 0.80, 0.68 and 0.75 of an even
# render's rays in cover, cornell, glass and smoke; by 64, 0.84, 0.79, 0.63 and 0.74; the best shares that tiles can
# have, 0.82, 0.77, 0.58 and 0.73.
_PART_OF_SMALLEST_PILOT = 0.08
_PART_OF_PILOT = 0.03
_SMALLEST_PILOT = 2 * FIRST_PASS

# Samples of a tile over the mean of all tiles, at least: what a pilot did not meet may be there.  Of the numbers above
# this takes less than 0.01 away, and 1/4 up to 0.02; for a picture that is half empty 0.50 is the best, and 0.52 and
# 0.57 are left.
_FLOOR = 1.0 / 16.0

# Part of the noise of the 3 x 3 tiles around it that a tile is taken to have, at least; that takes 0.01 away, too.
_FROM_AROUND = 0.125

# How near two levels of samples count as one, relative to them: finer than a packet's share of 8,000 samples.
_LEVEL_STEP = 2.0**-10

# Part of the time left that a round is planned for, but if the samples grow by less than a quarter in all of it.
_PLANNED = 0.9
_LAST_ROUND = 1.25


class Aim(NamedTuple):
    """When to stop: at a relative error, at a number of samples in every pixel, or at a time of `scheduling.now`."""

    noise: float | None
    most: int | None
    deadline: float | None


class Pilots(NamedTuple):
    """How to take samples that are thrown away.

    scene : by seed and spp, the scene with a sampler for these.
    scratch : makes a film of one tile, of the same type as the picture's.
    tally : makes an empty one for the picture's tiles.
    seed : the picture's, which is below 2^32.
    """

    scene: Callable[[int, int], Scene]
    scratch: Callable[[], FilmView]
    tally: Callable[[], Tally]
    seed: int


class Shares(NamedTuple):
    """What pilots tell of each tile: (tiles,) each.

    samples, in proportion, their mean over pixels being 1; errors, squared and up to a factor, at equal samples.
    """

    samples: Array
    errors: Array


class Standing(NamedTuple):
    """What rounds have settled so far, so that others may go on from there.

    shares; goals int64 (tiles,), the samples that the round under way gives each tile, 0 without one; number of the
    last pilot, its `pilot_spp`, and what all of them took, `pilot_samples` and `pilot_rays`.
    """

    shares: Shares
    goals: NDArray[np.int64]
    number: int = 0
    pilot_spp: int = 0
    pilot_samples: int = 0
    pilot_rays: int = 0

    @classmethod
    def initial(cls, tiles: int) -> "Standing":
        """That of a picture of so many tiles that has had no round."""
        return cls(Shares(np.ones(tiles), np.ones(tiles)), np.zeros(tiles, dtype=np.int64))

    def gathered(self) -> dict[str, NDArray[Any]]:
        """The same as arrays by name: (tiles,), and `pilots` (4,), the numbers."""
        return {**self.shares._asdict(), "goals": self.goals, "pilots": np.array(self[2:], dtype=np.int64)}

    @classmethod
    def of(cls, gathered: Mapping[str, NDArray[Any]]) -> "Standing":
        """What such arrays say."""
        shares = Shares(gathered["samples"], gathered["errors"])
        return cls(shares, gathered["goals"], *gathered["pilots"].tolist())


class Outcome(NamedTuple):
    """Whether the error asked for, if one was, was reached; the samples over all pixels, and rays, that pilots took."""

    reached: bool
    pilot_samples: int
    pilot_rays: int


def seed_of_pilot(seed: int, number: int) -> int:
    """The seed of pilot 1, 2, ...: none that a picture has, whose seeds are below 2^32."""
    return seed + (number << 32)


class Adaptive:
    """A render that goes on from the first pass until an end that `aim` names.

    Which samples it takes depends on the scene and the seed, and not on threads or the clock, but that a deadline may
    end it.
    """

    def __init__(self, canvas: Canvas, pilots: Pilots, aim: Aim, standing: Standing | None = None) -> None:
        """A render that has had no round, or goes on where one stands whose film it has."""
        self._canvas, self._pilots, self._aim = canvas, pilots, aim
        self._most = _MOST if aim.most is None else aim.most
        self._reached = aim.noise is None
        self.standing = standing or Standing.initial(len(canvas.windows))

    @property
    def outcome(self) -> Outcome:
        """What came of it so far."""
        return Outcome(self._reached, self.standing.pilot_samples, self.standing.pilot_rays)

    def run(self, report: Callable[[float, Estimate | None], Any]) -> None:
        """Render.

        Parameters
        ----------
        report : called before every round with the samples over all pixels that the picture is likely to end with,
            and with its error as far as that is known.
        """
        canvas, aim = self._canvas, self._aim
        canvas.by_turns(min(_FEWEST, self._most), aim.deadline)
        canvas.bring_to(self.standing.goals, aim.deadline)
        while not self._canvas.crew.stopped:
            estimate = None
            if aim.noise is not None:
                estimate = canvas.estimate()
                if estimate is None:
                    return
                if estimate.error <= aim.noise:
                    self._reached = True
                    return
            in_time = self._growth_in_time()
            growth = min(self._growth_for_noise(estimate), in_time, self._most / canvas.samples)
            if growth <= 1.0:
                return
            report(growth * canvas.done, estimate)
            self._look(growth)
            if canvas.crew.stopped:
                # Who goes on from here takes the pilot once more.
                return
            before = canvas.done
            self.standing = self.standing._replace(goals=self._goals(estimate, in_time))
            canvas.bring_to(self.standing.goals, aim.deadline)
            if canvas.done == before:
                return

    def _growth_for_noise(self, estimate: Estimate | None) -> float:
        """By how much the samples are to grow, if evenly, to reach the error asked for."""
        if self._aim.noise is None or estimate is None:
            return math.inf
        return float((estimate.error / self._aim.noise) ** (2.0 / estimate.exponent))

    def _growth_in_time(self) -> float:
        """By how much the samples may grow, if evenly, until the deadline."""
        if self._aim.deadline is None:
            return math.inf
        left = max(0.0, self._aim.deadline - now()) * self._canvas.threads
        return 1.0 + left / float(self._canvas.pace @ self._canvas.counts)

    def _look(self, growth: float) -> None:
        """Take pilot samples, if the picture is to grow by enough to be worth more of them than the last ones."""
        canvas = self._canvas
        expected = canvas.samples * min(growth, _LONGEST_ROUND**3)
        spp = 1 << max(0, math.floor(math.log2(_PART_OF_PILOT * expected)))
        if spp < _SMALLEST_PILOT <= _PART_OF_SMALLEST_PILOT * expected:
            spp = _SMALLEST_PILOT
        standing = self.standing
        if spp < max(_SMALLEST_PILOT, 4 * standing.pilot_spp):
            return
        number = standing.number + 1
        scene = self._pilots.scene(seed_of_pilot(self._pilots.seed, number), spp)
        errors, rays, taken = look(canvas, scene, self._pilots.scratch, spp, self._pilots.tally())
        if canvas.crew.stopped:
            return
        self.standing = standing._replace(
            shares=shares(errors, rays / canvas.pixels, canvas.columns, canvas.pixels),
            number=number,
            pilot_spp=spp,
            pilot_samples=standing.pilot_samples + int(canvas.pixels @ taken),
            pilot_rays=standing.pilot_rays + int(rays.sum()),
        )

    def _goals(self, estimate: Estimate | None, in_time: float) -> NDArray[np.int64]:
        """Numbers of samples (tiles,) to have after the next round."""
        canvas, noise = self._canvas, self._aim.noise
        counts, pixels = canvas.counts, canvas.pixels

        def at(level: float) -> NDArray[np.int64]:
            return goals_at(level, self.standing.shares.samples, counts, self._most)

        def is_within(factor: float) -> Callable[[float], bool]:
            return lambda level: bool(pixels @ at(level) <= factor * canvas.done)

        _, level = _boundary(is_within(_LONGEST_ROUND))
        if noise is not None and estimate is not None:
            weight, slope = pixels * self.standing.shares.errors, -estimate.exponent
            goal = (noise / estimate.error) ** 2 * float(weight @ counts**slope)
            _, enough = _boundary(lambda level: bool(weight @ at(level) ** slope > goal))
            level = max(min(level, enough), _boundary(is_within(_SHORTEST_ROUND))[1])
        if self._aim.deadline is not None:
            # The last round is planned for a little more than it can do.
            is_last = in_time < _LAST_ROUND
            seconds = self._canvas.threads * (self._aim.deadline - now()) * (1.0 if is_last else _PLANNED)
            fits = _boundary(lambda level: bool(canvas.pace @ (at(level) - counts) <= seconds))
            level = min(level, fits[1 if is_last else 0])
        return at(level)


def look(
    canvas: Canvas, scene: Scene, scratch: Callable[[], FilmView], spp: int, tally: Tally
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Take samples of every pixel that the picture does not get.

    Parameters
    ----------
    spp : how many, a power of two from 16 on.
    tally : an empty one, for this.

    Returns
    -------
    By tile (tiles,), float64 and int64: the relative squared error of so many samples, up to a factor; the rays traced;
    and the samples taken, which are fewer after an interrupt.
    """
    taken = np.zeros(len(canvas.windows), dtype=np.int64)
    rays = np.zeros(len(canvas.windows), dtype=np.int64)
    if canvas.elsewhere is None:
        _look_here(canvas, scene, scratch, spp, tally, rays, taken)
    else:
        _look_elsewhere(canvas, canvas.elsewhere, scene, spp, tally, rays, taken)
    tally.settle(canvas.mean)
    return np.nan_to_num(tally.tile_mse(np.full(len(canvas.windows), spp))), rays, taken


def _look_here(
    canvas: Canvas,
    scene: Scene,
    scratch: Callable[[], FilmView],
    spp: int,
    tally: Tally,
    rays: NDArray[np.int64],
    taken: NDArray[np.int64],
) -> None:
    films = deque(scratch() for _ in range(canvas.crew.threads))

    def work(room: Workspace, tile: int) -> None:
        window, film = canvas.windows[tile], films.pop()
        film = film._replace(left=window.left, top=window.top)
        for array in (film.mean, film.m2, film.count, film.bad):
            array.fill(0)
        mean = film.mean[: window.bottom - window.top, : window.right - window.left]
        begin = 0
        while begin < spp and not canvas.crew.stopped:
            end = canvas.soon(tile, begin, spp // 2 if begin < spp // 2 else spp)
            rays[tile] += render_tile(scene, film, room, *window, begin, end)
            if end in (spp // 2, spp):
                tally.record(tile, mean, end)
            taken[tile] = begin = end
        films.append(film)

    canvas.crew.run(range(len(canvas.windows)), work)


def _look_elsewhere(
    canvas: Canvas,
    elsewhere: Elsewhere,
    scene: Scene,
    spp: int,
    tally: Tally,
    rays: NDArray[np.int64],
    taken: NDArray[np.int64],
) -> None:
    waiting = deque(range(len(canvas.windows)))
    seconds = canvas.pace * spp

    def draw() -> Errand | None:
        limit = canvas.errand_seconds(float(seconds[list(waiting)].sum()))
        tiles = canvas.batch(waiting, lambda tile: float(seconds[tile]), limit)
        if not tiles:
            return None
        windows, every = tuple(canvas.windows[tile] for tile in tiles), len(tiles)
        marks = ((spp // 2,),) * every
        return Errand(tuple(tiles), windows, (0,) * every, (spp,) * every, marks, scene.sampler, None, mean_only=True)

    def bring(errand: Errand, haul: Haul) -> None:
        for number, (tile, found) in enumerate(zip(errand.tiles, brought(errand, haul), strict=True)):
            for count, mean in (*found.noted, (spp, found.arrays[0])):
                tally.record(tile, mean, count)
            rays[tile], taken[tile] = haul.rays[number], spp

    canvas.crew.send(elsewhere, draw, bring)


def shares(errors: Array, cost: Array, columns: int, pixels: NDArray[np.int64]) -> Shares:
    """What pilots tell, with some caution.

    A tile counts as noisy in part if those around it are: what few samples show, as a caustic, seldom ends at the edge
    of a tile.

    Parameters
    ----------
    errors, cost : (tiles,), squared errors, up to a factor, and rays of a pixel; that takes no less time than one.
    columns : tiles in a row.
    pixels : (tiles,), of each tile.
    """
    grid = errors.reshape(-1, columns)
    rows = np.pad(grid, 1, mode="edge")
    around = sum(rows[y : y + grid.shape[0], x : x + columns] for y in range(3) for x in range(3)) / 9.0
    suspected = np.maximum(grid, _FROM_AROUND * around).ravel()
    if not suspected.any():
        return Shares(np.ones(len(errors)), np.ones(len(errors)))
    samples = np.sqrt(suspected / np.maximum(cost, 1.0))
    samples = np.maximum(samples, _FLOOR * np.average(samples, weights=pixels))
    return Shares(samples / np.average(samples, weights=pixels), suspected)


def goals_at(level: float, samples: Array, counts: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Numbers of samples (tiles,): `level` times their shares, in whole packets, from `counts` up to `most`."""
    wanted = np.minimum(PACKET * np.rint(level * samples / PACKET), most).astype(np.int64)
    return np.asarray(np.maximum(counts, wanted))


def _boundary(holds: Callable[[float], bool]) -> tuple[float, float]:
    """Levels next to each other, up to `_LEVEL_STEP` of them: the first holds what the second, greater one, does not.

    `holds` is true up to some level.  (0, _MOST) are taken as known.
    """
    low, high = 0.0, float(_MOST)
    while high - low > _LEVEL_STEP * max(low, 1.0):
        middle = math.sqrt(max(low, 1.0) * high) if high > 2.0 else 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high
