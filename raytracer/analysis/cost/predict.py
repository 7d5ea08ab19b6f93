"""How error falls and time grows with samples, from replicates of a scene."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cost.measure import REPLICATES, Replicates
from raytracer.cost.results import Point, Prediction
from raytracer.noise import (
    Interval,
    PowerLaw,
    Rate,
    bootstrap_intervals,
    fit_power_law,
    fit_rate,
    halving,
    mapped,
    mse_by_tile,
    root,
    weights,
)

Array = NDArray[np.float64]


# Each takes a fit, a millisecond.
_RESAMPLES = 1000

_HALVES = (slice(0, REPLICATES // 2), slice(REPLICATES // 2, REPLICATES))

# Student's t with a degree of freedom less than replicates, for 95 %.
_STUDENT = 3.182


class Question(NamedTuple):
    """What is asked for: a relative error, and seconds or None."""

    target: float
    budget: float | None


class Picture(NamedTuple):
    """What is known of the whole picture.

    pixels; rays, that a sample in every pixel takes, nan if only a part has been looked at; threads, that share the
    work; fixed, seconds that do not depend on samples.
    """

    pixels: int
    rays: float
    threads: int
    fixed: float


class Fit(NamedTuple):
    """What a sample of the tiles says: how error falls, and seconds for a sample in every pixel."""

    rate: Rate
    seconds: float


class Answers(NamedTuple):
    """What a picture takes: seconds for a sample in every pixel; samples and seconds to the target; the budget's error.

    With None for a budget, its error is that of no samples.
    """

    per_sample: Interval
    target_spp: Interval
    target_seconds: Interval
    budget_error: Interval


def predict(
    measured: Replicates, scale: float, picture: Picture, question: Question, steepest: float, seed: int
) -> Prediction:
    """Predict time and error.

    Everything is worked out anew for each resample of the tiles, so its interval knows of what other tiles may hold,
    and of the noise of what was measured.  Intervals of times also hold how replicates differ in time.

    Parameters
    ----------
    scale : the picture's mean, that errors are relative to; if it is 0, errors are unknown.
    steepest : exponent of the MSE that the sampler can have.
    seed : of the bootstrap.
    """
    columns = _columns(measured, scale, picture)
    squares = bootstrap_intervals(columns[:, :-2], lambda rows: rows, seed)
    answers = _answers(columns, measured.levels, picture, question, steepest, seed)
    answers = _with_drift(answers, _spread_in_time(measured), picture.fixed)
    rate, last = _fitted(columns.sum(axis=0), measured.levels, steepest).rate, measured.levels[-1]
    per_sample, goal = answers.per_sample.value, question.target**2
    power = fit_power_law(measured.levels, [square.value for square in squares], steepest)
    plain_spp, power_spp = PowerLaw(squares[-1].value * last, 1.0).samples(goal), power.samples(goal)
    has_budget = question.budget is not None
    return Prediction(
        points=tuple(
            Point(spp, picture.fixed + spp * per_sample, root(square))
            for spp, square in zip(measured.levels, squares, strict=True)
        ),
        linear=rate.linear,
        steep=rate.steep,
        early=rate.early,
        exponent=power.exponent,
        factor=power.factor,
        halving=halving(rate, len(measured.busy), last),
        # Measured once.
        fixed=Interval(picture.fixed, math.nan, math.nan),
        per_sample=answers.per_sample,
        target=question.target,
        budget=question.budget,
        target_spp=answers.target_spp,
        target_seconds=answers.target_seconds,
        plain_spp=plain_spp,
        plain_seconds=picture.fixed + plain_spp * per_sample,
        power_spp=power_spp,
        power_seconds=picture.fixed + power_spp * per_sample,
        budget_spp=_bought(question, picture.fixed, per_sample) if has_budget else None,
        budget_error=answers.budget_error if has_budget else None,
    )


def _fitted(sums: Array, levels: Sequence[int], steepest: float) -> Fit:
    """What sums of `_columns` say."""
    return Fit(fit_rate(levels, sums[:-2], steepest), float(sums[-2] / sums[-1]))


def _answers(
    columns: Array, levels: Sequence[int], picture: Picture, question: Question, steepest: float, seed: int
) -> Answers:
    """All that depends on the fit, in one go, with what resamples of the tiles make of it."""
    goal = question.target**2

    def answer(sums: Array) -> list[float]:
        found = _fitted(sums, levels, steepest)
        wanted, bought = found.rate.samples(goal), _bought(question, picture.fixed, found.seconds)
        error = math.sqrt(found.rate.mse(bought)) if bought else math.inf
        return [found.seconds, wanted, picture.fixed + wanted * found.seconds, error]

    return Answers(
        *bootstrap_intervals(columns, lambda rows: np.array([answer(row) for row in rows]), seed, _RESAMPLES)
    )


def _with_drift(answers: Answers, spread: float, fixed: float) -> Answers:
    """Answers whose times are less certain, by the `spread` of what replicates took."""
    rendering = _widened(mapped(answers.target_seconds, lambda seconds: seconds - fixed), spread)
    return answers._replace(
        per_sample=_widened(answers.per_sample, spread),
        target_seconds=mapped(rendering, lambda seconds: seconds + fixed),
    )


def relative(best: Array, scale: float) -> Array:
    """Weights of squared errors, as `noise.weights`; nan if the picture is black, to which no error is relative."""
    return weights(best, scale) if scale > 0.0 else np.full_like(best, math.nan)


def _columns(measured: Replicates, scale: float, picture: Picture) -> Array:
    """By tile: its part of the MSE at each level; and two columns whose ratio is the seconds for a sample.

    Tiles that are drawn in proportion to their error have about equal parts of the MSE, which makes for a sharp sum.
    Seconds are those for a ray, times the rays of the whole picture if these are known, since rays tell most of what
    tiles differ in.  The seconds are medians over replicates, so that a disturbance of the machine disturbs few tiles.

    References: Horvitz and Thompson 1952, "A Generalization of Sampling Without Replacement from a Finite Universe",
        Journal of the American Statistical Association 47(260); Cochran 1977, "Sampling Techniques", chapter 6.
    """
    tiles, sure = measured.tiles, 1.0 / measured.tiles.weight
    owner, means = tiles.owner, measured.means.values()
    weight = _misjudged(measured, scale) * relative(measured.means[measured.levels[-1]].mean(axis=0), scale)
    squares = [mse_by_tile(level, weight, owner).sums for level in means]
    # How far the first two replicates and the others are from agreeing tells the noise of what all four say.
    halves = [[mse_by_tile(level[part], weight, owner).sums for part in _HALVES] for level in means]
    noise = [0.5 * (first - second) for first, second in halves]

    seconds = np.median(measured.busy, axis=0) / picture.threads
    known = tiles.pixels / picture.pixels
    if not math.isnan(picture.rays):
        known = measured.rays.mean(axis=0) / picture.rays
    nothing = np.zeros(len(known))
    columns = np.stack([*(part / picture.pixels for part in squares), seconds, known], axis=1)
    noises = np.stack([*(part / picture.pixels for part in noise), nothing, nothing], axis=1)
    return with_spread(columns / sure[:, None], noises / sure[:, None], sure[:, None])


def _misjudged(measured: Replicates, scale: float) -> float:
    """The MSE over what weights from the replicates' own mean make of it.

    What is bright by chance seems to have a small relative error, and hides itself; what is dark by chance counts for
    too much.  The less noisy the mean, the less of that: so an early MSE with weights of the last level, and with
    those of the level before, tell how much is left (Richardson's extrapolation).
    """
    if len(measured.levels) < 3:
        return 1.0
    early, before, last = measured.levels[-3:]
    by_before, by_last = (
        _mean_square(measured, early, relative(measured.means[level].mean(axis=0), scale)) for level in (before, last)
    )
    return float((by_last / by_before) ** (1.0 / (last / before - 1.0))) if by_before > 0.0 else 1.0


def _mean_square(measured: Replicates, level: int, weight: Array) -> float:
    """MSE at a level, but for a factor."""
    squares = mse_by_tile(measured.means[level], weight, measured.tiles.owner).sums
    return float(squares @ measured.tiles.weight)


def with_spread(columns: Array, noise: Array, sure: Array) -> Array:
    """Columns (tiles, k) with the same sums, that spread as those of other samples of tiles, and other noise, would.

    What differs between tiles is no reason for doubt as far as all of them are known: a tile that was drawn with the
    probability `sure` (tiles, 1) adds 1 - sure of its difference from the mean to the variance of a sum, and as much
    of the noise of its own, of which `noise` (tiles, k) is an example, as that leaves out.

    References: Särndal, Swensson and Wretman 1992, "Model Assisted Survey Sampling", section 2.8 (the variance of
        sums over samples with unequal probabilities); Wu 1986, "Jackknife, Bootstrap and Other Resampling Methods in
        Regression Analysis", Annals of Statistics 14(4) (resampling deviations).
    """
    mean = columns.mean(axis=0)
    deviation = np.sqrt(1.0 - sure) * (columns - mean) + np.sqrt(sure) * noise
    return np.asarray(mean + deviation - deviation.mean(axis=0))


def _spread_in_time(measured: Replicates) -> float:
    """Half the width of the interval of the logarithm of the time, as replicates tell it."""
    logs = np.log(measured.busy @ measured.tiles.weight)
    return float(_STUDENT * logs.std(ddof=1) / math.sqrt(len(logs)))


def _widened(interval: Interval, by: float) -> Interval:
    """An interval of a time that is uncertain by one more reason, as the logarithm of a factor."""
    value, low, high = interval
    if not all(math.isfinite(end) and end > 0.0 for end in interval):
        return interval
    down, up = (math.hypot(math.log(value / low), by), math.hypot(math.log(high / value), by))
    return Interval(value, value * math.exp(-down), value * math.exp(up))


def _bought(question: Question, fixed: float, per_sample: float) -> float:
    """Samples per pixel that the budget has time for, 0 if not for one."""
    bought = ((question.budget or 0.0) - fixed) / per_sample
    return bought if bought >= 1.0 else 0.0
