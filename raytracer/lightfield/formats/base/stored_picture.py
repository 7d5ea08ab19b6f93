"""A picture as its file holds it, decoded part by part, and the views that it is a mosaic of."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film import image_file
from raytracer.film.formats.base.image_format import wrap_decode_errors
from raytracer.film.formats.registry import image_formats
from raytracer.film.light_field.lazy_array import LazyArray
from raytracer.lightfield.formats.base.exr_parts import read_headers
from raytracer.lightfield.formats.base.scanline_exr import Part, map_parts
from raytracer.util import safe_open, srgb
from raytracer.util.safe_open import BrokenFileError

_CHANNELS = 3


def _decode_linear(pixels: NDArray[Any]) -> NDArray[np.float64]:
    return np.asarray(pixels, dtype=np.float64)


def decode_integers(pixels: NDArray[Any]) -> NDArray[np.float64]:
    """Decode display values, sRGB in unsigned integers, to linear light."""
    return np.take(srgb.decode(np.arange(np.iinfo(pixels.dtype).max + 1) / np.iinfo(pixels.dtype).max), pixels)


class StoredPicture(NamedTuple):
    """A picture whose pixels are decoded as they are asked for.

    pixels : (height, width, 3), of any type: an array, or what is indexed as one, mapped into memory.
    decode : makes linear light of some pixels.
    """

    pixels: Any
    decode: Callable[[NDArray[Any]], NDArray[np.float64]] = _decode_linear


def open_stored(path: Path) -> StoredPicture:
    """Open a picture: .npy files, and .exr files as this program writes them, are mapped, others decoded as a whole.

    Raises InputError: as `image_file.load`.
    """
    suffix = path.suffix.lower()
    opening = {".npy": _open_npy, ".exr": _open_exr}.get(suffix, _open_bytes)
    with safe_open.name_read_errors(path):
        stored = opening(path)
    return StoredPicture(image_file.load(path)) if stored is None else stored


def _open_npy(path: Path) -> StoredPicture:
    """Map an array; unsigned integers are display values."""
    with safe_open.open_regular(path, sys.maxsize) as file:
        header = safe_open.read_npy_header(file)
    shape, kind = header.shape, header.dtype.kind
    if (
        len(shape) != 3
        or shape[2] != _CHANNELS
        or 0 in shape
        or not (kind == "f" or header.dtype.str[1:] in ("u1", "u2"))
    ):
        raise BrokenFileError(
            f"must be (height, width, 3) of floating-point numbers, or uint8 or uint16; it is {shape} of {header.dtype}"
        )
    pixels = np.memmap(path, header.dtype, "r", header.start, shape, "F" if header.is_fortran else "C")
    return StoredPicture(pixels, decode_integers if kind == "u" else _decode_linear)


def _open_exr(path: Path) -> StoredPicture | None:
    """Map an uncompressed picture of three channels; None for another, which has to be decoded as a whole."""
    headers = read_headers(path)
    if len(headers) != 1 or headers[0].names != ("B", "G", "R"):
        return None
    width, height = headers[0].width, headers[0].height
    for kind in (np.float32, np.float16):
        mapped = map_parts(path, [Part("", dict.fromkeys("RGB", np.dtype(kind)))], width, height)
        if mapped is not None:
            blocks = mapped[0]
            planes = [blocks[f"channel {name}"] for name in "RGB"]
            return StoredPicture(Planes(planes))
    return None


class Planes:
    """Planes (height, width) of one channel each, indexed as one array (height, width, channels)."""

    def __init__(self, planes: list[NDArray[Any]]) -> None:
        self._planes = planes
        self.shape = (*planes[0].shape, len(planes))

    def __getitem__(self, index: Any) -> NDArray[Any]:
        return np.stack([plane[index] for plane in self._planes], axis=-1)


def _open_bytes(path: Path) -> StoredPicture | None:
    """Decode a picture of integers, without making linear light of all of it; None for others."""
    image_format = image_formats().get(path.suffix.lower())
    if image_format is None or image_format.decode_display is None or image_format.decode_stored is None:
        return None
    with wrap_decode_errors(path.suffix):
        stored = image_format.decode_stored(safe_open.read_regular(path))
    texels: NDArray[Any] = stored.texels
    if not stored.integer:
        return None
    if texels.dtype != np.uint8:
        # Integers of 16 bits are given in 0..1, with more digits than they have.
        texels = np.rint(np.iinfo(np.uint16).max * texels).astype(np.uint16)
    colours = texels[..., :_CHANNELS] if texels.shape[2] >= _CHANNELS else texels[..., :1]
    return StoredPicture(np.broadcast_to(colours, (*texels.shape[:2], _CHANNELS)), decode_integers)


class LazyMosaic(LazyArray):
    """Array of views in one picture, (rows, columns, height, width, 3) in linear light, decoded as they are read.

    is_interleaved : True if the pixels of all views lie beside each other; else the views do.
    top : rows of the picture above the views, which are no part of them; columns on the right of them are none either.
    """

    def __init__(
        self, picture: StoredPicture, rows: int, columns: int, *, is_interleaved: bool = False, top: int = 0
    ) -> None:
        height, width = picture.pixels.shape[:2]
        self._picture, self._is_interleaved, self._top = picture, is_interleaved, top
        super().__init__((rows, columns, (height - top) // rows, width // columns, _CHANNELS), np.dtype(np.float64))

    def _read(self, ahead: tuple[slice, ...]) -> NDArray[Any]:
        rows, columns, down, across, channels = (
            range(size)[part] for part, size in zip(ahead, self.shape, strict=True)
        )
        views = [self._view(v, u, down, across)[..., ahead[4]] for v in rows for u in columns]
        sizes = [len(rows), len(columns), len(down), len(across), len(channels)]
        return np.array(views, dtype=self.dtype).reshape(sizes)

    def _view(self, row: int, column: int, down: range, across: range) -> NDArray[np.float64]:
        """Read some pixels of a view."""
        vertical = self._place(down, row, self.shape[0], self.shape[2])
        horizontal = self._place(across, column, self.shape[1], self.shape[3])
        if self._top:
            vertical = slice(vertical.start + self._top, vertical.stop + self._top, vertical.step)
        return self._picture.decode(self._picture.pixels[vertical, horizontal])

    def _place(self, pixels: range, view: int, views: int, size: int) -> slice:
        """Find where pixels of a view are in the picture, along one axis."""
        step, first = (views, view) if self._is_interleaved else (1, view * size)
        start, stop = first + step * pixels.start, first + step * max(pixels.stop, pixels.start)
        return slice(start, stop, step * pixels.step)
