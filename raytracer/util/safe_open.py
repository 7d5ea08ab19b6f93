"""Read untrusted files: only regular ones, and only up to a limit.

A size that a file states of itself is never trusted: it is compared with the data before memory is
allocated.
"""

import contextlib
import io
import json
import math
import os
import stat
import warnings
from collections.abc import Collection, Iterator
from errno import EFBIG, EINVAL
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.util.errors import InputError, one_line


class BrokenFileError(ValueError):
    """Error of a file that cannot be used; its text completes the sentence "FILE: ..."."""


@contextlib.contextmanager
def name_read_errors(path: Path) -> Iterator[None]:
    """Turn errors of reading a file into InputErrors that name it."""
    try:
        yield
    except BrokenFileError as error:
        raise InputError(f"{path}: {error}") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or one_line(str(error))}") from error
    except MemoryError as error:
        raise InputError(f"{path}: does not fit into memory") from error


def check_suffix(path: Path, known: Collection[str], noun: str) -> None:
    """Check that the suffix of a file is one of those that are known, in lower case.

    noun : what the file holds, for the sentence: "an image".

    Raises
    ------
    InputError : it is none of them.
    """
    if path.suffix.lower() not in known:
        problem = f"unknown suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise InputError(f"{path}: {problem} for {noun}; known: {', '.join(known)}")


MAX_BYTES = 2**32
"""Largest file that is read whole; the limit of .glb files."""

_NPY_MAGIC = b"\x93NUMPY"

# The header that NumPy reads at most, behind the magic, the version and the header's own length.
_NPY_HEADER, _NPY_START = 10_000, 12

# More than any array here has, and fewer than NumPy takes.
_NPY_DIMENSIONS = 32


def open_regular(path: Path, most: int = MAX_BYTES) -> io.BufferedReader:
    """Open a file for reading; a pipe, device or socket is refused without waiting for it.

    Raises
    ------
    OSError : it cannot be opened, is no regular file, or has more than `most` bytes.
    """

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    file = open(path, "rb", opener=at_once)  # noqa: SIM115
    try:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError(EINVAL, "is no regular file")
        if status.st_size > most:
            raise OSError(EFBIG, f"has {status.st_size:,} bytes, and at most {most:,} are read")
    except BaseException:
        file.close()
        raise
    return file


def read_regular(path: Path, most: int = MAX_BYTES) -> bytes:
    """Read the bytes of a file; see `open_regular`.

    Raises
    ------
    OSError : as `open_regular`.
    """
    with open_regular(path, most) as file:
        return file.read(os.fstat(file.fileno()).st_size)


def read_json(path: Path, most: int) -> Any:
    """Read the values of a JSON file of at most so many bytes.

    Raises
    ------
    InputError : it cannot be read, or is no JSON.
    """
    with name_read_errors(path):
        data = read_regular(path, most)
    try:
        return json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no JSON file, or a broken one") from error


class NpyHeader(NamedTuple):
    """The header of a .npy file, checked against its size.

    shape, dtype : of the array.
    is_fortran : in Fortran order.
    start : byte at which the numbers begin.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    is_fortran: bool
    start: int


def read_npy_header(file: BinaryIO) -> NpyHeader:
    """Read the header of a .npy file.

    Raises
    ------
    BrokenFileError : it is no such file, holds anything else than numbers, or fewer of them than it says.
    """
    head = file.read(_NPY_START + _NPY_HEADER)
    size = file.seek(0, io.SEEK_END)
    if not head.startswith(_NPY_MAGIC):
        raise BrokenFileError("is no NumPy file")
    beginning = io.BytesIO(head)
    try:
        # NumPy warns of headers that Python 2 wrote.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            version = np.lib.format.read_magic(beginning)
            reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, is_fortran, dtype = reader(beginning, max_header_size=_NPY_HEADER)
    except Exception as error:
        # A header that is no literal, or no type, raises anything from SyntaxError to RecursionError.
        raise BrokenFileError("is a broken NumPy file, or cut off") from error
    if dtype.hasobject:
        raise BrokenFileError("holds pickled objects, which are not read")
    if dtype.kind not in "biufc":
        raise BrokenFileError(f"must hold real numbers, got {dtype!s:.40}")
    if len(shape) > _NPY_DIMENSIONS or any(isinstance(length, bool) or length < 0 for length in shape):
        raise BrokenFileError("has a shape that is none")
    if math.prod(shape) * dtype.itemsize > size - beginning.tell():
        raise BrokenFileError("is a broken NumPy file, or cut off")
    return NpyHeader(tuple(shape), dtype, bool(is_fortran), beginning.tell())


def parse_npy(data: bytes) -> NDArray[Any]:
    """Parse the bytes of a .npy file to an array, which is a read-only view.

    Raises
    ------
    BrokenFileError : as `read_npy_header`.
    """
    header = read_npy_header(io.BytesIO(data))
    flat = np.frombuffer(data, header.dtype, math.prod(header.shape), header.start)
    return flat.reshape(header.shape, order="F" if header.is_fortran else "C")
