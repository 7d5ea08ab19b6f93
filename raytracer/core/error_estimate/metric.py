"""The error measure of the whole program: relative, and without regard to exposure."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FLOOR = 0.1
"""Fraction of the picture's mean below which a pixel counts as if it were that bright."""


def scale_of(image: ArrayLike) -> float:
    """The mean of an image (..., 3) over pixels and channels; its size if that is negative, as filters may make it."""
    return abs(float(np.mean(np.asarray(image, dtype=np.float64))))


def weights(image: ArrayLike, scale: float | None = None) -> Array:
    """What a squared error is multiplied by: 1 / (b^2 + (FLOOR m)^2) for pixels b of a picture with the mean m.

    Parameters
    ----------
    image : (..., 3), the best picture at hand.
    scale : m; `scale_of(image)` if None.

    Returns
    -------
    float64, the shape of `image`; 0 everywhere for a scale of 0, of which no error is relative.
    """
    best = np.asarray(image, dtype=np.float64)
    m = scale_of(best) if scale is None else scale
    if m == 0.0:
        return np.zeros_like(best)
    return 1.0 / (best**2 + (FLOOR * m) ** 2)


def relative_error(a: ArrayLike, b: ArrayLike) -> float:
    """Relative error of `a` against the reference `b`, both (..., 3): the root of the mean of w (a - b)^2.

    It is the root of the relMSE of Rousselle and others (`comparison.relmse`) of the pictures divided by the mean of
    the reference, so that it is the same for any exposure.  0.01 is an error of 1 %.  Black pictures have an error of
    0, any other one against black of inf.

    References: Rousselle, Knaus and Zwicker 2011, "Adaptive Sampling and Reconstruction using Greedy Error
        Minimization", ACM Transactions on Graphics 30(6), section 6.
    """
    difference = np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64)
    if scale_of(b) == 0.0:
        return math.inf if np.any(difference) else 0.0
    return math.sqrt(float(np.mean(weights(b) * difference**2)))
