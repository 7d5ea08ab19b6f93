"""Arguments of compiled code: their types, and their values in a row of eight bytes each, without the compiler.

A kernel takes numbers, arrays, None, and tuples of these, such as the packed scene.  The order of the values is that of
Numba's data models.
"""

import enum
import struct
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import numpy as np

_NONE, _BOOLEAN, _INTEGER, _LARGE, _FLOAT = "none", "bool", "int64", "uint64", "float64"

_MAX_INT64 = 2**63 - 1

# Formats of `struct` for a value in eight bytes.
_FORMATS = {
    **dict.fromkeys(("int8", "int16", "int32", "int64"), "q"),
    **dict.fromkeys(("uint8", "uint16", "uint32", "uint64"), "Q"),
    "float64": "d",
    "float32": "fxxxx",
    "bool": "Q",
}


class PackedArgument(NamedTuple):
    """An argument as compiled code takes it.

    Attributes
    ----------
    value : the argument itself, which must live as long as its arrays are used.
    kind : its type: equal for what one compiled version can take.
    data : its values, eight bytes each.
    """

    value: Any
    kind: Hashable
    data: bytes


def pack_argument(value: Any) -> PackedArgument:
    """Pack an argument.

    Raises
    ------
    TypeError : kernels take no such thing.
    """
    formats: list[str] = []
    values: list[Any] = []
    kind = _add(value, formats, values)
    return PackedArgument(value, kind, struct.pack(f"={''.join(formats)}", *values))


def _add(value: Any, formats: list[str], values: list[Any]) -> Hashable:
    """Append the values of an argument and their formats, and return its type."""
    kind = type(value)
    if isinstance(value, np.ndarray):
        return _add_array(value, formats, values)
    if isinstance(value, tuple):
        inner = tuple(_add(item, formats, values) for item in value)
        return (kind, *inner)
    if value is None:
        formats.append("Q")
        values.append(0)
        return _NONE
    if isinstance(value, enum.IntEnum):
        formats.append("q")
        values.append(int(value))
        return (kind,)
    name = _number_type(value)
    formats.append(_FORMATS[name])
    values.append(value.item() if isinstance(value, np.generic) else value)
    return name


def _number_type(value: Any) -> str:
    """Name the type of a number.

    Raises
    ------
    TypeError : it is none.
    """
    name = ""
    if isinstance(value, np.generic):
        name = value.dtype.name
    elif isinstance(value, bool):
        name = _BOOLEAN
    elif type(value) is int:
        name = _INTEGER if value <= _MAX_INT64 else _LARGE
    elif isinstance(value, float):
        name = _FLOAT
    if name not in _FORMATS:
        raise TypeError(f"a kernel takes numbers, arrays and tuples of them, not {type(value).__name__}")
    return name


def _add_array(array: Any, formats: list[str], values: list[Any]) -> Hashable:
    flags = array.flags
    layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    formats.append(f"QQqqQ{2 * array.ndim}q")
    # Nothing counts references in kernels, nor do they know the object.
    address = array.__array_interface__["data"][0]
    values += (0, 0, array.size, array.itemsize, address, *array.shape, *array.strides)
    return ("array", array.dtype, array.ndim, layout, flags.writeable, flags.aligned)


def stable_text(kind: Hashable) -> str | None:
    """Describe the type of an argument by text that is the same in every process; None if there is none.

    A class within a function has no place that would tell it from others.
    """
    if isinstance(kind, str):
        return kind
    if isinstance(kind, type):
        return None if "<locals>" in kind.__qualname__ else f"{kind.__module__}:{kind.__qualname__}"
    if not isinstance(kind, tuple):
        return None
    if kind[0] == "array":
        return f"array({kind[1]!r},{kind[2:]})"
    inner = [stable_text(item) for item in kind]
    return None if None in inner else f"({','.join(map(str, inner))})"


class Result(NamedTuple):
    """A result as compiled code leaves it in words of eight bytes.

    Attributes
    ----------
    format : of `struct`, for all numbers in it.
    shape : None, the type of a number, or a class with the shapes of its items.
    """

    format: str
    shape: Any

    def read(self, buffer: Any, offset: int) -> Any:
        """Read the result at a place of a buffer, in bytes."""
        return _shaped(self.shape, iter(struct.unpack_from(f"={self.format}", buffer, offset)))


def _shaped(shape: Any, numbers: Any) -> Any:
    """Make a value of a shape: None, a function of one number, or a class or `tuple` with the shapes of its items."""
    if shape is None:
        return None
    if isinstance(shape, str):
        number = next(numbers)
        return bool(number) if shape == _BOOLEAN else number
    make: Callable[..., Any]
    make, items = shape
    inner = [_shaped(item, numbers) for item in items]
    return tuple(inner) if make is tuple else make(*inner)


def number_format(name: str) -> str:
    """Return the format of `struct` for a number of a type in eight bytes.

    Raises
    ------
    KeyError : entries do not return such numbers.
    """
    return _FORMATS[name]
