"""Contents of the cache of compiled kernels: how much there is, and its removal."""

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from raytracer.core.compiler import cache
from raytracer.core.compiler.kernel_files import load_signed, save_signed
from raytracer.util.errors import InputError


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
    return CacheContents(cache.CACHE_FOLDER.parent, kernels, parts, sum(sizes), min(times, default=None))


def check_cache() -> None:
    """Make sure that compiled kernels are kept.

    Raises
    ------
    InputError : the folder cannot be written, or what is in it may be another user's.
    """
    probe = cache.CACHE_FOLDER / "probe.took"
    save_signed(probe, b"", sweep=False)
    is_kept = load_signed(probe) is not None
    for path in probe.parent.glob("probe.*.took"):
        path.unlink(missing_ok=True)
    if not is_kept:
        raise InputError(
            f"{cache.CACHE_FOLDER}: compiled kernels cannot be kept there; RAYTRACER_CACHE_DIR names another folder"
        )


def clear_cache() -> CacheContents:
    """Remove all kernels; who renders meanwhile compiles anew.  Returns what is left."""
    for folder in _folders():
        shutil.rmtree(folder, ignore_errors=True)
    return cache_contents()


def _folders() -> list[Path]:
    return [path for path in cache.CACHE_FOLDER.parent.glob("kernels-*") if path.is_dir() and not path.is_symlink()]


def _files() -> Iterator[Path]:
    for folder in _folders():
        yield from (path for path in folder.iterdir() if path.is_file())
