"""Keys of parts of kernels: what their code depends on, as text that is the same in every process."""

import functools
import hashlib
import inspect
from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any

from numba import types
from numba.core import config

from raytracer.core.compiler.cache import WITH_KERNELS, processor
from raytracer.core.compiler.lowered_intrinsics import Shared

_PREFIXES = tuple(f"raytracer.{name}." for name in WITH_KERNELS)

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
    return f"{processor()} {config.OPT} {config.BOUNDSCHECK}"  # type: ignore[attr-defined]


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
