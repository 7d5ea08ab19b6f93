"""Images as textures read them; the first byte chooses the suffix, and whether a PNG's checksums are put right."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image

from raytracer.film.formats import hdr
from raytracer.film.formats.base.image_format import MAX_PIXELS
from raytracer.scene.assets.images import decode_image
from raytracer.util.errors import InputError
from tests.fuzz.targets._parts import npy, with_header, with_sums

MAX_LENGTH = 2048
DICTIONARY = (
    b"IHDR",
    b"PLTE",
    b"IDAT",
    b"tRNS",
    b"iCCP",
    b"acTL",
    b"fdAT",
    b"dataWindow\x00box2i",
    b"channels\x00chlist",
    b"EXPOSURE=",
)

SUFFIXES = (".png", ".jpg", ".bmp", ".tga", ".tif", ".webp", ".exr", ".hdr", ".npy")
_REPAIRED = 0x80

_PIXELS = np.arange(5 * 9 * 4, dtype=np.uint8).reshape(5, 9, 4)


def pillow_files() -> Iterator[tuple[str, bytes]]:
    """Small files of every mode that each format has."""
    rgba = PIL.Image.fromarray(_PIXELS)
    deep = PIL.Image.fromarray(np.arange(45, dtype=np.uint16).reshape(5, 9) * 1000)
    for suffix, name, modes, options in (
        (".png", "PNG", ("1", "L", "LA", "P", "RGB", "RGBA"), {}),
        (".jpg", "JPEG", ("L", "RGB", "CMYK"), {}),
        (".jpg", "JPEG", ("RGB",), {"progressive": True}),
        (".bmp", "BMP", ("1", "L", "P", "RGB"), {}),
        (".tga", "TGA", ("L", "RGB", "RGBA"), {"compression": "tga_rle"}),
        (".tif", "TIFF", ("1", "L", "P", "RGBA", "F"), {}),
        (".tif", "TIFF", ("RGB",), {"compression": "tiff_lzw"}),
        (".tif", "TIFF", ("RGB",), {"compression": "tiff_deflate"}),
        (".webp", "WEBP", ("RGB", "RGBA"), {"lossless": True}),
        (".webp", "WEBP", ("RGB",), {}),
    ):
        for mode in modes:
            file = io.BytesIO()
            (rgba.convert("L").convert(mode) if mode == "F" else rgba.convert(mode)).save(file, name, **options)
            yield suffix, file.getvalue()
    for suffix, name in ((".png", "PNG"), (".tif", "TIFF")):
        file = io.BytesIO()
        deep.save(file, name)
        yield suffix, file.getvalue()


def exr_files() -> Iterator[bytes]:
    values = np.linspace(0, 1, 4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    planes = {name: np.ascontiguousarray(values[..., number]) for number, name in enumerate("RGB")}
    for compression in ("NO", "RLE", "ZIP", "PIZ", "PXR24", "B44A", "DWAA"):
        header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
        file = io.BytesIO()
        OpenEXR.File(header, {name: plane.astype(np.float16) for name, plane in planes.items()}).write(file)
        yield file.getvalue()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    file = io.BytesIO()
    OpenEXR.File(header, {"Y": planes["R"], "depth.Z": planes["G"].astype(np.uint32)}).write(file)
    yield file.getvalue()


def seeds() -> Iterator[bytes]:
    for suffix, data in pillow_files():
        yield bytes([SUFFIXES.index(suffix) | _REPAIRED]) + data
    for data in exr_files():
        yield bytes([SUFFIXES.index(".exr")]) + data
    values = np.linspace(0, 2, 2 * 9 * 3).reshape(2, 9, 3)
    for data in (hdr.encode(values, {"a": "b"}), hdr.encode(values[:, :3], {})):
        yield bytes([SUFFIXES.index(".hdr")]) + data
    for array in (values, _PIXELS, values[..., 0].astype(np.float32)):
        yield bytes([SUFFIXES.index(".npy")]) + npy(array)
    header = b"{'descr': '<u2', 'fortran_order': True, 'shape': (2, 3), }\x00"
    yield bytes([SUFFIXES.index(".npy") | _REPAIRED]) + header + bytes(range(12))


def run(data: bytes, folder: Path) -> None:
    choice, data = data[0] if data else 0, data[1:]
    suffix = SUFFIXES[(choice & ~_REPAIRED) % len(SUFFIXES)]
    if choice & _REPAIRED and suffix == ".png":
        data = with_sums(data)
    elif choice & _REPAIRED and suffix == ".npy":
        data = with_header(*data.partition(b"\x00")[::2])
    try:
        image = decode_image(data, suffix)
    except ValueError as error:
        raise InputError(str(error)) from error
    height, width, channels = image.texels.shape
    assert 0 < height * width <= MAX_PIXELS
    assert channels in (1, 2, 3, 4)
    assert image.texels.dtype in (np.uint8, np.float32)
    assert image.texels.dtype == np.uint8 or np.isfinite(image.texels).all()
