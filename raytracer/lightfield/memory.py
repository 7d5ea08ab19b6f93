"""Memory that work on a light field may take, besides the program itself: how much there is, and what does not fit.

What can be done in parts, such as planes of a sweep or of a focal stack, is done in as many at a time as fit; what
cannot is refused before it is begun.  It is set for a `with` block, as the work of one command is.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from raytracer.util.errors import InputError

MEMORY = 2 * 10**9
"""Default of the bytes that work may take."""

MORE_MEMORY = "give more by --memory"
"""Advice for the sentences of `require_memory`, where nothing takes less."""

_LIMIT: ContextVar[int] = ContextVar("memory", default=MEMORY)
_RESERVED: ContextVar[float] = ContextVar("reserved", default=0.0)


@contextmanager
def memory_limit(size: int) -> Iterator[None]:
    """Set the memory (bytes) that work in the `with` block may take."""
    token = _LIMIT.set(size)
    try:
        yield
    finally:
        _LIMIT.reset(token)


def require_memory(size: float, what: str, instead: str) -> None:
    """Refuse what takes more memory (bytes) than is given.

    what : takes the memory, for the sentence: "super-resolution".
    instead : takes less.

    Raises
    ------
    InputError : it takes more.
    """
    if size > _left():
        given = f"{_LIMIT.get() / 1e9:.3g} GB are given"
        if _RESERVED.get() > 0.0:
            given = f"{_left() / 1e9:.3g} GB are left, as {given}"
        raise InputError(f"memory: {what} takes {size / 1e9:.3g} GB, and {given}; {instead}")


def _left() -> float:
    return _LIMIT.get() - _RESERVED.get()


@contextmanager
def reserved_memory(size: float, what: str, instead: str) -> Iterator[None]:
    """Reserve memory (bytes) in a `with` block, in which other work may take what is left.

    Raises
    ------
    InputError : it is more than is given; see `require_memory`.
    """
    require_memory(size, what, instead)
    token = _RESERVED.set(_RESERVED.get() + size)
    try:
        yield
    finally:
        _RESERVED.reset(token)


def count_that_fit(fixed: float, each: float, what: str, instead: str) -> int:
    """Count how many parts of `each` bytes fit beside `fixed` bytes.

    Raises
    ------
    InputError : not even one does; see `require_memory`.
    """
    require_memory(fixed + each, what, instead)
    return int((_left() - fixed) / each)
