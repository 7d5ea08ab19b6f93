"""Names, limits and filters of `.lf` files; objects, arrays and attributes of them, checked before they are used.

A file may claim anything.
"""

import itertools
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.util.errors import InputError, abbreviate, one_line

SUFFIX = ".lf"
FORMAT = "rt light field"
VERSION = 1
POSED_VERSION = 2
"""Version of files whose views have poses of their own: programs that know views in one plane alone refuse them."""

TYPES = ("float16", "float32", "float64")
"""Types of the numbers in a file."""

RAYS_PER_TILE = 16_384

CACHE_BYTES = 16 << 20
"""Size of the cache of tiles, so that reading row by row does not read each again."""

MAX_COMPRESSION = 1_100
"""Greatest compression: deflate reaches 1032 to 1 (zlib's own documentation); and a little for checksums."""

SHUFFLE, DEFLATE, FLETCHER = 2, 1, 3
FILTERS = [SHUFFLE, DEFLATE, FLETCHER]
"""Registered numbers of the filters that tiles may go through, once each and in this order: for others HDF5 looks for
plug-ins, LZF's tiles are not checked while they are unpacked, and deflated twice, a kilobyte is a gigabyte."""

CHECKSUM_BYTES = 4
"""Size of the checksum behind a tile."""

DEFLATE_MARGIN = 64
"""Deflated, a tile grows by less than this part of it, or by less than as many bytes."""

RADIANCE = "radiance"
MICROLENSES = "microlenses"
COVERAGE = "coverage"
AXES = ("v", "u", "t", "s", "channel")
NUMBERS = ("pixel", "left", "top", "inverse_focus")
OPTIONAL_NUMBERS = ("aperture", "focal_length")

UNITS = {
    "pixel": "tangent",
    "left": "tangent",
    "top": "tangent",
    "inverse_focus": "1/m",
    "focus_distance": "m",
    "cell": "m",
    "aperture": "m",
    "focal_length": "mm",
    "pose": "m, and unit vectors",
}


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


def find_object(file: Any, name: str, path: Path) -> Any:
    """Find an object in the file itself, None if there is none: links to other files are refused."""
    import h5py

    parent = file
    for part in name.split("/"):
        link = parent.get(part, getlink=True) if isinstance(parent, h5py.Group) else None
        if link is None:
            return None
        if not isinstance(link, h5py.HardLink):
            raise InputError(f"{path}: {name} must be in the file itself, and is a link")
        parent = parent[part]
    return parent


def list_members(file: Any, name: str, path: Path) -> list[str]:
    """List the names in a group; none if there is no such group."""
    import h5py

    group = find_object(file, name, path)
    if group is None:
        return []
    if not isinstance(group, h5py.Group):
        raise InputError(f"{path}: {name} must be a group")
    return [checked_name(member, name, path) for member in group]


def checked_name(name: str | bytes, kind: str, path: Path) -> str:
    """Check that a name can be printed and written; h5py has bytes for one that is not UTF-8."""
    if isinstance(name, str) and name.isprintable():
        return name
    raise InputError(f"{path}: a name in {kind} is of letters that cannot be printed: {abbreviate(ascii(name))}")


def checked_array(file: Any, name: str, path: Path, *, axes: int | None, kinds: str = "f") -> StoredArray:
    """Open a dataset of numbers, if it is in the file itself and holds as much as it claims to."""
    import h5py

    dataset = find_object(file, name, path)
    if not isinstance(dataset, h5py.Dataset):
        raise InputError(f"{path}: has no dataset {name}")
    if dataset.dtype.kind not in kinds or dataset.dtype.subdtype is not None:
        wanted = "floating-point numbers" if kinds == "f" else "numbers"
        raise InputError(f"{path}: {name} must be of {wanted}, not of {abbreviate(one_line(str(dataset.dtype)))}")
    shape = dataset.shape
    is_ray = name.startswith("rays/")
    if shape is None or len(shape) not in ((axes,) if axes else (4, 5)) or (0 in shape and not is_ray):
        raise InputError(f"{path}: {name} must have {axes or '4 or 5'} axes, none of them empty; its shape is {shape}")
    filters = filter_ids(dataset)
    if dataset.is_virtual or dataset.external or filters != [known for known in FILTERS if known in filters]:
        raise InputError(f"{path}: {name} must be in the file itself, plain or compressed by deflate")
    if not _is_native(dataset.id.get_type(), dataset.dtype):
        raise InputError(f"{path}: {name} is of numbers that no processor has")

    # Values that were never written read as zeros, as many as a file cares to claim.
    claimed = math.prod(shape) * dataset.dtype.itemsize
    held = dataset.id.get_storage_size()
    if claimed > held * (1 if dataset.compression is None else MAX_COMPRESSION) or held > file.id.get_filesize():
        raise InputError(
            f"{path}: {name} claims to be of shape {shape}, {claimed} bytes; the file holds {held} of them"
        )
    if dataset.chunks is not None:
        _check_tiles(dataset, path, name)
    return StoredArray(dataset, path, name)


def _check_tiles(dataset: Any, path: Path, name: str) -> None:
    """Check that a dataset is in tiles of a sensible size, that all are there, and that none is too large to unpack.

    HDF5 writes beyond its arrays where the index of the tiles has been made for another size than they have.
    """
    shape, tile = dataset.shape, dataset.chunks
    if math.prod(tile) > math.prod(shape) + RAYS_PER_TILE:
        raise InputError(f"{path}: {name} is in tiles of {tile}, more than there is of it")
    if dataset.maxshape != shape:
        raise InputError(f"{path}: {name} must be of a fixed size")
    tiles = math.prod(-(-n // k) for n, k in zip(shape, tile, strict=True))
    if dataset.id.get_num_chunks() != tiles:
        raise InputError(f"{path}: {name} has {dataset.id.get_num_chunks()} of {tiles} tiles, and must have all")

    filters = filter_ids(dataset)
    size, behind = math.prod(tile) * dataset.dtype.itemsize, CHECKSUM_BYTES if FLETCHER in filters else 0
    places, wrong = set[tuple[int, ...]](), list[int]()

    def check(tile_info: Any) -> None:
        if all(at % k == 0 and at < n for at, n, k in zip(tile_info.chunk_offset, shape, tile, strict=True)):
            places.add(tile_info.chunk_offset)
        most = size + size // DEFLATE_MARGIN + DEFLATE_MARGIN
        packed = tile_info.size - behind
        if tile_info.filter_mask != 0 or not (0 < packed <= most if DEFLATE in filters else packed == size):
            wrong.append(tile_info.size)

    dataset.id.chunk_iter(check)
    if len(places) != tiles:
        raise InputError(f"{path}: {name} has {len(places)} of {tiles} tiles, and must have all")
    if wrong:
        raise InputError(f"{path}: {name} has a tile of {wrong[0]} bytes, which is not what {size} bytes take")


def _is_native(stored: Any, dtype: np.dtype[Any]) -> bool:
    """Return True if numbers are stored as `dtype` has them: HDF5's types may have any number of bits anywhere."""
    import h5py

    return bool(stored == h5py.h5t.py_create(dtype, logical=True))


def read_attribute(owner: Any, name: str, path: Path) -> Any:
    """Read an attribute: a string, a number, or an array of float64; None if there is none, or of another type."""
    import h5py

    if name not in owner.attrs:
        return None
    attribute = owner.attrs.get_id(name)
    if attribute.get_storage_size() > _MAX_ATTRIBUTE_BYTES:
        raise InputError(f"{path}: its attribute {name} is larger than {_MAX_ATTRIBUTE_BYTES} bytes")
    # HDF5 does not come back from some damaged heaps, in which values of variable length are.
    if h5py.check_vlen_dtype(attribute.dtype) is not None or h5py.check_ref_dtype(attribute.dtype) is not None:
        raise InputError(f"{path}: its attribute {name} must be of fixed length")
    stored, dtype = attribute.get_type(), attribute.dtype
    if not (isinstance(stored, h5py.h5t.TypeStringID) or (dtype.kind in "fiub" and _is_native(stored, dtype))):
        return None
    value = owner.attrs[name]
    if isinstance(value, str):
        # h5py represents bytes that are not UTF-8 as surrogates, which cannot be written.
        value = value.encode("utf-8", "surrogateescape")
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.integer) and value.ndim == 0:
        return int(value)
    if isinstance(value, np.floating) and value.ndim == 0:
        return float(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
        return value.astype(np.float64)
    return None


# Scene files are among settings.
_MAX_ATTRIBUTE_BYTES = 1 << 24


def read_string(file: Any, name: str, path: Path) -> str | None:
    """Read an attribute that is a string, None if there is none."""
    value = read_attribute(file, name, path)
    return value if isinstance(value, str) else None


def read_numbers(file: Any, name: str, path: Path, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """Read an attribute of numbers of a shape, None if there is none."""
    if name not in file.attrs:
        return None
    value = read_attribute(file, name, path)
    if value is None or isinstance(value, str) or np.shape(value) != shape:
        wanted = "a number" if shape == () else f"numbers of shape {shape}"
        raise InputError(f"{path}: its attribute {name} must be {wanted}")
    return np.asarray(value, dtype=np.float64)


def read_number(file: Any, name: str, path: Path) -> float:
    """Read an attribute that is a number, and must be there."""
    value = read_numbers(file, name, path, ())
    if value is None:
        raise InputError(f"{path}: has no attribute {name}")
    return float(value)
