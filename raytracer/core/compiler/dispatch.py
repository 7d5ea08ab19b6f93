"""Dispatch by type: functions that kernels call, chosen when a scene is compiled.

Everything in the inner loop is called from one `entry`: a plain function under `kernel`, or one case of a `generic`
function, chosen when a scene is compiled by the NamedTuple class of its first argument.  A scene without a kind of
thing therefore holds no code for it.
"""

import contextlib
import functools
import gc
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numba
import numpy as np
from numba import types

from raytracer.core.compiler.cache import KernelCache
from raytracer.core.compiler.lock import compiler_lock
from raytracer.core.compiler.part_cache import write_parts
from raytracer.core.compiler.parts import declare_part
from raytracer.core.compiler.passes import OPTIONS
from raytracer.util.signals import run_in_thread

F = TypeVar("F", bound=Callable[..., Any])


def entry(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls: it releases the interpreter lock, and is cached on disk.

    If several processes need it for the same types, one compiles it and the others wait.
    """
    compiled = numba.njit(nogil=True, **OPTIONS)(function)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return compiled
    cache, compile_now = KernelCache(function), compiled.compile
    compiled._cache = cache

    def compile_alone(signature: tuple[types.Type, ...]) -> Any:
        with (
            compiler_lock,
            cache.files.compile_lock(cache._index_key(signature, compiled.targetctx.codegen())),
            _without_collector(),
        ):
            try:
                return compile_now(signature)
            finally:
                write_parts()

    def compile_interruptibly(signature: tuple[types.Type, ...]) -> Any:
        # A thread that compiles already holds the lock, for which another thread would have to wait.
        return (
            compile_alone(signature) if compiler_lock.is_locked() else run_in_thread(lambda: compile_alone(signature))
        )

    compiled.compile = compile_interruptibly
    return compiled


@contextlib.contextmanager
def _without_collector() -> Iterator[None]:
    """Leave cycles of garbage in memory meanwhile: of the many objects of a compiler few are garbage.

    Looking through them took 0.4 of 3.6 s for the cover, 2.4 of 15.1 s for studio, which needs 140 MB more without.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def kernel(function: F) -> F:
    """Make `function` part of whatever compiled code calls it, without a call.

    Not a Numba dispatcher: that would compile wrappers for Python around each of hundreds of small functions, which
    took 9.5 s for the cover scene where this took 5.8 s.  Called from Python, it is compiled by itself, at need.
    """
    compiled = numba.njit(**OPTIONS)(function)

    @functools.wraps(function)
    def from_python(*args):
        return compiled(*args)

    declare_part(from_python, lambda *args: function)
    return from_python  # type: ignore[return-value]


def routine(function: F) -> F:
    """Make `function` a call from kernels, where `kernel` inlines: for large ones with many callers and few arguments.

    The kernel of a scene with noise in three parameters of materials is a tenth smaller so, and no slower.
    """
    compiled = numba.njit(**OPTIONS)(function)

    @functools.wraps(function)
    def from_python(*args):
        return compiled(*args)

    declare_part(from_python, lambda *args: function, inline=False)
    return from_python  # type: ignore[return-value]


def _class_of(numba_type: types.Type) -> type | None:
    """Return the Python class of what has a type in kernels, as far as cases are registered for it."""
    for family, cls in ((types.NoneType, type(None)), (types.Array, np.ndarray), (types.BaseTuple, tuple)):
        if isinstance(numba_type, family):
            return getattr(numba_type, "instance_class", cls)
    return None


def generic(stub: Callable[..., Any]) -> Any:
    """Make `stub` a function whose implementation is chosen by the class of its first argument.

    Cases are added with `@stub.register(SomeNamedTuple)`.  Called from Python it is `functools.singledispatch`;
    called from a kernel the choice is made while compiling, so nothing is left of it at run time.
    A case must take the same argument names as the stub.
    """
    dispatcher = functools.singledispatch(stub)

    def choose(first: types.Type) -> Callable[..., Any] | None:
        cls = _class_of(first)
        case = dispatcher.dispatch(cls) if cls is not None else stub
        return None if case is stub else case

    declare_part(dispatcher, lambda first, *rest: choose(first))
    return dispatcher


def optional(*absent: Any) -> Any:
    """Make a `generic` of an effect that a scene may lack: the body is what is done without it, where it is None.

    Used as `@optional`, or as `@optional(NoLightSampling)`: the body is then also the case of those classes.
    """
    if len(absent) == 1 and not isinstance(absent[0], type):
        return optional()(absent[0])

    def decorated(function: Callable[..., Any]) -> Any:
        @functools.wraps(function)
        def stub(*args):
            raise NotImplementedError

        dispatcher = generic(stub)
        for cls in (type(None), *absent):
            dispatcher.register(cls)(function)
        return dispatcher

    return decorated


def kernel_overload(implementation: Callable[..., Any]) -> Callable[[F], F]:
    """Give a Python function an implementation for kernels: `implementation(*types)` returns it, as for `overload`."""

    def decorated(function: F) -> F:
        declare_part(function, implementation)
        return function

    return decorated


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

    def called(tables, *args):
        for table in tables:
            case(table, *args)

    def typing(tables, *args):
        if len(tables) == 1:
            return lambda tables, *args: case(tables[0], *args)

        def implementation(tables, *args):
            case(tables[0], *args)
            called(tables[1:], *args)

        return implementation

    declare_part(called, typing)
    return called
