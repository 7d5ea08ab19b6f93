"""Drawing one of many by weight, in constant time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.jit import kernel
from raytracer.sampling.hashing import BELOW_ONE


class AliasTable(NamedTuple):
    """probability (n,) float64 of keeping a bin, alias (n,) int32 taken otherwise, pmf (n,) float64."""

    probability: NDArray[np.float64]
    alias: NDArray[np.int32]
    pmf: NDArray[np.float64]


def build_alias(weights: ArrayLike) -> AliasTable:
    """The table of n non-negative weights, n < 2^31; what has weight 0 is never drawn.

    Raises
    ------
    ValueError : no weight, a negative or non-finite one, or only zeros.

    References: Vose 1991, "A Linear Algorithm for Generating Random Numbers with a Given Distribution".
    """
    values = np.ascontiguousarray(weights, np.float64).ravel()
    if values.size == 0 or not np.isfinite(values).all() or (values < 0.0).any() or not values.any():
        raise ValueError("weights must be finite, non-negative, and not all zero")

    # Divide by the largest first: the sum alone could overflow.
    relative = values / values.max()
    pmf = relative / relative.sum()
    scaled = (pmf * len(pmf)).tolist()
    probability, alias = np.ones(len(pmf)), np.arange(len(pmf), dtype=np.int32)
    small = [number for number, share in enumerate(scaled) if share < 1.0]
    large = [number for number, share in enumerate(scaled) if share >= 1.0]
    while small and large:
        less, more = small.pop(), large[-1]
        probability[less], alias[less] = scaled[less], more
        scaled[more] -= 1.0 - scaled[less]
        if scaled[more] < 1.0:
            small.append(large.pop())

    # Bins left over are full but for rounding, which cannot amount to the whole share that one without weight lacks.
    return AliasTable(probability, alias, pmf)


@kernel
def sample_alias(table, u):
    """(index, its probability, a new number in [0, 1)) from a number in [0, 1).

    The new number holds what u knows beyond the choice: log2 n bits fewer.
    """
    scaled = u * len(table.pmf)
    drawn = min(int(scaled), len(table.pmf) - 1)
    rest = scaled - drawn
    keep = table.probability[drawn]
    if rest < keep:
        return drawn, table.pmf[drawn], min(rest / keep, BELOW_ONE)
    other = np.int64(table.alias[drawn])
    return other, table.pmf[other], min((rest - keep) / (1.0 - keep), BELOW_ONE)
