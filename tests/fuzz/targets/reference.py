"""References of `rt check`: .npz."""

import io
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from raytracer.analysis.regression.reference_file import Recipe, load_reference, save_reference

PARSERS = ("zipfile",)
DICTIONARY = (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06", b"\x93NUMPY", b"'shape': (", b"'<U9'", b'"gains"', b'"spp"')


def seeds() -> Iterator[bytes]:
    mean = np.random.default_rng(1).random((2, 3, 3))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "seed.npz")
        for gains in (None, (1.0, 2.0, 0.5)):
            save_reference(
                path, mean, mean, Recipe("ball.yaml", {"camera.vfov": 40}, 16, 1, "0.1", {"a": "b"}, 0, gains)
            )
            yield path.read_bytes()
        # Not packed, what is in the arrays is reached by changes of single bytes.
        with np.load(path) as held, path.with_suffix(".plain").open("wb") as plain:
            np.savez(plain, **held)
        yield path.with_suffix(".plain").read_bytes()


def _summed(data: bytes) -> bytes:
    """With the checksums that the list of files states as they should be, where files are not packed."""
    found = bytearray(data)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for member in archive.infolist():
                start = member.header_offset + 30 + len(member.filename) + len(member.extra)
                start = data.find(b"\x93NUMPY", member.header_offset) if member.compress_type == 0 else start
                crc = zlib.crc32(data[start : start + member.file_size]).to_bytes(4, "little")
                at = found.rfind(b"PK\x01\x02", 0, found.rfind(member.filename.encode()))
                if member.compress_type == 0 and at >= 0:
                    found[at + 16 : at + 20] = found[member.header_offset + 14 : member.header_offset + 18] = crc
    except Exception:  # noqa: BLE001
        return data
    return bytes(found)


def run(data: bytes, folder: Path) -> None:
    path = folder / "given.npz"
    path.write_bytes(_summed(data))
    found = load_reference(path)
    assert found.mean.ndim == 3
    assert found.mean.shape == found.variance.shape
    assert found.mean.shape[2] == 3
    assert (found.variance >= 0.0).all()
    assert 1 <= found.recipe.spp < 2**31
    assert 0 <= found.recipe.seed < 2**32
