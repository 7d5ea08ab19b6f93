"""Declarations of what kernels may call, kept until the compiler is loaded.

A process that takes its kernels from the cache never loads it.
"""

from collections.abc import Callable
from typing import Any

_waiting: list[Callable[[Callable[..., None]], object]] = []
_declare: Callable[..., None] | None = None


def when_compiler_loads(action: Callable[[Callable[..., None]], object]) -> None:
    """Call `action` with the compiler's function that declares parts, when the compiler is loaded, or now if it is."""
    if _declare is None:
        _waiting.append(action)
    else:
        action(_declare)


def compiler_loaded(declare: Callable[..., None]) -> None:
    """Make all declarations so far by a function of the compiler, and those to come at once."""
    global _declare  # noqa: PLW0603
    _declare = declare
    while _waiting:
        _waiting.pop(0)(declare)


def declare_part(function: Callable[..., Any], choose: Callable[..., Any], *, inline: bool = True) -> None:
    """Have calls of `function` in kernels compile `choose(*types)`, which returns an implementation or None.

    Parameters
    ----------
    inline : put implementations into their callers; otherwise they are called.
    """
    when_compiler_loads(lambda declare: declare(function, choose, inline=inline))


def declare_global(function: Callable[..., Any], make_type: Callable[[], Any]) -> None:
    """Have kernels see a Python function as a value of the Numba type that `make_type()` returns."""

    def declare(_: object) -> None:
        from numba.core.typing.templates import infer_global

        infer_global(function, make_type())

    when_compiler_loads(declare)


def external_function(name: str, arguments: int) -> Any:
    """Make a name by which kernels call a function of a library that is loaded, with addresses alone."""

    def external(*addresses: int) -> None:
        raise NotImplementedError

    def make_type() -> Any:
        from numba import types

        return types.ExternalFunction(name, types.void(*[types.intp] * arguments))

    declare_global(external, make_type)
    return external
