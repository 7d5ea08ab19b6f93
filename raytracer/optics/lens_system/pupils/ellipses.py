"""Small ellipses round points of a plane."""

import functools
import itertools
import math

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

# Directions in which what is farthest out stands for an outline.
_OUTLINE_DIRECTIONS = 128


def _growth_factor(points: Points, ellipse: Points) -> float:
    """Find the factor by which an ellipse (middle x, y, half axes) must grow to hold points (n, 2)."""
    if not len(points):
        return 0.0
    return float(np.sqrt((((points - ellipse[:2]) / ellipse[2:]) ** 2).sum(axis=1)).max())


def fit_ellipse(points: Points, *, centred: bool) -> Points:
    """Fit a small ellipse with axes along x and y round points (n, 2): middle x, y, half axes; `centred` on y = 0.

    Its size is within 1/1000 of the smallest.  Grids over the ratio of its axes and the place of its middle, each finer
    than the one before, reduce it to the smallest circle.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if centred:
        low[1], high[1] = -np.abs(points[:, 1]).max(), np.abs(points[:, 1]).max()
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), np.finfo(np.float64).tiny)
    unit = outline((points - middle) / half)
    steps = np.linspace(-1.0, 1.0, 5)
    offsets = np.array(list(itertools.product(steps, steps, [0.0] if centred else steps)))
    best, spread = np.zeros(3), 0.5
    for _round in range(11):
        tried = best + spread * offsets
        stretch = np.exp(tried[:, 0])[:, None]
        x, y = stretch * (unit[:, 0] - tried[:, 1:2]), (unit[:, 1] - tried[:, 2:3]) / stretch
        best = tried[int((x * x + y * y).max(axis=1).argmin())]
        spread = 0.5 * spread
    ellipse = np.concatenate([middle + half * best[1:], half * np.exp([-best[0], best[0]])])
    ellipse[2:] *= _growth_factor(points, ellipse)
    return ellipse


@functools.cache
def unit_circle(count: int) -> Points:
    """List points of the unit circle (n, 2)."""
    turns = np.arange(count) * 2.0 * math.pi / count
    return np.stack([np.cos(turns), np.sin(turns)], axis=1)


def outline(points: Points) -> Points:
    """Select from points (n, 2) those that are farthest out in some direction, all around."""
    farthest = (points @ unit_circle(_OUTLINE_DIRECTIONS).T).argmax(axis=0)
    return np.asarray(points[farthest[np.append(True, farthest[1:] != farthest[:-1])]])
