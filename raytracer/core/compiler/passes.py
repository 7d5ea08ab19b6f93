"""Numba passes and options: parts of kernels are lowered to LLVM alone, and become machine code in their caller."""

import functools
from collections.abc import Callable
from typing import Any, ClassVar

from numba.core import ir, types
from numba.core.analysis import dead_branch_prune, rewrite_semantic_constants
from numba.core.bytecode import FunctionIdentity
from numba.core.compiler import Flags, StateDict, _CompileStatus, _make_subtarget
from numba.core.errors import NumbaError
from numba.core.funcdesc import PythonFunctionDescriptor
from numba.core.imputils import builtin_registry
from numba.core.ir_utils import build_definitions
from numba.core.lowering import Lower
from numba.core.postproc import PostProcessor
from numba.core.registry import cpu_target
from numba.core.rewrites.registry import rewrite_registry
from numba.core.ssa import reconstruct_ssa
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import (
    IRLegalization,
    NoPythonSupportedFeatureValidation,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    ExtractByteCode,
    FixupArgs,
    InlineClosureLikes,
    MakeFunctionToJitFunction,
    TranslateByteCode,
)
from numba.parfors.parfor import ParforDiagnostics

from raytracer.core.compiler.part_cache import StoredPart
from raytracer.core.compiler.part_library import PartLibrary

# Kernels allocate nothing, so arrays need no reference counts: these are atomic, and shared by all threads
# (cover scene, 4 threads: 1.48 s with them, 1.0 s without).  Calls would pass whole scenes on the stack: inlining
# them took the cover from 3.05 s to 2.60 s on one thread.
OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "forceinline": True}

_READ_PASSES: Any = ExtractByteCode(), TranslateByteCode(), FixupArgs()

_CLOSURE_PASSES: Any = InlineClosureLikes(), MakeFunctionToJitFunction()

_INFERENCE_PASS, _PHI_PASS = NopythonTypeInference(), PreLowerStripPhis()

_LAST_PASSES: Any = NoPythonSupportedFeatureValidation(), IRLegalization()


def lower_part(function: Callable[..., Any], arguments: tuple[Any, ...], name: str, *, inline: bool) -> StoredPart:
    """Lower a function to LLVM for types of arguments, by those of Numba's passes that kernels need.

    Numba's own pipeline, with a dispatcher for each part, took half of the time of compiling the cover: passes for what
    kernels do not do (parallel loops, `with` blocks, Python objects), each with an event, timers, and an analysis of
    the function after it.

    Parameters
    ----------
    name : of the LLVM function.
    inline : put it into its callers; otherwise it is called.

    Raises
    ------
    NumbaError : it is not a kernel.
    """
    flags = _flags(inline)
    with ConfigStack().enter(flags):
        state = _state(function, arguments, flags)
        try:
            _type(state)
            return _lower(state, name)
        except NumbaError as error:
            error.args = (f"Failed to compile {function.__module__}.{function.__qualname__}\n{error}",)
            raise


@functools.cache
def _flags(inline: bool) -> Any:
    """Make Numba's flags, as its dispatchers make them of our options."""
    flags = Flags()
    # Nothing is inherited from whoever happens to call a part first.
    with ConfigStack().enter(Flags()):
        cpu_target.options.parse_as_flags(flags, {**OPTIONS, "nopython": True, "forceinline": inline})
    return flags


@functools.cache
def _target(inline: bool) -> Any:
    context = _make_subtarget(cpu_target.target_context, _flags(inline))
    # Asked for when a function is unknown as yet, such as an intrinsic that was typed just now.  Numba's own refresh
    # imports 30 modules again each time.
    context.refresh = lambda: context.install_registry(builtin_registry)
    return context


class _TypingContext(type(cpu_target.typing_context)):  # type: ignore[misc]
    """Numba's context of types, which remembers what type an operator on numbers has.

    Numba asks up to ten templates each time: of 1.14 s for studio's 7500 operations and calls 0.5 s are left.
    """

    _known: ClassVar[dict[Any, Any]] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        is_operator = getattr(getattr(func, "typing_key", None), "__module__", None) == "_operator"
        if not is_operator or not all(isinstance(argument, _SCALARS) for argument in args):
            return super().resolve_function_type(func, args, kws)
        key = func, tuple(args), tuple(kws.items())
        if key not in self._known:
            resolved = super().resolve_function_type(func, args, kws)
            if resolved is None:
                return None
            self._known[key] = resolved
        return self._known[key]


_SCALARS = types.Number, types.Boolean


@functools.cache
def _typing_context() -> _TypingContext:
    # All but the method is Numba's own context.
    context = object.__new__(_TypingContext)
    context.__dict__ = cpu_target.typing_context.__dict__
    return context


def _state(function: Callable[..., Any], arguments: tuple[Any, ...], flags: Any) -> Any:
    """Make the state that Numba's passes share."""
    state = StateDict()
    state.update(
        typingctx=_typing_context(),
        targetctx=_target(flags.forceinline),
        func_id=FunctionIdentity.from_function(function),
        args=arguments,
        return_type=None,
        flags=flags,
        locals={},
        lifted=(),
        typemap=None,
        calltypes=None,
        metadata={},
        reload_init=[],
        parfor_diagnostics=ParforDiagnostics(),
        status=_CompileStatus(can_fallback=False),
    )
    return state


def _type(state: Any) -> None:
    """Translate a function to Numba's code, and find the types in it, which compiles what it calls."""
    for each in _READ_PASSES:
        each.run_pass(state)
    PostProcessor(state.func_ir).run()
    if _has_closures(state.func_ir):
        for each in _CLOSURE_PASSES:
            each.run_pass(state)
    # Branches on None, and on constants, need not have types.
    rewrite_semantic_constants(state.func_ir, state.args)
    dead_branch_prune(state.func_ir, state.args)
    _rewrite(state, "before-inference")
    state.func_ir = reconstruct_ssa(state.func_ir)
    state.func_ir._definitions = build_definitions(state.func_ir.blocks)
    dead_branch_prune(state.func_ir, state.args)
    _INFERENCE_PASS.run_pass(state)
    state.func_ir = _PHI_PASS._strip_phi_nodes(state.func_ir)
    state.func_ir._definitions = build_definitions(state.func_ir.blocks)
    _rewrite(state, "after-inference")
    for each in _LAST_PASSES:
        each.run_pass(state)


def _rewrite(state: Any, kind: str) -> None:
    """Rewrite a function's blocks by Numba's rules of a kind, such as for an index that is constant, until none fits.

    Numba's own loop also analyses the lives of variables, and counts references, which kernels do not have.
    """
    blocks = state.func_ir.blocks
    for rule in (make(state) for make in rewrite_registry.rewrites[kind]):
        for key in blocks:
            while rule.match(state.func_ir, blocks[key], state.typemap, state.calltypes):
                blocks[key] = rule.apply()


def _has_closures(func_ir: Any) -> bool:
    return any(
        isinstance(statement.value, ir.Expr) and statement.value.op == "make_function"
        for block in func_ir.blocks.values()
        for statement in block.find_insts(ir.Assign)
    )


def _lower(state: Any, name: str) -> StoredPart:
    """Lower a typed function to LLVM."""
    context, library = state.targetctx, PartLibrary(name)
    descriptor = PythonFunctionDescriptor.from_specialized_function(
        state.func_ir,
        state.typemap,
        state.return_type,
        state.calltypes,
        mangler=lambda qualified, types, **_: f"NumbaEnv.{name}" if qualified.startswith(".NumbaEnv") else name,
        inline=state.flags.forceinline,
        noalias=state.flags.noalias,
        abi_tags=(),
    )
    with context.push_code_library(library):
        Lower(context, library, descriptor, state.func_ir, metadata=state.metadata).lower()
    return StoredPart(state.return_type, tuple(state.func_ir.arg_names), library)
