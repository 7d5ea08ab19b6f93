"""SIMD vectors of eight numbers in LLVM: their types, operators, and the functions of `raytracer.core.simd`."""

import operator
from typing import Any, ClassVar

import llvmlite.ir
from numba import types
from numba.core.cgutils import get_item_pointer, get_or_insert_function
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

_inline: Any = intrinsic

WIDTH = 8

_DOUBLE, _BIT = llvmlite.ir.DoubleType(), llvmlite.ir.IntType(1)
_VECTOR, _BITS = llvmlite.ir.VectorType(_DOUBLE, WIDTH), llvmlite.ir.VectorType(_BIT, WIDTH)


class _Lanes(types.Type):
    """The Numba type of eight float64."""


class _Mask(types.Type):
    """The Numba type of eight booleans."""


LANES, MASK = _Lanes("Lanes"), _Mask("LaneMask")


@register_model(_Lanes)
class _LanesModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


@register_model(_Mask)
class _MaskModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


# ---- Operators

# A product and a sum may be one instruction, which rounds once.
_FUSED = ("contract",)


def _spread(builder: Any, value: Any) -> Any:
    """Broadcast a scalar to all lanes."""
    if value.type != _DOUBLE:
        return value
    index = llvmlite.ir.IntType(32)
    one = builder.insert_element(llvmlite.ir.Constant(_VECTOR, llvmlite.ir.Undefined), value, index(0))
    zeros = llvmlite.ir.Constant(llvmlite.ir.VectorType(index, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, llvmlite.ir.Constant(_VECTOR, llvmlite.ir.Undefined), zeros)


def _operator(function: Any, result: types.Type, generate: Any) -> None:
    """Register an operator on two vectors of lanes, or lanes and a number, with Numba."""
    pairs = [(LANES, LANES), (LANES, types.float64), (types.float64, LANES)]

    @infer_global(function)
    class _Template(ConcreteTemplate):
        cases: ClassVar = [signature(result, *pair) for pair in pairs]

    def lower(context, builder, typing, arguments):
        return generate(builder, *(_spread(builder, argument) for argument in arguments))

    for pair in pairs:
        lower_builtin(function, *pair)(lower)


_operator(operator.add, LANES, lambda builder, a, b: builder.fadd(a, b, flags=_FUSED))
_operator(operator.sub, LANES, lambda builder, a, b: builder.fsub(a, b, flags=_FUSED))
_operator(operator.mul, LANES, lambda builder, a, b: builder.fmul(a, b, flags=_FUSED))
_operator(operator.truediv, LANES, lambda builder, a, b: builder.fdiv(a, b))
_operator(operator.lt, MASK, lambda builder, a, b: builder.fcmp_ordered("<", a, b))
_operator(operator.le, MASK, lambda builder, a, b: builder.fcmp_ordered("<=", a, b))
_operator(operator.gt, MASK, lambda builder, a, b: builder.fcmp_ordered(">", a, b))
_operator(operator.ge, MASK, lambda builder, a, b: builder.fcmp_ordered(">=", a, b))


@infer_global(operator.and_)
class _And(ConcreteTemplate):
    cases: ClassVar = [signature(MASK, MASK, MASK)]


@lower_builtin(operator.and_, MASK, MASK)
def _and(context, builder, typing, arguments):
    return builder.and_(*arguments)


@infer_global(operator.neg)
class _Negative(ConcreteTemplate):
    cases: ClassVar = [signature(LANES, LANES)]


@lower_builtin(operator.neg, LANES)
def _negative(context, builder, typing, arguments):
    return builder.fneg(arguments[0])


# ---- Functions


@_inline
def _sqrt_lanes(typing_context, value):
    def generate(context, builder, typing, arguments):
        kind = llvmlite.ir.FunctionType(_VECTOR, [_VECTOR])
        function = get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{WIDTH}f64")
        return builder.call(function, arguments)

    return LANES(LANES), generate


@_inline
def _select(typing_context, where, yes, no):
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


@_inline
def _load(typing_context, rows, row):
    def generate(context, builder, typing, arguments):
        held, number = arguments
        number = context.cast(builder, number, typing.args[1], types.intp)
        return builder.load(_address(context, builder, typing.args[0], held, number), align=8)

    return LANES(rows, row), generate


@_inline
def _store(typing_context, rows, row, value):
    def generate(context, builder, typing, arguments):
        held, number, lanes = arguments
        number = context.cast(builder, number, typing.args[1], types.intp)
        address = _address(context, builder, typing.args[0], held, number)
        builder.store(_spread(builder, lanes), address, align=8)
        return context.get_dummy_value()

    return types.void(rows, row, value), generate


@_inline
def _any_lane(typing_context, where):
    def generate(context, builder, typing, arguments):
        bits = llvmlite.ir.IntType(WIDTH)
        return builder.icmp_unsigned("!=", builder.bitcast(arguments[0], bits), bits(0))

    return types.boolean(where), generate


@_inline
def _gather_lanes(typing_context, rows, numbers, column):
    def generate(context, builder, typing, arguments):
        held, lanes, place = arguments
        word, index = context.get_value_type(types.intp), llvmlite.ir.IntType(32)
        array = context.make_array(typing.args[0])(context, builder, held)
        place = context.cast(builder, place, typing.args[2], types.intp)
        gathered = llvmlite.ir.Constant(_VECTOR, llvmlite.ir.Undefined)
        for lane in range(WIDTH):
            row = builder.fptosi(builder.extract_element(lanes, index(lane)), word)
            pointer = get_item_pointer(context, builder, typing.args[0], array, [row, place], wraparound=False)
            gathered = builder.insert_element(gathered, builder.load(pointer), index(lane))
        return gathered

    return LANES(rows, numbers, column), generate


IMPLEMENTATIONS = {
    "any_lane": lambda where: _any_lane(where),  # noqa: PLW0108
    "sqrt_lanes": lambda value: _sqrt_lanes(value),  # noqa: PLW0108
    "select": lambda where, yes, no: _select(where, yes, no),  # noqa: PLW0108
    "load": lambda rows, row: _load(rows, row),  # noqa: PLW0108
    "store": lambda rows, row, value: _store(rows, row, value),  # noqa: PLW0108
    "gather_lanes": lambda rows, numbers, column: _gather_lanes(rows, numbers, column),  # noqa: PLW0108
}
"""Functions that kernels call in place of those of `raytracer.core.simd`."""
