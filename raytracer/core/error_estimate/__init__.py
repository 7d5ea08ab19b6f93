"""Noise of pictures: the error measure, its fall with samples, and estimates of it without a reference.

Plain arithmetic on pictures, without the renderer.
"""

from raytracer.core.error_estimate.halves import ErrorEstimate, ErrorEstimator
from raytracer.core.error_estimate.intervals import (
    UNKNOWN,
    Interval,
    bootstrap_intervals,
    map_interval,
    median_interval,
    ratio_interval,
    ratio_of_sums,
    sqrt_interval,
)
from raytracer.core.error_estimate.metric import FLOOR, error_weights, mean_scale, relative_error
from raytracer.core.error_estimate.rates import (
    ConvergenceRate,
    PowerLaw,
    fit_power_law,
    fit_rate,
    prefix_mse,
    sampler_exponent,
    split_run_penalty,
)
from raytracer.core.error_estimate.replicates import (
    TileSums,
    brightness_by_tile,
    mse_by_tile,
    squared_bias_by_tile,
    worst_pixel_share,
)

__all__ = [
    "FLOOR",
    "UNKNOWN",
    "ConvergenceRate",
    "ErrorEstimate",
    "ErrorEstimator",
    "Interval",
    "PowerLaw",
    "TileSums",
    "bootstrap_intervals",
    "brightness_by_tile",
    "error_weights",
    "fit_power_law",
    "fit_rate",
    "map_interval",
    "mean_scale",
    "median_interval",
    "mse_by_tile",
    "prefix_mse",
    "ratio_interval",
    "ratio_of_sums",
    "relative_error",
    "sampler_exponent",
    "split_run_penalty",
    "sqrt_interval",
    "squared_bias_by_tile",
    "worst_pixel_share",
]
