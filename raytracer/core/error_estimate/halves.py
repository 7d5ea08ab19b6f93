"""Error estimates of a render without a reference, from differences of means at powers of two samples.

At a power of two n, the mean T of n samples of a pixel and the mean A of their first half differ by E (A - T)^2 =
s2(n/2) - s2(n), which is s2(n) (2^b - 1) for an s2 that falls as n^-b (`ConvergenceRate.half_difference`).  The
differences at n, n/2 and n/4 over all pixels determine s2 and b.  For independent samples b = 1, and the squared
difference is the MSE itself.

The weights 1 / (b^2 + (FLOOR m)^2) of the error measure need the pixels b of a picture without noise.  With the noisy
T there, bright errors lower their own weights: of an error of 20 % only 14 are seen.  So the weights are made of T
shrunk towards the means of 2 x 2, 4 x 4, 8 x 8, ... pixels around, as far as these differ by no more than their noise.

The stratified sampler spreads only its whole run evenly, and not the first half of it, so that the difference tells
more noise than there is: what is estimated here is an upper bound then.

References: James and Stein 1961, "Estimation with Quadratic Loss", Proceedings of the Fourth Berkeley Symposium 1
(shrinking).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.core.error_estimate.intervals import NORMAL
from raytracer.core.error_estimate.metric import FLOOR, mean_scale
from raytracer.core.error_estimate.rates import MAX_EXPONENT, MIN_EXPONENT, ConvergenceRate, fit_differences

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

FIRST_SPP = 8
"""Samples at which the first mean is stored; an estimate takes twice as many."""

# Means that are stored of a tile: at n and its halves.
_MEANS_KEPT = 4

# Variance of T over that of A - T, which is 1 for b = 1 and 0.55 for b = 1.5.
_NOISE_OF_DIFFERENCE = 0.7

# Share of the steep term in the MSE at 16 samples: differences are 1.21 times the MSE then, and were 1.12 to 1.28 times
# it in cover, cornell, bokeh and aperture.
_STEEP_AT_FIRST = 0.25

# Standard deviation of the logarithm of an estimate e through errors of the weights, over e (1 + e): scenes with errors
# of 5 to 40 % had estimates off by up to a quarter of e, and one of 91 % was estimated as 60 %.
_NOISE_OF_WEIGHTS = 0.25

# Variance of the square of a normal number over the mean of its fourth power.
_LEAST_SPREAD = 2.0 / 3.0

# Tiles of one batch, for the caches.
_BATCH_TILES = 64


class ErrorEstimate(NamedTuple):
    """The estimated error of a render.

    Attributes
    ----------
    error : relative RMS error.
    low, high : the interval that holds the true error of this picture in 95 % of renders.
    exponent : local b of the MSE, at the present counts.
    samples : mean number over pixels.
    """

    error: float
    low: float
    high: float
    exponent: float
    samples: float


class ErrorEstimator:
    """An estimator of a render's error, from differences of the means of tiles at powers of two samples.

    `record` may be called by many threads, as long as each tile is only with one; the others while none records.
    It takes 48 bytes a pixel, 24 for independent samples.

    Parameters
    ----------
    windows : (left, top, right, bottom) of the tiles, in any coordinates.
    steepest : of the sampler, `rates.sampler_exponent`.
    """

    def __init__(self, windows: Sequence[tuple[int, int, int, int]], steepest: float = MAX_EXPONENT) -> None:
        widths = np.array([right - left for left, _, right, _ in windows])
        heights = np.array([bottom - top for _, top, _, bottom in windows])
        edge = 2 ** math.ceil(math.log2(max(widths.max(), heights.max())))
        inside = np.arange(edge) < heights[:, None], np.arange(edge) < widths[:, None]
        self._inside: Flags = inside[0][:, :, None] & inside[1][:, None, :]
        self._pixels = (widths * heights).astype(np.float64)
        self._steepest = steepest
        self._scale = 0.0
        self._means = np.zeros((len(windows), _MEANS_KEPT if steepest > MIN_EXPONENT else 2, 3, edge, edge), np.float32)
        self._units = np.zeros(len(windows))
        self._last = np.zeros(len(windows), np.int64)
        self._first = np.zeros(len(windows), np.int64)
        self._measured = np.zeros(len(windows), np.int64)
        self._sums = np.zeros((len(windows), self._means.shape[1] - 1))
        self._squares = np.zeros_like(self._sums)

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the recorded arrays (tiles, ...) by name, from which another estimator of the tiles continues."""
        return {"means": self._means, "units": self._units, "last": self._last, "first": self._first}

    @property
    def scale(self) -> float:
        """The picture's mean, that errors are relative to; 0 before `set_scale`, or if the picture was black then."""
        return self._scale

    def set_scale(self, mean: ArrayLike) -> None:
        """Fix the scale by a picture (..., 3): once, or each time before it is used."""
        scale = mean_scale(mean)
        if scale != self._scale:
            self._scale = scale
            self._measured[:] = 0

    def record(self, tile: int, mean: Array, n: int) -> None:
        """Keep the mean (height, width, 3) of a tile that has `n` samples; of use at 8, 16, 32, ... alone."""
        if n < FIRST_SPP or n & (n - 1):
            return
        if n != 2 * self._last[tile]:
            self._first[tile] = n
        if self._units[tile] == 0.0 and (top := float(np.abs(mean).max())) > 0.0:
            # A power of two, so that only float32 itself rounds, for light of any strength.
            self._units[tile] = math.ldexp(1.0, min(math.frexp(top)[1], 1022)) if math.isfinite(top) else 1.0
        place = (int(n).bit_length() - 1) % self._means.shape[1]
        kept = self._means[tile, place, :, : mean.shape[0], : mean.shape[1]]
        with np.errstate(over="ignore"):
            np.divide(mean.transpose(2, 0, 1), self._units[tile] or 1.0, out=kept)
        self._last[tile] = n

    def estimate(self, counts: ArrayLike) -> ErrorEstimate | None:
        """Estimate the error of the picture with `counts` (tiles,) samples in each tile.

        None where a tile has fewer than 16, or its means were not recorded at the last two powers of two; or where the
        picture was black when it was last settled, but is not.
        """
        given = np.asarray(counts, dtype=np.int64)
        if not np.all(self._is_known(given)):
            return None
        pixels = float(self._pixels.sum())
        samples = float(np.sum(self._pixels * given)) / pixels
        if self._scale == 0.0 and np.any(self._means):
            return None
        groups = self._groups(given)
        total = math.fsum(group.squared_error for group in groups)
        if not math.isfinite(total):
            return None
        if total == 0.0:
            return ErrorEstimate(0.0, 0.0, 0.0, MIN_EXPONENT, samples)
        error = math.sqrt(total / pixels)
        of_sums = math.sqrt(math.fsum(group.variance for group in groups)) / (2.0 * total)
        factor = math.exp(NORMAL * math.hypot(of_sums, _NOISE_OF_WEIGHTS * error * (1.0 + error)))
        exponent = math.fsum(group.squared_error * group.exponent for group in groups) / total
        return ErrorEstimate(error, error / factor, error * factor, exponent, samples)

    def tile_mse(self, counts: ArrayLike) -> Array:
        """Estimate the relative MSE (tiles,) of tiles with `counts` (tiles,) samples: means over pixels and channels.

        nan where a tile has fewer than 16, or its means were not recorded.
        """
        mse = np.full(len(self._pixels), math.nan)
        for group in self._groups(np.asarray(counts, dtype=np.int64)):
            mse[group.tiles] = group.errors / self._pixels[group.tiles]
        return mse

    def _is_known(self, counts: Indices) -> Flags:
        """Tell which tiles (tiles,) have means at the last power of two that `counts` reach, and at half of it."""
        power = 2 ** _exponents(np.maximum(counts, 1))
        return np.asarray((counts >= 2 * FIRST_SPP) & (self._last == power) & (self._first < power))

    def _groups(self, counts: Indices) -> "list[_Group]":
        """Group the known tiles by the last power of two recorded, and the number of powers before it."""
        known = self._is_known(counts)
        self._measure(np.flatnonzero(known & (self._measured != self._last)))
        differences = self._sums.shape[1]
        levels = np.minimum(_exponents(self._last) - _exponents(self._first), differences)
        groups = []
        for last, seen in sorted({*zip(self._last[known].tolist(), levels[known].tolist(), strict=True)}):
            tiles = np.flatnonzero(known & (self._last == last) & (levels == seen))
            groups.append(
                _group(
                    tiles,
                    counts[tiles],
                    last >> np.arange(seen)[::-1],
                    self._sums[tiles, differences - seen :],
                    self._squares[tiles, differences - seen :],
                    self._pixels[tiles],
                    self._steepest,
                )
            )
        return groups

    def _measure(self, tiles: Indices) -> None:
        """Compute sums and sums of squares of the relative squared differences of `tiles`."""
        for some in np.split(tiles, range(_BATCH_TILES, len(tiles), _BATCH_TILES)):
            with np.errstate(over="ignore", invalid="ignore"):
                self._sums[some], self._squares[some] = self._differences(some)
            self._measured[some] = self._last[some]

    def _differences(self, tiles: Indices) -> tuple[Floats, Floats]:
        """Compute sums and sums of squares over pixels (tiles, differences): rising samples, means over channels."""
        places = (_exponents(self._last[tiles])[:, None] + 1 + np.arange(self._means.shape[1])) % self._means.shape[1]
        means, inside = self._means[tiles[:, None], places], self._inside[tiles].astype(np.float32)
        relative = self._units[tiles] / self._scale if self._scale > 0.0 else np.zeros(len(tiles))
        means *= relative.astype(np.float32)[:, None, None, None, None]
        squared = np.diff(means, axis=1)
        squared *= squared
        shrunk = _shrink_noise(means[:, -1], squared[:, -1], inside)
        weights = inside[:, None] / (3.0 * (shrunk * shrunk + FLOOR**2))
        errors = np.einsum("tlcyx,tcyx->tlyx", squared, weights)
        return errors.sum(axis=(2, 3)), np.einsum("tlyx,tlyx->tl", errors, errors)


def _exponents(counts: Indices) -> Indices:
    """Return the exponent of the last power of two that `counts` reach; -1 for 0."""
    return np.frexp(counts.astype(np.float64))[1].astype(np.int64) - 1


def _shrink_noise(mean: Floats, squared: Floats, inside: Floats) -> Floats:
    """Denoise means (tiles, 3, edge, edge): shrink each pixel towards the means of larger and larger squares.

    Of the variation of four means within a square, the part that is not noise is kept.

    squared : squared differences, like `mean`.  inside : (tiles, edge, edge), 0 where a tile has no pixel.
    """
    there = inside[:, None]
    sizes: list[Floats] = [there]
    sums: list[Floats] = [mean * there]
    noise: list[Floats] = [squared * there]
    while sizes[-1].shape[-1] > 1:
        for pyramid in (sizes, sums, noise):
            pyramid.append(_sum_2x2(pyramid[-1]))
    shrunk = sums[-1] / sizes[-1]
    for size, total, whole, of_whole in zip(sizes[-2::-1], sums[-2::-1], sizes[:0:-1], noise[:0:-1], strict=True):
        # Children outside of the tile do not differ.
        difference = total - size * _repeat_2x2(shrunk)
        difference /= np.maximum(size, 1.0)
        variation = _sum_2x2(size * difference * difference)
        # The noise of a child's mean is that of a pixel over its size; children weigh by their sizes here.
        of_noise = _NOISE_OF_DIFFERENCE * of_whole * (_sum_2x2(np.sign(size)) / np.maximum(whole, 1.0))
        signal = 1.0 - np.divide(of_noise, variation, out=np.ones_like(variation), where=variation > of_noise)
        shrunk = _repeat_2x2(shrunk) + _repeat_2x2(signal) * difference
    return shrunk


def _sum_2x2(values: Floats) -> Floats:
    """Sum squares of 2 x 2: (..., edge, edge) to half the edge."""
    rows = values[..., 0::2, :] + values[..., 1::2, :]
    return np.asarray(rows[..., 0::2] + rows[..., 1::2])


def _repeat_2x2(values: Floats) -> Floats:
    """Repeat each value four times: (..., edge, edge) to twice the edge."""
    *front, rows, columns = values.shape
    out = np.empty((*front, 2 * rows, 2 * columns), values.dtype)
    for row in (0, 1):
        for column in (0, 1):
            out[..., row::2, column::2] = values
    return out


class _Group(NamedTuple):
    """Tiles with the same last power of two: indices, squared errors by tile, their sum, its variance, the slope."""

    tiles: Indices
    errors: Array
    squared_error: float
    variance: float
    exponent: float


def _group(
    tiles: Indices, counts: Indices, spp: Indices, sums: Array, squares: Array, pixels: Array, steepest: float
) -> _Group:
    """Estimate the error of `tiles` (t,) at `counts` (t,) from sums (t, levels) of differences and squares at `spp`."""
    drops = sums.sum(axis=0)
    if drops[-1] == 0.0 or not np.all(np.isfinite(drops)):
        return _Group(tiles, sums[:, -1], float(drops[-1]), 0.0, MIN_EXPONENT)

    # A level without any difference, as where rare light came late, says nothing of the rate.
    informative = drops > 0.0
    # Few pixels may agree by chance: no less than normal differences of one channel have, whose E x^4 is 3 (E x^2)^2.
    fourth = squares.sum(axis=0)
    spread = np.maximum(fourth - np.sum(sums**2 / pixels[:, None], axis=0), _LEAST_SPREAD * fourth)[informative]
    spp, drops = spp[informative], drops[informative]
    deviations = np.sqrt(spread) / drops

    # Tiles that stopped at the same count behave alike.
    unique, which = np.unique(counts, return_inverse=True)
    share = np.bincount(which, sums[:, -1]) / sums[:, -1].sum()
    rate = _fitted(spp, drops, steepest)
    value = _mean_mse(rate, unique, share)

    # Noise of each sum in the fit, and once more that of the picture's own error around its mean.
    variance = float(deviations[-1]) ** 2
    for i, deviation in enumerate(deviations.tolist()):
        up, down = drops.copy(), drops.copy()
        up[i] *= math.exp(deviation)
        down[i] *= math.exp(-deviation)
        ratio = _mean_mse(_fitted(spp, up, steepest), unique, share) / _mean_mse(
            _fitted(spp, down, steepest), unique, share
        )
        variance += (0.5 * math.log(ratio)) ** 2
    if len(spp) == 1:
        # The slope may be anywhere between its bounds.
        variance += math.log(2.0**steepest - 1.0) ** 2 / 12.0

    errors = sums[:, -1] * np.array([rate.mse(n) for n in unique.tolist()])[which]
    slope = math.fsum(part * rate.exponent_at(n) for part, n in zip(share.tolist(), unique.tolist(), strict=True))
    return _Group(tiles, errors * (value / errors.sum()), value, variance * value**2, slope)


def _fitted(spp: Indices, drops: Array, steepest: float) -> ConvergenceRate:
    """Fit the convergence rate to differences; to a single one, with the usual share of the steep term there."""
    if len(spp) > 1:
        return fit_differences(spp, drops, steepest)
    n, steep = float(spp[0]), _STEEP_AT_FIRST if steepest > MIN_EXPONENT else 0.0
    unit = ConvergenceRate((1.0 - steep) * n, steep * n**1.5)
    mse = float(drops[0]) / unit.half_difference(n)
    return ConvergenceRate(mse * unit.linear, mse * unit.steep)


def _mean_mse(rate: ConvergenceRate, counts: Indices, share: Array) -> float:
    """Compute the MSE of a group of which the part `share` (n,) of the error is at `counts` (n,) samples."""
    return math.fsum(part * rate.mse(n) for part, n in zip(share.tolist(), counts.tolist(), strict=True))
