"""Parts of kernels: functions that are compiled for the types that a kernel calls them with, and linked into it."""

import dis
import functools
import inspect
import itertools
import re
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import typeof, types
from numba.core.errors import TypingError
from numba.core.funcdesc import FunctionDescriptor
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, Signature, fold_arguments, infer_global, signature
from numba.core.utils import pysignature  # type: ignore[attr-defined]

from raytracer.core.compiler.compile_progress import COMPILATION
from raytracer.core.compiler.declarations import compiler_loaded
from raytracer.core.compiler.part_cache import StoredPart, digest, load_part, part_key, save_part
from raytracer.core.compiler.part_library import PartLibrary
from raytracer.core.compiler.passes import OPTIONS, lower_part

_numbers = itertools.count()

counts: Counter[str] = Counter()
"""Numbers of parts that this process has lowered, and loaded."""


class _Part(NamedTuple):
    """A part that is compiled for types of arguments.

    Attributes
    ----------
    signature : types of its result and its arguments.
    key : under which Numba finds its code.
    """

    signature: Signature
    key: object


_named: dict[str, _Part] = {}
"""The parts of this process, by name: some are chosen by several functions."""


class _PartTemplate(AbstractTemplate):
    """The template that Numba asks for the type of a call of a part.

    Attributes
    ----------
    key : what is called.
    choose : returns the implementation for types of arguments, or None if there is none.
    inline : put it into its callers.
    parts : those that are compiled, by types of arguments as the call has them.
    """

    key: Any
    choose: Any
    inline: bool
    parts: dict[tuple[Any, ...], _Part]

    def generic(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Signature | None:
        if kws:
            raise TypingError("kernels take no keyword arguments")
        arguments = tuple(args)
        part = self.parts.get(arguments)
        if part is None:
            function = type(self).choose(*arguments)
            if function is None:
                return None
            part = self.parts[arguments] = _compile_part(function, arguments, inline=self.inline)
        self._key = part.key
        return part.signature

    def get_impl_key(self, sig: Signature) -> object:
        return self._key

    def get_template_info(self) -> dict[str, Any]:
        # Of the class, which does not bind it.
        function = type(self).key
        code, line, path = self.get_source_code_info(function)
        return {
            "kind": "kernel",
            "name": function.__qualname__,
            "sig": str(pysignature(function)),
            "filename": path,
            "lines": (line, line + len(code) - 1),
            "docstring": function.__doc__,
        }


def declare_part(function: Callable[..., Any], choose: Callable[..., Any], *, inline: bool = True) -> None:
    """Have calls of `function` in kernels compile `choose(*types)`, which returns an implementation or None.

    As Numba's `overload` does; but that makes a dispatcher for each implementation.

    Parameters
    ----------
    inline : put implementations into their callers; otherwise they are called.
    """
    attributes = {"key": function, "choose": staticmethod(choose), "inline": inline, "parts": {}}
    template = type(f"PartTemplate_{function.__name__}", (_PartTemplate,), attributes)
    infer_global(function, types.Function(template))


def lower_entry(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[FunctionDescriptor, PartLibrary]:
    """Lower a function that Python calls, and all that it calls; returns what Numba must know of it, and its code."""
    given = _fold(pysignature(function), arguments)
    name = _name(function, None)
    stored = lower_part(function, given, name, inline=True)
    return _descriptor(function, given, name, stored, inline=True), stored.library


def jitted(function: Callable[..., Any]) -> Any:
    """Make Numba's own compiled function of a part, for calls from Python."""
    return numba.njit(**OPTIONS)(function)


def class_of(numba_type: types.Type) -> type | None:
    """Return the Python class of what has a type in kernels, as far as cases are registered for it."""
    for family, cls in ((types.NoneType, type(None)), (types.Array, np.ndarray), (types.BaseTuple, tuple)):
        if isinstance(numba_type, family):
            return getattr(numba_type, "instance_class", cls)
    return None


def _compile_part(function: Callable[..., Any], given: tuple[Any, ...], *, inline: bool) -> _Part:
    """Compile an implementation for types of arguments, or load it, and tell Numba of it."""
    python_signature = pysignature(function)
    arguments = _fold(python_signature, given)
    if trivial := trivial_part(function, arguments):
        result, implementation = trivial
        trivial_key = object()
        cpu_target.target_context.insert_func_defn([(implementation, trivial_key, arguments)])
        return _Part(signature(result, *arguments).replace(pysig=python_signature), trivial_key)
    key = part_key(function, arguments, inline=inline)
    name = _name(function, key)
    part = _named.get(name)
    if part is None:
        stored = _stored_part(function, arguments, name, key, inline=inline)
        descriptor = _descriptor(function, arguments, name, stored, inline=inline)
        impl_key = object()
        cpu_target.target_context.insert_user_function(impl_key, descriptor, [stored.library])
        result = signature(stored.result, *arguments).replace(pysig=python_signature)
        part = _named[name] = _Part(result, impl_key)
    return part


def _fold(python_signature: inspect.Signature, given: tuple[Any, ...]) -> tuple[Any, ...]:
    """Put types of arguments into the order of the parameters: defaults added, and `*args` as a tuple."""
    return tuple(
        fold_arguments(
            python_signature,
            given,
            {},
            lambda index, parameter, value: value,
            lambda index, parameter, default: types.Omitted(default),
            lambda index, parameter, values: types.StarArgTuple(values),
        )
    )


def _stored_part(
    function: Callable[..., Any], arguments: tuple[Any, ...], name: str, key: str | None, *, inline: bool
) -> StoredPart:
    """Load a part, or lower it, and keep it."""
    stored = None if key is None else load_part(name, key)
    if stored is None:
        counts["lowered"] += 1
        stored = lower_part(function, arguments, name, inline=inline)
        if key is not None:
            save_part(stored, key)
    else:
        counts["loaded"] += 1
    COMPILATION.add_part()
    return stored


def _descriptor(
    function: Callable[..., Any], arguments: tuple[Any, ...], name: str, stored: StoredPart, *, inline: bool
) -> FunctionDescriptor:
    """Make what Numba must know to call a part."""
    return FunctionDescriptor(
        native=True,
        modname=function.__module__,
        qualname=function.__qualname__,
        unique_name=name,
        doc="",
        typemap={},
        restype=stored.result,
        calltypes={},
        args=stored.names,
        kws=(),
        mangler=lambda *_, **__: name,
        argtypes=arguments,
        inline=inline,
    )


def _name(function: Callable[..., Any], key: str | None) -> str:
    """Name the LLVM function of a part; without a key, no other of this process has the name."""
    plain = re.sub(r"[^A-Za-z0-9_]+", ".", function.__qualname__)
    return f"part.{plain}.{next(_numbers) if key is None else digest(key)}"


# ---- Trivial parts
#
# Functions that return nothing, one of their arguments, or a constant need no compiling.  Such is what an effect does
# in a scene that lacks it.  A part costs 20 ms to compile, however small it is, and the path tracer asks some forty
# effects at each segment.

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


compiler_loaded(declare_part)
