"""A sweep as one page of HTML: a slider for each key, the numbers of each point, and a wipe between two of them."""

import math
import os
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import pages
from raytracer.film.output import write_bytes
from raytracer.sweeping.manifest import CSV, JSON
from raytracer.sweeping.points import Sweep, Taken
from raytracer.sweeping.sheet import SHEET
from raytracer.sweeping.sliders import Images, extent, short_names, sliders, title_of

PAGE = "index.html"

# Up to so many pixels together every picture is in the page as it is; a browser holds 4 bytes of each.
_EXACT_PIXELS = 16e6
_MOST_PIXELS = 400e6
_QUALITY = 90

_MEDIA_TYPES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg"}

# The overview's pictures: those that are little wider are their own.
_THUMB_WIDTH = 320
_THUMB_QUALITY = 85

_UNIT = re.compile(r"(.+)_(deg|mm|um|m|s|px)")
_WORDS = {
    "airy_disc": "Airy disc",
    "hyperfocal": "hyperfocal distance",
    "pixel_at_1m": "pixel at 1 m",
    "samples": "samples a pixel",
    "error": "relative error",
    "render_seconds": "time to render",
    "seconds": "time in all",
    "nan_samples": "samples dropped",
    "ev100": "EV100",
    "iso": "ISO",
    "hfov": "horizontal field of view",
    "vfov": "vertical field of view",
    "dfov": "diagonal field of view",
    "f_number": "f-number",
}
_UNITS = {"error": "%", "render_seconds": "s", "seconds": "s"}
_DIGITS = 4


def numbers(taken: Taken) -> dict[str, float]:
    """A point's numbers by name, those of its picture first; the error is in percent."""
    if taken.status != "done":
        return {}
    told: dict[str, float] = {"samples": taken.samples}
    if "relative" in taken.error:
        told["error"] = 100.0 * taken.error["relative"]
    for name, phase in (("render_seconds", "render"), ("seconds", "total")):
        if phase in taken.seconds:
            told[name] = taken.seconds[phase]
    told |= {"rays": taken.rays, "nan_samples": taken.nan_samples}
    # Of metered pictures the exposure knows the sensitivity, which the camera's own EV100 takes for ISO 100.
    return told | taken.exposure | taken.camera | taken.exposure


class _Shown(NamedTuple):
    """A picture as the page holds it, a smaller one of it where that is worth it, and its size."""

    picture: str
    thumb: str | None
    size: tuple[int, int]


def page(sweep: Sweep, images: Images) -> bytes:
    """The page as HTML (UTF-8).

    Pictures are in it as they are, up to 16 million pixels together; beyond that with the losses of a WebP of quality
    90, and so much smaller that they are at most 400 million.  The page says so.
    """
    chosen = sliders(sweep.axes, zipped=sweep.zipped)
    shown, note = _pictures(sweep, images)
    size = next((entry.size for entry in shown if entry is not None), (320, 180))
    data = {
        "scene": title_of(sweep),
        "extent": extent(sweep),
        "notes": [*_notes(sweep), *note],
        "axes": [slider._asdict() for slider in chosen],
        "columns": _columns(sweep.taken),
        "points": [_point(taken, entry, len(chosen)) for taken, entry in zip(sweep.taken, shown, strict=True)],
        "size": size,
        "files": [] if sweep.folder is None else [CSV, JSON, SHEET],
    }
    title = f"{title_of(sweep)}: {', '.join(short_names([axis.key for axis in sweep.axes]))}"
    return pages.page("sweep", title, data, parts=("wipe",))


def write_page(sweep: Sweep, images: Images) -> Path:
    """Write the page into the sweep's folder, beside its images.

    Returns
    -------
    The file.

    Raises
    ------
    ValueError : the sweep has no folder.
    OutputError : the file cannot be written.
    """
    if sweep.folder is None:
        raise ValueError("a sweep in memory has no folder for a page")
    path = sweep.folder / PAGE
    write_bytes(path, page(sweep, images))
    return path


def _point(taken: Taken, shown: _Shown | None, axes: int) -> dict[str, Any]:
    return {
        "index": taken.point.index[:axes],
        "name": taken.point.name,
        "status": taken.status,
        "reason": taken.reason,
        "warnings": taken.warnings,
        "picture": shown and shown.picture,
        "thumb": shown and shown.thumb,
        "files": taken.files,
        "numbers": numbers(taken),
    }


def _columns(taken: Sequence[Taken]) -> list[dict[str, Any]]:
    """How numbers are said, in the order in which points name them."""
    keys = dict.fromkeys(key for point in taken for key in numbers(point))
    if not any(point.nan_samples for point in taken):
        keys.pop("nan_samples", None)
    return [_column(key) for key in keys]


def _column(key: str) -> dict[str, Any]:
    match = _UNIT.fullmatch(key)
    name, unit = match.groups() if match else (key, _UNITS.get(key, ""))
    return {
        "key": key,
        "words": _WORDS.get(name, name.replace("_", " ")),
        "unit": "\u00b0" if unit == "deg" else "\u00b5m" if unit == "um" else unit,
        "digits": 3 if key in _UNITS else _DIGITS,
    }


def _notes(sweep: Sweep) -> list[str]:
    count = len(sweep.taken)
    failed, missing = (sum(taken.status == status for taken in sweep.taken) for status in ("failed", "missing"))
    notes = []
    if failed:
        notes.append(f"{failed} of {count} points failed.")
    if missing:
        notes.append(f"The sweep was ended early, with {missing} of {count} points to go.")
    return notes


def _pictures(sweep: Sweep, images: Images) -> tuple[list[_Shown | None], list[str]]:
    """The points' pictures as the page holds them, and what is to be said of that."""
    done = [taken for taken in sweep.taken if taken.status == "done"]
    first = next((picture for picture in map(images, done) if picture is not None), None)
    if first is None:
        return [None] * len(sweep.taken), []
    pixels = float(first.shape[0] * first.shape[1] * len(done))
    scale = min(1.0, math.sqrt(_MOST_PIXELS / pixels))
    exact = pixels <= _EXACT_PIXELS

    def shown(taken: Taken) -> _Shown | None:
        picture = images(taken)
        if picture is None:
            return None
        if exact:
            return _Shown(_file_of(sweep, taken) or pages.webp(picture), _thumb(picture), _size(picture))
        picture = _resized(picture, max(1, round(scale * picture.shape[1])))
        return _Shown(pages.webp(picture, _QUALITY), _thumb(picture), _size(picture))

    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as threads:
        entries = list(threads.map(shown, sweep.taken))
    if exact:
        return entries, []
    smaller = f"scaled to {100.0 * scale:.0f} % and " if scale < 1.0 else ""
    return entries, [f"To be held by a browser, the pictures on this page are {smaller}compressed; the files are not."]


def _file_of(sweep: Sweep, taken: Taken) -> str | None:
    """The point's file as an address, if browsers can show it: it is there, and encoding it anew takes its time."""
    if sweep.folder is None or not taken.files:
        return None
    path = sweep.folder / taken.files[0]
    media_type = _MEDIA_TYPES.get(path.suffix.lower())
    return media_type and pages.data_uri(path.read_bytes(), media_type)


def _thumb(picture: NDArray[np.uint8]) -> str | None:
    if picture.shape[1] <= 1.25 * _THUMB_WIDTH:
        return None
    return pages.webp(_resized(picture, _THUMB_WIDTH), _THUMB_QUALITY)


def _size(picture: NDArray[np.uint8]) -> tuple[int, int]:
    return picture.shape[1], picture.shape[0]


def _resized(picture: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    import PIL.Image

    if width == picture.shape[1]:
        return picture
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    with PIL.Image.fromarray(picture) as image:
        return np.asarray(image.resize((width, height), PIL.Image.Resampling.LANCZOS))
