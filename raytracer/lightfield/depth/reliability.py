"""Reliability of a depth estimate: its standard error, and the confidence that follows from it.

Three things make a depth wrong, and their squares add up:

- noise, where there is little texture: the variance of the refined estimate (`refinement`);
- another distance that explains the views nearly as well, as where a texture repeats: how far it is, weighed by the
  probability that it is the true one, which falls with a power of the ratio of their costs;
- an edge in depth through the pixel or beside it, which may belong to either side.

Reference: Matthies, Kanade, Szeliski 1989, "Kalman Filter-based Algorithms for Estimating Depth from Image Sequences",
    sec. 3 (variance of a disparity by the curvature of its cost).
"""

import numpy as np

from raytracer.lightfield.depth.estimate import Estimate, FloatArray
from raytracer.lightfield.depth.refinement import Refined

_RIVAL_POWER = 4.0
"""Power of the ratio of costs by which the odds of the second best explanation fall.  Measured on twenty scenes, half
of which repeat: for ratios of 1.1, 1.4, 1.8 and 3 a share of 0.35, 0.2, 0.1 and 0.01 of the pixels is wrong."""

_WRONG_SIDE = 1.0 / 8.0
"""Share of the pixels beside an edge that are taken to be of its other side, measured on the same scenes."""

_GROWN, _GROWTH, _UNSURE = 1.0 / 64.0, 3, 0.25
"""Share of the pixels that a surface has grown over, and pixels by which it grows, as wide as the filters of the sweep,
where the standard error beside it is more than this share of the step from plane to plane."""

TOLERANCE = 0.01
"""Standard error, as a share of the range of 1 / distance in the scene, at which the confidence is a half."""


def standard_error(estimate: Estimate, refined: Refined, bounds: tuple[float, float], step: float) -> FloatArray:
    """Compute the standard error of refined 1 / distance (1/m), float64 (height, width).

    bounds : least and greatest 1 / distance that were searched (1/m).
    step : from plane to plane (1/m): what is that close to a bound may lie beyond it.
    """
    from scipy import ndimage

    low, high = bounds
    is_at_end = (refined.inverse < low + step) | (refined.inverse > high - step)
    # The mean square distance of an end from what may be anywhere between both.
    anywhere = (high - low) ** 2 / 3.0
    variance = np.where(is_at_end, np.maximum(refined.error**2, anywhere), refined.error**2)
    # A surface grows over one that has little texture.
    beside = ndimage.maximum_filter(variance, 2 * _GROWTH + 1, mode="nearest")
    grown = ndimage.maximum_filter(refined.jump, 2 * _GROWTH - 1, mode="nearest")
    grown = np.where(beside > (_UNSURE * step) ** 2, grown, 0.0)
    wrong_side = np.maximum(_WRONG_SIDE * refined.jump**2, _GROWN * grown**2)
    if estimate.rival is not None and estimate.rival_cost is not None:
        # Odds of 1 to ratio^power, without powers of infinity.
        odds = (1.0 / estimate.rival_cost) ** _RIVAL_POWER
        wrong_side = np.maximum(wrong_side, odds / (1.0 + odds) * (estimate.rival - refined.inverse) ** 2)
    return np.asarray(np.sqrt(variance + wrong_side))


def confidence_of(error: FloatArray, found: float) -> FloatArray:
    """Turn the standard error into a confidence in 0..1: 1 for none, a half for `TOLERANCE` of the range (1/m)."""
    return np.asarray(1.0 / (1.0 + (error / (TOLERANCE * found)) ** 2))
