"""Machine code of an entry: kept in a file, linked into this process by LLVM alone, and called."""

import ctypes
import functools
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from raytracer.core.compiler.arguments import Result

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
        data : of the arguments, in the order of `arguments.pack_argument`.

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
