"""`.lf` files: HDF5, of this program and of others that write the older forms of it."""

import io
import math
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.views import Plane, Pose, Views

MAX_LENGTH = 16384
# HDF5 makes room for a header of a size of 32 bits before it looks whether the file has so much; it is not written to.
ADDRESS_LIMIT = 2**33

DICTIONARY = (b"OHDR", b"TREE", b"HEAP", b"SNOD", b"FRHP", b"BTHD", b"FADB", b"OCHK", b"GCOL", b"radiance", b"position")

_MOST_BYTES = 2**24
"""That are read of a file's arrays: each is asked for by parts, as programs do."""


def seeds() -> Iterator[bytes]:
    for rows, columns, extra in ((2, 2, False), (1, 1, True)):
        position = np.zeros((rows, columns, 2))
        position[..., 0] = np.arange(columns)
        position[..., 1] = -np.arange(rows)[:, None]
        pose = Pose((0.0, 1.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)) if extra else None
        views = Views(position, Plane(0.1, -0.2, 0.2), 4, 4, 0.5, (0.1, 0.1) if extra else None, pose=pose)
        layers = {"depth": np.ones((rows, columns, 4, 4)), "id": np.ones((rows, columns, 4, 4, 2), np.uint16)}
        rays = Rays(np.zeros((3, 4)), np.ones((3, 3)), np.ones(3)) if extra else None
        radiance = np.random.default_rng(1).random((rows, columns, 4, 4, 3))
        field = LightField(radiance, views, layers if extra else {}, rays, {"spp": 16, "scene": "ball", "gain": 0.5})
        for compress in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                lf.write(Path(folder, "seed.lf"), field, compress=compress)
                yield Path(folder, "seed.lf").read_bytes()
        yield _plainly(field)


def _plainly(field: LightField) -> bytes:
    """The oldest form of HDF5, which other programs write and which has no checksums: mistakes in it get farther."""
    held, views = io.BytesIO(), field.views
    with h5py.File(held, "w", libver="earliest") as file:
        numbers = {**views.plane._asdict(), "inverse_focus": views.inverse_focus}
        for name, value in {"format": np.bytes_(lf.FORMAT), "version": 1, **numbers}.items():
            file.attrs[name] = value
        file["position"] = views.position
        file.create_dataset("radiance", data=field.radiance, chunks=(1, 1, 4, 4, 3), dtype="f4", compression="gzip")
        for name, layer in field.layers.items():
            file[f"layers/{name}"] = layer
        for name, part in (field.rays._asdict() if field.rays else {}).items():
            file[f"rays/{name}"] = part
        for name, setting in field.settings.items():
            file.require_group("settings").attrs[name] = np.bytes_(setting) if isinstance(setting, str) else setting
    return held.getvalue()


def run(data: bytes, folder: Path) -> None:
    path = folder / "given.lf"
    path.write_bytes(_summed(data))
    with lf.open(path) as field:
        views = field.views
        assert field.radiance.shape == (views.rows, views.columns, views.height, views.width, 3)
        assert np.isfinite(views.position).all()
        assert views.position.nbytes <= 1100 * len(data)
        for value in field.settings.values():
            assert isinstance(value, str | int | float)
        for array in (field.radiance, *field.layers.values()):
            for at in ((0, 0), (-1, -1)):
                view = array[at][: max(1, _MOST_BYTES // max(1, math.prod(array.shape[3:]) * array.dtype.itemsize))]
                assert view.shape[1:] == array.shape[3:]
        for part in field.rays or ():
            assert len(part[:1000]) <= 1000


# ---- Checksums


def _summed(data: bytes) -> bytes:
    """With the checksums of the superblock and of object headers as they should be: who means harm gets these right."""
    found = bytearray(data)
    if len(found) >= 48 and found[:8] == b"\x89HDF\r\n\x1a\n" and found[8] in (2, 3):
        found[44:48] = struct.pack("<I", lookup3(bytes(found[:44])))
    at = found.find(b"OHDR")
    while at >= 0:
        _sum_header(found, at)
        at = found.find(b"OHDR", at + 4)
    return bytes(found)


def _sum_header(found: bytearray, at: int) -> None:
    """An object header of version 2: signature, version, flags, times and limits if there are any, size of messages."""
    if at + 6 > len(found):
        return
    flags = found[at + 5]
    start = at + 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
    width = 1 << (flags & 3)
    end = start + width + int.from_bytes(found[start : start + width], "little")
    if end + 4 <= len(found):
        found[end : end + 4] = struct.pack("<I", lookup3(bytes(found[at:end])))


def lookup3(data: bytes) -> int:
    """Bob Jenkins' hash "lookup3" (`hashlittle`, initial value 0), which HDF5's metadata are summed by."""
    a = b = c = (0xDEADBEEF + len(data)) & 0xFFFFFFFF
    if not data:
        return c
    padded = data + bytes(-len(data) % 12)
    words = struct.unpack(f"<{len(padded) // 4}I", padded)
    for i in range(0, len(words) - 3, 3):
        a, b, c = a + words[i], b + words[i + 1], c + words[i + 2]
        for turn in (4, 6, 8, 16, 19, 4):
            a = ((a - c) ^ _turned(c, turn)) & 0xFFFFFFFF
            c = (c + b) & 0xFFFFFFFF
            a, b, c = b, c, a
    a, b, c = ((x + y) & 0xFFFFFFFF for x, y in zip((a, b, c), words[-3:], strict=True))
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _turned(b, turn)) & 0xFFFFFFFF
        a, b, c = b, c, a
    return b


def _turned(value: int, bits: int) -> int:
    value &= 0xFFFFFFFF
    return (value << bits | value >> (32 - bits)) & 0xFFFFFFFF
