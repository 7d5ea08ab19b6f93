"""Read untrusted files: only regular ones, and only up to a limit.

A size that a file states of itself is never trusted: it is compared with the data before memory is
allocated.
"""

import io
import math
import os
import stat
import warnings
from errno import EFBIG, EINVAL
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class NpyError(ValueError):
    """Error of a file that is no NumPy file, or of an unsupported kind; its text completes "FILE: ..."."""


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
    NpyError : it is no such file, holds anything else than numbers, or fewer of them than it says.
    """
    head = file.read(_NPY_START + _NPY_HEADER)
    size = file.seek(0, io.SEEK_END)
    if not head.startswith(_NPY_MAGIC):
        raise NpyError("is no NumPy file")
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
        raise NpyError("is a broken NumPy file, or cut off") from error
    if dtype.hasobject:
        raise NpyError("holds pickled objects, which are not read")
    if dtype.kind not in "biufc":
        raise NpyError(f"must hold real numbers, got {dtype!s:.40}")
    if len(shape) > _NPY_DIMENSIONS or any(isinstance(length, bool) or length < 0 for length in shape):
        raise NpyError("has a shape that is none")
    if math.prod(shape) * dtype.itemsize > size - beginning.tell():
        raise NpyError("is a broken NumPy file, or cut off")
    return NpyHeader(tuple(shape), dtype, bool(is_fortran), beginning.tell())


def parse_npy(data: bytes) -> NDArray[Any]:
    """Parse the bytes of a .npy file to an array, which is a read-only view.

    Raises
    ------
    NpyError : as `read_npy_header`.
    """
    header = read_npy_header(io.BytesIO(data))
    flat = np.frombuffer(data, header.dtype, math.prod(header.shape), header.start)
    return flat.reshape(header.shape, order="F" if header.is_fortran else "C")
