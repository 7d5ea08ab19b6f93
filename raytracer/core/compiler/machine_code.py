"""Machine code of an entry: its arguments and results as rows of words, without the compiler, and the call of it.

A kernel takes numbers, arrays, None, and tuples of these, such as the packed scene, and their values lie in a row of
eight bytes each, in the order of Numba's data models.  The code is kept in a file, and linked into this process by LLVM
alone.
"""

import ctypes
import enum
import functools
import struct
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

_NONE, _BOOLEAN, _INTEGER, _LARGE, _FLOAT = "none", "bool", "int64", "uint64", "float64"

_MAX_INT64 = 2**63 - 1

FORMATS = {
    **dict.fromkeys(("int8", "int16", "int32", "int64"), "q"),
    **dict.fromkeys(("uint8", "uint16", "uint32", "uint64"), "Q"),
    "float64": "d",
    "float32": "fxxxx",
    "bool": "Q",
}
"""Formats of `struct` for a number of a type in eight bytes."""

_INTEGER_FORMAT = struct.Struct("=q")


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
    if type(value) is int and value <= _MAX_INT64:
        # Most arguments that change from call to call.
        return PackedArgument(value, _INTEGER, _INTEGER_FORMAT.pack(value))
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
    formats.append(FORMATS[name])
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
    if name not in FORMATS:
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
        if self.shape == _INTEGER:
            return _INTEGER_FORMAT.unpack_from(buffer, offset)[0]
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


# ---- Code

_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)

OK = 0
"""Status of a call without an error."""


class MachineCode(NamedTuple):
    """Contents of a file of the cache.

    Attributes
    ----------
    symbol : name of the function, which takes the address of its arguments, with room for the result after them.
    words : eight bytes each, of the arguments.
    result : how the result is read.
    externals : names of the functions of other libraries that it calls.
    object_code : a relocatable object file.
    """

    symbol: str
    words: int
    result: Result
    externals: tuple[str, ...]
    object_code: bytes


class LoadedCode:
    """Machine code in this process, which can be called."""

    def __init__(self, code: MachineCode) -> None:
        self._result, self._size = code.result, 8 * code.words
        self._room = bytes(8 * max(1, len(code.result.format)))
        # Symbols of two objects may have the same names.
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target().create_target_machine(jit=True))
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code.object_code))
        self._engine.finalize_object()
        self._function = _FUNCTION(self._engine.get_function_address(code.symbol))

    def __call__(self, data: bytes) -> Any:
        """Call it, without the interpreter's lock.

        Parameters
        ----------
        data : of the arguments, in the order of `pack_argument`.

        Raises
        ------
        RuntimeError : the code ended with an error.
        """
        buffer = ctypes.create_string_buffer(data + self._room, self._size + len(self._room))
        status = self._function(ctypes.addressof(buffer))
        if status != OK:
            raise RuntimeError(f"a kernel ended with status {status}")
        return self._result.read(buffer, self._size)


def load(code: MachineCode) -> LoadedCode | None:
    """Link machine code into this process; None if it calls a function that no library of the process has."""
    target = _target()
    if target is None or any(llvm.address_of_symbol(name) is None for name in code.externals):
        return None
    return LoadedCode(code)


@functools.cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple()
