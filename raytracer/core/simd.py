"""SIMD vectors of eight numbers, one a lane of a packet, for kernels.

`Lanes` are eight float64 in a vector of LLVM's, which every processor has in some form: one register of AVX-512, two of
AVX, four of SSE or NEON.  Kernels write formulas of them as of single numbers, with + - * / and comparisons, and
`select` in place of a branch; compilers seldom find such code by themselves in a loop over rays that may end early.
Called from Python they are NumPy's arrays of eight.
"""

from typing import Any

import numpy as np

from raytracer.core.compiler.declarations import when_compiler_loads
from raytracer.core.compiler.dispatch import kernel_overload

WIDTH = 8
"""The number of lanes."""


def _register_operators(_: object) -> None:
    from raytracer.core.compiler import lanes  # noqa: F401


when_compiler_loads(_register_operators)


def _lowered(function: Any) -> Any:
    """Give a function its implementation for kernels, by its name in `core.compiler.lanes`."""

    def implementation(*types: Any) -> Any:
        from raytracer.core.compiler import lanes

        return lanes.IMPLEMENTATIONS[function.__name__]

    return kernel_overload(implementation)(function)


@_lowered
def any_lane(where):
    """Return True if a condition holds in any lane."""
    return bool(np.any(where))


@_lowered
def sqrt_lanes(value):
    """Compute square roots; NaN of negative numbers."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(value)


@_lowered
def select(where, yes, no):
    """Select `yes` in the lanes in which `where` holds, `no` in the others."""
    return np.where(where, yes, no)


@_lowered
def load(rows, row):
    """Load a row of an array (n, WIDTH), float64."""
    return rows[row].copy()


@_lowered
def store(rows, row, value):
    """Write lanes, or the same number into all of them, into a row of an array (n, WIDTH), float64."""
    rows[row] = value


@_lowered
def gather_lanes(rows, numbers, column):
    """Gather a column of an array (n, m), float64: for each lane the entry in the row of its number."""
    return rows[numbers.astype(np.int64), column]
