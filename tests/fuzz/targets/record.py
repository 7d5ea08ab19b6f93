"""What a sweep has written down of a point, and goes by when it goes on."""

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

from raytracer.analysis.sweep.manifest import RECORDS, load_record, to_csv, to_json, write_record
from raytracer.analysis.sweep.results import Axis, PointResult, Sweep, SweepPoint

DICTIONARY = (b'"inf"', b'"done"', b'"status"', b'"warnings"', b'"seconds"', b'"sha256"', b"NaN", b"1e999", b"null")

_POINT = SweepPoint((0,), {"camera.vfov": 40}, "vfov=40", "0" * 8)


def seeds() -> Iterator[bytes]:
    numbers = {"relative": 0.01, "low": 0.009, "high": 0.011}
    full = {"camera": {"f_number": math.inf}, "exposure": {"ev": 3.0}, "seconds": {"total": 1.5}, "error": numbers}
    for rest in ({}, {**full, "samples": 16.0, "rays": 1000, "warnings": ("a sentence",)}):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / RECORDS).mkdir()
            write_record(PointResult(_POINT, "done", **rest), Path(folder))
            yield (Path(folder) / RECORDS / f"{_POINT.name}.json").read_bytes()


def run(data: bytes, folder: Path) -> None:
    (folder / RECORDS).mkdir()
    (folder / RECORDS / f"{_POINT.name}.json").write_bytes(data)
    found = load_record(_POINT, (), folder)
    if found is not None:
        assert found.point is _POINT
        # All of it can be told.
        sweep = Sweep("scene.yaml", (Axis("camera.vfov", (40,), ("40",)),), False, (found,))
        to_csv(sweep)
        to_json(sweep)
