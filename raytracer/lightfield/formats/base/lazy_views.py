"""Arrays of views that are read from their files as they are asked for."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.film import image_file
from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.util import srgb
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError, open_regular, read_npy_header

_CHANNELS = 3


class LazyPictures(LazyArray):
    """Array of views in one picture file each, (rows, columns, height, width, 3) in linear light.

    Raises InputError, when one is read: a file is broken, or of another size than the first.
    """

    def __init__(self, files: list[list[Path]], last: tuple[Path, NDArray[np.float64]] | None = None) -> None:
        """Take the files of views, row by row, and one of their pictures, if it has been read."""
        self._files = files
        self._last = (files[0][0], image_file.load(files[0][0])) if last is None else last
        self._first = self._last[0]
        height, width = self._last[1].shape[:2]
        super().__init__((len(files), len(files[0]), height, width, _CHANNELS), np.dtype(np.float64))

    def rearrange(self, files: list[list[Path]]) -> "LazyPictures":
        """Return the array of the same pictures in other rows and columns, without reading one again."""
        return LazyPictures(files, self._last)

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, *within = ahead
        views = [[self._view(path)[tuple(within)] for path in row[columns]] for row in self._files[rows]]
        sizes = [len(range(size)[part]) for part, size in zip(ahead, self.shape, strict=True)]
        return np.array(views, dtype=self.dtype).reshape(sizes)

    def _view(self, path: Path) -> NDArray[np.float64]:
        if path == self._last[0]:
            return self._last[1]
        picture = image_file.load(path)
        if picture.shape[:2] != self.shape[2:4]:
            height, width = picture.shape[:2]
            first = f"{self.shape[3]} x {self.shape[2]} as {self._first.name} is"
            raise InputError(f"{path}: is of {width} x {height} pixels, and must be {first}: views are of one size")
        self._last = (path, picture)
        return picture


class LazyNpy(LazyArray):
    """Array of views in a .npy file, (rows, columns, height, width) and 3 or 1 channels, or none, mapped into memory.

    Integers are taken for display values (sRGB), floating-point numbers for linear light.

    Raises InputError: the file is missing, truncated, or holds something else.
    """

    def __init__(self, path: Path) -> None:
        try:
            with open_regular(path, sys.maxsize) as file:
                header = read_npy_header(file)
        except FileNotFoundError as error:
            raise InputError(f"{path}: no such file") from error
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}") from error
        except BrokenFileError as error:
            raise InputError(f"{path}: is truncated, or no .npy file of numbers") from error
        shape, dtype = header.shape, header.dtype
        is_known = dtype.kind == "f" or (dtype.kind == "u" and dtype.itemsize <= 2)
        if len(shape) not in (4, 5) or 0 in shape or shape[4:] not in ((), (1,), (_CHANNELS,)) or not is_known:
            wanted = "(rows, columns, height, width, 3) of floating-point numbers, or uint8 or uint16"
            raise InputError(f"{path}: must be {wanted}; it is {shape} of {dtype}")
        order: Literal["F", "C"] = "F" if header.is_fortran else "C"
        self._array = np.memmap(path, dtype, "r", header.start, shape, order)
        super().__init__((*shape[:4], _CHANNELS), np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        values = np.asarray(self._array[ahead[: min(4, self._array.ndim)]])
        if self._array.ndim == len(ahead) - 1:
            values = values[..., None]
        if values.dtype.kind == "u":
            values = srgb.decode(values / np.iinfo(values.dtype).max)
        colours = np.broadcast_to(values.astype(np.float64), (*values.shape[:4], _CHANNELS))
        return np.asarray(colours[..., ahead[4]])


class PartialLayer(LazyArray):
    """Layer that is known of some views, by row and column, (rows, columns, height, width); nan in all others."""

    def __init__(self, known: Mapping[tuple[int, int], NDArray[np.float64]], shape: tuple[int, int, int, int]) -> None:
        self._known = known
        super().__init__(shape, np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, *within = (range(size)[part] for part, size in zip(ahead, self.shape, strict=True))
        layer = np.full([len(rows), len(columns), *map(len, within)], np.nan)
        for (row, column), values in self._known.items():
            if row in rows and column in columns:
                layer[rows.index(row), columns.index(column)] = values[ahead[2:]]
        return layer
