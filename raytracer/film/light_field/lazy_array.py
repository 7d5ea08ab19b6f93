"""Arrays that are read when they are indexed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


class LazyArray:
    """An array that is indexed as NumPy's, by slices, integers and lists, and reads only what is needed.

    Derived classes implement `_read`, which takes a slice for each axis, all with positive steps.
    """

    def __init__(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self.shape = shape
        self.dtype = dtype
        self.ndim = len(shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> NDArray[Any]:
        ahead, rest = _forward_slices(key, self.shape)
        return np.asarray(self._read(ahead)[rest])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False:
            raise ValueError("what is in a file cannot be had without a copy")
        whole = self._read(tuple(slice(0, size, 1) for size in self.shape))
        return np.asarray(whole, dtype=dtype)

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        raise NotImplementedError


def _forward_slices(key: Any, shape: tuple[int, ...]) -> tuple[tuple[slice, ...], tuple[Any, ...]]:
    """Convert a key to slices with positive steps, which are read, and a key into what was read."""
    keys = key if isinstance(key, tuple) else (key,)
    if not any(k is Ellipsis for k in keys):
        keys = (*keys, Ellipsis)
    at = next(i for i, k in enumerate(keys) if k is Ellipsis)
    missing = len(shape) - (len(keys) - 1)
    if missing < 0:
        raise IndexError(f"too many indices: the array has {len(shape)} axes, and {len(keys) - 1} are named")
    keys = (*keys[:at], *(slice(None),) * missing, *keys[at + 1 :])

    ahead: list[slice] = []
    rest: list[Any] = []
    for axis, (k, size) in enumerate(zip(keys, shape, strict=True)):
        if isinstance(k, slice):
            indices = range(size)[k]
            forward = indices if indices.step > 0 else indices[::-1]
            ahead.append(slice(forward.start, max(forward.stop, forward.start), forward.step))
            rest.append(slice(None, None, 1 if indices.step > 0 else -1))
            continue
        wanted = np.asarray(k)
        if wanted.dtype == bool and wanted.shape == (size,):
            wanted = np.flatnonzero(wanted)
        if k is None or (wanted.size > 0 and wanted.dtype.kind not in "iu"):
            raise IndexError("an array in a file takes integers, slices and lists, and one ellipsis")
        if wanted.size > 0 and not (wanted.min() >= -size and wanted.max() < size):
            raise IndexError(f"index out of bounds for axis {axis}, which has {size}")
        wanted = np.where(wanted < 0, wanted + size, wanted).astype(np.intp)
        low, high = (int(wanted.min()), int(wanted.max()) + 1) if wanted.size > 0 else (0, 0)
        ahead.append(slice(low, high, 1))
        rest.append(int(wanted) - low if wanted.ndim == 0 else wanted - low)
    return tuple(ahead), tuple(rest)
