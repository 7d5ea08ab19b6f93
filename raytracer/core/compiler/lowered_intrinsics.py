"""LLVM code of the functions that kernels call as `intrinsics` and `raytracer.core.simd` declare them.

SIMD vectors of eight numbers are types of their own here, with their operators.
"""

import operator
from typing import Any, ClassVar

from llvmlite import ir
from numba import types
from numba.core.cgutils import alloca_once_value, gep_inbounds, get_item_pointer, get_or_insert_function
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AttributeTemplate, ConcreteTemplate, infer_global, signature
from numba.extending import infer_getattr, intrinsic, lower_builtin, lower_getattr_generic, register_model


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
        pointer = ir.PointerType(ir.IntType(8))
        word = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [pointer, word, word, word])
        function = builder.module.declare_intrinsic("llvm.prefetch", [pointer], kind)
        read, keep, data = (ir.Constant(word, value) for value in (0, 3, 1))
        builder.call(function, [builder.inttoptr(arguments[0], pointer), read, keep, data])
        return context.get_dummy_value()

    return types.void(types.intp), generate


# ---- SIMD vectors

WIDTH = 8

_DOUBLE, _BIT = ir.DoubleType(), ir.IntType(1)
_VECTOR, _BITS = ir.VectorType(_DOUBLE, WIDTH), ir.VectorType(_BIT, WIDTH)


class _Vector(types.Type):
    """The Numba type of eight float64, or of eight booleans."""


LANES, MASK = _Vector("Lanes"), _Vector("LaneMask")


@register_model(_Vector)
class _VectorModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR if kind == LANES else _BITS)


# ---- Operators on lanes

# A product and a sum may be one instruction, which rounds once.
_FUSED = ("contract",)


def _spread(builder: Any, value: Any) -> Any:
    """Broadcast a scalar to all lanes."""
    if value.type != _DOUBLE:
        return value
    index = ir.IntType(32)
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, index(0))
    zeros = ir.Constant(ir.VectorType(index, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), zeros)


_PAIRS = (LANES, LANES), (LANES, types.float64), (types.float64, LANES)


def _operator(function: Any, result: types.Type, generate: Any, operands: Any = _PAIRS) -> None:
    """Register an operator with Numba, by default on two vectors of lanes, or lanes and a number."""

    @infer_global(function)
    class _Template(ConcreteTemplate):
        cases: ClassVar = [signature(result, *kinds) for kinds in operands]

    def lower(context, builder, typing, arguments):
        return generate(builder, *(_spread(builder, argument) for argument in arguments))

    for kinds in operands:
        lower_builtin(function, *kinds)(lower)


_operator(operator.add, LANES, lambda builder, a, b: builder.fadd(a, b, flags=_FUSED))
_operator(operator.sub, LANES, lambda builder, a, b: builder.fsub(a, b, flags=_FUSED))
_operator(operator.mul, LANES, lambda builder, a, b: builder.fmul(a, b, flags=_FUSED))
_operator(operator.truediv, LANES, lambda builder, a, b: builder.fdiv(a, b))
_operator(operator.lt, MASK, lambda builder, a, b: builder.fcmp_ordered("<", a, b))
_operator(operator.le, MASK, lambda builder, a, b: builder.fcmp_ordered("<=", a, b))
_operator(operator.gt, MASK, lambda builder, a, b: builder.fcmp_ordered(">", a, b))
_operator(operator.ge, MASK, lambda builder, a, b: builder.fcmp_ordered(">=", a, b))
_operator(operator.and_, MASK, lambda builder, a, b: builder.and_(a, b), [(MASK, MASK)])
_operator(operator.neg, LANES, lambda builder, a: builder.fneg(a), [(LANES,)])

# ---- Functions of lanes


@intrinsic
def sqrt_lanes(typing_context, value):
    """Compute square roots."""

    def generate(context, builder, typing, arguments):
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        function = get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{WIDTH}f64")
        return builder.call(function, arguments)

    return LANES(LANES), generate


@intrinsic
def select(typing_context, where, yes, no):
    """Select by lane."""

    def generate(context, builder, typing, arguments):
        mask, *values = arguments
        return builder.select(mask, *(_spread(builder, value) for value in values))

    return LANES(where, yes, no), generate


def _address(context: Any, builder: Any, kind: Any, rows: Any, row: Any) -> Any:
    """Return the address of row `index` of an array (n, WIDTH), as that of a vector."""
    array = context.make_array(kind)(context, builder, rows)
    zero = context.get_constant(types.intp, 0)
    pointer = get_item_pointer(context, builder, kind, array, [row, zero], wraparound=False)
    return builder.bitcast(pointer, _VECTOR.as_pointer())


@intrinsic
def load(typing_context, rows, row):
    """Load a row."""

    def generate(context, builder, typing, arguments):
        held, number = arguments
        number = context.cast(builder, number, typing.args[1], types.intp)
        return builder.load(_address(context, builder, typing.args[0], held, number), align=8)

    return LANES(rows, row), generate


@intrinsic
def store(typing_context, rows, row, value):
    """Store a row."""

    def generate(context, builder, typing, arguments):
        held, number, lanes = arguments
        number = context.cast(builder, number, typing.args[1], types.intp)
        address = _address(context, builder, typing.args[0], held, number)
        builder.store(_spread(builder, lanes), address, align=8)
        return context.get_dummy_value()

    return types.void(rows, row, value), generate


@intrinsic
def any_lane(typing_context, where):
    """Tell if any lane holds."""

    def generate(context, builder, typing, arguments):
        bits = ir.IntType(WIDTH)
        return builder.icmp_unsigned("!=", builder.bitcast(arguments[0], bits), bits(0))

    return types.boolean(where), generate


@intrinsic
def gather_lanes(typing_context, rows, numbers, column):
    """Gather a column."""

    def generate(context, builder, typing, arguments):
        held, lanes, place = arguments
        word, index = context.get_value_type(types.intp), ir.IntType(32)
        array = context.make_array(typing.args[0])(context, builder, held)
        place = context.cast(builder, place, typing.args[2], types.intp)
        gathered = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(WIDTH):
            row = builder.fptosi(builder.extract_element(lanes, index(lane)), word)
            pointer = get_item_pointer(context, builder, typing.args[0], array, [row, place], wraparound=False)
            gathered = builder.insert_element(gathered, builder.load(pointer), index(lane))
        return gathered

    return LANES(rows, numbers, column), generate
