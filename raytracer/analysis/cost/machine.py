"""Description of the machine that a measurement ran on."""

import os
import platform
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from raytracer import __version__

_PACKAGES = ("numpy", "numba", "embreex")

_LEVELS = {"X86_V2": "x86-64-v2 (SSE4.2)", "X86_V3": "x86-64-v3 (AVX2)", "X86_V4": "x86-64-v4 (AVX-512)"}

_CPU_INFO = Path("/proc/cpuinfo")


def machine() -> dict[str, Any]:
    """Describe processor, the widest of its instruction sets, operating system and versions, by name."""
    return {
        "processor": processor(),
        "instruction_set": _instruction_set(),
        "system": f"{platform.system()} {platform.release()}",
        "versions": {
            "rt": __version__,
            "python": platform.python_version(),
            **{name: version(name) for name in _PACKAGES},
        },
    }


def _instruction_set() -> str:
    """Name the widest instruction set that NumPy finds; levels of x86-64 with the names that people know."""
    extensions = np.show_config(mode="dicts").get("SIMD Extensions", {})
    known = [*extensions.get("baseline", []), *extensions.get("found", [])]
    return _LEVELS.get(known[-1], known[-1]) if known else platform.machine()


def processor() -> str:
    """Return the name of the processor."""
    if sys.platform.startswith("linux"):
        try:
            lines = _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        names = [value.strip() for key, _, value in (line.partition(":") for line in lines) if "model name" in key]
        if names:
            return names[0]
    return platform.processor() or platform.machine()


def load_average() -> float | None:
    """Return the load average over the last minute; None where the system does not tell."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None
