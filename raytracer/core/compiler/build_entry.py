"""Build the machine code of an entry: its parts linked and optimised as a whole, behind a function that takes a row.

Numba would wrap an entry for calls by Python, which takes Numba to be loaded.  Here the wrapper is a function in C's
convention that reads all arguments from a row of words, and needs nothing (`machine_code.py`).
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numba
from llvmlite import ir
from numba import typeof, types
from numba.core.codegen import CPUCodeLibrary
from numba.core.registry import cpu_target

from raytracer.core.compiler.compile_progress import COMPILATION
from raytracer.core.compiler.machine_code import FORMATS, OK, MachineCode, Result, pack_argument
from raytracer.core.compiler.part_library import PartLibrary
from raytracer.core.compiler.parts import lower_entry

_WORD, _STATUS = ir.IntType(64), ir.IntType(32)


def build_entry(function: Callable[..., Any], arguments: Sequence[Any]) -> MachineCode:
    """Compile a function for the types of some arguments.

    Raises
    ------
    NumbaError : it is not a kernel for these.
    """
    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()
    kinds = tuple(typeof(argument) for argument in arguments)
    descriptor, library = lower_entry(function, kinds)
    _check_words(descriptor, arguments)
    symbol = f"call.{descriptor.mangled_name}"
    COMPILATION.link()
    wrapper, words = _wrapper(symbol, descriptor)
    module = link_entry(symbol, wrapper, library)
    formats: list[str] = []
    shape = _result_shape(descriptor.restype, formats)
    externals = tuple(
        function.name
        for function in module.functions
        if function.is_declaration and not function.name.startswith("llvm.")
    )
    return MachineCode(symbol, words, Result("".join(formats), shape), externals, _target_machine().emit_object(module))


def _check_words(descriptor: Any, arguments: Sequence[Any]) -> None:
    """Make sure that this version of Numba lays out arguments as `pack_argument` does.

    Raises
    ------
    RuntimeError : it does not.
    """
    expected = len(cpu_target.target_context.get_arg_packer(descriptor.argtypes).argument_types)
    packed = sum(len(pack_argument(argument).data) for argument in arguments) // 8
    if packed != expected:
        raise RuntimeError(f"arguments are {packed} words, and Numba {numba.__version__} takes {expected}")


def _codegen() -> Any:
    return cpu_target.target_context.codegen()


def _target_machine() -> Any:
    return _codegen()._tm


class _EntryLibrary(CPUCodeLibrary):
    """A code library that is linked and optimised as a whole, and left to be made an object file."""

    def _finalize_final_module(self) -> None:
        self._finalized = True


def link_entry(name: str, wrapper: ir.Module, library: PartLibrary) -> Any:
    """Link an entry's wrapper with all parts that it needs, and optimise the whole; returns LLVM's module."""
    linked: Any = _EntryLibrary(_codegen(), name)
    linked.add_ir_module(wrapper)
    linked.add_linking_library(library)
    linked.finalize()
    return linked._final_module


def _wrapper(symbol: str, descriptor: Any) -> tuple[ir.Module, int]:
    """Make the function that Python calls with the address of the arguments, and count their words."""
    context = cpu_target.target_context
    module = _codegen()._create_empty_module(symbol)
    function = ir.Function(module, ir.FunctionType(_STATUS, [ir.IntType(8).as_pointer()]), symbol)
    builder = ir.IRBuilder(function.append_basic_block())
    row = builder.bitcast(function.args[0], _WORD.as_pointer())
    packer = context.get_arg_packer(descriptor.argtypes)
    held = packer.argument_types
    read = [builder.load(_place(builder, row, number, kind)) for number, kind in enumerate(held)]
    values = packer.from_arguments(builder, read)
    callee = context.declare_function(module, descriptor)
    status, result = context.call_conv.call_function(builder, callee, descriptor.restype, descriptor.argtypes, values)
    _store_result(builder, descriptor.restype, result, row, len(held))
    builder.ret(builder.select(status.is_error, status.code, _STATUS(OK)))
    return module, len(held)


def _place(builder: ir.IRBuilder, row: Any, number: int, kind: ir.Type) -> Any:
    """Return the address of a word of the row, which holds a value of an LLVM type."""
    return builder.bitcast(builder.gep(row, [_WORD(number)]), kind.as_pointer())


def _store_result(builder: Any, kind: Any, value: Any, row: Any, number: int) -> int:
    """Store a result from a word of the row on, and return the number of the word after it."""
    is_a = functools.partial(issubclass, type(kind))
    if is_a(types.NoneType):
        return number
    if is_a(types.BaseTuple):
        for index, item in enumerate(kind):
            number = _store_result(builder, item, builder.extract_value(value, index), row, number)
        return number
    if is_a(types.Boolean):
        value = builder.zext(value, _WORD)
    elif is_a(types.Integer):
        value = (builder.sext if kind.signed else builder.zext)(value, _WORD)
    builder.store(value, _place(builder, row, number, value.type))
    return number + 1


def _result_shape(kind: Any, formats: list[str]) -> Any:
    """Describe a type as `Result` has it, and append the formats of its numbers.

    Raises
    ------
    TypeError : entries return numbers, None, and tuples of them.
    """
    is_a = functools.partial(issubclass, type(kind))
    if is_a(types.NoneType):
        return None
    if is_a(types.BaseTuple):
        return getattr(kind, "instance_class", tuple), [_result_shape(item, formats) for item in kind]
    name = "bool" if is_a(types.Boolean) else str(types.unliteral(kind))
    if not is_a((types.Number, types.Boolean)):
        raise TypeError(f"an entry returns numbers, None and tuples of them, not {kind}")
    formats.append(FORMATS[name])
    return name
