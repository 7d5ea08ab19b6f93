"""The cache of compiled kernels: its folder, which sources and processor they depend on, and what is in it."""

import contextlib
import functools
import getpass
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding

from raytracer.core.compiler.kernel_files import load_signed, make_folder, save_signed, source_hash
from raytracer.util.errors import InputError

_PACKAGE = Path(__file__).parents[2]

# Packages with kernels: an edit of any other leaves the compiled kernels valid.
WITH_KERNELS = ("core", "kernel", "lightfield.kernels", "optics", "plugins")

_MAX_FOLDERS = 4

# Processors that Numba uses no AVX of by default.
_AVX_OFF = ("corei7-avx", "core-avx-i", "sandybridge", "ivybridge")


def _source_hash() -> str:
    """Hash the kernels' sources, since Numba does not notice an edited callee, and the compilers' versions."""
    versions = [_version_text(name) for name in ("numba", "llvmlite")]
    return source_hash(*(_PACKAGE.joinpath(*name.split(".")) for name in WITH_KERNELS), versions=versions)[:16]


def _version_text(package: str) -> str:
    """Read the version of a package from its own file, without importing it."""
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


# ---- Contents


class CacheContents(NamedTuple):
    """Contents of the cache, for these sources and for earlier ones.

    Attributes
    ----------
    folder : that of the cache.
    kernels : files of kernels.
    parts : files of parts.
    bytes : size of all files.
    oldest : when the oldest file was written, seconds since 1970; None if there is none.
    """

    folder: Path
    kernels: int
    parts: int
    bytes: int
    oldest: float | None


def cache_contents() -> CacheContents:
    """Count what is in the cache; files that are removed meanwhile do not count."""
    suffixes, sizes, times = [], [], []
    for path in _files():
        with contextlib.suppress(OSError):
            status = path.stat()
            suffixes.append(path.suffix)
            sizes.append(status.st_size)
            times.append(status.st_mtime)
    kernels, parts = suffixes.count(".nbc"), suffixes.count(".part")
    return CacheContents(CACHE_FOLDER.parent, kernels, parts, sum(sizes), min(times, default=None))


def check_cache() -> None:
    """Make sure that compiled kernels are kept.

    Raises
    ------
    InputError : the folder cannot be written, or what is in it may be another user's.
    """
    probe = CACHE_FOLDER / "probe.took"
    save_signed(probe, b"", sweep=False)
    is_kept = load_signed(probe) is not None
    for path in probe.parent.glob("probe.*.took"):
        path.unlink(missing_ok=True)
    if not is_kept:
        raise InputError(
            f"{CACHE_FOLDER}: compiled kernels cannot be kept there; RAYTRACER_CACHE_DIR names another folder"
        )


def clear_cache() -> CacheContents:
    """Remove all kernels; who renders meanwhile compiles anew.  Returns what is left."""
    for folder in _folders():
        shutil.rmtree(folder, ignore_errors=True)
    return cache_contents()


def _folders() -> list[Path]:
    return [path for path in CACHE_FOLDER.parent.glob("kernels-*") if path.is_dir() and not path.is_symlink()]


def _files() -> Iterator[Path]:
    for folder in _folders():
        yield from (path for path in folder.iterdir() if path.is_file())
