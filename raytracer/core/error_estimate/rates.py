"""Convergence rates: the fall of the error of an unbroken run with its samples.

The mean of N Owen-scrambled Sobol' points has a variance of o(1/N) for square-integrable integrands, and of N^-3 but
for logarithms for smooth ones (Owen 1997).  What a path tracer integrates is neither: the first dimensions, edges and
lenses, are smooth in parts (N^-1.5 for an edge through a square), and the many others behave as if independent (1/N).
So s2(N) = linear / N + steep / N^1.5 + early / N^2 is fitted, none of them below 0.  A power law c N^-b, fitted at 16
to 256 samples, predicts 7 to 17 % too few, since b itself falls towards 1.

References: Owen 1997, "Scrambled Net Variance for Integrals of Smooth Functions", Annals of Statistics 25(4); Owen
1998, "Scrambling Sobol' and Niederreiter-Xing Points", Journal of Complexity 14(4); He and Wang 2015, "On the
Convergence Rate of Randomized Quasi-Monte Carlo for Discontinuous Functions", SIAM Journal on Numerical Analysis 53(5).
"""

import math
import sys
from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MIN_EXPONENT = 1.0
"""The exponent of the MSE of independent samples."""

MAX_EXPONENT = 1.5
"""The largest exponent of the MSE that is accepted."""

# Exponents of the terms of `ConvergenceRate`.
_EXPONENTS = np.array([1.0, 1.5, 2.0])

# Samples to reach an error are sought between powers of two in steps of this fraction of the lower one.
_STEPS = 256


def sampler_exponent(sampler: str) -> float:
    """Return the steepest exponent of a sampler, by its name in scenes: 1 for independent samples."""
    return MIN_EXPONENT if sampler == "independent" else MAX_EXPONENT


def prefix_mse(mse_of_power: Callable[[int], float], n: int) -> float:
    """Compute the variance of the mean of a run's first `n` samples, from that of runs of powers of two.

    Aligned blocks of 2^k samples are exchangeable under Owen's scrambling: any two within an aligned block of 2^(k+1)
    have the same joint distribution, and so has one with any part of the other.  So the halves A, B of a block with the
    mean T have Cov(A, B) = 2 Var(T) - Var(A), which is the covariance of A with every aligned block inside B too.
    n = 2^k1 + 2^k2 + ... in falling order is a row of such blocks, each the first half of what the later ones lie in:
    Var = sum_i w_i^2 s2(2^ki) + 2 sum_(i<j) w_i w_j (2 s2(2^(ki + 1)) - s2(2^ki)) with w_i = 2^ki / n.

    Parameters
    ----------
    mse_of_power : k to s2(2^k).
    n : 1 or more.
    """
    total, remaining = 0.0, n
    while remaining:
        k = remaining.bit_length() - 1
        remaining -= 1 << k
        w, alone = (1 << k) / n, mse_of_power(k)
        total += w * w * alone
        if remaining:
            total += 2.0 * w * (remaining / n) * (2.0 * mse_of_power(k + 1) - alone)
    return total


def _between(exponent: float) -> Array:
    """Compute `prefix_mse` of s2(N) = N^-exponent for N = 1 .. 2 in `_STEPS` steps, relative to 1: (_STEPS + 1,)."""
    unit = float(_STEPS) ** exponent
    rows = range(_STEPS, 2 * _STEPS + 1)
    return np.array([unit * prefix_mse(lambda k: 2.0 ** (-exponent * k), n) for n in rows])


_STEEP_BETWEEN = _between(1.5)
_EARLY_BETWEEN = _between(2.0)


class ConvergenceRate(NamedTuple):
    """MSE of an unbroken run: linear / N + steep / N^1.5 + early / N^2 for N that are powers of two, none below 0.

    All nan where nothing is known, and then so are all results.  The sampler of renders has nets of 65,536
    samples, and what lies in different ones is independent: beyond that the last two terms should fall as 1/N too, so
    the MSE is a little larger than it says here.
    """

    linear: float
    steep: float
    early: float = 0.0

    def mse_at_power(self, n: float) -> float:
        """Compute the MSE if `n` were a power of two."""
        return self.linear / n + self.steep / n / math.sqrt(n) + self.early / n / n

    def mse(self, n: float) -> float:
        """Compute the MSE of `n` samples, 1 or more, by `prefix_mse`; linear between integers."""
        if math.isinf(n):
            return self.mse_at_power(n)
        whole = math.floor(n)
        below = self._prefix(whole)
        if n > whole:
            below += (n - whole) * (self._prefix(whole + 1) - below)
        return self.linear / n + below

    def _prefix(self, n: int) -> float:
        """Compute the part of the MSE besides the linear term, which is the same for any number."""
        if not self.steep and not self.early:
            return 0.0
        return prefix_mse(lambda k: self.steep * 2.0 ** (-1.5 * k) + self.early * 2.0 ** (-2.0 * k), n)

    def half_difference(self, n: float) -> float:
        """Compute the expected squared difference of the means of `n` samples, a power of two, and of their first half.

        As the halves A, B of a block with the mean T are exchangeable, Cov(A, T) = Var(T), so E (A - T)^2 =
        s2(n/2) - s2(n).
        """
        return self.mse_at_power(n / 2.0) - self.mse_at_power(n)

    def exponent_at(self, n: float) -> float:
        """Return the local exponent b: the MSE falls as n^-b; 1 for independent samples, or if there is no error."""
        linear, steep, early = self.linear / n, self.steep / n**1.5, self.early / n**2
        total = linear + steep + early
        return MIN_EXPONENT if total == 0.0 else (linear + 1.5 * steep + 2.0 * early) / total

    def samples(self, mse: float) -> float:
        """Find the fewest samples, 1 or more, that reach an MSE; inf if no float number does.

        Powers of two are better than numbers between; the steps between two are 1/256 of the lower one.
        """
        if math.isnan(self.mse_at_power(1.0)):
            return math.nan
        if mse >= self.mse_at_power(1.0):
            return 1.0
        if not mse > 0.0:
            return math.inf

        # The largest power of two that does not reach it.
        k = 0
        while self.mse_at_power(2.0 ** (k + 1)) > mse:
            k += 1
            if k + 1 == sys.float_info.max_exp:
                return math.inf
        steps = min(_STEPS, 2**k)
        n = 2.0**k * (1.0 + np.arange(steps + 1) / steps)
        thinned = slice(None, None, _STEPS // steps)
        between = self.linear / n + self.steep * 2.0 ** (-1.5 * k) * _STEEP_BETWEEN[thinned]
        between += self.early * 2.0 ** (-2.0 * k) * _EARLY_BETWEEN[thinned]
        between[0], between[-1] = self.mse_at_power(2.0**k), self.mse_at_power(2.0 ** (k + 1))
        first = int(np.argmax(between <= mse))
        before, after = between[first - 1], between[first]
        return float(n[first - 1] + (n[first] - n[first - 1]) * (before - mse) / (before - after))


def fit_rate(spp: ArrayLike, mse: ArrayLike, steepest: float = MAX_EXPONENT) -> ConvergenceRate:
    """Fit `ConvergenceRate` to measured MSEs by least squares of the relative residuals, no term below 0.

    Residuals are multiplied by the root of spp, since the terms are the beginning of a series that holds the better the
    more samples there are.

    Parameters
    ----------
    spp : (n,) powers of two; as many terms are fitted as there are points, but the third for four or more.
    mse : (n,), at `spp`.
    steepest : 1 leaves all but the linear term out, as is right for independent samples.

    Returns
    -------
    All 0 if all MSEs are.  Else those of 0 are left out, since they tell nothing: rare light came only later.  All nan
    if an MSE is negative or not known.
    """
    n = np.asarray(spp, dtype=np.float64)
    return _fit_terms(n, n[:, None] ** -_EXPONENTS, mse, steepest)


def fit_differences(spp: ArrayLike, drops: ArrayLike, steepest: float = MAX_EXPONENT) -> ConvergenceRate:
    """Fit `ConvergenceRate` to measured values of `ConvergenceRate.half_difference`, as `fit_rate` does to MSEs."""
    n = np.asarray(spp, dtype=np.float64)
    return _fit_terms(n, (2.0**_EXPONENTS - 1.0) * n[:, None] ** -_EXPONENTS, drops, steepest)


def _fit_terms(n: Array, terms: Array, values: ArrayLike, steepest: float) -> ConvergenceRate:
    """Fit the rate whose `terms` (n, 3) add up to `values` (n,)."""
    known = np.asarray(values, dtype=np.float64)
    if not _are_errors(known):
        return ConvergenceRate(math.nan, math.nan, math.nan)
    some = known > 0.0
    n, terms, known = n[some], terms[some], known[some]
    if len(n) == 0:
        return ConvergenceRate(0.0, 0.0)
    columns = 1 if steepest <= MIN_EXPONENT or len(n) == 1 else 2 if len(n) < 4 else 3

    # Columns of like size, whatever the unit of the picture.
    trust = np.sqrt(n)
    relative = terms[:, :columns] * (trust / known)[:, None]
    size = np.linalg.norm(relative, axis=0)
    factors = np.zeros(3)
    factors[:columns] = _nonnegative(relative / size, trust) / size
    return ConvergenceRate(*factors.tolist())


def _are_errors(values: Array) -> bool:
    """Return True if no value is negative or unknown."""
    return bool(np.all(np.isfinite(values) & (values >= 0.0)))


def _nonnegative(matrix: Array, right: Array) -> Array:
    """Solve matrix (n, k) x = right (n,) by least squares with x >= 0, for a matrix without negative numbers.

    It is the plain solution for those columns that it does not leave out, so all choices of a few columns are tried;
    scipy's NNLS is the same, but takes half a second to import.
    """
    best, least = np.zeros(matrix.shape[1]), math.inf
    for chosen in product((True, False), repeat=matrix.shape[1]):
        if not any(chosen):
            continue
        x = np.zeros(matrix.shape[1])
        x[list(chosen)] = np.linalg.lstsq(matrix[:, chosen], right, rcond=None)[0]
        if x.min() < 0.0:
            continue
        if all(chosen):
            return x
        residual = float(np.sum((matrix @ x - right) ** 2))
        if residual < least:
            best, least = x, residual
    return best


class PowerLaw(NamedTuple):
    """MSE(N) = factor N^-exponent; both nan where nothing is known."""

    factor: float
    exponent: float

    def mse(self, n: float) -> float:
        return float(self.factor * n**-self.exponent)

    def samples(self, mse: float) -> float:
        """Find the fewest samples, 1 or more, that reach an MSE; inf if none do."""
        if mse >= self.factor:
            return 1.0
        return float((self.factor / mse) ** (1.0 / self.exponent)) if mse > 0.0 else math.inf


def fit_power_law(spp: ArrayLike, mse: ArrayLike, steepest: float = MAX_EXPONENT) -> PowerLaw:
    """Fit `PowerLaw` by least squares of the logarithms, with the exponent between 1 and `steepest`.

    spp, mse : (n,), of which those are left out that `fit_rate` leaves out; one point takes the exponent 1.
    """
    n, values = np.asarray(spp, dtype=np.float64), np.asarray(mse, dtype=np.float64)
    if not _are_errors(values):
        return PowerLaw(math.nan, math.nan)
    some = values > 0.0
    if not some.any():
        return PowerLaw(0.0, MIN_EXPONENT)
    x, y = np.log(n[some]), np.log(values[some])
    spread = float(np.sum((x - x.mean()) ** 2))
    exponent = -float(np.sum((x - x.mean()) * y)) / spread if spread > 0.0 else MIN_EXPONENT
    exponent = min(max(exponent, MIN_EXPONENT), steepest)
    return PowerLaw(math.exp(float(np.mean(y + exponent * x))), exponent)


def split_run_penalty(rate: ConvergenceRate, replicates: int, n: int) -> float:
    """Compute the factor by which the MSE of the mean of `replicates` runs of `n` exceeds that of one long run.

    The runs are independent, so their mean has s2(n) / R where an unbroken run has s2(R n): R^(b - 1) for s2 ~ N^-b,
    (2^(b - 1))^2 for four.  1 if there is no error.
    """
    unbroken = rate.mse(replicates * n)
    return 1.0 if unbroken == 0.0 else rate.mse(n) / replicates / unbroken
