"""Results of a study as plain values."""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.error_estimate.intervals import UNKNOWN, Interval


class PlanItem(NamedTuple):
    """An effect of the scene, or a setting that trades accuracy for time.

    group : "simulated", "left out" or "setting".
    why : the reason why it is as it is.
    """

    group: str
    name: str
    why: str


class ConvergencePoint(NamedTuple):
    """A measurement at a number of samples per pixel.

    seconds : for the whole picture.
    error : relative, of the whole picture.
    """

    spp: int
    seconds: float
    error: Interval


@dataclass(frozen=True)
class Prediction:
    """Prediction of error and time by samples.

    Relative errors are root mean squares, 0.01 being 1 %; MSE is their square.

    Attributes
    ----------
    points : measurements at rising spp, for single renders of the whole picture (not means of replicates).
    linear, steep, early : the fit MSE(N) = linear / N + steep / N^1.5 + early / N^2.
    exponent, factor : the fit MSE(N) = factor N^-exponent with the exponent in [1, 1.5].
    halving : factor by which the MSE of the mean of the replicates exceeds that of an unbroken run of as many samples.
    fixed : seconds that do not depend on samples: load, pack, build, develop; without compiling.
    per_sample : seconds for one sample in every pixel.
    target, budget : relative error and seconds that were asked for; budget may be None.
    target_spp, target_seconds : to reach the target; inf if it cannot be reached.
    plain_spp, plain_seconds : to reach the target by the slope -1 from the last point.
    power_spp, power_seconds : to reach the target by the power law.
    budget_spp, budget_error : after the budget; None without one, 0 and inf if it is less than one sample per pixel.
    """

    points: tuple[ConvergencePoint, ...]
    linear: float
    steep: float
    exponent: float
    factor: float
    halving: float
    fixed: Interval
    per_sample: Interval
    target: float
    budget: float | None
    target_spp: Interval
    target_seconds: Interval
    plain_spp: float
    plain_seconds: float
    power_spp: float
    power_seconds: float
    budget_spp: float | None
    budget_error: Interval | None
    early: float = 0.0

    def error(self, spp: float) -> float:
        """Return the relative error of a render with that many samples per pixel, by the fit."""
        return math.sqrt(self.linear / spp + self.steep / spp**1.5 + self.early / spp**2)


@dataclass(frozen=True)
class VariantResult:
    """A variant of the scene, measured against the scene as it is.

    Attributes
    ----------
    name : short, as on the command line: "defocus", "accuracy=fast", "max_depth=4"; "A/A" for the repeat of the same.
    group : "scene", "control", "effect", "setting", "sampler".
    what : the change, in one sentence.
    per_sample : seconds for one sample in every pixel of the whole picture.
    per_ray : nanoseconds for a ray, over all threads.
    rays_per_sample : camera, bounce and shadow rays.
    time : time per sample over that of the scene, paired by rounds.
    time_differs : True if the interval of its median over rounds excludes 1, by three standard deviations of the
        rounds' mean too, and the difference exceeds that of the repeat of the same, which is of two equal scenes.
    spp : samples per pixel at which noise is stated.
    noise : relative error (RMS, of noise alone) of a render with `spp`.
    noise_ratio : its square over that of the scene at the same spp.
    noise_differs : True if the interval of that excludes 1, and the difference exceeds that of the repeat of the same.
    bias : relative bias (RMS) against the scene; None for the scene itself, and if there is none by construction.
    bias_resolved : True if it is told from chance: its square exceeds three standard deviations of what is measured
        of variants without any.
    brightness : mean of the picture over that of the scene, less 1; None for the scene itself.
    target_spp, target_seconds : to reach the target; None where the bias exceeds it, or nothing can be told.
    why_blank : one sentence if they are None, or may be wrong.
    unbiased : True if it has no bias by construction, so that what is measured as one is chance.
    failed : one sentence if the variant could not be measured; its numbers are unknown then.
    """

    name: str
    group: str
    what: str
    per_sample: Interval = UNKNOWN
    per_ray: Interval = UNKNOWN
    rays_per_sample: float = math.nan
    time: Interval = UNKNOWN
    time_differs: bool = False
    spp: int = 0
    noise: Interval = UNKNOWN
    noise_ratio: Interval = UNKNOWN
    noise_differs: bool = False
    bias: Interval | None = None
    bias_resolved: bool = False
    brightness: Interval | None = None
    target_spp: float | None = None
    target_seconds: float | None = None
    why_blank: str = ""
    failed: str = ""
    unbiased: bool = False


@dataclass(frozen=True)
class Study:
    """Results of `rt cost` for a scene.

    Attributes
    ----------
    scene : its file; width, height, its size in pixels.
    plan : effects and settings.
    prediction : error and time by samples.
    variants : the scene itself first, then the repeat of the same, then the others.
    seconds : by phase: load, pack, build, compile (apart from all predictions), measure.
    machine : processor, instruction set, threads, load before and after, versions, seed, rounds.
    warnings : sentences.
    tiles, tiles_measured : number of 16 x 16 tiles of the picture, and of those that were rendered.
    top_share : share of the squared error that the worst 0.1 % of the pixels carry; nan if too few were measured.
    error_map : float64 (height, width), relative error of each pixel (RMS over channels) at the last point, nan where
        not measured.
    picture : float64 (height, width, 3), the mean of all that was rendered of the scene, nan where not measured.
    interrupted : True if the user ended it early.
    rounds : renders of each variant; 0 without a comparison.
    """

    scene: str
    width: int
    height: int
    plan: tuple[PlanItem, ...]
    prediction: Prediction
    variants: tuple[VariantResult, ...]
    seconds: dict[str, float]
    machine: dict[str, Any]
    warnings: tuple[str, ...]
    tiles: int
    tiles_measured: int
    top_share: float
    error_map: NDArray[np.float64] = field(repr=False)
    picture: NDArray[np.float64] = field(repr=False)
    interrupted: bool = False
    rounds: int = 0
