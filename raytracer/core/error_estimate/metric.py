"""The error measure of the whole program, a relative error that does not depend on exposure; and its estimates.

Error and bias are estimated without a reference from arrays of independent replicates (R, P, 3): R renders that share
nothing but the scene, P pixels.  `weights` (P, 3) are those of `error_weights`, the same for all that is compared;
`tile` (P,) says which tile a pixel belongs to, since intervals come from the bootstrap over tiles.
"""

import math
from typing import NamedTuple

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


# ---- Replicates


class TileSums(NamedTuple):
    """Sums over the pixels of each tile (of the mean over channels), float64 (tiles,), and numbers of pixels (tiles,).

    Sums over pixels are ready for `intervals.ratio_of_sums`.
    """

    sums: Array
    pixels: Array

    @property
    def mean(self) -> float:
        """The mean over all pixels."""
        return float(self.sums.sum() / self.pixels.sum())


def _by_tile(values: Array, tile: ArrayLike) -> TileSums:
    """Sum `values` (P, 3) over the pixels of each tile."""
    index = np.asarray(tile, dtype=np.int64)
    tiles = int(index.max()) + 1
    sums, pixels = np.bincount(index, values.mean(axis=1), tiles), np.bincount(index, minlength=tiles)
    return TileSums(sums.astype(np.float64), pixels.astype(np.float64))


def mse_by_tile(replicates: ArrayLike, weights: ArrayLike, tile: ArrayLike) -> TileSums:
    """Compute the relative MSE of one replicate: the unbiased sample variance over replicates, weighted.

    Raises
    ------
    ValueError : fewer than two replicates.
    """
    a = _replicates(replicates)
    return _by_tile(np.asarray(weights) * a.var(axis=0, ddof=1), tile)


def squared_bias_by_tile(a: ArrayLike, r: ArrayLike, weights: ArrayLike, tile: ArrayLike) -> TileSums:
    """Compute the squared relative difference of the expectations of `a` and `r`, without their noise.

    The mean over i != j of (a_i - r_i) (a_j - r_j): different replicates are independent, so the expectation of the
    product is that of the square without noise.  It may be negative.  a_i and r_i may share their random numbers,
    which makes it sharper.

    Raises
    ------
    ValueError : fewer than two replicates, or not as many of both.

    References: Hoeffding 1948, "A Class of Statistics with Asymptotically Normal Distribution", Annals of Mathematical
        Statistics 19(3) (U-statistics).
    """
    difference = _replicates(a) - _replicates(r)
    n = len(difference)
    products = (difference.sum(axis=0) ** 2 - (difference**2).sum(axis=0)) / (n * (n - 1))
    return _by_tile(np.asarray(weights) * products, tile)


def brightness_by_tile(a: ArrayLike, r: ArrayLike, tile: ArrayLike) -> tuple[Array, Array]:
    """Sum the means of `a` and of `r` over each tile, both (tiles,): the ratio of their totals is of brightness."""
    first, second = (np.asarray(x, dtype=np.float64).mean(axis=0) for x in (a, r))
    return _by_tile(first, tile).sums, _by_tile(second, tile).sums


def worst_pixel_share(
    replicates: ArrayLike, weights: ArrayLike, fraction: float = 1e-3, stands: ArrayLike | None = None
) -> float:
    """Compute the share of the relative MSE of the worst `fraction` of the pixels, at least one; 0 without an error.

    stands : (P,), how many pixels of the picture each of them stands for; 1 if None.
    """
    a = _replicates(replicates)
    errors = (np.asarray(weights) * a.var(axis=0, ddof=1)).mean(axis=1)
    standing = np.ones(len(errors)) if stands is None else np.asarray(stands, dtype=np.float64)
    order = np.argsort(-errors, kind="stable")
    carried = np.cumsum((errors * standing)[order])
    if carried[-1] == 0.0:
        return 0.0
    # A sum of n numbers is off by less than n roundings, which must not cost a pixel.
    rounding = 1.0 + len(errors) * np.finfo(np.float64).eps
    among = np.searchsorted(np.cumsum(standing[order]), fraction * standing.sum() * rounding, side="right")
    return float(carried[max(1, among) - 1] / carried[-1])


def _replicates(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if len(array) < 2:
        raise ValueError(f"{len(array)} replicates do not tell their noise")
    return array
