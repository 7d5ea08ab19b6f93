"""SIMD vectors of eight numbers, one a lane of a packet, for kernels.

`Lanes` are eight float64 in a vector of LLVM's, which every processor has in some form: one register of AVX-512, two of
AVX, four of SSE or NEON.  Kernels write formulas of them as of single numbers, with + - * / and comparisons, and
`select` in place of a branch; compilers seldom find such code by themselves in a loop over rays that may end early.
Called from Python they are NumPy's arrays of eight.
"""

import numpy as np

from raytracer.core.compiler.intrinsics import intrinsic

WIDTH = 8
"""The number of lanes."""


@intrinsic
def any_lane(where):
    """Return True if a condition holds in any lane."""
    return bool(np.any(where))


@intrinsic
def sqrt_lanes(value):
    """Compute square roots; NaN of negative numbers."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(value)


@intrinsic
def select(where, yes, no):
    """Select `yes` in the lanes in which `where` holds, `no` in the others."""
    return np.where(where, yes, no)


@intrinsic
def load(rows, row):
    """Load a row of an array (n, WIDTH), float64."""
    return rows[row].copy()


@intrinsic
def store(rows, row, value):
    """Write lanes, or the same number into all of them, into a row of an array (n, WIDTH), float64."""
    rows[row] = value


@intrinsic
def gather_lanes(rows, numbers, column):
    """Gather a column of an array (n, m), float64: for each lane the entry in the row of its number."""
    return rows[numbers.astype(np.int64), column]
