"""Drawing one of many by weight, in constant time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.jit import kernel

_BELOW_ONE = 1.0 - 2.0**-53


class AliasTable(NamedTuple):
    """probability (n,) float64 of keeping a bin, alias (n,) int32 taken otherwise, pmf (n,) float64."""

    probability: NDArray[np.float64]
    alias: NDArray[np.int32]
    pmf: NDArray[np.float64]


def build_alias(weights: ArrayLike) -> AliasTable:
    """The table of n non-negative weights.

    Raises
    ------
    ValueError : no weight, a negative or non-finite one, or only zeros.

    References: Vose 1991, "A Linear Algorithm for Generating Random Numbers with a Given Distribution".
    """
    values = np.asarray(weights, np.float64)
    total = values.sum()
    if values.size == 0 or not np.isfinite(total) or (values < 0.0).any() or total == 0.0:
        raise ValueError("weights must be finite, non-negative, and not all zero")
    pmf = values / total
    scaled = pmf * len(pmf)
    probability, alias = np.ones(len(pmf)), np.arange(len(pmf), dtype=np.int32)
    small, large = list(np.flatnonzero(scaled < 1.0)), list(np.flatnonzero(scaled >= 1.0))
    while small and large:
        less, more = small.pop(), large[-1]
        probability[less], alias[less] = scaled[less], more
        scaled[more] -= 1.0 - scaled[less]
        if scaled[more] < 1.0:
            small.append(large.pop())

    # What rounding left over: a bin of zero weight must never be kept.
    heaviest = int(np.argmax(pmf))
    for bin_ in small:
        if pmf[bin_] == 0.0:
            probability[bin_], alias[bin_] = 0.0, heaviest
    return AliasTable(probability, alias, pmf)


@kernel
def sample_alias(table, u):  # type: ignore[no-untyped-def]
    """(index, its probability, the number in [0, 1) that is left of u)."""
    scaled = u * len(table.pmf)
    bin_ = min(int(scaled), len(table.pmf) - 1)
    rest = scaled - bin_
    keep = table.probability[bin_]
    if rest < keep:
        return bin_, table.pmf[bin_], min(rest / keep, _BELOW_ONE)
    other = table.alias[bin_]
    return np.int64(other), table.pmf[other], min((rest - keep) / (1.0 - keep), _BELOW_ONE)
