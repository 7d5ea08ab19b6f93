"""What renders of like scenes share: files that were read, what was packed, and structures that were built."""

import dataclasses
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from raytracer.assets import LOADERS, companions, file_of
from raytracer.embree import Accel, Placements
from raytracer.geometry import Geometry
from raytracer.spec import Spec

T = TypeVar("T")

_MOST_BYTES = 2**30
"""Bytes in arrays up to which files are kept, and up to which packed worlds are."""

_MOST_GEOMETRY = 2**28
"""Bytes of geometry up to which structures are kept: Embree's own memory comes on top, four times as much for meshes
(a million triangles: 18 MB of geometry, 69 MB)."""


class Counts(NamedTuple):
    """What was done so far: files read, worlds packed, structures built, and kernels compiled or taken from the cache.

    Kernels that the process had before are not counted.
    """

    files_read: int
    worlds_packed: int
    structures_built: int
    kernels: int


class Stock:
    """Keeps what renders of like scenes share, so that it is made once: for `rendering.render(..., stock=...)`.

    A file is read again once it has changed, by its size or its time, or a file that it names has.  Scenes that differ
    in their camera, film and render settings alone are packed once but for these; those whose geometry is the same
    have one structure of the ray caster's.  What was not used for longest goes where there is too much.

    It may be used by several threads at once, one of which makes what the others then share.

    Attributes
    ----------
    counts : what was made so far.
    """

    def __init__(self) -> None:
        # While one thread makes something, others that may want the same wait.
        self._lock = threading.RLock()
        self._files: _Shelf[_File] = _Shelf(_MOST_BYTES)
        self._worlds: _Shelf[Any] = _Shelf(_MOST_BYTES)
        self._structures: _Shelf[Accel] = _Shelf(_MOST_GEOMETRY)
        self._kernels = 0

    @property
    def counts(self) -> Counts:
        """What was made so far."""
        return Counts(self._files.made, self._worlds.made, self._structures.made, self._kernels)

    def note_kernels(self, count: int) -> None:
        """Count kernels that the process did not have before."""
        with self._lock:
            self._kernels += count

    def read(self, kind: str, path: Path) -> Any:
        """What a file holds, read as a kind of `assets.LOADERS`; the very same as long as the file stays as it is.

        Raises
        ------
        InputError : the file cannot be read.
        """

        def unchanged(file: _File) -> bool:
            return file.stamp is not None and file.stamp == _stamp(kind, path)

        def load() -> _File:
            # Stamped before it is read, so that a change while it is read is noticed the next time.
            stamp = _stamp(kind, path)
            return _File(stamp, LOADERS[kind](path))

        with self._lock:
            return self._files.get((kind, path), load, lambda file: _weight(file.content), unchanged).content

    def structure(
        self,
        geometries: Mapping[int, Geometry],
        groups: Sequence[Mapping[int, Geometry]],
        placements: Sequence[Placements],
        *,
        first_instance: int,
        robust: bool,
    ) -> Accel:
        """The ray caster's structure of these; see `Accel`."""
        key = _key(geometries, groups, placements, first_instance, robust)

        def build() -> Accel:
            return Accel(geometries, groups, placements, first_instance=first_instance, robust=robust)

        with self._lock:
            return self._structures.get(key, build, lambda _: _weight(key))

    def has_structure(
        self,
        geometries: Mapping[int, Geometry],
        groups: Sequence[Mapping[int, Geometry]],
        placements: Sequence[Placements],
        *,
        first_instance: int,
        robust: bool,
    ) -> bool:
        """Whether the structure of these is there already."""
        with self._lock:
            return self._structures.has(_key(geometries, groups, placements, first_instance, robust))

    def kept(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """What was made for the same key, if that is still `fresh`; or what `make` makes now."""
        with self._lock:
            found: T = self._worlds.get(key, make, _weight, fresh)
            return found


def _key(
    geometries: Mapping[int, Geometry],
    groups: Sequence[Mapping[int, Geometry]],
    placements: Sequence[Placements],
    first_instance: int,
    robust: bool,
) -> tuple[Any, ...]:
    """All that a structure depends on."""
    numbered = tuple({number: tuple(held) for number, held in group.items()} for group in (geometries, *groups))
    return numbered, tuple(tuple(placed) for placed in placements), first_instance, robust


class _File(NamedTuple):
    """What a file holds, and when it did."""

    stamp: Any
    content: Any


class _Entry(NamedTuple):
    key: tuple[Any, ...]
    value: Any
    weight: int


class _Shelf(Generic[T]):
    """Values by keys that need not be hashable, up to a weight; the one that was used last stays however heavy.

    made, how many were.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._entries: list[_Entry] = []
        self.made = 0

    def get(
        self,
        key: tuple[Any, ...],
        make: Callable[[], T],
        weigh: Callable[[T], int],
        fresh: Callable[[T], bool] = lambda value: True,
    ) -> T:
        """The value for the same key; made now if there is none, or it is not `fresh`."""
        place = self._place(key)
        if place is not None:
            entry = self._entries.pop(place)
            if fresh(entry.value):
                self._entries.append(entry)
                return entry.value  # type: ignore[no-any-return]
        value = make()
        self.made += 1
        self._entries.append(_Entry(key, value, weigh(value)))
        while len(self._entries) > 1 and sum(entry.weight for entry in self._entries) > self._most:
            del self._entries[0]
        return value

    def has(self, key: tuple[Any, ...]) -> bool:
        """Whether there is a value for the same key."""
        return self._place(key) is not None

    def _place(self, key: tuple[Any, ...]) -> int | None:
        return next((place for place, entry in enumerate(self._entries) if same(entry.key, key)), None)


def same(one: Any, other: Any) -> bool:
    """Whether two values mean the same to the last bit: 0.0 is not -0.0, and a key that was set to its default is set.

    Specs, tuples, lists and mappings are compared by what they hold, mappings by the order of it too.
    """
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, Spec):
        return one.model_fields_set == other.model_fields_set and same(one.__dict__, other.__dict__)
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and _same_bits(one, other)
    if isinstance(one, float):
        return one.hex() == float(other).hex()
    return bool(one == other)


def _same_bits(one: NDArray[Any], other: NDArray[Any]) -> bool:
    bits = np.dtype(f"V{one.itemsize}") if one.itemsize not in (1, 2, 4, 8) else np.dtype(f"u{one.itemsize}")
    return np.array_equal(np.ascontiguousarray(one).view(bits), np.ascontiguousarray(other).view(bits))


def _stamp(kind: str, path: Path) -> Any:
    """What tells that a file, or one that it names, has changed; None for one that is not there."""
    try:
        found = [file.stat() for file in (file_of(path), *companions(kind, path))]
    except OSError:
        return None
    # The time at which the file's entry changed is nobody's to put back, as that of its content is.
    return [(status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino) for status in found]


def _weight(value: Any) -> int:
    """Bytes of all arrays that a value holds, each counted once."""
    arrays = {id(array): array.nbytes for array in _arrays(value, set())}
    return sum(arrays.values())


def _arrays(value: Any, seen: set[int]) -> Iterator[NDArray[Any]]:
    if isinstance(value, np.ndarray):
        yield value
        return
    if id(value) in seen:
        return
    seen.add(id(value))
    below: Iterable[Any] = ()
    if isinstance(value, Mapping):
        below = value.values()
    elif isinstance(value, tuple | list):
        below = value
    elif dataclasses.is_dataclass(value):
        below = vars(value).values()
    for held in below:
        yield from _arrays(held, seen)
