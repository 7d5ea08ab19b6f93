"""Adaptive sampling: rounds over the picture that put samples where the error is, until it is small or time is up.

Before a round, pilot samples measure how noisy each tile is and how many rays it takes.  They have a seed of their own
and are thrown away: an average over samples that decide on their own number is biased, since pixels that look quiet by
chance get no more.  The picture's own samples decide only on one number for all tiles, the ratio of its error to the
one that was asked for.

The squared error sum_t p_t v_t / n_t of tiles t of p_t pixels falls the most for a number of rays sum_t p_t c_t n_t if
the samples n_t are in proportion to sqrt(v_t / c_t).

References: Kirk, Arvo 1991, "Unbiased Sampling Techniques for Image Synthesis", SIGGRAPH '91 (pilots that are thrown
away); Cochran 1977, "Sampling Techniques", 3rd ed., section 5.5 (the best shares where strata differ in cost).
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.halves import ErrorEstimate, ErrorEstimator
from raytracer.core.error_estimate.rates import MIN_EXPONENT
from raytracer.core.sampling import SAMPLERS
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.tile_job import TileJob, TileResult, split_by_tile
from raytracer.rendering.tile_scheduler import FIRST_PASS, TileQueue, now

if TYPE_CHECKING:
    from raytracer.rendering.compilation import PreparedScene

# ---- Pilot samples


def pilot_seed(seed: int, number: int) -> int:
    """Return the seed of pilot 1, 2, ...: none that a picture has, whose seeds are below 2^32."""
    return seed + (number << 32)


def take_pilot_samples(
    queue: TileQueue, prepared: "PreparedScene", number: int, spp: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Render pilot samples of every pixel, which are not added to the picture.

    number : of the pilot, from 1.
    spp : samples a pixel, a power of two from 16 on.

    Returns
    -------
    By tile (tiles,), float64 and int64: the relative squared error of so many samples, up to a factor; the rays traced;
    and the samples taken, which are fewer after an interrupt.
    """
    settings = prepared.packed.spec.render
    scene = prepared.scene._replace(sampler=SAMPLERS[settings.sampler](pilot_seed(settings.seed, number), spp))
    # Shares need only one difference, for which it takes half the memory.
    estimator = ErrorEstimator(queue.windows, MIN_EXPONENT)
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
        films.extend(prepared.empty_tile() for _ in range(queue.pool.threads))
        queue.pool.run(range(len(queue.windows)), work)
    else:
        queue.pool.run_remote(queue.remote, next_job, merge)
    estimator.set_scale(queue.mean)
    return np.nan_to_num(estimator.tile_mse(np.full(len(queue.windows), spp))), rays, taken


# ---- Rounds over the picture

Array = NDArray[np.float64]

# Samplers count to 2^32.
_MAX_SPP = 2**31

# Samples that every pixel gets: two differences, that an estimate may rest on.
_MIN_SPP = 4 * FIRST_PASS

# A round brings the picture to at most so many times its samples, since what is known so far may mislead; and to at
# least so many times, since an estimate that is looked at often enough will be low once.
_MAX_GROWTH = 4.0
_MIN_GROWTH = 1.05

# Pilots of `_SMALLEST_PILOT` samples may take the first part of the samples that the picture is expected to end with,
# and larger ones the second.  To the same error, shares by 16 samples take 0.85, 0.80, 0.68 and 0.75 of an even
# render's rays in cover, cornell, glass and smoke; by 64, 0.84, 0.79, 0.63 and 0.74; the best shares that tiles can
# have, 0.82, 0.77, 0.58 and 0.73.
_SMALLEST_PILOT_FRACTION = 0.08
_PILOT_FRACTION = 0.03
_SMALLEST_PILOT = 2 * FIRST_PASS

# Samples of a tile over the mean of all tiles, at least: a pilot may have missed something there.  Of the numbers above
# this takes less than 0.01 away, and 1/4 up to 0.02; for a picture that is half empty 0.50 is the best, and 0.52 and
# 0.57 are left.
_MIN_SHARE = 1.0 / 16.0

# Part of the noise of the 3 x 3 tiles around it that a tile is taken to have, at least; that takes 0.01 away, too.
_NEIGHBOR_FRACTION = 0.125

# Relative difference up to which two levels of samples count as one: finer than a packet's share of 8,000 samples.
_LEVEL_STEP = 2.0**-10

# Part of the time left that a round is planned for, but if the samples grow by less than a quarter in all of it.
_ROUND_TIME_FRACTION = 0.9
_LAST_ROUND_GROWTH = 1.25


class AdaptiveState(NamedTuple):
    """The state of adaptive sampling between rounds, from which a checkpoint goes on.

    shares : (tiles,), of the tiles in the samples, by the last pilot; their mean over pixels is 1.
    errors : (tiles,), squared and up to a factor, at equal samples.
    goals : int64 (tiles,), samples that the current round gives each tile; 0 without one.
    number : of the last pilot.
    pilot_spp : samples a pixel of the last pilot.
    pilot_samples, pilot_rays : samples over all pixels and rays of all pilots.
    """

    shares: Array
    errors: Array
    goals: NDArray[np.int64]
    number: int = 0
    pilot_spp: int = 0
    pilot_samples: int = 0
    pilot_rays: int = 0

    @classmethod
    def initial(cls, tiles: int) -> "AdaptiveState":
        """Return the state before the first round, for so many tiles."""
        return cls(np.ones(tiles), np.ones(tiles), np.zeros(tiles, dtype=np.int64))

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state as arrays by name: (tiles,), and `pilots` (4,), the numbers."""
        shares = {"samples": self.shares, "errors": self.errors}
        return {**shares, "goals": self.goals, "pilots": np.array(self[3:], dtype=np.int64)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "AdaptiveState":
        """Make the state of what `state_arrays` has returned."""
        return cls(arrays["samples"], arrays["errors"], arrays["goals"], *arrays["pilots"].tolist())


class Outcome(NamedTuple):
    """The outcome of the samples of a render.

    reached : True if all samples were taken, or the error asked for was reached.
    pilot_samples, pilot_rays : samples over all pixels and rays of pilots.
    """

    reached: bool
    pilot_samples: int
    pilot_rays: int


class AdaptiveRender:
    """Adaptive sampling of a picture after its first pass: until its error, its samples or the time are as asked for.

    Which samples it takes depends on the scene and the seed, and not on threads or the clock, but that a deadline may
    end it.
    """

    def __init__(
        self, queue: TileQueue, prepared: "PreparedScene", deadline: float | None, state: AdaptiveState | None = None
    ) -> None:
        """Begin before the first round, or go on from a state of the queue's film; `deadline` is a time of `now`."""
        self._queue, self._prepared, self._deadline = queue, prepared, deadline
        options = prepared.options
        self._noise, self._max_spp = options.noise, _MAX_SPP if options.max_spp is None else options.max_spp
        self._reached = options.noise is None
        self.adaptive_state = state or AdaptiveState.initial(len(queue.windows))

    @property
    def outcome(self) -> Outcome:
        """Return the outcome so far."""
        return Outcome(self._reached, self.adaptive_state.pilot_samples, self.adaptive_state.pilot_rays)

    def run(self, report: Callable[[float, ErrorEstimate | None], Any]) -> None:
        """Render.

        report : called before every round with the samples over all pixels that the picture is likely to end with,
            and with its error as far as that is known.
        """
        queue, noise = self._queue, self._noise
        queue.render_passes(min(_MIN_SPP, self._max_spp), self._deadline)
        queue.render_to(self.adaptive_state.goals, self._deadline)
        while not self._queue.pool.is_stopped:
            estimate = None
            if noise is not None:
                estimate = queue.estimate()
                if estimate is None:
                    return
                if estimate.error <= noise:
                    self._reached = True
                    return
            in_time = self._growth_in_time()
            growth = min(in_time, self._max_spp / queue.samples)
            if noise is not None and estimate is not None:
                # If evenly, to reach the error asked for.
                growth = min(growth, float((estimate.error / noise) ** (2.0 / estimate.exponent)))
            if growth <= 1.0:
                return
            report(growth * queue.done, estimate)
            self._update_pilots(growth)
            if queue.pool.is_stopped:
                # A render that goes on from here takes the pilot again.
                return
            before = queue.done
            self.adaptive_state = self.adaptive_state._replace(goals=self._goals(estimate, in_time))
            queue.render_to(self.adaptive_state.goals, self._deadline)
            if queue.done == before:
                return

    def _growth_in_time(self) -> float:
        """Return the factor by which the samples may grow, if evenly, until the deadline."""
        if self._deadline is None:
            return math.inf
        left = max(0.0, self._deadline - now()) * self._queue.threads
        return 1.0 + left / float(self._queue.seconds_per_sample @ self._queue.counts)

    def _update_pilots(self, growth: float) -> None:
        """Take pilot samples, if the picture is to grow by enough to be worth more of them than the last ones."""
        queue = self._queue
        expected = queue.samples * min(growth, _MAX_GROWTH**3)
        spp = 1 << max(0, math.floor(math.log2(_PILOT_FRACTION * expected)))
        if spp < _SMALLEST_PILOT <= _SMALLEST_PILOT_FRACTION * expected:
            spp = _SMALLEST_PILOT
        state = self.adaptive_state
        if spp < max(_SMALLEST_PILOT, 4 * state.pilot_spp):
            return
        number = state.number + 1
        errors, rays, taken = take_pilot_samples(queue, self._prepared, number, spp)
        if queue.pool.is_stopped:
            return
        shares, errors = allocate_samples(errors, rays / queue.pixels, queue.columns, queue.pixels)
        self.adaptive_state = state._replace(
            shares=shares,
            errors=errors,
            number=number,
            pilot_spp=spp,
            pilot_samples=state.pilot_samples + int(queue.pixels @ taken),
            pilot_rays=state.pilot_rays + int(rays.sum()),
        )

    def _goals(self, estimate: ErrorEstimate | None, in_time: float) -> NDArray[np.int64]:
        """Return the numbers of samples (tiles,) to have after the next round."""
        queue, noise = self._queue, self._noise
        counts, pixels = queue.counts, queue.pixels

        def at(level: float) -> NDArray[np.int64]:
            return sample_goals(level, self.adaptive_state.shares, counts, self._max_spp)

        def is_within(factor: float) -> Callable[[float], bool]:
            return lambda level: bool(pixels @ at(level) <= factor * queue.done)

        _, level = _bisect(is_within(_MAX_GROWTH))
        if noise is not None and estimate is not None:
            weight, slope = pixels * self.adaptive_state.errors, -estimate.exponent
            goal = (noise / estimate.error) ** 2 * float(weight @ counts**slope)
            _, enough = _bisect(lambda level: bool(weight @ at(level) ** slope > goal))
            level = max(min(level, enough), _bisect(is_within(_MIN_GROWTH))[1])
        if self._deadline is not None:
            # The last round is planned for a little more than it can do.
            is_last = in_time < _LAST_ROUND_GROWTH
            seconds = self._queue.threads * (self._deadline - now()) * (1.0 if is_last else _ROUND_TIME_FRACTION)
            fits = _bisect(lambda level: bool(queue.seconds_per_sample @ (at(level) - counts) <= seconds))
            level = min(level, fits[1 if is_last else 0])
        return at(level)


def allocate_samples(errors: Array, cost: Array, columns: int, pixels: NDArray[np.int64]) -> tuple[Array, Array]:
    """Find the shares of tiles in the samples by their errors in a pilot, with some caution; and those errors.

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
    suspected = np.maximum(grid, _NEIGHBOR_FRACTION * around).ravel()
    if not suspected.any():
        return np.ones(len(errors)), np.ones(len(errors))
    samples = np.sqrt(suspected / np.maximum(cost, 1.0))
    samples = np.maximum(samples, _MIN_SHARE * np.average(samples, weights=pixels))
    return samples / np.average(samples, weights=pixels), suspected


def sample_goals(level: float, samples: Array, counts: NDArray[np.int64], max_spp: int) -> NDArray[np.int64]:
    """Return numbers of samples (tiles,): `level` times their shares, in whole packets, from `counts` to `max_spp`."""
    wanted = np.minimum(PACKET * np.rint(level * samples / PACKET), max_spp).astype(np.int64)
    return np.asarray(np.maximum(counts, wanted))


def _bisect(holds: Callable[[float], bool]) -> tuple[float, float]:
    """Find neighbouring levels, up to `_LEVEL_STEP`: `holds` is true of the first, and not of the greater second.

    `holds` is true up to some level.  It is taken to be true of 0 and false of `_MAX_SPP`.
    """
    low, high = 0.0, float(_MAX_SPP)
    while high - low > _LEVEL_STEP * max(low, 1.0):
        middle = math.sqrt(max(low, 1.0) * high) if high > 2.0 else 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high
