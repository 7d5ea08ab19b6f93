"""Find LLVM's shared library for Dr.Jit, which the `llvm_*` variants of Mitsuba compile with; imports neither."""

from __future__ import annotations

import os
import re
from pathlib import Path

VARIABLE = "DRJIT_LIBLLVM_PATH"

OLDEST = 16
"""LLVM 15 aborts the process in Mitsuba 3.9."""

PATTERNS = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)


def version(path: Path) -> int:
    """Parse the major version of a library's name or folder, libLLVM.so.19.1 or llvm-19/lib/libLLVM.so; else 0."""
    found = re.search(r"libLLVM-(\d+)|libLLVM\.so\.(\d+)|llvm[-@](\d+)/", str(path))
    return int(next(filter(None, found.groups()))) if found else 0


def find_llvm() -> Path | None:
    """Find the newest library of version 16 or later in the systems' usual places."""
    paths = (path for pattern in PATTERNS for path in Path("/").glob(pattern.removeprefix("/")))
    return max((path for path in paths if version(path) >= OLDEST), key=version, default=None)


def use_llvm() -> bool:
    """Point Dr.Jit at LLVM, unless the variable is set already; return True if there is one."""
    if os.environ.get(VARIABLE):
        return True
    path = find_llvm()
    if path is not None:
        os.environ[VARIABLE] = str(path)
    return path is not None
