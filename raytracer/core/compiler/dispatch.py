"""The one place for Numba: compiler options, the kernel cache, and dispatch by type.

Everything in the inner loop is called from one `entry`: a plain function under `kernel`, or one case of a `generic`
function, chosen when a scene is compiled by the NamedTuple class of its first argument.  A scene without a kind of
thing therefore holds no code for it.
"""

import contextlib
import functools
import getpass
import hashlib
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.ir
import numba
from numba import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.cgutils import alloca_once_value, gep_inbounds
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.datamodel.models import PrimitiveModel
from numba.core.serialize import dumps
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, overload, register_model

from raytracer.interrupts import unhindered
from raytracer.kernel_files import KernelFiles, make_folder, source_hash

_PACKAGE = Path(__file__).parent

# What lies above the kernels, and has none of its own: an edit of these leaves all that is compiled as it is.
_WITHOUT_KERNELS = (
    "adaptive",
    "checkpoints",
    "cli",
    "cluster",
    "command",
    "comparison",
    "cost",
    "debugging",
    "development",
    "errands",
    "explanation",
    "interrupts",
    "lens_report",
    "lightfield",
    "memory",
    "pages",
    "plenoptic",
    "preparation",
    "probing",
    "pytest_plugin",
    "reach",
    "regression",
    "rendering",
    "replay",
    "scene",
    "scheduling",
    "signing_key",
    "snapshots",
    "stock",
    "sweeping",
    "untrusted",
    "vocabulary",
)

_CACHES_KEPT = 4

# Kernels allocate nothing, so arrays need no reference counts: these are atomic, and shared by all threads
# (cover scene, 4 threads: 1.48 s with them, 1.0 s without).  Calls would pass whole scenes on the stack: inlining
# them took the cover from 3.05 s to 2.60 s on one thread.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "forceinline": True}


class _PartLibrary(JITCodeLibrary):
    """Code that is only ever linked into a caller's: neither optimised by itself nor made machine code.

    The cover compiled for 11.7 s of processor time when every part was made machine code too, and does for 8.8 s.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    """Lowers a part to LLVM, and leaves the rest to the entry that it becomes part of."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        # Numba knows a compiled function by a built-in one, which nobody calls: a method of a list of its own.
        name = list[Any]().append
        lowered = state["cr"]
        state["cr"] = lowered._replace(cfunc=name)
        state.targetctx.insert_user_function(name, lowered.fndesc, [state.library])
        return True


class _PartCompiler(CompilerBase):
    """Numba's compiler, but for the last pass."""

    def define_pipelines(self) -> list[Any]:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.add_pass_after(_PartLowering, NativeLowering)
        manager.passes = [entry for entry in manager.passes if entry[0] is not NativeLowering]
        manager.finalize()
        return [manager]


alone: Any = global_compiler_lock
"""Held by the thread that compiles.

Who else changes what the whole process shares, such as the filters of warnings, holds it too: the compiler puts back
the filters that it has found, and of two threads that do so at once one puts back the other's.
"""


def _forget_who_compiles() -> None:
    # In a process that was forked while a thread compiled, that thread is not there to let go.
    alone._lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_who_compiles)

_PART: Any = {**_OPTIONS, "no_cfunc_wrapper": True, "pipeline_class": _PartCompiler}

_ROUTINE: Any = {**_PART, "forceinline": False}

F = TypeVar("F", bound=Callable[..., Any])


def _source_hash() -> str:
    """Hash of the kernels' sources, since Numba does not notice an edited callee, and of the compilers' versions."""
    return source_hash(_PACKAGE, numba.__version__, without=_WITHOUT_KERNELS)[:16]


def _cache_root() -> Path:
    """The user's cache folder, by each system's custom; `RAYTRACER_CACHE_DIR` overrides it."""
    if given := os.environ.get("RAYTRACER_CACHE_DIR"):
        return Path(given)
    try:
        if sys.platform == "win32":
            # Not the whole folder of the program: the key that signs what is kept lies there.
            return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "raytracer" / "Cache"
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "raytracer"
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "raytracer"
    except RuntimeError:
        # A user without a home, as containers have them.
        return (
            Path(tempfile.gettempdir()) / f"raytracer-{getpass.getuser() if sys.platform == 'win32' else os.getuid()}"
        )


def _use_cache_of_these_sources() -> Path:
    """A folder that only these sources use, made if it can be; and drop the oldest folders of others."""
    root = _cache_root()
    folder = root / f"kernels-{_source_hash()}"
    # Where it cannot be written, kernels are compiled in memory.
    with contextlib.suppress(OSError):
        make_folder(folder)
        os.utime(folder)
        old = sorted(root.glob("kernels-*"), key=lambda path: path.stat().st_mtime)[:-_CACHES_KEPT]
        for path in old:
            shutil.rmtree(path, ignore_errors=True)
    return folder


CACHE_FOLDER = _use_cache_of_these_sources()


def processor() -> str:
    """What kernels are compiled for: platform, processor and its instruction set; where that is alike, bits are."""
    from numba.core.registry import cpu_target

    return " ".join(cpu_target.target_context.codegen().magic_tuple())


class _Place:
    """Where Numba is to keep what it compiled; its own ways to find a place end the program where there is none."""

    def __init__(self, py_file: str) -> None:
        self._py_file = py_file

    @classmethod
    def from_function(cls, function: Callable[..., Any], py_file: str) -> "_Place":
        return cls(py_file)

    def get_cache_path(self) -> str:
        return str(CACHE_FOLDER)

    def ensure_cache_path(self) -> None:
        """Nothing: what saves a file makes the folder."""

    def get_source_stamp(self) -> str:
        # The folder is that of the package's sources; other modules, as those of tests, are told apart by their own.
        return hashlib.sha256(Path(self._py_file).read_bytes()).hexdigest()[:16]

    get_disambiguator = get_source_stamp


class _CacheContent(CompileResultCacheImpl):
    """What Numba keeps of a function, in our place."""

    _locator_classes: Any = (_Place,)


class _Cache(FunctionCache):
    """What was compiled of a function, in our files."""

    _impl_class = _CacheContent

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self.files = KernelFiles(CACHE_FOLDER, self._impl.filename_base, dumps)
        self._cache_file: Any = self.files


def entry(function: Callable[..., Any]) -> Any:
    """Compile what Python calls to start work: without the interpreter lock, and cached on disk.

    Of several processes that need it for the same types one compiles it, and the others wait.
    """
    compiled = numba.njit(nogil=True, **_OPTIONS)(function)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return compiled
    cache, at_once = _Cache(function), compiled.compile
    compiled._cache = cache

    def in_turn(signature: tuple[types.Type, ...]) -> Any:
        with alone, cache.files.alone(cache._index_key(signature, compiled.targetctx.codegen())):
            return at_once(signature)

    def compiled_for(signature: tuple[types.Type, ...]) -> Any:
        # Another thread would wait for the one that compiles already, and waits for it.
        return in_turn(signature) if alone.is_locked() else unhindered(lambda: in_turn(signature))

    compiled.compile = compiled_for
    return compiled


def kernel(function: F) -> F:
    """Make `function` part of whatever compiled code calls it, without a call.

    Not a Numba dispatcher: that would compile wrappers for Python around each of hundreds of small functions, which
    took 9.5 s for the cover scene where this takes 5.8 s.  Called from Python, it is compiled by itself, at need.
    """
    compiled = numba.njit(**_OPTIONS)(function)

    @functools.wraps(function)
    def from_python(*args):  # type: ignore[no-untyped-def]
        return compiled(*args)

    overload(from_python, strict=False, jit_options=_PART)(lambda *args: function)
    return from_python  # type: ignore[return-value]


def routine(function: F) -> F:
    """As `kernel`, for what is large, called from many places, and takes few arguments: it stays a call.

    The kernel of a scene with noise in three parameters of materials is a tenth smaller, and no slower.
    """
    compiled = numba.njit(**_OPTIONS)(function)

    @functools.wraps(function)
    def from_python(*args):  # type: ignore[no-untyped-def]
        return compiled(*args)

    overload(from_python, strict=False, jit_options=_ROUTINE)(lambda *args: function)
    return from_python  # type: ignore[return-value]


def _class_of(numba_type: types.Type) -> type | None:
    return getattr(numba_type, "instance_class", None)


def generic(stub: Callable[..., Any]) -> Any:
    """Make `stub` a function whose implementation is chosen by the class of its first argument.

    Cases are added with `@stub.register(SomeNamedTuple)`.  Called from Python it is `functools.singledispatch`;
    called from a kernel the choice is made while compiling, so nothing is left of it at run time.
    A case must take the same argument names as the stub.
    """
    dispatcher = functools.singledispatch(stub)

    def choose(first: types.Type) -> Callable[..., Any] | None:
        cls = type(None) if isinstance(first, types.NoneType) else _class_of(first)
        found = dispatcher.dispatch(cls) if cls is not None else stub
        return None if found is stub else found

    @overload(dispatcher, strict=False, jit_options=_PART)
    def typing(first, *rest):  # type: ignore[no-untyped-def]
        return choose(first)

    return dispatcher


def instead(implementation: Callable[..., Any]) -> Callable[[F], F]:
    """Make what kernels call in place of a Python function: `implementation(*types)` gives it, as for `overload`."""

    def decorated(function: F) -> F:
        overload(function, strict=False, jit_options=_PART)(implementation)
        return function

    return decorated


def switch(case: Callable[..., Any]) -> Any:
    """Make `case(table, *args)` into `function(tables, index, *args)` that picks one table of a tuple at run time.

    `tables` holds tables of different classes, so no index can reach into it; the choice becomes a chain of
    comparisons, as long as the number of kinds in the scene and no longer.
    """

    def chosen(tables, index, *args):  # type: ignore[no-untyped-def]
        return case(tables[index], *args)

    @overload(chosen, jit_options=_PART)
    def typing(tables, index, *args):  # type: ignore[no-untyped-def]
        if len(tables) == 1:
            return lambda tables, index, *args: case(tables[0], *args)

        def implementation(tables, index, *args):  # type: ignore[no-untyped-def]
            if index == 0:
                return case(tables[0], *args)
            return chosen(tables[1:], index - 1, *args)

        return implementation

    return chosen


def fold(case: Callable[..., Any], combine: Callable[..., Any]) -> Any:
    """Make `case(table, *args)` into `function(tables, *args)` that combines the cases of all tables of a tuple."""

    def folded(tables, *args):  # type: ignore[no-untyped-def]
        return functools.reduce(combine, (case(table, *args) for table in tables))

    @overload(folded, jit_options=_PART)
    def typing(tables, *args):  # type: ignore[no-untyped-def]
        if len(tables) == 1:
            return lambda tables, *args: case(tables[0], *args)
        return lambda tables, *args: combine(case(tables[0], *args), folded(tables[1:], *args))

    return folded


def each(case: Callable[..., Any]) -> Any:
    """Make `case(table, *args)` into `function(tables, *args)` that calls it for every table of a tuple, in order."""

    def called(tables, *args):  # type: ignore[no-untyped-def]
        for table in tables:
            case(table, *args)

    @overload(called, jit_options=_PART)
    def typing(tables, *args):  # type: ignore[no-untyped-def]
        if len(tables) == 1:
            return lambda tables, *args: case(tables[0], *args)

        def implementation(tables, *args):  # type: ignore[no-untyped-def]
            case(tables[0], *args)
            called(tables[1:], *args)

        return implementation

    return called


class _Shared(types.Type):
    """A NamedTuple that is handed on by its address, with the same attributes.

    By value it would be as many arguments as there are numbers in its arrays' headers, hundreds for a scene, in each
    of some two hundred functions that become one in the end (the glass scene compiled for 19.5 s of processor time so,
    and does for 12.3 s).
    """

    def __init__(self, pointee: Any) -> None:
        self.pointee = pointee
        super().__init__(name=f"Shared({pointee})")


@register_model(_Shared)
class _SharedModel(PrimitiveModel):
    def __init__(self, manager: Any, shared: Any) -> None:
        super().__init__(manager, shared, manager.lookup(shared.pointee).get_value_type().as_pointer())


@infer_getattr
class _SharedAttributes(AttributeTemplate):
    key = _Shared

    def generic_resolve(self, shared: Any, name: str) -> Any:  # type: ignore[override]
        fields = shared.pointee.fields
        return shared.pointee.types[fields.index(name)] if name in fields else None


@lower_getattr_generic(_Shared)
def _shared_attribute(context, builder, shared, value, name):  # type: ignore[no-untyped-def]
    return builder.load(gep_inbounds(builder, value, 0, shared.pointee.fields.index(name)))


@intrinsic
def _share(typing_context, value):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return alloca_once_value(builder, arguments[0])

    return _Shared(value)(value), generate


share: Any = _share
"""A NamedTuple's address, to hand on in its place while the function that calls this runs; for entries only."""


@intrinsic
def _prefetch(typing_context, address):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = llvmlite.ir.PointerType(llvmlite.ir.IntType(8))
        word = llvmlite.ir.IntType(32)
        kind = llvmlite.ir.FunctionType(llvmlite.ir.VoidType(), [pointer, word, word, word])
        function = builder.module.declare_intrinsic("llvm.prefetch", [pointer], kind)
        read, keep, data = (llvmlite.ir.Constant(word, value) for value in (0, 3, 1))
        builder.call(function, [builder.inttoptr(arguments[0], pointer), read, keep, data])
        return context.get_dummy_value()

    return types.void(types.intp), generate


prefetch: Any = _prefetch
"""Ask for the cache line at an address (intp) that will be read soon; for kernels only."""
