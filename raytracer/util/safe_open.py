"""Files that others wrote: opened only if they are regular files, and read only as far as they may be.

Nothing here trusts a size that a file states of itself: what it claims is compared with what is there before room is
made for it.
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
"""Of a file that is read whole; what a .glb file may have."""

_NPY_MAGIC = b"\x93NUMPY"

# The header that NumPy reads at most, behind the magic, the version and the header's own length.
_NPY_HEADER, _NPY_START = 10_000, 12

# More than any array here has, and fewer than NumPy takes.
_NPY_DIMENSIONS = 32


def opened(path: Path, most: int = MAX_BYTES) -> io.BufferedReader:
    """`path`, opened to be read from; a pipe, device or socket is refused without waiting for it.

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


def contents(path: Path, most: int = MAX_BYTES) -> bytes:
    """The bytes of a file; see `opened`.

    Raises
    ------
    OSError : as `opened`.
    """
    with opened(path, most) as file:
        return file.read(os.fstat(file.fileno()).st_size)


class BrokenArrayError(ValueError):
    """No NumPy file, or one that is not read; its text completes the sentence "FILE: ..."."""


class Stated(NamedTuple):
    """What a .npy file says that it holds, which is there: shape, type, order, and the byte at which it begins."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    is_fortran: bool
    start: int


def stated_array(file: BinaryIO) -> Stated:
    """What is in a .npy file, without reading its numbers.

    Raises
    ------
    BrokenArrayError : it is no such file, holds anything else than numbers, or fewer of them than it says.
    """
    head = file.read(_NPY_START + _NPY_HEADER)
    size = file.seek(0, io.SEEK_END)
    if not head.startswith(_NPY_MAGIC):
        raise BrokenArrayError("is no NumPy file")
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
        raise BrokenArrayError("is a broken NumPy file, or cut off") from error
    if dtype.hasobject:
        raise BrokenArrayError("holds pickled objects, which are not read")
    if dtype.kind not in "biufc":
        raise BrokenArrayError(f"must hold real numbers, got {dtype!s:.40}")
    if len(shape) > _NPY_DIMENSIONS or any(isinstance(length, bool) or length < 0 for length in shape):
        raise BrokenArrayError("has a shape that is none")
    if math.prod(shape) * dtype.itemsize > size - beginning.tell():
        raise BrokenArrayError("is a broken NumPy file, or cut off")
    return Stated(tuple(shape), dtype, bool(is_fortran), beginning.tell())


def array(data: bytes) -> NDArray[Any]:
    """The numbers in the bytes of a .npy file, not copied and not to be written to.

    Raises
    ------
    BrokenArrayError : as `stated_array`.
    """
    found = stated_array(io.BytesIO(data))
    flat = np.frombuffer(data, found.dtype, math.prod(found.shape), found.start)
    return flat.reshape(found.shape, order="F" if found.is_fortran else "C")
