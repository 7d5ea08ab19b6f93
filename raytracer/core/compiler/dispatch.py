"""Dispatch by type: functions that kernels call, chosen when a scene is compiled.

Everything in the inner loop is called from one `entry`: a plain function under `kernel`, or one case of a `generic`
function, chosen when a scene is compiled by the NamedTuple class of its first argument.  A scene without a kind of
thing therefore holds no code for it.
"""

import functools
from collections.abc import Callable
from typing import Any, TypeVar

from raytracer.core.compiler.declarations import declare_part
from raytracer.core.compiler.entry import entry as entry  # noqa: PLC0414

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Make `function` part of whatever compiled code calls it, without a call.

    Not a Numba dispatcher: that would compile wrappers for Python around each of hundreds of small functions, which
    took 9.5 s for the cover scene where this took 5.8 s.  Called from Python, it is compiled by itself, at need.
    """
    return _part(function, inline=True)


def routine(function: F) -> F:
    """Make `function` a call from kernels, where `kernel` inlines: for large ones with many callers and few arguments.

    The kernel of a scene with noise in three parameters of materials is a tenth smaller so, and no slower.
    """
    return _part(function, inline=False)


def _part(function: F, *, inline: bool) -> F:
    @functools.cache
    def compiled() -> Any:
        from raytracer.core.compiler.parts import jitted

        return jitted(function)

    @functools.wraps(function)
    def from_python(*args):
        return compiled()(*args)

    declare_part(from_python, lambda *args: function, inline=inline)
    return from_python  # type: ignore[return-value]


def generic(stub: Callable[..., Any]) -> Any:
    """Make `stub` a function whose implementation is chosen by the class of its first argument.

    Cases are added with `@stub.register(SomeNamedTuple)`.  Called from Python it is `functools.singledispatch`;
    called from a kernel the choice is made while compiling, so nothing is left of it at run time.
    A case must take the same argument names as the stub, whose body is never run: a class without a case is an
    error.
    """

    @functools.wraps(stub)
    def default(*args):
        raise NotImplementedError(f"{stub.__name__} has no case for {type(args[0]).__name__}")

    dispatcher = functools.singledispatch(default)

    def choose(first: Any) -> Callable[..., Any] | None:
        from raytracer.core.compiler.parts import class_of

        cls = class_of(first)
        case = dispatcher.dispatch(cls) if cls is not None else default
        return None if case is default else case

    declare_part(dispatcher, lambda first, *rest: choose(first))
    return dispatcher


def optional(*absent: Any) -> Any:
    """Make a `generic` of an effect that a scene may lack: the body is what is done without it, where it is None.

    Used as `@optional`, or as `@optional(NoLightSampling)`: the body is then also the case of those classes.
    """
    if len(absent) == 1 and not isinstance(absent[0], type):
        return optional()(absent[0])

    def decorated(function: Callable[..., Any]) -> Any:
        dispatcher = generic(function)
        for cls in (type(None), *absent):
            dispatcher.register(cls)(function)
        return dispatcher

    return decorated


def overridable(function: Callable[..., Any]) -> Any:
    """Make a `generic` whose body is done for all that has no case of its own."""
    return optional(tuple)(function)


def switch(case: Callable[..., Any]) -> Any:
    """Make `case(table, *args)` into `function(tables, index, *args)` that picks one table of a tuple at run time.

    `tables` holds tables of different classes, so no index can reach into it; the choice becomes a chain of
    comparisons, as long as the number of kinds in the scene and no longer.
    """

    def chosen(tables, index, *args):
        return case(tables[index], *args)

    def typing(tables, index, *args):
        if len(tables) == 1:
            return lambda tables, index, *args: case(tables[0], *args)

        def implementation(tables, index, *args):
            if index == 0:
                return case(tables[0], *args)
            return chosen(tables[1:], index - 1, *args)

        return implementation

    declare_part(chosen, typing)
    return chosen


def fold(case: Callable[..., Any], combine: Callable[..., Any]) -> Any:
    """Make `case(table, *args)` into `function(tables, *args)` that combines the cases of all tables of a tuple."""

    def folded(tables, *args):
        return functools.reduce(combine, (case(table, *args) for table in tables))

    def typing(tables, *args):
        if len(tables) == 1:
            return lambda tables, *args: case(tables[0], *args)
        return lambda tables, *args: combine(case(tables[0], *args), folded(tables[1:], *args))

    declare_part(folded, typing)
    return folded


def each(case: Callable[..., Any]) -> Any:
    """Make `case(table, *args)` into `function(tables, *args)` that calls it for every table of a tuple, in order."""
    return fold(case, _nothing)


@kernel
def _nothing(first: None, rest: None) -> None:
    """Combine the results of functions that return nothing."""
