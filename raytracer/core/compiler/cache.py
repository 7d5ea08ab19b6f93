"""Cache policy: in which folder compiled kernels lie, which sources they depend on, and what Numba keeps there."""

import contextlib
import getpass
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from raytracer.core.compiler.kernel_files import KernelFiles, make_folder, source_hash

_PACKAGE = Path(__file__).parents[2]

# Packages with kernels: an edit of any other leaves the compiled kernels valid.
WITH_KERNELS = ("core", "kernel", "optics", "plugins")

_MAX_FOLDERS = 4


def _source_hash() -> str:
    """Hash the kernels' sources, since Numba does not notice an edited callee, and the compilers' versions."""
    return source_hash(*(_PACKAGE / name for name in WITH_KERNELS), versions=(numba.__version__,))[:16]


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
    from numba.core.registry import cpu_target

    return " ".join(cpu_target.target_context.codegen().magic_tuple())


class _CacheLocator:
    """A locator that has Numba cache in our folder; its own locators raise an error if they find no folder."""

    def __init__(self, py_file: str) -> None:
        self._py_file = py_file

    @classmethod
    def from_function(cls, function: Callable[..., Any], py_file: str) -> "_CacheLocator":
        return cls(py_file)

    def get_cache_path(self) -> str:
        return str(CACHE_FOLDER)

    def ensure_cache_path(self) -> None:
        """Return at once: `KernelFiles` makes the folder when it saves a file."""

    def get_source_stamp(self) -> str:
        # The folder is for the package's sources; other modules, such as tests, are distinguished by their own.
        return hashlib.sha256(Path(self._py_file).read_bytes()).hexdigest()[:16]

    get_disambiguator = get_source_stamp


class _CacheContent(CompileResultCacheImpl):
    """The cached content of a function, located by `_CacheLocator`."""

    _locator_classes: Any = (_CacheLocator,)


class KernelCache(FunctionCache):
    """Numba's cache of one function, in files of `KernelFiles`."""

    _impl_class = _CacheContent

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self.files = KernelFiles(CACHE_FOLDER, self._impl.filename_base, dumps)
        self._cache_file: Any = self.files
