"""Drawing one of many by weight, in constant time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling.hashing import ONE_MINUS_EPSILON


class AliasTable(NamedTuple):
    """probability (n,) float64 of keeping a bin, alias (n,) int32 taken otherwise, pmf (n,) float64."""

    probability: NDArray[np.float64]
    alias: NDArray[np.int32]
    pmf: NDArray[np.float64]


def build_alias(weights: ArrayLike) -> AliasTable:
    """Build the table of n non-negative weights, n < 2^31; what has weight 0 is never drawn.

    Raises
    ------
    ValueError : no weight, a negative or non-finite one, or only zeros.

    References: Vose 1991, "A Linear Algorithm for Generating Random Numbers with a Given Distribution";
    Huebschle-Schneider, Sanders 2022, "Parallel Weighted Random Sampling", ACM TOMS 48(3), sec. 4.2, which sweeps over
    the light and the heavy bins once, and so can be written by cumulative sums.
    """
    values = np.ascontiguousarray(weights, np.float64).ravel()
    if values.size == 0 or not np.isfinite(values).all() or (values < 0.0).any() or not values.any():
        raise ValueError("weights must be finite, non-negative, and not all zero")

    # Divide by the largest first: the sum alone could overflow.
    pmf = values / values.max()
    pmf /= pmf.sum()
    scaled = pmf * len(pmf)
    light, heavy = np.flatnonzero(scaled < 1.0), np.flatnonzero(scaled >= 1.0)
    probability, alias = np.ones(len(pmf)), np.arange(len(pmf), dtype=np.int32)
    if len(light) == 0 or len(heavy) == 0:
        return AliasTable(probability, alias, pmf)
    lacking, spare = _running_sums(1.0 - scaled[light]), _running_sums(scaled[heavy] - 1.0)

    # A light bin is filled up by the heavy bin whose turn it is: the first that all light ones before it left over.
    giver = np.searchsorted(spare, np.concatenate([[0.0], lacking[:-1]]))
    probability[light] = scaled[light]
    alias[light] = heavy[np.minimum(giver, len(heavy) - 1)]

    # A heavy bin may give its last to a light one that takes more than it has, and is then filled up by the next.
    taker = np.searchsorted(lacking, spare[:-1], side="right")
    over = lacking[np.minimum(taker, len(lacking) - 1)] - spare[:-1]
    probability[heavy[:-1]] = np.clip(1.0 - over, 0.0, 1.0)
    alias[heavy[:-1]] = heavy[1:]
    return AliasTable(probability, alias, pmf)


def _running_sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
    # Rounding of a million equal terms adds up: in float64 it would be some 1e-6 of a bin.
    return np.cumsum(values, dtype=np.longdouble).astype(np.float64)


@kernel
def sample_alias(table, u):
    """Sample (index, its probability, a new number in [0, 1)) from a number in [0, 1).

    The new number holds what u knows beyond the choice: log2 n bits fewer.
    """
    scaled = u * len(table.pmf)
    drawn = min(int(scaled), len(table.pmf) - 1)
    rest = scaled - drawn
    keep = table.probability[drawn]
    if rest < keep:
        return drawn, table.pmf[drawn], min(rest / keep, ONE_MINUS_EPSILON)
    other = np.int64(table.alias[drawn])
    return other, table.pmf[other], min((rest - keep) / (1.0 - keep), ONE_MINUS_EPSILON)
