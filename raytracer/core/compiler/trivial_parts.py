"""Parts that need no compiling: functions that return nothing, one of their arguments, or a constant.

Such is what an effect does in a scene that lacks it.  A part costs 20 ms to compile, however small it is, and the path
tracer asks some forty effects at each segment.
"""

import dis
import functools
import inspect
from collections.abc import Callable
from typing import Any

from numba import typeof, types

_READ_ARGUMENT = "LOAD_FAST"

# Instructions that read and return, by the beginnings of their names, which differ between versions of Python.
_PLAIN = (
    *("RESUME", "NOP", "CACHE", "LOAD_CONST", "LOAD_SMALL_INT", "LOAD_GLOBAL", "LOAD_ATTR", _READ_ARGUMENT),
    *("BUILD_TUPLE", "RETURN_VALUE", "RETURN_CONST"),
)

Implementation = Callable[[Any, Any, Any, tuple[Any, ...]], Any]


def trivial_part(
    function: Callable[..., Any], arguments: tuple[types.Type, ...]
) -> tuple[types.Type, Implementation] | None:
    """Implement a function that does nothing but return something.

    Returns
    -------
    The type of its result, and what makes the result in LLVM, as Numba calls it; None if the function does more.
    """
    read = _arguments_read(function)
    if read is None or len(inspect.signature(function).parameters) != len(arguments):
        return None
    if not read:
        # It reads constants alone, whatever it is called with.
        return _constant(function(*[None] * len(arguments)))
    return _argument(read[0], arguments[read[0]]) if len(read) == 1 else None


@functools.cache
def _arguments_read(function: Callable[..., Any]) -> tuple[int, ...] | None:
    """List the arguments that a function returns; None if it does anything else.

    By its instructions: a source file may have changed since it was imported.
    """
    steps = list(dis.get_instructions(function))
    read = [step for step in steps if step.opname.startswith(_READ_ARGUMENT)]
    if not all(step.opname.startswith(_PLAIN) for step in steps):
        return None
    # A part of an argument, or arguments in a tuple, are made by Numba.
    if read and not all(step.opname.startswith(("RESUME", "NOP", "CACHE", "RETURN", _READ_ARGUMENT)) for step in steps):
        return None
    names = function.__code__.co_varnames
    return tuple(names.index(step.argval) if step.argval in names else -1 for step in read)


def _argument(number: int, given: types.Type) -> tuple[types.Type, Implementation]:
    """Return the argument of this number."""
    result = types.unliteral(given)

    def make(context: Any, builder: Any, sig: Any, args: tuple[Any, ...]) -> Any:
        return context.cast(builder, args[number], sig.args[number], result)

    return result, make


def _constant(value: Any) -> tuple[types.Type, Implementation] | None:
    """Return a constant: None, a number, or a tuple of numbers."""
    if value is None:
        return types.none, lambda context, builder, sig, args: context.get_dummy_value()
    items = value if type(value) is tuple else (value,)
    if not all(type(item) in (bool, int, float) for item in items):
        return None
    result = typeof(value)
    return result, lambda context, builder, sig, args: context.get_constant_generic(builder, result, value)
