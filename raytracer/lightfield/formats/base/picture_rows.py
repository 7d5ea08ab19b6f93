"""Pictures written a few rows at a time: .png of 8 or 16 bits in sRGB, .exr and .npy of linear light.

References: ISO/IEC 15948:2004, "Portable Network Graphics", sec. 11.2 (IHDR, IDAT, sRGB) and 9 (filters).
"""

import contextlib
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from raytracer.film import image_file
from raytracer.film.image import Image
from raytracer.lightfield.formats.base.scanline_exr import Part, open_writer
from raytracer.util import srgb
from raytracer.util.atomic_write import atomic_write, wrap_os_errors
from raytracer.util.errors import InputError

Put = Callable[[NDArray[Any]], None]
"""Writes further rows of a picture: linear light, (rows, width, 3)."""

_CHANNELS = 3

_PNG_LARGEST = 2**31 - 1
"""Largest width and height of a .png file (ISO/IEC 15948, sec. 7.1)."""

_COMPRESSION = 6
"""Of zlib, and of Pillow's .png files."""

_UP = 2
"""The filter of .png that subtracts the row above."""


def encode_display(radiance: NDArray[Any], bits: int) -> NDArray[Any]:
    """Encode linear light as what a display shows, sRGB in integers of 8 or 16 bits; NaN becomes 0."""
    if bits == 8:
        return srgb.to_uint8(radiance)
    encoded = np.iinfo(np.uint16).max * srgb.encode(radiance)
    return np.rint(np.where(np.isnan(encoded), 0.0, encoded)).astype(np.uint16)


@contextlib.contextmanager
def open_picture(path: Path, width: int, height: int, *, bits: int, dtype: "np.dtype[Any]") -> Iterator[Put]:
    """Open a picture to be written a few rows at a time, which appears when all rows are there.

    bits : of the channels of a .png file.
    dtype : of linear light.

    Raises OutputError: it cannot be written.
    """
    if path.suffix.lower() == ".exr":
        half = np.dtype(np.float16) if dtype.itemsize == 2 else np.dtype(np.float32)
        with open_writer(path, [Part("", dict.fromkeys("RGB", half))], width, height) as writer:
            top = 0

            def put_rows(rows: NDArray[Any]) -> None:
                nonlocal top
                writer.put(0, top, {name: rows[..., number] for number, name in enumerate("RGB")})
                top += len(rows)

            yield put_rows
        return
    open_rows = _ROW_WRITERS[path.suffix.lower()]
    with (
        atomic_write(path) as aside,
        wrap_os_errors(path),
        aside.open("wb") as file,
        open_rows(file, width, height, bits, dtype) as put,
    ):
        yield put


@contextlib.contextmanager
def _npy_rows(file: BinaryIO, width: int, height: int, bits: int, dtype: "np.dtype[Any]") -> Iterator[Put]:
    del bits
    stored = dtype.newbyteorder("<")
    header = {"descr": stored.str, "fortran_order": False, "shape": (height, width, _CHANNELS)}
    np.lib.format.write_array_header_2_0(file, header)
    yield lambda rows: _write_all(file, np.ascontiguousarray(rows, dtype=stored).tobytes())


@contextlib.contextmanager
def _png_rows(file: BinaryIO, width: int, height: int, bits: int, dtype: "np.dtype[Any]") -> Iterator[Put]:
    del dtype
    file.write(b"\x89PNG\r\n\x1a\n")
    _write_chunk(file, b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 2, 0, 0, 0))
    _write_chunk(file, b"sRGB", b"\0")
    packing = zlib.compressobj(_COMPRESSION)
    # Before the first row there is one of zeros.
    above = np.zeros((1, width * _CHANNELS * bits // 8), np.uint8)

    def put(rows: NDArray[Any]) -> None:
        nonlocal above
        pixels = encode_display(rows, bits)
        stored = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(len(rows), -1)
        filtered = np.full((len(rows), stored.shape[1] + 1), _UP, np.uint8)
        filtered[:, 1:] = stored - np.concatenate([above, stored[:-1]])
        above = stored[-1:]
        if packed := packing.compress(filtered.tobytes()):
            _write_chunk(file, b"IDAT", packed)

    yield put
    _write_chunk(file, b"IDAT", packing.flush())
    _write_chunk(file, b"IEND", b"")


def _write_chunk(file: BinaryIO, kind: bytes, data: bytes) -> None:
    file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))


def _write_all(file: BinaryIO, data: bytes) -> None:
    file.write(data)


_ROW_WRITERS: Mapping[str, Any] = {".png": _png_rows, ".npy": _npy_rows}

ROW_SUFFIXES = (".png", ".exr", ".npy")
"""Suffixes of pictures that are written a few rows at a time."""


def save_view(radiance: NDArray[np.float64], path: Path, bits: int | None) -> None:
    """Write a whole picture, in a .png file of 16 bits if asked for; an OutputError says that it cannot be written."""
    if bits != 16:
        image_file.save(Image(radiance), path)
        return
    height, width = radiance.shape[:2]
    with open_picture(path, width, height, bits=bits, dtype=np.dtype(np.float64)) as put:
        put(radiance)


def check_picture(path: Path, width: int, height: int, bits: int | None) -> None:
    """Refuse a picture that cannot be written in rows: its suffix, its bits, or more pixels than a file holds."""
    suffix = path.suffix.lower()
    if suffix not in ROW_SUFFIXES:
        raise InputError(
            f"{path}: unknown suffix {path.suffix!r} for a picture of all views; known: {', '.join(ROW_SUFFIXES)}"
        )
    if bits is not None and suffix != ".png":
        raise InputError(f"{path}: --bits are of .png")
    if max(width, height) > _PNG_LARGEST:
        raise InputError(f"{path}: {width} x {height} pixels are more than a picture holds")


def count_rows(memory: int, width: int, height: int) -> int:
    """Count the rows of a picture that fit into `memory` bytes, at least one: as float64, and once more as stored."""
    return max(1, min(height, memory // (width * _CHANNELS * 2 * np.dtype(np.float64).itemsize)))
