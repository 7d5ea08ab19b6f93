"""Arrays in an HDF5 file, read by slices, their tiles checked before they are unpacked."""

import itertools
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.film.light_field.lf.constants import DEFLATE
from raytracer.util.errors import InputError


class StoredArray(LazyArray):
    """An array in an HDF5 file.

    Raises, when it is read
    -----------------------
    InputError : the file is damaged, or has been closed.
    """

    def __init__(self, dataset: Any, path: Path, name: str) -> None:
        super().__init__(tuple(dataset.shape), dataset.dtype.newbyteorder("="))
        self._dataset = dataset
        self._path = path
        self._name = name
        self._is_packed = DEFLATE in filter_ids(dataset)
        self._checked = set[tuple[int, ...]]()

    def __repr__(self) -> str:
        return f"<{self._name} of {self._path}: {self.shape}, {self.dtype}>"

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        if not self._dataset:
            raise InputError(f"{self._path}: has been closed")
        try:
            if self._is_packed:
                self._check_tiles(ahead)
            return np.asarray(self._dataset[ahead], dtype=self.dtype)
        except (OSError, RuntimeError, ValueError, zlib.error) as error:
            raise InputError(f"{self._path}: {self._name} is damaged") from error

    def _check_tiles(self, ahead: tuple[slice, ...]) -> None:
        """Check that tiles unpack to their size, before HDF5 unpacks them.

        It allocates memory for whatever they unpack to, and reads beyond it if that is too little.
        """
        tile = self._dataset.chunks
        size = math.prod(tile) * self._dataset.dtype.itemsize
        spans = (range(s.start // k * k, s.stop, k) for s, k in zip(ahead, tile, strict=True))
        for place in itertools.product(*spans):
            if place in self._checked:
                continue
            _, data = self._dataset.id.read_direct_chunk(place)
            unpacking = zlib.decompressobj()
            if len(unpacking.decompress(data, size + 1)) != size or not unpacking.eof:
                raise ValueError("a tile unpacks to another size")
            self._checked.add(place)


def filter_ids(dataset: Any) -> list[int]:
    """List the numbers of the filters through which a dataset is read."""
    properties = dataset.id.get_create_plist()
    return [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
