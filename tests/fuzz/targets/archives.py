"""What renders and sweeps have written down and go on from: checkpoints, references, and records of points."""

import io
import json
import math
import tempfile
import zipfile
import zlib
from pathlib import Path

import numpy as np

from raytracer.analysis.regression.reference_file import Recipe, load_reference, save_reference
from raytracer.analysis.sweep.manifest import RECORDS, load_record, to_csv, to_json, write_record
from raytracer.analysis.sweep.results import Axis, PointResult, Sweep, SweepPoint
from raytracer.util import array_snapshot
from raytracer.util.array_snapshot import DamagedError
from tests.fuzz.harness import target

# ---- Checkpoints

_SIZE = (2, 3)
_ABOUT = {"format": 1, "identity": {"scene": {"camera": {"vfov": 40.0}}, "seed": 1}, "told": {"seconds": 1.5}}


def _arrays():
    rng = np.random.default_rng(1)
    return {"mean": rng.random((*_SIZE, 3)), "count": np.full(_SIZE, 16, np.int64), "rays": rng.random((*_SIZE, 2))}


def _checkpoints():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "seed.checkpoint")
        for about, arrays in ((_ABOUT, _arrays()), ({}, {"count": np.zeros(_SIZE, np.int64)})):
            array_snapshot.write(path, about, arrays, keep=False)
            yield path.read_bytes()


def _summed(data):
    """With the checksums of files that are not packed as they should be: who means harm gets these right."""

    def number(at, length):
        return int.from_bytes(data[at : at + length], "little")

    found = bytearray(data)
    at = data.find(b"PK\x01\x02")
    while 0 <= at <= len(data) - 46:
        size, place = number(at + 20, 4), number(at + 42, 4)
        start = place + 30 + number(place + 26, 2) + number(place + 28, 2)
        if number(at + 10, 2) == zipfile.ZIP_STORED and start <= len(data):
            crc = zlib.crc32(data[start : start + size]).to_bytes(4, "little")
            found[at + 16 : at + 20] = found[place + 14 : place + 18] = crc
        at = data.find(b"PK\x01\x02", at + 4)
    return bytes(found)


_WORDS = "PK\x01\x02~PK\x03\x04~PK\x05\x06~PK\x06\x06~\udc93NUMPY~'shape': (~about.json"


# Python's reader of ZIP files makes room for a list of files of 32 bits' size before it looks whether there is so much.
@target("checkpoint", seeds=_checkpoints, address_limit=2**33, words=_WORDS)
def load_checkpoint(data, folder):
    path = folder / "given.checkpoint"
    for content in (data, _summed(data)):
        path.write_bytes(content)
        targets = {name: np.full_like(array, -1) for name, array in _arrays().items()}

        def accept(about, targets=targets):
            assert isinstance(about, dict)
            return targets

        try:
            about = array_snapshot.read(path, accept)
        except DamagedError:
            continue
        # What a checksum lets through is what was written: another list of files, or none of it.
        if content is data and about == json.loads(json.dumps(_ABOUT)):
            listed = zipfile.ZipFile(path).infolist()
            assert all(np.array_equal(targets[name], array) for name, array in _arrays().items()), listed


# ---- References of `rt check`


def _references():
    mean = np.random.default_rng(1).random((2, 3, 3))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "seed.npz")
        for gains in (None, (1.0, 2.0, 0.5)):
            recipe = Recipe("ball.yaml", {"camera.vfov": 40}, 16, 1, "0.1", {"a": "b"}, 0, gains)
            save_reference(path, mean, mean, recipe)
            yield path.read_bytes()
        # Not packed, what is in the arrays is reached by changes of single bytes.
        plain = io.BytesIO()
        with np.load(path) as held:
            np.savez(plain, **held)
        yield plain.getvalue()


_WORDS = "PK\x01\x02~PK\x03\x04~PK\x05\x06~\udc93NUMPY~'shape': (~'<U9'~\"gains\"~\"spp\""


@target("reference", seeds=_references, words=_WORDS)
def load_npz(data, folder):
    path = folder / "given.npz"
    path.write_bytes(_summed(data))
    found = load_reference(path)
    assert found.mean.shape == (*found.variance.shape[:2], 3)
    assert (found.variance >= 0.0).all()
    assert 1 <= found.recipe.spp < 2**31
    assert 0 <= found.recipe.seed < 2**32


# ---- Records

_POINT = SweepPoint((0,), {"camera.vfov": 40}, "vfov=40", "0" * 8)


def _records():
    numbers = {"relative": 0.01, "low": 0.009, "high": 0.011}
    full = {"camera": {"f_number": math.inf}, "exposure": {"ev": 3.0}, "seconds": {"total": 1.5}, "error": numbers}
    for rest in ({}, {**full, "samples": 16.0, "rays": 1000, "warnings": ("a sentence",)}):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / RECORDS).mkdir()
            write_record(PointResult(_POINT, "done", **rest), Path(folder))
            yield (Path(folder) / RECORDS / f"{_POINT.name}.json").read_bytes()


_WORDS = '"inf"~"done"~"status"~"warnings"~"seconds"~"sha256"~NaN~1e999~null'


@target("record", seeds=_records, words=_WORDS)
def load_point(data, folder):
    """What a sweep has written down of a point, and goes by when it goes on."""
    (folder / RECORDS).mkdir()
    (folder / RECORDS / f"{_POINT.name}.json").write_bytes(data)
    found = load_record(_POINT, (), folder)
    if found is not None:
        assert found.point is _POINT
        # All of it can be told.
        sweep = Sweep("scene.yaml", (Axis("camera.vfov", (40,), ("40",)),), False, (found,))
        to_csv(sweep)
        to_json(sweep)
