"""Entries: the compiled functions that Python calls.

An entry is compiled for the types of its arguments, and the machine code kept in a file.  Who finds it there neither
types nor lowers anything, and does not even import the compiler, which takes a quarter of a second.
"""

import contextlib
import functools
import gc
import hashlib
import os
import pickle
import re
import sys
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Sequence
from pathlib import Path
from typing import Any

from raytracer.core.compiler import cache
from raytracer.core.compiler.compile_progress import COMPILATION
from raytracer.core.compiler.kernel_files import KernelFiles
from raytracer.core.compiler.lock import compiler_lock
from raytracer.core.compiler.machine_code import (
    LoadedCode,
    MachineCode,
    PackedArgument,
    load,
    pack_argument,
    stable_text,
)
from raytracer.util.signals import run_in_thread

_NOTHING = PackedArgument(object(), None, b"")


def entry(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls: it releases the interpreter lock, and is cached on disk.

    If several processes need it for the same types, one compiles it and the others wait.
    """
    return function if _is_interpreted() else Entry(function)


def needs_compiling(function: Any, *arguments: Any) -> bool:
    """Tell if a call of an entry with arguments of these types would compile it, as far as one can tell before."""
    return isinstance(function, Entry) and not function.is_at_hand(*arguments)


def _is_interpreted() -> bool:
    """Return True if Numba is told to leave functions as they are, by its own setting."""
    if "numba" in sys.modules or "NUMBA_DISABLE_JIT" in os.environ:
        from numba import config

        return bool(config.DISABLE_JIT)  # type: ignore[attr-defined]
    return False


class Entry:
    """A function that is compiled for the types of its arguments when it is called.

    Attributes
    ----------
    counts : how many versions were `loaded` from files, and how many `compiled`.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._codes: dict[Hashable, LoadedCode] = {}
        # The last call of a thread, which is often repeated for another part of the picture.
        self._last = threading.local()
        self.counts: Counter[str] = Counter()

    @property
    def signatures(self) -> Sequence[Hashable]:
        """Types of arguments that this process has machine code for."""
        return tuple(self._codes)

    def __call__(self, *arguments: Any) -> Any:
        """Call the machine code for these types, which is loaded or compiled first."""
        last = self._last
        before = getattr(last, "packed", ())
        if len(before) != len(arguments):
            before = (_NOTHING,) * len(arguments)
        packed = [
            old if old.value is new and isinstance(new, tuple) else pack_argument(new)
            for old, new in zip(before, arguments, strict=True)
        ]
        kinds = tuple(argument.kind for argument in packed)
        if getattr(last, "kinds", None) != kinds:
            last.code, last.kinds = self._code(kinds, arguments), kinds
        # Arrays of their own are let go with the call.
        last.packed = [argument if isinstance(argument.value, tuple) else _NOTHING for argument in packed]
        return last.code(b"".join([argument.data for argument in packed]))

    def is_at_hand(self, *arguments: Any) -> bool:
        """Tell if there is machine code for these types, in this process or on disk."""
        kinds = tuple(pack_argument(argument).kind for argument in arguments)
        if kinds in self._codes:
            return True
        key = self._key(kinds)
        return key is not None and self._files().has(key)

    def _code(self, kinds: Hashable, arguments: Sequence[Any]) -> LoadedCode:
        """Find the machine code for types of arguments, in this process, on disk, or by compiling."""
        code = self._codes.get(kinds)
        if code is None:
            # A thread that compiles already holds the lock, for which another thread would have to wait.
            code = (
                self._load_or_compile(kinds, arguments)
                if compiler_lock.is_locked()
                else run_in_thread(lambda: self._load_or_compile(kinds, arguments), COMPILATION.report)
            )
        return code

    def _load_or_compile(self, kinds: Hashable, arguments: Sequence[Any]) -> LoadedCode:
        with compiler_lock:
            if kinds in self._codes:
                return self._codes[kinds]
            key, files = self._key(kinds), self._files()
            code = self._load(files, key)
            if code is None:
                with contextlib.nullcontext() if key is None else files.compile_lock(key):
                    # Another process may have compiled it meanwhile.
                    code = self._load(files, key) or self._compile(arguments, files, key)
            self._codes[kinds] = code
            return code

    def _load(self, files: KernelFiles, key: Any) -> LoadedCode | None:
        """Load machine code from its file; None if there is none that can be used."""
        held = None if key is None else files.load(key)
        code = None if held is None else load(MachineCode(*held))
        self.counts["loaded"] += code is not None
        return code

    def _compile(self, arguments: Sequence[Any], files: KernelFiles, key: Any) -> LoadedCode:
        with COMPILATION.of(self._function.__name__):
            from raytracer.core.compiler.build_entry import build_entry
            from raytracer.core.compiler.part_cache import write_parts

            # The lock is Numba's too, now that Numba is there.
            with compiler_lock, _without_collector():
                try:
                    made = build_entry(self._function, arguments)
                finally:
                    write_parts()
                code = load(made)
        if code is None:
            raise RuntimeError(f"the kernel {self._function.__qualname__} calls functions that are nowhere")
        if key is not None:
            # A result may be of a class that has no place in a module.
            with contextlib.suppress(pickle.PicklingError, AttributeError):
                files.save(key, tuple(made))
        self.counts["compiled"] += 1
        return code

    def _files(self) -> KernelFiles:
        name = f"{self._function.__module__.rpartition('.')[2]}.{self._function.__qualname__}"
        plain = re.sub(r"[^A-Za-z0-9_.]+", "_", name)
        return KernelFiles(cache.CACHE_FOLDER, f"{plain}-{self._function.__code__.co_firstlineno}")

    def _key(self, kinds: Any) -> tuple[str, ...] | None:
        """Write down what the machine code depends on, beside the sources that the folder is named by.

        Returns
        -------
        The key; None if another process would not know the types by it, or if the function closes over others.
        """
        texts = [stable_text(kind) for kind in kinds]
        if None in texts or self._function.__closure__ or self._source is None:
            return None
        return (self._function.__qualname__, self._source, cache.compiler_target(), *map(str, texts))

    @functools.cached_property
    def _source(self) -> str | None:
        """Hash of the module's text, which may be outside of the package, and of the function's own code."""
        code = self._function.__code__
        try:
            text = Path(code.co_filename).read_bytes()
        except OSError:
            return None
        return hashlib.sha256(text + code.co_code).hexdigest()


@contextlib.contextmanager
def _without_collector() -> Iterator[None]:
    """Leave cycles of garbage in memory meanwhile: of the many objects of a compiler few are garbage.

    Looking through them took 0.4 of 3.6 s for the cover, 2.4 of 15.1 s for studio, which needs 140 MB more without.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
