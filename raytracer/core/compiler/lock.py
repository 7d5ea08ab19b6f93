"""The compiler's lock: one thread of a process compiles at a time."""

import os
import threading
from typing import Any

from numba.core.compiler_lock import global_compiler_lock

compiler_lock: Any = global_compiler_lock
"""Held by the thread that compiles.

Code that changes state of the whole process, such as the filters of warnings, holds it too: the compiler restores the
filters that it saved, and of two threads that do so at once one would restore the other's.
"""


def _reset_compiler_lock() -> None:
    # In a process that was forked while a thread compiled, that thread is not there to release it.
    compiler_lock._lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reset_compiler_lock)
