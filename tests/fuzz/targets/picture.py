"""Pictures as they are compared; the first byte chooses the suffix and what is asked for."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.film import load, load_layers
from raytracer.film.formats import hdr
from raytracer.film.formats.base.image_format import MAX_PIXELS
from raytracer.film.formats.registry import display_suffixes, image_suffixes
from raytracer.film.image_file import load_encoded
from tests.fuzz.targets import image as images
from tests.fuzz.targets._parts import npy, with_header, with_sums

MAX_LENGTH = 2048
DICTIONARY = images.DICTIONARY
_REPAIRED, _OTHERWISE = 0x80, 0x40


def seeds() -> Iterator[bytes]:
    for suffix, data in images.pillow_files():
        if suffix in image_suffixes():
            yield bytes([image_suffixes().index(suffix) | _REPAIRED]) + data
    exr = image_suffixes().index(".exr")
    for data in images.exr_files():
        yield bytes([exr]) + data
        yield bytes([exr | _OTHERWISE]) + data
    values = np.linspace(0, 2, 2 * 9 * 3).reshape(2, 9, 3)
    yield bytes([image_suffixes().index(".hdr")]) + hdr.encode(values, {"EXPOSURE": "2"})
    yield bytes([image_suffixes().index(".npy")]) + npy(values)
    yield (
        bytes([image_suffixes().index(".npy") | _REPAIRED])
        + b"{'descr': '<f2', 'fortran_order': True, 'shape': (1, 2, 3), }\x00"
        + bytes(12)
    )


def run(data: bytes, folder: Path) -> None:
    choice, data = data[0] if data else 0, data[1:]
    suffix = image_suffixes()[(choice & 0x3F) % len(image_suffixes())]
    if choice & _REPAIRED and suffix == ".png":
        data = with_sums(data)
    elif choice & _REPAIRED and suffix == ".npy":
        data = with_header(*data.partition(b"\x00")[::2])
    path = folder / f"a{suffix}"
    path.write_bytes(data)
    if choice & _OTHERWISE and suffix == ".exr":
        layers, settings = load_layers(path)
        assert all(layer.dtype == np.float64 and layer.ndim in (2, 3) for layer in layers.values())
        assert all(isinstance(value, str) for value in settings.values())
        return
    found = load_encoded(path) if choice & _OTHERWISE and suffix in display_suffixes() else load(path)
    height, width, channels = found.shape
    assert found.dtype == np.float64
    assert channels == 3
    assert 0 < height * width <= MAX_PIXELS
