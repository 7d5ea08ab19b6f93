"""LLVM code of the intrinsics for kernels: pass a scene by its address, and prefetch memory."""

from typing import Any

import llvmlite.ir
from numba import types
from numba.core.cgutils import alloca_once_value, gep_inbounds
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model


class Shared(types.Type):
    """The Numba type of a NamedTuple that is passed by its address, with the same attributes.

    By value it would be as many arguments as there are numbers in its arrays' headers, hundreds for a scene, in each
    of some two hundred functions that are inlined in the end (the glass scene compiled for 19.5 s of processor time so,
    and does for 12.3 s).
    """

    def __init__(self, pointee: Any) -> None:
        self.pointee = pointee
        super().__init__(name=f"Shared({pointee})")


@register_model(Shared)
class _SharedModel(PrimitiveModel):
    def __init__(self, manager: Any, shared: Any) -> None:
        super().__init__(manager, shared, manager.lookup(shared.pointee).get_value_type().as_pointer())


@infer_getattr
class _SharedAttributes(AttributeTemplate):
    key = Shared

    def generic_resolve(self, shared: Any, name: str) -> Any:  # type: ignore[override]
        fields = shared.pointee.fields
        return shared.pointee.types[fields.index(name)] if name in fields else None


@lower_getattr_generic(Shared)
def _shared_attribute(context, builder, shared, value, name):
    return builder.load(gep_inbounds(builder, value, 0, shared.pointee.fields.index(name)))


@intrinsic
def share(typing_context, value):
    """Pass a NamedTuple by its address."""

    def generate(context, builder, signature, arguments):
        return alloca_once_value(builder, arguments[0])

    return Shared(value)(value), generate


@intrinsic
def prefetch(typing_context, address):
    """Prefetch a cache line."""

    def generate(context, builder, signature, arguments):
        pointer = llvmlite.ir.PointerType(llvmlite.ir.IntType(8))
        word = llvmlite.ir.IntType(32)
        kind = llvmlite.ir.FunctionType(llvmlite.ir.VoidType(), [pointer, word, word, word])
        function = builder.module.declare_intrinsic("llvm.prefetch", [pointer], kind)
        read, keep, data = (llvmlite.ir.Constant(word, value) for value in (0, 3, 1))
        builder.call(function, [builder.inttoptr(arguments[0], pointer), read, keep, data])
        return context.get_dummy_value()

    return types.void(types.intp), generate
