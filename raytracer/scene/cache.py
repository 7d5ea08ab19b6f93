"""The cache that renders of similar scenes share: files read, worlds packed, and structures built."""

import dataclasses
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import Accel
from raytracer.scene.assets import LOADERS, companion_files
from raytracer.scene.assets.images import file_of
from raytracer.scene.scene_assets import AccelInput, AssetProvider
from raytracer.schema.spec import Spec

T = TypeVar("T")

_MAX_FILE_BYTES = 2**30
"""Bytes of arrays up to which files are cached, and up to which packed worlds are."""

_MAX_GEOMETRY_BYTES = 2**28
"""Bytes of geometry up to which structures are cached: Embree's own memory comes on top, four times as much for meshes
(a million triangles: 18 MB of geometry, 69 MB)."""


class CacheCounts(NamedTuple):
    """Counts of what was made so far.

    files_read, worlds_packed, structures_built : cache misses.
    kernels : compiled, or taken from the disk; those that the process had before are not counted.
    """

    files_read: int
    worlds_packed: int
    structures_built: int
    kernels: int


class RenderCache(AssetProvider):
    """A cache for what renders of similar scenes share, so that it is made once: for `rt.render(..., cache=...)`.

    A file is read again once it has changed, by its size or its time, or a file that it names has.  Scenes that differ
    in their camera, film and render settings alone share all else that is packed; those whose geometry is the same
    share the ray caster's structure.  The least recently used entries are removed where there are too many bytes.

    It may be used by several threads at once, one of which makes what the others then share.

    Attributes
    ----------
    counts : number of things made so far.
    """

    def __init__(self) -> None:
        # While one thread makes something, others that may need the same wait.
        self._lock = threading.RLock()
        self._files: _LRUCache[_CachedFile] = _LRUCache(_MAX_FILE_BYTES)
        self._worlds: _LRUCache[Any] = _LRUCache(_MAX_FILE_BYTES)
        self._structures: _LRUCache[Accel] = _LRUCache(_MAX_GEOMETRY_BYTES)
        self._kernels = 0

    @property
    def counts(self) -> CacheCounts:
        """Return the counts of what was made so far."""
        return CacheCounts(self._files.misses, self._worlds.misses, self._structures.misses, self._kernels)

    def count_kernels(self, count: int) -> None:
        """Add to the count of kernels that the process did not have before."""
        with self._lock:
            self._kernels += count

    def read(self, kind: str, path: Path) -> Any:
        """Read a file, or return the same object as before if it has not changed."""
        with self._lock:
            # Stamped before it is read, so that a change while it is read is noticed the next time.
            stamp = _file_stamp(kind, path)
            return self._files.get(
                (kind, path),
                lambda: _CachedFile(stamp, LOADERS[kind](path)),
                lambda file: _array_bytes(file.content),
                lambda file: stamp is not None and file.stamp == stamp,
            ).content

    def build_accel(self, parts: AccelInput) -> Accel:
        """Build the ray caster's structure, or return the cached one; see `Accel`."""
        key = _key(parts)
        with self._lock:
            return self._structures.get(key, parts.build, lambda _: _array_bytes(key))

    def has_structure(self, parts: AccelInput) -> bool:
        """Tell if the structure of these is in the cache."""
        with self._lock:
            return self._structures.index(_key(parts)) is not None

    def get_or_create(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Return the value of a key, if there is one that is still `fresh`; else make it."""
        with self._lock:
            value: T = self._worlds.get(key, make, _array_bytes, fresh)
            return value


def _key(parts: AccelInput) -> tuple[Any, ...]:
    """Make the cache key of a structure: all that it depends on."""
    groups = (parts.geometries, *parts.groups)
    numbered = tuple({number: tuple(geometry) for number, geometry in group.items()} for group in groups)
    return numbered, tuple(tuple(instances) for instances in parts.placements), parts.first_instance, parts.robust


class _CachedFile(NamedTuple):
    """The content of a file, and the stamp that the file had then."""

    stamp: Any
    content: Any


class _Entry(NamedTuple):
    key: tuple[Any, ...]
    value: Any
    weight: int


class _LRUCache(Generic[T]):
    """A cache of values by keys that need not be hashable, of limited weight; the last one stays however heavy it is.

    misses : number of values made.
    """

    def __init__(self, max_weight: int) -> None:
        self._max_weight = max_weight
        self._entries: list[_Entry] = []
        self.misses = 0

    def get(
        self,
        key: tuple[Any, ...],
        make: Callable[[], T],
        weigh: Callable[[T], int],
        fresh: Callable[[T], bool] = lambda value: True,
    ) -> T:
        """Return the value of a key; make it if there is none, or it is not `fresh`."""
        index = self.index(key)
        if index is not None:
            entry = self._entries.pop(index)
            if fresh(entry.value):
                self._entries.append(entry)
                return entry.value  # type: ignore[no-any-return]
        value = make()
        self.misses += 1
        self._entries.append(_Entry(key, value, weigh(value)))
        while len(self._entries) > 1 and sum(entry.weight for entry in self._entries) > self._max_weight:
            del self._entries[0]
        return value

    def index(self, key: tuple[Any, ...]) -> int | None:
        """Return the number of the entry of a key; None if there is none."""
        return next((index for index, entry in enumerate(self._entries) if is_identical(entry.key, key)), None)


def is_identical(one: Any, other: Any) -> bool:
    """Tell if two values are bit-identical: 0.0 is not -0.0, and a key that was set to its default counts as set.

    Specs, tuples, lists and mappings are compared by their items, mappings by the order of these too.
    """
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, Spec):
        return one.model_fields_set == other.model_fields_set and is_identical(one.__dict__, other.__dict__)
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(is_identical(value, other[key]) for key, value in one.items())
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(is_identical, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and _same_bits(one, other)
    if isinstance(one, float):
        return one.hex() == float(other).hex()
    return bool(one == other)


def _same_bits(one: NDArray[Any], other: NDArray[Any]) -> bool:
    bits = np.dtype(f"V{one.itemsize}") if one.itemsize not in (1, 2, 4, 8) else np.dtype(f"u{one.itemsize}")
    return np.array_equal(np.ascontiguousarray(one).view(bits), np.ascontiguousarray(other).view(bits))


def _file_stamp(kind: str, path: Path) -> Any:
    """Return a stamp that changes with a file, or one that it names; None if there is no file."""
    try:
        statuses = [file.stat() for file in (file_of(path), *companion_files(kind, path))]
    except OSError:
        return None
    # The time of the content can be set back by programs; that of the file's entry (ctime) cannot.
    return [(status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino) for status in statuses]


def _array_bytes(value: Any) -> int:
    """Count the bytes of all arrays in a value, each array once."""
    return sum({id(array): array.nbytes for array in _arrays(value, set())}.values())


def _arrays(value: Any, seen: set[int]) -> Iterator[NDArray[Any]]:
    if isinstance(value, np.ndarray):
        yield value
        return
    if id(value) in seen:
        return
    seen.add(id(value))
    if dataclasses.is_dataclass(value):
        value = vars(value)
    for item in value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple | list) else ():
        yield from _arrays(item, seen)
