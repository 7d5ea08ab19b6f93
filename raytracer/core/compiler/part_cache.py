"""Parts of kernels that are kept on disk, for other scenes that have the same kinds of things."""

import contextlib
import pickle
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.core.compiler import cache
from raytracer.core.compiler.kernel_files import load_signed, save_signed
from raytracer.core.compiler.part_library import PartLibrary

_libraries: dict[str, PartLibrary] = {}
"""Those that this process has loaded, by name."""


_pending: list[tuple[Path, bytes]] = []
"""Files that are to be written."""


class StoredPart(NamedTuple):
    """A part as its callers need it.

    Attributes
    ----------
    result : type of its result.
    names : of its arguments.
    library : its code.
    """

    result: Any
    names: tuple[str, ...]
    library: PartLibrary


class _Record(NamedTuple):
    """Content of a file.

    Attributes
    ----------
    key : what the code depends on; None for a function of Numba's own.
    result : type of its result.
    names : of its arguments.
    callees : names of the libraries that it calls directly.
    bitcode : its own LLVM code.
    """

    key: str | None
    result: Any
    names: tuple[str, ...]
    callees: tuple[str, ...]
    bitcode: bytes


def part_path(name: str) -> Path:
    """Name the file of a library; not one of a kernel, which a race of processes leaves one of."""
    return cache.CACHE_FOLDER / f"{name.rsplit('.', 1)[-1]}.part"


def load_part(name: str, key: str) -> StoredPart | None:
    """Load a part and all that it calls; None if any of it is missing, damaged, or not signed by the user's key."""
    record = _load(name)
    if record is None or record.key != key:
        return None
    library = _library(name, record)
    return None if library is None else StoredPart(record.result, record.names, library)


def save_part(part: StoredPart, key: str) -> None:
    """Have `write_parts` keep a part for other processes, unless it calls what cannot be kept."""
    if all(_is_kept(callee) for callee in part.library.callees):
        _save(part.library, key, part.result, part.names)


def _is_kept(library: PartLibrary) -> bool:
    if library.is_foreign and not library.is_kept:
        _save(library, None, None, ())
    return library.is_kept


def _save(library: PartLibrary, key: str | None, result: Any, names: tuple[str, ...]) -> None:
    if library.is_bound:
        return
    record = _Record(key, result, names, tuple(callee.name for callee in library.callees), library.bitcode)
    # A type may be of a class that has no place in a module.
    with contextlib.suppress(Exception):
        content = pickle.dumps(tuple(record), protocol=-1)
        _pending.append((part_path(library.name), content))
        library.is_kept = True


def write_parts() -> None:
    """Write the files of parts that were lowered since this was called last.

    All at once, so that a process that is killed while it compiles leaves no half of one.
    """
    while _pending:
        path, content = _pending.pop()
        save_signed(path, content, sweep=False)


def _load(name: str) -> _Record | None:
    content = load_signed(part_path(name))
    # A file of another version may raise nearly anything.
    with contextlib.suppress(Exception):
        return None if content is None else _Record(*pickle.loads(content))
    return None


def _library(name: str, record: _Record | None) -> PartLibrary | None:
    """Make the library of a record, and those that it calls."""
    if record is None:
        return None
    library = PartLibrary(name)
    for callee in record.callees:
        loaded = _libraries.get(callee) or _library(callee, _load(callee))
        if loaded is None:
            return None
        library.add_linking_library(loaded)
    library.bitcode = record.bitcode
    library.is_kept = True
    _libraries[name] = library
    return library
