"""The compiler's lock: one thread of a process compiles at a time."""

import os
import sys
import threading
from types import TracebackType
from typing import Any, Self


class _CompilerLock:
    """Our own lock, and Numba's as soon as Numba is there: other programs in the process may compile, too."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Make it free, whoever held it."""
        self._own = threading.RLock()
        self._held: list[Any] = []
        if numba_lock := _numba_lock():
            numba_lock._lock = threading.RLock()

    def __enter__(self) -> Self:
        self._own.acquire()
        other = _numba_lock()
        if other is not None:
            other.acquire()
        self._held.append(other)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        other = self._held.pop()
        if other is not None:
            other.release()
        self._own.release()

    def is_locked(self) -> bool:
        """Return True if this thread holds it."""
        return self._own._is_owned()  # type: ignore[attr-defined, no-any-return]


def _numba_lock() -> Any:
    """Return Numba's lock; None if Numba has not been imported."""
    module = sys.modules.get("numba.core.compiler_lock")
    return getattr(module, "global_compiler_lock", None)


compiler_lock = _CompilerLock()
"""Held by the thread that compiles.

Code that changes state of the whole process, such as the filters of warnings, holds it too: the compiler restores the
filters that it saved, and of two threads that do so at once one would restore the other's.
"""


if hasattr(os, "register_at_fork"):
    # In a process that was forked while a thread compiled, that thread is not there to release it.
    os.register_at_fork(after_in_child=compiler_lock.reset)
