"""The error measure of the whole program: a relative error that does not depend on exposure."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FLOOR = 0.1
"""Fraction of the picture's mean below which a pixel counts as if it were that bright."""


def mean_scale(image: ArrayLike) -> float:
    """Return the absolute mean of an image (..., 3) over pixels and channels: filters may make it negative."""
    return abs(float(np.mean(np.asarray(image, dtype=np.float64))))


def error_weights(image: ArrayLike, scale: float | None = None) -> Array:
    """Compute the weights of squared errors: 1 / (b^2 + (FLOOR m)^2) for pixels b of a picture with the mean m.

    Parameters
    ----------
    image : (..., 3), the best picture at hand.
    scale : m; `mean_scale(image)` if None.

    Returns
    -------
    float64, the shape of `image`; 0 everywhere for a scale of 0, of which no error is relative.
    """
    best = np.asarray(image, dtype=np.float64)
    m = mean_scale(best) if scale is None else scale
    if m == 0.0:
        return np.zeros_like(best)
    return 1.0 / (best**2 + (FLOOR * m) ** 2)


def relative_error(a: ArrayLike, b: ArrayLike) -> float:
    """Compute the relative error of `a` against the reference `b`, both (..., 3): sqrt(mean(w (a - b)^2)).

    It is the root of the relMSE of Rousselle and others (`analysis.compare.metrics.relmse`) of the pictures divided by
    the mean of the reference, so that it is the same for any exposure.  0.01 is an error of 1 %.  Black pictures have
    an error of 0, any other one against black of inf.

    References: Rousselle, Knaus and Zwicker 2011, "Adaptive Sampling and Reconstruction using Greedy Error
        Minimization", ACM Transactions on Graphics 30(6), section 6.
    """
    difference = np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64)
    if mean_scale(b) == 0.0:
        return math.inf if np.any(difference) else 0.0
    return math.sqrt(float(np.mean(error_weights(b) * difference**2)))
