"""Prediction of error and time by samples, from replicates of a scene."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.measure_scene import RayCount, Replicates
from raytracer.analysis.cost.results import ConvergencePoint, Prediction
from raytracer.analysis.cost.study_options import StudySettings
from raytracer.analysis.cost.tile_sample import REPLICATES
from raytracer.core.error_estimate.intervals import NORMAL, Interval, bootstrap_intervals, map_interval, sqrt_interval
from raytracer.core.error_estimate.metric import mse_by_tile
from raytracer.core.error_estimate.rates import PowerLaw, fit_power_law, fit_rate, split_run_penalty

Array = NDArray[np.float64]

# Each takes a fit, which is a millisecond.
_RESAMPLES = 1000

# Student's t for 95 %, with one degree of freedom less than replicates.
_STUDENT = 3.182


class PictureCost(NamedTuple):
    """Known costs of the whole picture.

    pixels : number of pixels.
    rays : rays of a sample in every pixel, and their standard error; nan if only a part has been looked at.
    threads : number of threads that share the work.
    fixed : seconds that do not depend on samples.
    """

    pixels: int
    rays: RayCount
    threads: int
    fixed: float


def predict(measured: Replicates, picture: PictureCost, settings: StudySettings, steepest: float) -> Prediction:
    """Predict time and error.

    Everything is computed anew for each resample of the tiles, so that intervals contain the differences between tiles
    and the noise of the measurements.  Intervals of times also contain the differences between replicates, and the
    uncertainty of the picture's rays.

    Parameters
    ----------
    settings : target, budget, and the seed of the bootstrap.
    steepest : exponent of the MSE that the sampler can have.
    """
    columns, levels, fixed = _tile_columns(measured, picture), measured.levels, picture.fixed
    seed, goal, budget = settings.seed, settings.target**2, settings.budget

    def answers(sums: Array) -> list[float]:
        """Compute seconds per sample, samples and seconds to the target, and the error after the budget."""
        rate, seconds = fit_rate(levels, sums[:-2], steepest), float(sums[-2] / sums[-1])
        wanted, affordable = rate.samples(goal), _samples_in_budget(budget, fixed, seconds)
        error = math.sqrt(rate.mse(affordable)) if affordable else math.inf
        return [seconds, wanted, fixed + wanted * seconds, error]

    squares = bootstrap_intervals(columns[:, :-2], lambda rows: rows, seed)
    per_sample, target_spp, target_seconds, budget_error = bootstrap_intervals(
        columns, lambda rows: np.array([answers(row) for row in rows]), seed, _RESAMPLES
    )
    spread = math.hypot(_spread_in_time(measured), _spread_in_rays(picture.rays))
    rendering = widened(map_interval(target_seconds, lambda seconds: seconds - fixed), spread, spread)
    rate, last = fit_rate(levels, columns.sum(axis=0)[:-2], steepest), levels[-1]
    power = fit_power_law(levels, [square.value for square in squares], steepest)
    plain_spp, power_spp = PowerLaw(squares[-1].value * last, 1.0).samples(goal), power.samples(goal)
    return Prediction(
        points=tuple(
            ConvergencePoint(spp, fixed + spp * per_sample.value, sqrt_interval(square))
            for spp, square in zip(levels, squares, strict=True)
        ),
        **rate._asdict(),
        exponent=power.exponent,
        factor=power.factor,
        halving=split_run_penalty(rate, len(measured.busy), last),
        # Measured once.
        fixed=Interval(fixed, math.nan, math.nan),
        per_sample=widened(per_sample, spread, spread),
        target=settings.target,
        budget=budget,
        target_spp=target_spp,
        target_seconds=map_interval(rendering, lambda seconds: seconds + fixed),
        plain_spp=plain_spp,
        plain_seconds=fixed + plain_spp * per_sample.value,
        power_spp=power_spp,
        power_seconds=fixed + power_spp * per_sample.value,
        budget_spp=None if budget is None else _samples_in_budget(budget, fixed, per_sample.value),
        budget_error=None if budget is None else budget_error,
    )


def _tile_columns(measured: Replicates, picture: PictureCost) -> Array:
    """Compute columns by tile: its part of the MSE at each level; and two whose ratio is the seconds for a sample.

    Tiles that are drawn in proportion to their error have about equal parts of the MSE, which makes for a sharp sum.
    Seconds are those for a ray, times the rays of the whole picture if these are known, since rays tell most of what
    tiles differ in.  The seconds for a ray are medians over replicates, so that a disturbance of the machine disturbs
    few tiles.

    References: Horvitz and Thompson 1952, "A Generalization of Sampling Without Replacement from a Finite Universe",
        Journal of the American Statistical Association 47(260); Cochran 1977, "Sampling Techniques", chapter 6.
    """
    tiles, sure = measured.tiles, 1.0 / measured.tiles.weight[:, None]
    weight = _weight_correction(measured) * measured.weight(measured.levels[-1])

    def squares(part: slice) -> Array:
        """Compute the squared errors of tiles at each level from some replicates: (tiles, levels)."""
        sums = [mse_by_tile(level[part], weight, tiles.owner).sums for level in measured.means.values()]
        return np.stack(sums, axis=1)

    rays = measured.rays.mean(axis=0)
    to_mean = np.divide(rays, measured.rays, out=np.ones_like(measured.rays), where=measured.rays > 0.0)
    seconds = np.median(measured.busy * to_mean, axis=0) / picture.threads
    known = tiles.pixels / picture.pixels if math.isnan(picture.rays.value) else rays / picture.rays.value
    columns = np.column_stack([squares(slice(None)) / picture.pixels, seconds, known])
    # The difference between the first two replicates and the others tells the noise of the mean of all four.
    noise = 0.5 * (squares(slice(0, REPLICATES // 2)) - squares(slice(REPLICATES // 2, REPLICATES)))
    noise = np.pad(noise / picture.pixels, ((0, 0), (0, 2)))
    return with_sampling_spread(columns / sure, noise / sure, sure)


def _weight_correction(measured: Replicates) -> float:
    """Estimate the ratio of the MSE to that by weights from the replicates' own mean.

    What is bright by chance seems to have a small relative error, and hides itself; what is dark by chance counts for
    too much.  The less noisy the mean, the less of that: so an early MSE with weights of the last level, and with
    those of the level before, tell how much is left (Richardson's extrapolation).
    """
    if len(measured.levels) < 3:
        return 1.0
    early, before, last = measured.levels[-3:]
    owner, stands = measured.tiles.owner, measured.tiles.weight
    by_before, by_last = (
        float(mse_by_tile(measured.means[early], measured.weight(level), owner).sums @ stands)
        for level in (before, last)
    )
    return float((by_last / by_before) ** (1.0 / (last / before - 1.0))) if by_before > 0.0 else 1.0


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


def _spread_in_rays(rays: RayCount) -> float:
    """Compute half the width of the interval of the logarithm of the picture's rays; 0 if seconds do not go by them."""
    return NORMAL * rays.error / rays.value if rays.value > 0.0 else 0.0


def widened(interval: Interval, down: float, up: float) -> Interval:
    """Widen an interval by uncertainties of its logarithm, downwards and upwards."""
    value, low, high = interval
    if not all(math.isfinite(end) and end > 0.0 for end in interval):
        return interval
    down, up = math.hypot(math.log(value / low), down), math.hypot(math.log(high / value), up)
    return Interval(value, value * math.exp(-down), value * math.exp(up))


def _samples_in_budget(budget: float | None, fixed: float, per_sample: float) -> float:
    """Compute the samples per pixel that the budget has time for; 0 if less than one."""
    samples = ((budget or 0.0) - fixed) / per_sample
    return samples if samples >= 1.0 else 0.0
