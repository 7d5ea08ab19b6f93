"""Manifests of a sweep, as JSON and CSV with a row for each point, and records of the points that are done.

Times are in seconds, the error is a fraction, other numbers are in the units that their names end in; an infinite
number is the string "inf", since JSON has none.

A record holds digests of the input of a point and of its files, so that the next sweep can resume after this one was
ended at any moment.
"""

import hashlib
import json
import sys
from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from raytracer import __version__
from raytracer.analysis.sweep.results import PointResult, Sweep, SweepPoint
from raytracer.report.page import to_plain
from raytracer.report.table import csv_text
from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import OutputError
from raytracer.util.safe_open import open_regular, read_regular

RECORDS = "points"
"""Folder, within that of a sweep, of the records."""

JSON = "manifest.json"
CSV = "manifest.csv"

_LARGEST_RECORD = 1 << 24
"""Most bytes of a record, which has two thousand of them and a sentence for each warning."""

# Fields of a result but its point.
_FIELDS = [f.name for f in fields(PointResult) if f.name != "point"]


def _result_fields(result: PointResult) -> dict[str, Any]:
    """Return the fields of a result but its point."""
    return {name: to_plain(getattr(result, name)) for name in _FIELDS}


# ---- Manifests


def to_json(sweep: Sweep) -> dict[str, Any]:
    """Convert all of a sweep but its images to what `json.dumps` takes with `allow_nan=False`."""
    return {
        "scene": sweep.scene,
        "version": __version__,
        "zipped": sweep.zipped,
        "interrupted": sweep.interrupted,
        "axes": [to_plain(axis._asdict()) for axis in sweep.axes],
        "points": [
            {
                "name": result.point.name,
                "index": list(result.point.index),
                "values": to_plain(result.point.values),
                "digest": result.point.digest,
                **_result_fields(result),
            }
            for result in sweep.results
        ],
    }


def to_csv(sweep: Sweep) -> str:
    """Write one row for each point; a cell is empty where nothing is known.

    Columns named after a key of the scene hold the values of axes; `f_number`, `hfov_deg` etc. are the camera's.
    """
    camera = dict.fromkeys(name for result in sweep.results for name in result.camera)
    exposure = dict.fromkeys(name for result in sweep.results for name in result.exposure)
    header = ["name", *(axis.key for axis in sweep.axes), "status", "file", "seconds", "render_seconds", "samples"]
    header += ["relative_error", "relative_error_low", "relative_error_high", "nan_samples"]
    header += [*camera, *(f"exposure.{name}" for name in exposure), "reason"]
    rows = []
    for result in sweep.results:
        is_done = result.status == "done"
        row = [result.point.name, *(result.point.values[axis.key] for axis in sweep.axes), result.status]
        row += [result.files[0] if result.files else None]
        row += [result.seconds.get("total"), result.seconds.get("render"), result.samples if is_done else None]
        row += [result.error.get(name) for name in ("relative", "low", "high")]
        row += [result.nan_samples if is_done else None]
        row += [result.camera.get(name) for name in camera] + [result.exposure.get(name) for name in exposure]
        rows.append(to_plain([*row, result.reason]))
    return csv_text(header, rows)


def write_manifest(sweep: Sweep, folder: Path) -> None:
    """Write both manifests.

    Raises
    ------
    OutputError : one cannot be written.
    """
    write_bytes(folder / CSV, to_csv(sweep).encode())
    write_bytes(folder / JSON, _encode_json(to_json(sweep)))


def _encode_json(value: Any) -> bytes:
    return (json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n").encode()


# ---- Records


def write_record(result: PointResult, folder: Path) -> None:
    """Write the record of a point whose files are written.

    Raises
    ------
    OutputError : it, or one of its files, cannot be written or read.
    """
    hashes = {name: _hash(folder / name) for name in result.files}
    if None in hashes.values():
        raise OutputError(f"{folder / result.files[0]}: has gone while the sweep was at work")
    record = {"digest": result.point.digest, "sha256": hashes, **_result_fields(result)}
    write_bytes(folder / RECORDS / f"{result.point.name}.json", _encode_json(record))


def load_record(point: SweepPoint, files: Sequence[str], folder: Path) -> PointResult | None:
    """Load the result of a point of an earlier sweep, if that had the same input and its files are unchanged."""
    try:
        record = json.loads(read_regular(folder / RECORDS / f"{point.name}.json", _LARGEST_RECORD))
        is_same = record["digest"] == point.digest and record["status"] == "done"
        if not is_same or any(_hash(folder / name) != record["sha256"][name] for name in files):
            return None
        known = {name: record[name] for name in _FIELDS}
        return _validator().validate_python({**known, "point": point, "files": tuple(files)})
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        # It is missing or broken: the point is rendered again.
        return None


@cache
def _validator() -> TypeAdapter[PointResult]:
    """Return what converts the values of JSON to those of a result: "inf" is a number."""
    return TypeAdapter(PointResult)


def _hash(path: Path) -> str | None:
    try:
        with open_regular(path, sys.maxsize) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
