"""Snapshots of arrays on disk, to resume from: one file, with checksums, and the previous one.

A file is a ZIP archive without compression, as `numpy.savez` writes it: `about.json`, and an .npy file for each
array.  ZIP has a CRC-32 of each of them, and lists them at its end, so that a file cut short is none.

References: PKWARE, "APPNOTE.TXT - .ZIP File Format Specification", 6.3.10; NumPy Enhancement Proposal 1, "A Simple File
    Format for NumPy Arrays".
"""

import errno
import json
import math
import os
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.util.atomic_write import atomic_write, wrap_os_errors
from raytracer.util.errors import OutputError
from raytracer.util.safe_open import open_regular

PREVIOUS_SUFFIX = ".previous"
"""Suffix of the name of the previous file."""

_ABOUT = "about.json"

# The JSON holds a scene, whose own file may have 64 MB.
_LONGEST_ABOUT = 2**28

# Longest header of .npy files.
_LONGEST_HEADER = 4096

_FULL = (errno.ENOSPC, errno.EDQUOT) if hasattr(errno, "EDQUOT") else (errno.ENOSPC,)


class DamagedError(Exception):
    """A snapshot that is not what was written; its text says what is wrong."""


def previous_path(path: Path) -> Path:
    """Return the path of the previous file."""
    return path.with_name(path.name + PREVIOUS_SUFFIX)


def write(path: Path, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], *, keep: bool) -> int:
    """Write plain values and arrays, by name, in place of the file that exists, and return its size in bytes.

    keep : keep the existing file as the previous one, in place of an older one, which is deleted first if
        the disk is full.

    Raises
    ------
    OutputError : the file cannot be written; the existing one is still there, if only as the previous one.
    """
    try:
        return _write_archive(path, header, arrays, keep=keep)
    except OutputError as error:
        if not keep or getattr(error.__cause__, "errno", None) not in _FULL:
            raise
        with wrap_os_errors(path):
            if not (path.exists() and previous_path(path).exists()):
                raise
            previous_path(path).unlink()
        return _write_archive(path, header, arrays, keep=keep)


def _write_archive(path: Path, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], *, keep: bool) -> int:
    with atomic_write(path) as aside, wrap_os_errors(path):
        with zipfile.ZipFile(aside, "w", zipfile.ZIP_STORED) as archive:
            archive.writestr(_ABOUT, json.dumps(header))
            for name, array in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
        size = aside.stat().st_size
        # Flushed to the disk before it replaces anything.
        with aside.open("rb+") as file:
            os.fsync(file.fileno())
        if keep and path.exists():
            os.replace(path, previous_path(path))
    return size


def delete_previous(path: Path) -> None:
    """Remove the previous file of `path`."""
    with suppress(OSError):
        previous_path(path).unlink(missing_ok=True)


def delete(path: Path) -> None:
    """Remove the file at `path` and its previous one."""
    delete_previous(path)
    with suppress(OSError):
        path.unlink(missing_ok=True)


def read(path: Path, accept: Callable[[Mapping[str, Any]], Mapping[str, NDArray[Any]]]) -> Mapping[str, Any]:
    """Read a file's arrays into existing ones, and return its header.

    accept : gets the header and returns the arrays by name to be filled: of the type and the first two dimensions of
        the file's, and in no other one smaller; the rest of them is set to 0.  Its exceptions end the reading.

    Raises
    ------
    DamagedError : the file is no snapshot, cut short or changed; what was filled is of no use then.
    OSError : it cannot be read, or is no regular file.
    """
    with open_regular(path, sys.maxsize) as file:
        with _wrap_damage():
            archive = zipfile.ZipFile(file)
            members = {member.filename: member for member in archive.infolist()}
            if any(member.compress_type != zipfile.ZIP_STORED for member in members.values()):
                raise DamagedError("is compressed")
            about = _read_header(archive, members)
        targets = accept(about)
        with _wrap_damage():
            if sorted(members) != sorted([_ABOUT, *(f"{name}.npy" for name in targets)]):
                raise DamagedError("holds other arrays than it should")
            for name, target in targets.items():
                _fill(archive, members[f"{name}.npy"], target)
    return about


def _read_header(archive: zipfile.ZipFile, members: Mapping[str, zipfile.ZipInfo]) -> Mapping[str, Any]:
    member = members[_ABOUT]
    if member.file_size > _LONGEST_ABOUT:
        raise DamagedError("says too much")
    about = json.loads(archive.read(member))
    if not isinstance(about, dict):
        raise DamagedError("does not say what it is")
    return about


def _fill(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: NDArray[Any]) -> None:
    """Read an array into one that is as large or larger, whatever size its header claims."""
    if member.file_size > target.nbytes + _LONGEST_HEADER:
        raise DamagedError(f"holds more of {member.filename} than it should")
    with archive.open(member) as file:
        np.lib.format.read_magic(file)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(file, max_header_size=_LONGEST_HEADER)
        fits = len(shape) == target.ndim and all(
            had <= has for had, has in zip(shape[2:], target.shape[2:], strict=True)
        )
        if fortran or dtype != target.dtype or shape[:2] != target.shape[:2] or not fits:
            raise DamagedError(f"holds {member.filename} in another shape than it should")
        # Read to its end, where zipfile compares the checksum.
        data = file.read()
    if len(data) != math.prod(shape) * dtype.itemsize:
        raise DamagedError(f"holds less of {member.filename} than it says")
    target[...] = 0
    target[tuple(map(slice, shape))] = np.frombuffer(data, dtype).reshape(shape)


@contextmanager
def _wrap_damage() -> Iterator[None]:
    """Turn exceptions of reading into DamagedError, except those of the file system."""
    try:
        yield
    except (DamagedError, FileNotFoundError, PermissionError, IsADirectoryError):
        raise
    except Exception as error:
        # A file cut short or overwritten can raise nearly anything.
        raise DamagedError(str(error) or type(error).__name__) from error
