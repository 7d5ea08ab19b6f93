"""How noisy a picture is: the error measure, how error falls with samples, and what is known of it without a reference.

Plain arithmetic on pictures, without the renderer.
"""

from raytracer.noise.halves import Estimate, Tally
from raytracer.noise.intervals import (
    UNKNOWN,
    Interval,
    bootstrap_intervals,
    mapped,
    median_interval,
    ratio_interval,
    ratio_of_sums,
    root,
)
from raytracer.noise.metric import FLOOR, relative_error, scale_of, weights
from raytracer.noise.rates import (
    PowerLaw,
    Rate,
    fit_power_law,
    fit_rate,
    halving,
    prefix_mse,
    steepest_of,
)
from raytracer.noise.replicates import ByTile, brightness_by_tile, mse_by_tile, squared_bias_by_tile, top_share

__all__ = [
    "FLOOR",
    "UNKNOWN",
    "ByTile",
    "Estimate",
    "Interval",
    "PowerLaw",
    "Rate",
    "Tally",
    "bootstrap_intervals",
    "brightness_by_tile",
    "fit_power_law",
    "fit_rate",
    "halving",
    "mapped",
    "median_interval",
    "mse_by_tile",
    "prefix_mse",
    "ratio_interval",
    "ratio_of_sums",
    "relative_error",
    "root",
    "scale_of",
    "squared_bias_by_tile",
    "steepest_of",
    "top_share",
    "weights",
]
