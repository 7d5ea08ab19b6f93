"""Comparison of variants with their scene, in time, noise and bias.

Ratios are measured in the same rounds and tiles; seconds and errors are the scene's prediction times the ratio, so that
rows of a table agree with each other and with the prediction.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.predict import PictureCost, widened, with_sampling_spread
from raytracer.analysis.cost.results import Prediction, VariantResult
from raytracer.analysis.cost.rounds import Rounds
from raytracer.analysis.cost.tile_sample import TileSample
from raytracer.analysis.cost.variants import Variant
from raytracer.core.error_estimate.intervals import (
    UNKNOWN,
    Interval,
    map_interval,
    ratio_interval,
    ratio_of_sums,
    sqrt_interval,
)
from raytracer.core.error_estimate.metric import TileSums, brightness_by_tile, mse_by_tile, squared_bias_by_tile
from raytracer.core.error_estimate.rates import ConvergenceRate, fit_rate, sampler_exponent

Array = NDArray[np.float64]

# Standard deviations from which on a bias or time is significant: there are many variants, and tails are heavy.
_Z = 3.0

# Rounds from which on each half of them has an estimate of noise.
_FEWEST_TO_HALVE = 4

_UNSEEN = "light that it finds rarely has not shown up yet, so its noise is not known"

_SAME = Interval(1.0, 1.0, 1.0)
_NO_BIAS = Interval(0.0, 0.0, 0.0)


class Baseline(NamedTuple):
    """Measurements of the scene that variants are compared with.

    scene : its rounds.
    tiles : the tiles of the rounds.
    weight : (P, 3), weights of squared errors.
    picture : costs of the whole picture.
    rays : rays of a sample of a pixel.
    seed : of the bootstrap.
    """

    scene: Rounds
    tiles: TileSample
    weight: Array
    prediction: Prediction
    picture: PictureCost
    rays: float
    seed: int

    @property
    def rate(self) -> ConvergenceRate:
        """Convergence of the scene."""
        return ConvergenceRate(self.prediction.linear, self.prediction.steep, self.prediction.early)


def baseline_result(basis: Baseline) -> VariantResult:
    """Make the row of the scene itself."""
    prediction, spp = basis.prediction, basis.scene.spp
    near = min(prediction.points, key=lambda point: abs(math.log(point.spp / spp))).error
    error = prediction.error(spp)
    return VariantResult(
        "scene",
        "scene",
        "the scene as it is",
        per_sample=prediction.per_sample,
        per_ray=_per_ray(basis, prediction.per_sample, basis.rays),
        rays_per_sample=basis.rays,
        time=_SAME,
        spp=spp,
        noise=map_interval(near, lambda end: error * end / near.value if near.value else 0.0),
        noise_ratio=_SAME,
        target_spp=prediction.target_spp.value,
        target_seconds=prediction.target_seconds.value,
    )


def noise_floor(basis: Baseline, control: Rounds) -> tuple[float, float]:
    """Measure how much equal scenes differ in time and noise, as logarithms of ratios, by the repeat of the same."""
    time = _largest_log(ratio_interval(*_times(basis, control), basis.seed))
    return time, _largest_log(_noise_ratio(basis, control.mean, basis.scene.mean))


def variant_result(
    basis: Baseline, variant: Variant, rounds: Rounds, sampler: str, floor: tuple[float, float]
) -> VariantResult:
    """Compare a variant, which is rendered with a `sampler`, with the scene."""
    time_floor, noise_floor = floor
    in_rounds = ratio_interval(*_times(basis, rounds), basis.seed)
    time = _with_tiles(basis, in_rounds, rounds)
    per_sample = map_interval(time, lambda ratio: ratio * basis.prediction.per_sample.value)
    own, scene = (float(each.rays.mean(axis=0) @ basis.tiles.weight) for each in (rounds, basis.scene))
    rays = basis.rays * own / scene
    # The measured bias of the control shows what chance does.
    is_certain = variant.same_mean and variant.group != "control"
    result = VariantResult(
        *variant[:3],
        per_sample=per_sample,
        per_ray=_per_ray(basis, per_sample, rays),
        rays_per_sample=rays,
        time=time,
        time_differs=_differs(in_rounds, time_floor) and is_steady(*_times(basis, rounds)),
        spp=rounds.spp,
        bias=None if is_certain else UNKNOWN,
        unbiased=variant.same_mean,
        brightness=_brightness(basis, rounds),
    )
    bias, resolved = _bias(basis, rounds)
    if variant.same_mean and resolved and result.brightness is not None and result.brightness.high < 0.0:
        return replace(result, why_blank=_UNSEEN)
    noise_ratio = _noise_ratio(basis, rounds.mean, basis.scene.mean)
    resolved = resolved and not variant.same_mean
    noise_differs = _differs(noise_ratio, noise_floor)
    # What is no measurable difference makes none in what follows from it.
    rate = _rate(basis, rounds, sampler) if noise_differs else basis.rate
    seconds = (per_sample if result.time_differs else basis.prediction.per_sample).value
    of_target = _NO_BIAS if variant.same_mean else bias
    spp, why_blank = _samples_to_target(basis.prediction.target, rate, of_target, bias_resolved=resolved)
    return replace(
        result,
        noise=_noise(basis, rounds, noise_ratio),
        noise_ratio=noise_ratio,
        noise_differs=noise_differs,
        bias=None if is_certain else bias,
        bias_resolved=resolved,
        target_spp=spp,
        target_seconds=None if spp is None else basis.prediction.fixed.value + spp * seconds,
        why_blank=why_blank,
    )


# ---- Time


def _times(basis: Baseline, rounds: Rounds) -> tuple[Array, Array]:
    """Sum the times of a variant and of the scene in each round."""
    return rounds.busy @ basis.tiles.weight, basis.scene.busy @ basis.tiles.weight


def is_steady(own: Array, scene: Array) -> bool:
    """Tell if times (rounds,) differ by more than their ratios spread, and than one of a dozen variants does by chance.

    A 95 % interval of one variant in twenty excludes 1 though nothing differs.
    """
    logs = np.log(own / scene)
    return bool(abs(logs.mean()) > _Z * logs.std(ddof=1) / math.sqrt(len(logs)))


def _with_tiles(basis: Baseline, ratio: Interval, rounds: Rounds) -> Interval:
    """Widen the ratio for the whole picture: its other tiles may have more or less of what differs."""
    if np.all(basis.tiles.weight == 1.0):
        return ratio
    own, scene = (np.median(busy, axis=0) * basis.tiles.weight for busy in (rounds.busy, basis.scene.busy))
    by_tile = ratio_of_sums(own, scene, basis.seed)
    return widened(ratio, math.log(by_tile.value / by_tile.low), math.log(by_tile.high / by_tile.value))


def _per_ray(basis: Baseline, per_sample: Interval, rays: float) -> Interval:
    """Convert to nanoseconds for a ray, over all threads."""
    return map_interval(per_sample, lambda seconds: 1e9 * seconds / (basis.picture.pixels * rays))


# ---- Noise


def _mse(basis: Baseline, means: Array) -> TileSums:
    return mse_by_tile(means, basis.weight, basis.tiles.owner)


def _noise_ratio(basis: Baseline, own: Array, scene: Array) -> Interval:
    """Compute the MSE over that of the scene; nan if the scene has no noise."""
    return _ratio(basis, lambda part: (_mse(basis, own[part]).sums, _mse(basis, scene[part]).sums), len(own))


def _ratio(basis: Baseline, sums: Callable[[slice], tuple[Array, Array]], rounds: int) -> Interval:
    """Compute a ratio of sums over the picture from those by tile; `sums` gives them for a part of the rounds."""
    tiles = basis.tiles
    noise = np.zeros((len(tiles.windows), 2))
    if rounds >= _FEWEST_TO_HALVE:
        first, second = (np.stack(sums(part), axis=1) for part in (slice(0, rounds // 2), slice(rounds // 2, rounds)))
        noise = 0.5 * (first - second)
    columns, sure = np.stack(sums(slice(None)), axis=1), 1.0 / tiles.weight[:, None]
    spread = with_sampling_spread(
        columns / sure, noise / sure, sure if rounds >= _FEWEST_TO_HALVE else np.zeros_like(sure)
    )
    return ratio_of_sums(spread[:, 0], spread[:, 1], basis.seed)


def _noise(basis: Baseline, rounds: Rounds, ratio: Interval) -> Interval:
    """Compute the relative error of a render with the rounds' samples."""
    scene = basis.rate.mse(rounds.spp)
    if math.isfinite(ratio.value):
        return sqrt_interval(map_interval(ratio, lambda factor: factor * scene))
    squares, weight = _mse(basis, rounds.mean), basis.tiles.weight
    return sqrt_interval(ratio_of_sums(squares.sums * weight, squares.pixels * weight, basis.seed))


def _rate(basis: Baseline, rounds: Rounds, sampler: str) -> ConvergenceRate | None:
    """Fit the convergence of a variant: that of the scene, unless its own sampler differs; None if it is unknown."""
    levels = {rounds.spp: (rounds.mean, basis.scene.mean)}
    if rounds.early is not None and basis.scene.early is not None:
        levels[rounds.early_spp] = (rounds.early, basis.scene.early)
    ratios = {spp: _noise_ratio(basis, *means).value for spp, means in levels.items()}
    # Light that early samples of the scene missed makes no noise there that another's could be so many times.
    ratios = {spp: ratio for spp, ratio in ratios.items() if spp == rounds.spp or math.isfinite(ratio)}
    if not math.isfinite(ratios[rounds.spp]):
        # The scene has none at all.
        noise = _noise(basis, rounds, UNKNOWN).value
        return None if math.isnan(noise) else fit_rate([rounds.spp], [noise**2], 1.0)
    if len(ratios) == 1 and sampler_exponent(sampler) > 1.0:
        return ConvergenceRate(*(ratios[rounds.spp] * term for term in basis.rate))
    spp = sorted(ratios)
    return fit_rate(spp, [ratios[n] * basis.rate.mse(n) for n in spp], sampler_exponent(sampler))


# ---- Bias


def _bias(basis: Baseline, rounds: Rounds) -> tuple[Interval, bool]:
    """Compute the relative bias, and tell if it is known not to be 0."""
    owner, pixels = basis.tiles.owner, basis.tiles.pixels.astype(np.float64)

    def sums(part: slice) -> tuple[Array, Array]:
        squares = squared_bias_by_tile(rounds.mean[part], basis.scene.mean[part], basis.weight, owner)
        return squares.sums, pixels

    total = float(sums(slice(None))[0] @ basis.tiles.weight)
    return sqrt_interval(_ratio(basis, sums, len(rounds.mean))), total > _Z * _deviation_of_bias(basis, rounds)


def _deviation_of_bias(basis: Baseline, rounds: Rounds) -> float:
    """Compute the standard deviation of the sum of squared biases under the hypothesis that there is none.

    That of the mean of d_i d_j over different rounds is the variance of d times the root of 2 / (R (R - 1)); channels
    are taken to have their noise in common.
    """
    differences = rounds.mean - basis.scene.mean
    count = len(differences)
    by_pixel = (basis.weight * differences.var(axis=0, ddof=1)).mean(axis=1) * basis.tiles.weight[basis.tiles.owner]
    return float(math.sqrt(2.0 / (count * (count - 1))) * np.linalg.norm(by_pixel))


def _brightness(basis: Baseline, rounds: Rounds) -> Interval:
    def sums(part: slice) -> tuple[Array, Array]:
        return brightness_by_tile(rounds.mean[part], basis.scene.mean[part], basis.tiles.owner)

    return map_interval(_ratio(basis, sums, len(rounds.mean)), lambda ratio: ratio - 1.0)


def _samples_to_target(
    target: float, rate: ConvergenceRate | None, bias: Interval, *, bias_resolved: bool
) -> tuple[float | None, str]:
    """Compute samples per pixel with which noise and bias together are at the target, and a doubt; or None, and why."""
    if rate is None:
        return None, "its noise is not known"
    if bias_resolved and bias.low > target:
        return None, "its bias exceeds the target, which no number of samples changes"
    goal = target**2 - (bias.value**2 if bias_resolved else 0.0)
    if bias_resolved and not goal > 0.0:
        return None, "its bias may exceed the target, which no number of samples changes"
    return rate.samples(goal), "its bias may exceed the target" if bias.high > target else ""


# ---- Significance


def _largest_log(ratio: Interval) -> float:
    """Return the largest logarithm of the ends of an interval; 0 where nothing is known."""
    ends = [abs(math.log(end)) for end in ratio if math.isfinite(end) and end > 0.0]
    return max(ends, default=0.0)


def _differs(ratio: Interval, floor: float) -> bool:
    """Tell if an interval excludes 1, and its middle is farther from 1 than equal scenes are from each other."""
    excludes = ratio.low > 1.0 or ratio.high < 1.0
    return excludes and (ratio.value <= 0.0 or abs(math.log(ratio.value)) > floor)
