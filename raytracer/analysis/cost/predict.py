"""Prediction of error and time by samples, from replicates of a scene."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.replicates import Replicates
from raytracer.analysis.cost.results import ConvergencePoint, Prediction
from raytracer.analysis.cost.workload import REPLICATES
from raytracer.core.error_estimate.intervals import Interval, bootstrap_intervals, map_interval, sqrt_interval
from raytracer.core.error_estimate.metric import error_weights, mse_by_tile
from raytracer.core.error_estimate.rates import ConvergenceRate, PowerLaw, fit_power_law, fit_rate, split_run_penalty

Array = NDArray[np.float64]


# Each takes a fit, which is a millisecond.
_RESAMPLES = 1000

_HALVES = (slice(0, REPLICATES // 2), slice(REPLICATES // 2, REPLICATES))

# Student's t for 95 %, with one degree of freedom less than replicates.
_STUDENT = 3.182


class PredictionGoal(NamedTuple):
    """A goal that is asked for: a relative error, and seconds or None."""

    target: float
    budget: float | None


class PictureCost(NamedTuple):
    """Known costs of the whole picture.

    pixels : number of pixels.
    rays : rays of a sample in every pixel; nan if only a part has been looked at.
    threads : number of threads that share the work.
    fixed : seconds that do not depend on samples.
    """

    pixels: int
    rays: float
    threads: int
    fixed: float


class ConvergenceFit(NamedTuple):
    """A fit to a sample of the tiles: convergence of the error, and seconds for a sample in every pixel."""

    rate: ConvergenceRate
    seconds: float


class PredictionIntervals(NamedTuple):
    """Predicted intervals of a picture.

    per_sample : seconds for a sample in every pixel.
    target_spp, target_seconds : to reach the target.
    budget_error : after the budget; without one, that of no samples.
    """

    per_sample: Interval
    target_spp: Interval
    target_seconds: Interval
    budget_error: Interval


def predict(
    measured: Replicates, scale: float, picture: PictureCost, question: PredictionGoal, steepest: float, seed: int
) -> Prediction:
    """Predict time and error.

    Everything is computed anew for each resample of the tiles, so that intervals contain the differences between tiles
    and the noise of the measurements.  Intervals of times also contain the differences between replicates.

    Parameters
    ----------
    scale : mean of the picture, which errors are relative to; if it is 0, errors are unknown.
    steepest : exponent of the MSE that the sampler can have.
    seed : of the bootstrap.
    """
    columns = _tile_columns(measured, scale, picture)
    squares = bootstrap_intervals(columns[:, :-2], lambda rows: rows, seed)
    answers = _predict_intervals(columns, measured.levels, picture, question, steepest, seed)
    answers = _with_drift(answers, _spread_in_time(measured), picture.fixed)
    rate, last = _fit(columns.sum(axis=0), measured.levels, steepest).rate, measured.levels[-1]
    per_sample, goal = answers.per_sample.value, question.target**2
    power = fit_power_law(measured.levels, [square.value for square in squares], steepest)
    plain_spp, power_spp = PowerLaw(squares[-1].value * last, 1.0).samples(goal), power.samples(goal)
    has_budget = question.budget is not None
    return Prediction(
        points=tuple(
            ConvergencePoint(spp, picture.fixed + spp * per_sample, sqrt_interval(square))
            for spp, square in zip(measured.levels, squares, strict=True)
        ),
        linear=rate.linear,
        steep=rate.steep,
        early=rate.early,
        exponent=power.exponent,
        factor=power.factor,
        halving=split_run_penalty(rate, len(measured.busy), last),
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
        budget_spp=_samples_in_budget(question, picture.fixed, per_sample) if has_budget else None,
        budget_error=answers.budget_error if has_budget else None,
    )


def _fit(sums: Array, levels: Sequence[int], steepest: float) -> ConvergenceFit:
    """Fit convergence and time to sums of `_tile_columns`."""
    return ConvergenceFit(fit_rate(levels, sums[:-2], steepest), float(sums[-2] / sums[-1]))


def _predict_intervals(
    columns: Array, levels: Sequence[int], picture: PictureCost, question: PredictionGoal, steepest: float, seed: int
) -> PredictionIntervals:
    """Predict all that depends on the fit in one go, with intervals from resamples of the tiles."""
    goal = question.target**2

    def answer(sums: Array) -> list[float]:
        fit = _fit(sums, levels, steepest)
        wanted, affordable = fit.rate.samples(goal), _samples_in_budget(question, picture.fixed, fit.seconds)
        error = math.sqrt(fit.rate.mse(affordable)) if affordable else math.inf
        return [fit.seconds, wanted, picture.fixed + wanted * fit.seconds, error]

    return PredictionIntervals(
        *bootstrap_intervals(columns, lambda rows: np.array([answer(row) for row in rows]), seed, _RESAMPLES)
    )


def _with_drift(answers: PredictionIntervals, spread: float, fixed: float) -> PredictionIntervals:
    """Widen the intervals of times by the `spread` of the times of replicates."""
    rendering = _widened(map_interval(answers.target_seconds, lambda seconds: seconds - fixed), spread)
    return answers._replace(
        per_sample=_widened(answers.per_sample, spread),
        target_seconds=map_interval(rendering, lambda seconds: seconds + fixed),
    )


def relative_weights(best: Array, scale: float) -> Array:
    """Compute weights of squared errors as `error_weights`; nan if the picture is black: no error is relative to it."""
    return error_weights(best, scale) if scale > 0.0 else np.full_like(best, math.nan)


def _tile_columns(measured: Replicates, scale: float, picture: PictureCost) -> Array:
    """Compute columns by tile: its part of the MSE at each level; and two whose ratio is the seconds for a sample.

    Tiles that are drawn in proportion to their error have about equal parts of the MSE, which makes for a sharp sum.
    Seconds are those for a ray, times the rays of the whole picture if these are known, since rays tell most of what
    tiles differ in.  The seconds are medians over replicates, so that a disturbance of the machine disturbs few tiles.

    References: Horvitz and Thompson 1952, "A Generalization of Sampling Without Replacement from a Finite Universe",
        Journal of the American Statistical Association 47(260); Cochran 1977, "Sampling Techniques", chapter 6.
    """
    tiles, sure = measured.tiles, 1.0 / measured.tiles.weight
    owner, means = tiles.owner, measured.means.values()
    weight = _weight_correction(measured, scale) * relative_weights(
        measured.means[measured.levels[-1]].mean(axis=0), scale
    )
    squares = [mse_by_tile(level, weight, owner).sums for level in means]
    # The difference between the first two replicates and the others tells the noise of the mean of all four.
    halves = [[mse_by_tile(level[part], weight, owner).sums for part in _HALVES] for level in means]
    noise = [0.5 * (first - second) for first, second in halves]

    seconds = np.median(measured.busy, axis=0) / picture.threads
    known = tiles.pixels / picture.pixels
    if not math.isnan(picture.rays):
        known = measured.rays.mean(axis=0) / picture.rays
    nothing = np.zeros(len(known))
    columns = np.stack([*(part / picture.pixels for part in squares), seconds, known], axis=1)
    noises = np.stack([*(part / picture.pixels for part in noise), nothing, nothing], axis=1)
    return with_sampling_spread(columns / sure[:, None], noises / sure[:, None], sure[:, None])


def _weight_correction(measured: Replicates, scale: float) -> float:
    """Estimate the ratio of the MSE to that by weights from the replicates' own mean.

    What is bright by chance seems to have a small relative error, and hides itself; what is dark by chance counts for
    too much.  The less noisy the mean, the less of that: so an early MSE with weights of the last level, and with
    those of the level before, tell how much is left (Richardson's extrapolation).
    """
    if len(measured.levels) < 3:
        return 1.0
    early, before, last = measured.levels[-3:]
    by_before, by_last = (
        _mean_square(measured, early, relative_weights(measured.means[level].mean(axis=0), scale))
        for level in (before, last)
    )
    return float((by_last / by_before) ** (1.0 / (last / before - 1.0))) if by_before > 0.0 else 1.0


def _mean_square(measured: Replicates, level: int, weight: Array) -> float:
    """Compute the MSE at a level, but for a factor."""
    squares = mse_by_tile(measured.means[level], weight, measured.tiles.owner).sums
    return float(squares @ measured.tiles.weight)


def with_sampling_spread(columns: Array, noise: Array, sure: Array) -> Array:
    """Change columns (tiles, k) but not their sums, so that they vary as other samples of tiles, and noise, would.

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
    """Compute half the width of the interval of the logarithm of the time, from the replicates."""
    logs = np.log(measured.busy @ measured.tiles.weight)
    return float(_STUDENT * logs.std(ddof=1) / math.sqrt(len(logs)))


def _widened(interval: Interval, by: float) -> Interval:
    """Widen the interval of a time by an uncertainty of its logarithm."""
    value, low, high = interval
    if not all(math.isfinite(end) and end > 0.0 for end in interval):
        return interval
    down, up = (math.hypot(math.log(value / low), by), math.hypot(math.log(high / value), by))
    return Interval(value, value * math.exp(-down), value * math.exp(up))


def _samples_in_budget(question: PredictionGoal, fixed: float, per_sample: float) -> float:
    """Compute the samples per pixel that the budget has time for; 0 if less than one."""
    samples = ((question.budget or 0.0) - fixed) / per_sample
    return samples if samples >= 1.0 else 0.0
