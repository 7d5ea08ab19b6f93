"""A sweep as data: `manifest.json` and `manifest.csv` with a row for each point, and a record of each that is done.

Times are in seconds, the error is a fraction, other numbers are in the units that their names end in; what is infinite
is the text "inf", for which JSON has no number.

A record says what a point's picture was made from and what its files hold, so that a sweep that was ended at any moment
is known to the next one, point by point.
"""

import csv
import hashlib
import io
import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

from pydantic import TypeAdapter

from raytracer import __version__
from raytracer.errors import OutputError
from raytracer.film.output import write_bytes
from raytracer.sweeping.points import Point, Sweep, Taken
from raytracer.untrusted import contents, opened

RECORDS = "points"
"""Folder, within that of a sweep, of the records."""

JSON = "manifest.json"
CSV = "manifest.csv"

_LARGEST_RECORD = 1 << 24
"""Bytes of a record, which has two thousand of them and a sentence for each warning."""

_INFINITE = {"inf": math.inf, "-inf": -math.inf}


def plain(value: Any) -> Any:
    """Texts, numbers, lists and dicts alone, as JSON has them."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def _found(taken: Taken) -> dict[str, Any]:
    """What is known of a point besides what it is."""
    return {f.name: plain(getattr(taken, f.name)) for f in fields(Taken) if f.name != "point"}


# ---- What a sweep tells


def to_json(sweep: Sweep) -> dict[str, Any]:
    """All of a sweep but its pictures, as `json.dumps` takes it with `allow_nan=False`."""
    return {
        "scene": sweep.scene,
        "version": __version__,
        "zipped": sweep.zipped,
        "interrupted": sweep.interrupted,
        "axes": [plain(axis._asdict()) for axis in sweep.axes],
        "points": [
            {
                "name": taken.point.name,
                "index": list(taken.point.index),
                "values": plain(taken.point.values),
                "digest": taken.point.digest,
                **_found(taken),
            }
            for taken in sweep.taken
        ],
    }


def to_csv(sweep: Sweep) -> str:
    """One row a point; a cell is empty where nothing is known.

    Columns that are called as a key of the scene hold the values of axes; `f_number`, `hfov_deg` etc. are the camera's.
    """
    camera = _names(taken.camera for taken in sweep.taken)
    exposure = _names(taken.exposure for taken in sweep.taken)
    header = ["name", *(axis.key for axis in sweep.axes), "status", "file", "seconds", "render_seconds", "samples"]
    header += ["relative_error", "relative_error_low", "relative_error_high", "nan_samples"]
    header += camera + [f"exposure.{name}" for name in exposure] + ["reason"]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for taken in sweep.taken:
        is_done = taken.status == "done"
        row = [taken.point.name, *(taken.point.values[axis.key] for axis in sweep.axes), taken.status]
        row += [taken.files[0] if taken.files else None]
        row += [taken.seconds.get("total"), taken.seconds.get("render"), taken.samples if is_done else None]
        row += [taken.error.get(name) for name in ("relative", "low", "high")]
        row += [taken.nan_samples if is_done else None]
        row += [taken.camera.get(name) for name in camera] + [taken.exposure.get(name) for name in exposure]
        writer.writerow([_cell(value) for value in [*row, taken.reason]])
    return text.getvalue()


def _names(dicts: Iterable[Mapping[str, float]]) -> list[str]:
    """The names of all, each once, in the order in which they first are there."""
    return list(dict.fromkeys(name for numbers in dicts for name in numbers))


def _cell(value: Any) -> Any:
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    return json.dumps(plain(value)) if isinstance(value, (list, tuple, Mapping)) else value


def write_manifest(sweep: Sweep, folder: Path) -> None:
    """Write both manifests.

    Raises
    ------
    OutputError : one cannot be written.
    """
    write_bytes(folder / CSV, to_csv(sweep).encode())
    write_bytes(folder / JSON, _encoded(to_json(sweep)))


def _encoded(value: Any) -> bytes:
    return (json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n").encode()


# ---- Records


def write_record(taken: Taken, folder: Path) -> None:
    """Keep what became of a point whose files are written.

    Raises
    ------
    OutputError : it, or one of its files, cannot be written or read.
    """
    hashes = {name: _hash(folder / name) for name in taken.files}
    if None in hashes.values():
        raise OutputError(f"{folder / taken.files[0]}: has gone while the sweep was at work")
    record = {"digest": taken.point.digest, "sha256": hashes, **_found(taken)}
    write_bytes(folder / RECORDS / f"{taken.point.name}.json", _encoded(record))


def find_record(point: Point, files: Sequence[str], folder: Path) -> Taken | None:
    """What became of a point in an earlier sweep, if that had the same input and its files are still what they were."""
    try:
        record = json.loads(contents(folder / RECORDS / f"{point.name}.json", _LARGEST_RECORD))
        is_same = record["digest"] == point.digest and record["status"] == "done"
        if not is_same or any(_hash(folder / name) != record["sha256"][name] for name in files):
            return None
        known = {name: kind.validate_python(_read(record[name])) for name, kind in _kinds().items()}
        return Taken(point=point, **{**known, "files": tuple(files)})
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        # None there, or broken: the point is rendered once more.
        return None


@cache
def _kinds() -> Mapping[str, TypeAdapter[Any]]:
    """What can be told of a point, by name, and of what type each is."""
    hints = get_type_hints(Taken)
    return {f.name: TypeAdapter(hints[f.name]) for f in fields(Taken) if f.name != "point"}


def _read(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _INFINITE.get(item, item) if isinstance(item, str) else item for key, item in value.items()}
    return value


def _hash(path: Path) -> str | None:
    try:
        with opened(path, sys.maxsize) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
