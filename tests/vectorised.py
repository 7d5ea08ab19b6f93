"""Call kernels for many rows of arguments at once: one compiled loop for all tests, in place of one for each.

    hits = vectorised(intersect)(table, rows(origins), rows(directions), 4.0)

What is wrapped by `rows` is handed over row by row, also within records and tuples; all else as it is.  The result is
what the kernel returns, with an array in place of each number.
"""

import functools
import hashlib
import inspect
from collections import namedtuple
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytracer.core.compiler.declarations import declare_part
from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import SAMPLERS
from raytracer.plugins.materials.base.interface import Draws

_WORDS = 256
"""The most numbers that a kernel may return here."""


class Numbers(NamedTuple):
    """Rows of one number each: (n,)."""

    values: Any


class Pairs(NamedTuple):
    """Rows of two numbers each: (n, 2)."""

    values: Any


class Triples(NamedTuple):
    """Rows of three numbers each: (n, 3)."""

    values: Any


def rows(values: Any) -> Any:
    """Wrap numbers (n,), pairs (n, 2) or triples (n, 3), of which a kernel is to take a row at a time.

    Integers and truth values stay what they are; all else is float64.
    """
    array = np.asarray(values)
    array = np.ascontiguousarray(array, array.dtype if array.dtype.kind in "iub" else np.float64)
    return Numbers(array) if array.ndim == 1 else {2: Pairs, 3: Triples}[array.shape[1]](array)


def vectorised(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Make a kernel a function of Python that takes `rows` among its arguments."""

    def call(*arguments: Any) -> Any:
        count = next(len(values) for values in _all_rows(arguments))
        # Column by column, so that what is not written takes no memory.
        out = np.empty((_WORDS, count)).T
        example = _fill(_tag(kernel), arguments, out)
        return _shaped(example, map(np.copy, out.T))

    return call


def random_draws(count: int, *, seed: int = 0, dimension: int = 8) -> Draws:
    """Random numbers for rows: sample after sample of one pixel."""
    return Draws(SAMPLERS["independent"](seed, 1), np.uint64(0x9E3779B97F4A7C15), rows(np.arange(count)), dimension)


@entry
def _fill(tag, arguments, out):
    for index in range(len(out)):
        result = _apply(tag, arguments, index)
        _store(result, out, index, 0)
    return _apply(tag, arguments, 0)


def _all_rows(arguments: Any) -> Iterator[Any]:
    for argument in arguments if isinstance(arguments, tuple) else ():
        if isinstance(argument, Numbers | Pairs | Triples):
            yield argument.values
        else:
            yield from _all_rows(argument)


def _shaped(example: Any, columns: Iterator[Any]) -> Any:
    """Put columns of results into the shape of one of them."""
    if example is None:
        return None
    if not isinstance(example, tuple):
        return next(columns).astype(np.asarray(example).dtype)
    items = [_shaped(item, columns) for item in example]
    if type(example) is not tuple:
        return type(example)(*items)
    return np.stack(items, axis=-1) if all(isinstance(item, float) for item in example) else tuple(items)


# ---- What the loop is compiled from

_kernels: dict[type, Callable[..., Any]] = {}


@functools.cache
def _tag(kernel: Callable[..., Any]) -> Any:
    """Make an empty record whose class stands for a kernel: its name is part of the key of what is on disk."""
    function = inspect.unwrap(kernel)
    source = hashlib.sha256(Path(function.__code__.co_filename).read_bytes()).hexdigest()[:16]
    tag = namedtuple("Kernel", ())
    tag.__qualname__ = f"{function.__module__}:{function.__qualname__}:{source}"
    _kernels[tag] = kernel
    return tag()


def _generated(text: str, **names: Any) -> Callable[..., Any]:
    """Make the function of an expression."""
    exec(text, names)
    return names["generated"]  # type: ignore[no-any-return]


def _apply(tag, arguments, index):
    raise NotImplementedError


def _row(argument, index):
    raise NotImplementedError


def _store(value, out, index, column):
    raise NotImplementedError


def _choose_apply(tag: Any, arguments: Any, index: Any) -> Callable[..., Any]:
    items = ", ".join(f"row(arguments[{number}], index)" for number in range(len(arguments)))
    text = f"def generated(tag, arguments, index): return kernel({items})"
    return _generated(text, kernel=_kernels[tag.instance_class], row=_row)


def _choose_row(argument: Any, index: Any) -> Callable[..., Any]:
    cls = getattr(argument, "instance_class", None)
    if cls is Numbers:
        return lambda argument, index: argument.values[index]
    if cls is Pairs:
        return lambda argument, index: (argument.values[index, 0], argument.values[index, 1])
    if cls is Triples:
        return lambda argument, index: (
            argument.values[index, 0],
            argument.values[index, 1],
            argument.values[index, 2],
        )
    if not _has_rows(argument):
        return lambda argument, index: argument
    items = ", ".join(f"row(argument[{number}], index)" for number in range(len(argument)))
    made = f"({items},)" if cls is None else f"make({items})"
    return _generated(f"def generated(argument, index): return {made}", make=cls, row=_row)


def _has_rows(kind: Any) -> bool:
    from numba import types

    if getattr(kind, "instance_class", None) in (Numbers, Pairs, Triples):
        return True
    return isinstance(kind, types.BaseTuple) and any(map(_has_rows, kind))


def _words(kind: Any) -> int:
    from numba import types

    if isinstance(kind, types.BaseTuple):
        return sum(map(_words, kind))
    return int(not isinstance(kind, types.NoneType))


def _choose_store(value: Any, out: Any, index: Any, column: Any) -> Callable[..., Any]:
    from numba import types

    if isinstance(value, types.NoneType):
        return lambda value, out, index, column: None
    if not isinstance(value, types.BaseTuple):

        def store(value, out, index, column):
            out[index, column] = value

        return store
    lines, column = [], 0
    for number, item in enumerate(value):
        lines.append(f"    store(value[{number}], out, index, column + {column})\n")
        column += _words(item)
    text = f"def generated(value, out, index, column):\n{''.join(lines)}    return None"
    return _generated(text, store=_store)


declare_part(_apply, _choose_apply)
declare_part(_row, _choose_row)
declare_part(_store, _choose_store)
