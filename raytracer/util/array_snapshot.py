"""Arrays on disk, to go on from: one file, with a checksum of all it holds, and the one before it.

A file is a ZIP archive without compression, as `numpy.savez` writes it: a text, `about.json`, and an .npy file for each
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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import OutputError
from raytracer.untrusted import opened
from raytracer.wholefiles import told, whole

PREVIOUS = ".previous"
"""What the name of the file before has at its end."""

_ABOUT = "about.json"

# The text holds a scene, whose own file may have 64 MB.
_LONGEST_ABOUT = 2**28

# What .npy files have before their data, at most.
_LONGEST_HEADER = 4096

_FULL = (errno.ENOSPC, errno.EDQUOT) if hasattr(errno, "EDQUOT") else (errno.ENOSPC,)


class DamagedError(Exception):
    """A file that is not what was written; its text says what is wrong with it."""


class Snapshot(NamedTuple):
    """What a file holds: plain values by name, and arrays by name."""

    about: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]


def previous_of(path: Path) -> Path:
    """Where the file before lies."""
    return path.with_name(path.name + PREVIOUS)


def write(path: Path, snapshot: Snapshot, *, keep: bool) -> int:
    """Write a file in place of the one that is there; the bytes that it has.

    keep : whether the one that is there is kept as the one before, in place of an older one, which goes first where
        there is no room for all.

    Raises
    ------
    OutputError : the file cannot be written; what was there is there still, if only as the one before.
    """
    try:
        return _written(path, snapshot, keep=keep)
    except OutputError as error:
        if not keep or getattr(error.__cause__, "errno", None) not in _FULL:
            raise
        with told(path):
            if not (path.exists() and previous_of(path).exists()):
                raise
            previous_of(path).unlink()
        return _written(path, snapshot, keep=keep)


def _written(path: Path, snapshot: Snapshot, *, keep: bool) -> int:
    with whole(path) as aside, told(path):
        with zipfile.ZipFile(aside, "w", zipfile.ZIP_STORED) as archive:
            archive.writestr(_ABOUT, json.dumps(snapshot.about))
            for name, array in snapshot.arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
        size = aside.stat().st_size
        # Put on the disk before anything that is there gives way to it.
        with aside.open("rb+") as file:
            os.fsync(file.fileno())
        if keep and path.exists():
            os.replace(path, previous_of(path))
    return size


def forget_previous(path: Path) -> None:
    """Remove the file before the one at `path`."""
    with suppress(OSError):
        previous_of(path).unlink(missing_ok=True)


def forget(path: Path) -> None:
    """Remove the file at `path`, and the one before it."""
    forget_previous(path)
    with suppress(OSError):
        path.unlink(missing_ok=True)


def read(path: Path, accept: Callable[[Mapping[str, Any]], Mapping[str, NDArray[Any]]]) -> Mapping[str, Any]:
    """What a file says besides its arrays, once these have been read into arrays that are there.

    Parameters
    ----------
    accept : given what the file says, the arrays by name to be filled: of the type and the first two dimensions of the
        file's, and in no other one smaller; what the file does not have of them is 0.  What it raises ends the reading.

    Raises
    ------
    DamagedError : the file is none of ours, cut short or changed; what was filled is of no use then.
    OSError : it cannot be read, or is no regular file.
    """
    with opened(path, sys.maxsize) as file:
        with _damage_told():
            archive = zipfile.ZipFile(file)
            members = {member.filename: member for member in archive.infolist()}
            if any(member.compress_type != zipfile.ZIP_STORED for member in members.values()):
                raise DamagedError("is compressed")
            about = _about(archive, members)
        targets = accept(about)
        with _damage_told():
            if sorted(members) != sorted([_ABOUT, *(f"{name}.npy" for name in targets)]):
                raise DamagedError("holds other arrays than it should")
            for name, target in targets.items():
                _fill(archive, members[f"{name}.npy"], target)
    return about


def _about(archive: zipfile.ZipFile, members: Mapping[str, zipfile.ZipInfo]) -> Mapping[str, Any]:
    member = members[_ABOUT]
    if member.file_size > _LONGEST_ABOUT:
        raise DamagedError("says too much")
    about = json.loads(archive.read(member))
    if not isinstance(about, dict):
        raise DamagedError("does not say what it is")
    return about


def _fill(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: NDArray[Any]) -> None:
    """Read an array into one that is as large or larger, whatever its header asks for."""
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
        # Read to its end, where the checksum is looked at.
        data = file.read()
    if len(data) != math.prod(shape) * dtype.itemsize:
        raise DamagedError(f"holds less of {member.filename} than it says")
    target[...] = 0
    target[tuple(map(slice, shape))] = np.frombuffer(data, dtype).reshape(shape)


@contextmanager
def _damage_told() -> Iterator[None]:
    """Take for damage whatever reading raises, but that the system cannot read."""
    try:
        yield
    except (DamagedError, FileNotFoundError, PermissionError, IsADirectoryError):
        raise
    except Exception as error:
        # A file cut short or overwritten can raise nearly anything.
        raise DamagedError(str(error) or type(error).__name__) from error
