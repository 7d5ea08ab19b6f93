"""Cache policy: in which folder compiled kernels lie, and which sources and processor they depend on."""

import contextlib
import functools
import getpass
import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path

import llvmlite.binding

from raytracer.core.compiler.kernel_files import make_folder, source_hash

_PACKAGE = Path(__file__).parents[2]

# Packages with kernels: an edit of any other leaves the compiled kernels valid.
WITH_KERNELS = ("core", "kernel", "optics", "plugins")

_MAX_FOLDERS = 4

# Processors that Numba uses no AVX of by default.
_AVX_OFF = ("corei7-avx", "core-avx-i", "sandybridge", "ivybridge")


def _source_hash() -> str:
    """Hash the kernels' sources, since Numba does not notice an edited callee, and the compilers' versions."""
    return source_hash(*(_PACKAGE / name for name in WITH_KERNELS), versions=_versions())[:16]


def _versions() -> tuple[str, ...]:
    """Read the versions of the compiler from its packages' own files, without importing them."""
    return tuple(_version_text(name) for name in ("numba", "llvmlite"))


def _version_text(package: str) -> str:
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise ImportError(f"the package {package}, which compiles kernels, is not installed")
    try:
        return Path(spec.origin).with_name("_version.py").read_text(encoding="utf-8")
    except OSError:
        return str(importlib.import_module(package).__version__)


def _cache_root() -> Path:
    """Find the user's cache folder, by each system's custom; `RAYTRACER_CACHE_DIR` overrides it."""
    if given := os.environ.get("RAYTRACER_CACHE_DIR"):
        return Path(given)
    try:
        if sys.platform == "win32":
            # Not the program's whole folder: the key that signs the files lies there.
            return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "raytracer" / "Cache"
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "raytracer"
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "raytracer"
    except RuntimeError:
        # The user has no home, as in containers.
        return (
            Path(tempfile.gettempdir()) / f"raytracer-{getpass.getuser() if sys.platform == 'win32' else os.getuid()}"
        )


def _make_cache_folder() -> Path:
    """Make the folder of kernels of these sources, if possible, and remove the oldest folders of others."""
    root = _cache_root()
    folder = root / f"kernels-{_source_hash()}"
    # If it cannot be written, kernels are compiled in memory.
    with contextlib.suppress(OSError):
        make_folder(folder)
        os.utime(folder)
        old = sorted(root.glob("kernels-*"), key=lambda path: path.stat().st_mtime)[:-_MAX_FOLDERS]
        for path in old:
            shutil.rmtree(path, ignore_errors=True)
    return folder


CACHE_FOLDER = _make_cache_folder()


def processor() -> str:
    """Name the target of the compiler: platform, processor and instruction set.  Equal targets give equal bits."""
    cpu = llvmlite.binding.get_host_cpu_name()
    if "numba" in sys.modules or cpu in _AVX_OFF or any(name.startswith("NUMBA_") for name in os.environ):
        # Numba has settings of its own for this.
        from numba.core.registry import cpu_target

        return " ".join(cpu_target.target_context.codegen().magic_tuple())
    features = llvmlite.binding.get_host_cpu_features().flatten()
    return f"{llvmlite.binding.get_process_triple()} {cpu} {features}"


@functools.cache
def compiler_target() -> str:
    """Describe what machine code depends on besides sources: the target, and the settings of Numba and LLVM."""
    settings = sorted(f"{name}={value}" for name, value in os.environ.items() if name.startswith("NUMBA_"))
    return " ".join((processor(), *settings))
