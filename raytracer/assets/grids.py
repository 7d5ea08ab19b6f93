"""Grids of densities read from NumPy files."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError, one_line

MAX_VOXELS = 2**31

_MAGIC = b"\x93NUMPY"


def read_grid(path: str | Path) -> NDArray[np.float32]:
    """Densities of a .npy file: float32 (nx, ny, nz), C-contiguous, finite and not negative.

    Raises
    ------
    InputError : the file is missing, no .npy file, or holds anything else than such a grid.
    """
    path = Path(path)
    if path.suffix.lower() != ".npy":
        found = f"unknown suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise InputError(f"{path}: {found} for a grid; known: .npy")
    try:
        with path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise _BrokenGridError("is no NumPy file")
        return _checked(np.load(path, mmap_mode="r", allow_pickle=False))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or one_line(str(error))}") from error
    except _BrokenGridError as error:
        raise InputError(f"{path}: {error}") from error
    except (ValueError, EOFError, TypeError, SyntaxError, MemoryError, OverflowError) as error:
        # NumPy tells of objects, of headers that are no literals and of files that are cut off in as many ways.
        objects = "Python objects" in str(error)
        what = "holds pickled objects, which are not read" if objects else "is a broken NumPy file, or cut off"
        raise InputError(f"{path}: {what}") from error


class _BrokenGridError(Exception):
    """What a file holds is no grid of densities; a sentence without its subject."""


def _checked(grid: NDArray[Any]) -> NDArray[np.float32]:
    if grid.ndim != 3 or 0 in grid.shape:
        found = f"shape {' x '.join(map(str, grid.shape))}" if grid.ndim else "a single number"
        raise _BrokenGridError(f"must hold an array of three dimensions (x, y, z), got {found}")
    if grid.dtype.kind not in "fiub":
        raise _BrokenGridError(f"must hold real numbers, got {grid.dtype}")
    if grid.size > MAX_VOXELS:
        raise _BrokenGridError(f"has {grid.size:,} voxels, at most {MAX_VOXELS:,} are possible")
    with np.errstate(over="ignore"):
        density = np.ascontiguousarray(grid, np.float32)
    for wrong, words in ((~np.isfinite(density), "is not finite"), (density < 0.0, "is negative")):
        if wrong.any():
            x, y, z = (int(number) for number in np.unravel_index(int(np.argmax(wrong)), wrong.shape))
            raise _BrokenGridError(f"has a density that {words}, at [{x}, {y}, {z}]")
    return density
