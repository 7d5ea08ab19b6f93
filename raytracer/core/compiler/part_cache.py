"""Parts of kernels that are kept on disk, for other scenes that have the same kinds of things.

A part's key is what its code depends on, as text that is the same in every process.
"""

import contextlib
import functools
import hashlib
import inspect
import pickle
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

from numba import types
from numba.core import config

from raytracer.core.compiler import cache
from raytracer.core.compiler.kernel_files import load_signed, save_signed
from raytracer.core.compiler.lowered_intrinsics import Shared
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


# ---- Keys

_PREFIXES = tuple(f"raytracer.{name}." for name in cache.WITH_KERNELS)

# Their names say all of them.
_PLAIN_TYPES = (types.Number, types.Boolean, types.NoneType, types.Literal, types.Record)


class _UnstableError(Exception):
    """Error that something has no text that would be the same, and mean the same, in another process."""


def part_key(function: Callable[..., Any], arguments: tuple[Any, ...], *, inline: bool) -> str | None:
    """Write down what the code of an implementation depends on, beside the kernels' sources and Numba.

    Returns
    -------
    The key; None if that cannot be said, as of a function that is not in the hashed sources, or closes over one.
    """
    try:
        described = [_function(function), *map(_type, arguments)]
    except (_UnstableError, RecursionError):
        return None
    return "\n".join([_target(), str(inline), *described])


def digest(key: str) -> str:
    """Hash a key (24 hex digits)."""
    return hashlib.sha256(key.encode()).hexdigest()[:24]


@functools.cache
def _target() -> str:
    return f"{cache.processor()} {config.OPT} {config.BOUNDSCHECK}"  # type: ignore[attr-defined]


def _place(thing: Any) -> str:
    """Say where in the kernels' sources a function or class is.

    Raises
    ------
    _UnstableError : it is not there.
    """
    if not f"{thing.__module__}.".startswith(_PREFIXES):
        raise _UnstableError
    return f"{thing.__module__}:{thing.__qualname__}"


def _function(function: Any) -> str:
    """Describe a function: cases of a `switch` are closures, alike but for the function that they close over."""
    code = inspect.unwrap(function).__code__
    constants = [constant for constant in code.co_consts if not isinstance(constant, CodeType)]
    source = hashlib.sha256(code.co_code + repr((code.co_names, constants)).encode()).hexdigest()[:16]
    closed = [_value(cell.cell_contents) for cell in inspect.unwrap(function).__closure__ or ()]
    defaults = [_value(value) for value in function.__defaults__ or ()]
    return f"{_place(function)}:{code.co_firstlineno}:{source}:{defaults}:{closed}"


def _value(value: Any) -> str:
    """Describe a value that a function closes over."""
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    if isinstance(value, tuple) and type(value) is tuple:
        return f"({','.join(map(_value, value))})"
    if isinstance(value, FunctionType):
        return _function(value)
    raise _UnstableError


@functools.cache
def _type(numba_type: Any) -> str:
    """Describe a type of an argument; names of Numba's types leave out in which module a class is."""
    kind, is_a = type(numba_type).__name__, functools.partial(issubclass, type(numba_type))
    if is_a(Shared):
        return f"{kind}({_type(numba_type.pointee)})"
    if is_a(types.BaseNamedTuple):
        cls = numba_type.instance_class
        if "<locals>" in cls.__qualname__:
            raise _UnstableError
        return f"{kind} {_place(cls)}{numba_type.fields}({','.join(map(_type, numba_type.types))})"
    if is_a(types.BaseTuple):
        return f"{kind}({','.join(map(_type, numba_type.types))})"
    if type(numba_type) is types.Array:
        dtype, *layout = numba_type.key
        return f"{kind}({_type(dtype)},{layout})"
    if type(numba_type) is types.NestedArray:
        return f"{kind}({_type(numba_type.dtype)},{numba_type.shape})"
    if is_a(_PLAIN_TYPES) or type(numba_type).__module__.startswith(_PREFIXES):
        return f"{kind} {numba_type}"
    raise _UnstableError
