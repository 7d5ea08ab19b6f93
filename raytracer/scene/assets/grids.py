"""Read grids of densities from NumPy files."""

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.util import safe_open

MAX_VOXELS = 2**31

# Of float64, and a header.
_MAX_BYTES = 8 * MAX_VOXELS + 2**16


def read_grid(path: str | Path) -> NDArray[np.float32]:
    """Read the densities of a .npy file: float32 (nx, ny, nz), C-contiguous, finite and not negative.

    Raises
    ------
    InputError : the file is missing, no .npy file, or holds anything else than such a grid.
    """
    path = Path(path)
    safe_open.check_suffix(path, (".npy",), "a grid")
    with safe_open.name_read_errors(path), safe_open.open_regular(path, _MAX_BYTES) as file:
        stated = safe_open.read_npy_header(file)
        _check_shape(stated)
        order: Literal["C", "F"] = "F" if stated.is_fortran else "C"
        return _checked(np.memmap(file, stated.dtype, "r", stated.start, stated.shape, order))


def _check_shape(stated: safe_open.NpyHeader) -> None:
    """Reject an array that is no grid, before its numbers are read."""
    shape = stated.shape
    if len(shape) != 3 or 0 in shape:
        shown = f"shape {' x '.join(map(str, shape))}" if shape else "a single number"
        raise safe_open.BrokenFileError(f"must hold an array of three dimensions (x, y, z), got {shown}")
    if stated.dtype.kind not in "fiub":
        raise safe_open.BrokenFileError(f"must hold real numbers, got {stated.dtype}")
    if math.prod(shape) > MAX_VOXELS:
        raise safe_open.BrokenFileError(f"has {math.prod(shape):,} voxels, at most {MAX_VOXELS:,} are possible")


def _checked(grid: NDArray[Any]) -> NDArray[np.float32]:
    with np.errstate(all="ignore"):
        density = np.ascontiguousarray(grid, np.float32)
    for wrong, words in ((~np.isfinite(density), "is not finite"), (density < 0.0, "is negative")):
        if wrong.any():
            x, y, z = (int(number) for number in np.unravel_index(int(np.argmax(wrong)), wrong.shape))
            raise safe_open.BrokenFileError(f"has a density that {words}, at [{x}, {y}, {z}]")
    return density
