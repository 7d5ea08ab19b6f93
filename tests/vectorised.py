"""Call kernels for many rows of arguments at once: one compiled loop for all tests, in place of one for each.

    hits = vectorised(intersect)(table, rows(origins), rows(directions), 4.0)

What is wrapped by `rows` is handed over row by row, also within records and tuples; all else as it is.  The result is
what the kernel returns, with an array in place of each number, and of a tuple of floats an array with a column for
each.  Numbers pass through float64: of integers beyond 2^53 the last bits are lost.
"""

import functools
import hashlib
import inspect
import sys
from collections import namedtuple
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytracer.core.compiler.declarations import declare_part
from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import SAMPLERS
from raytracer.plugins.materials.base.interface import Draws


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
    # A copy: whether an array may be written is part of its type, and each type would be compiled.
    array = np.array(array, array.dtype if array.dtype.kind in "iub" else np.float64, order="C")
    return Numbers(array) if array.ndim == 1 else {2: Pairs, 3: Triples}[array.shape[1]](array)


def vectorised(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Make a kernel a function of Python that takes `rows` among its arguments."""

    def call(*arguments: Any) -> Any:
        (count,) = {len(values) for values in _all_rows(arguments)}
        # What the first row gives tells how many numbers a row has.
        example = _fill(_tag(kernel), arguments, np.empty(0), 0)
        out = np.empty((sum(1 for _ in _numbers(example)), count))
        _fill(_tag(kernel), arguments, out.reshape(-1), count)
        return _shaped(example, iter(out))

    return call


def random_draws(count: int, *, seed: int = 0, dimension: int = 8, sampler: str = "independent") -> Draws:
    """Random numbers for rows: sample after sample of one pixel."""
    chosen = SAMPLERS[sampler](seed, count if sampler != "independent" else 1)
    # By the pixel, too: independent numbers know the seed by their pixel's key alone.
    return Draws(chosen, np.uint64(0x9E3779B97F4A7C15 + seed), rows(np.arange(count)), dimension)


def _numbers(example: Any) -> Iterator[Any]:
    """The numbers in nested tuples."""
    if isinstance(example, tuple):
        for item in example:
            yield from _numbers(item)
    elif example is not None:
        yield example


@entry
def _fill(tag, arguments, out, count):
    # Column after column: a flat array is of one type, whatever its length.
    for index in range(count):
        _store(_apply(tag, arguments, index), out, index, count)
    return _apply(tag, arguments, 0)


def _all_rows(arguments: Any) -> Iterator[Any]:
    """The arrays that are wrapped, at any depth."""
    for argument in arguments if isinstance(arguments, tuple) else ():
        if isinstance(argument, Numbers | Pairs | Triples):
            yield argument.values
        else:
            yield from _all_rows(argument)


def _shaped(example: Any, columns: Iterator[Any]) -> Any:
    """Put columns of results into the shape of one result."""
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
    files = (Path(sys.modules[name].__file__ or "").read_bytes() for name in sorted(_sources(function.__module__)))
    source = hashlib.sha256(b"\0".join(files)).hexdigest()[:16]
    tag = namedtuple("Kernel", ())
    tag.__qualname__ = f"{function.__module__}:{function.__qualname__}:{source}"
    _kernels[tag] = kernel
    return tag()


def _sources(module: str, *known: str) -> set[str]:
    """The names of a module, and of the tests' modules from which it has anything (keys know the package's)."""
    names = {module}
    for value in vars(sys.modules[module]).values():
        other = getattr(value, "__module__", None) or ""
        if other.startswith("tests.") and other not in (*known, *names):
            names |= _sources(other, *known, *names)
    return names


def _generated(text: str, **names: Any) -> Callable[..., Any]:
    """Make the function of an expression."""
    exec(text, names)
    return names["generated"]  # type: ignore[no-any-return]


# Under NUMBA_DISABLE_JIT these run as they are; otherwise what the functions below make in their place, by types.


def _apply(tag, arguments, index):
    return _kernels[type(tag)](*(_row(argument, index) for argument in arguments))


def _row(argument, index):
    if isinstance(argument, Numbers):
        return argument.values[index]
    if isinstance(argument, Pairs | Triples):
        return tuple(argument.values[index])
    if next(_all_rows((argument,)), None) is None:
        return argument
    items = (_row(item, index) for item in argument)
    return tuple(items) if type(argument) is tuple else type(argument)(*items)


def _store(value, out, place, count):
    for column, number in enumerate(_numbers(value)):
        out[place + column * count] = number


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
        return lambda argument, index: (argument.values[index, 0], argument.values[index, 1], argument.values[index, 2])
    if not _has_rows(argument):
        return lambda argument, index: argument
    items = ", ".join(f"row(argument[{number}], index)" for number in range(len(argument)))
    made = f"({items},)" if cls is None else f"make({items})"
    return _generated(f"def generated(argument, index): return {made}", make=cls, row=_row)


def _has_rows(kind: Any) -> bool:
    """Tell if arguments of a type hold rows, as `_all_rows` finds them in values."""
    from numba import types

    if getattr(kind, "instance_class", None) in (Numbers, Pairs, Triples):
        return True
    return isinstance(kind, types.BaseTuple) and any(map(_has_rows, kind))


def _words(kind: Any) -> int:
    """How many numbers results of a type hold, as `_numbers` finds them in values."""
    from numba import types

    if isinstance(kind, types.BaseTuple):
        return sum(map(_words, kind))
    return int(not isinstance(kind, types.NoneType))


def _choose_store(value: Any, out: Any, place: Any, count: Any) -> Callable[..., Any]:
    from numba import types

    if isinstance(value, types.NoneType):
        return lambda value, out, place, count: None
    if not isinstance(value, types.BaseTuple):

        def store(value, out, place, count):
            out[place] = value

        return store
    lines, column = [], 0
    for number, item in enumerate(value):
        lines.append(f"    store(value[{number}], out, place + {column} * count, count)\n")
        column += _words(item)
    text = f"def generated(value, out, place, count):\n{''.join(lines)}    return None"
    return _generated(text, store=_store)


declare_part(_apply, _choose_apply)
declare_part(_row, _choose_row)
declare_part(_store, _choose_store)
