"""HTML page of a sweep: a slider for each key, the numbers of each point, and a wipe between two images."""

import math
import os
import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.sweep.contact_sheet import SHEET
from raytracer.analysis.sweep.manifest import CSV, JSON
from raytracer.analysis.sweep.results import Images, PointResult, Sweep, short_names
from raytracer.film.formats.registry import image_formats
from raytracer.report import page as html

PAGE = "index.html"

# Pixels together up to which every image is in the page losslessly, and at most; a browser takes 4 bytes for each.
_EXACT_PIXELS = 16e6
_MOST_PIXELS = 400e6
_QUALITY = 90

# Thumbnails of the overview; images that are little wider have none.
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


def point_numbers(result: PointResult) -> dict[str, float]:
    """Collect a point's numbers by name, those of its image first; the error is in percent."""
    if result.status != "done":
        return {}
    values: dict[str, float] = {"samples": result.samples}
    if "relative" in result.error:
        values["error"] = 100.0 * result.error["relative"]
    for name, phase in (("render_seconds", "render"), ("seconds", "total")):
        if phase in result.seconds:
            values[name] = result.seconds[phase]
    values |= {"rays": result.rays, "nan_samples": result.nan_samples}
    # Of metered pictures the exposure knows the sensitivity, which the camera's own EV100 takes for ISO 100.
    return values | result.exposure | result.camera | result.exposure


def page(sweep: Sweep, images: Images) -> bytes:
    """Render the page as HTML (UTF-8).

    Pictures are in it as they are, up to 16 million pixels together; beyond that with the losses of a WebP of quality
    90, and so much smaller that they are at most 400 million.  The page says so.
    """
    sliders = sweep.sliders
    shown, size, note = _embed_images(sweep, images)
    data = {
        "scene": sweep.title,
        "extent": sweep.summary,
        "notes": [*_notes(sweep), *note],
        "axes": [slider._asdict() for slider in sliders],
        "columns": _columns(sweep.results),
        "points": [_point(result, entry, len(sliders)) for result, entry in zip(sweep.results, shown, strict=True)],
        "size": size,
        "files": [] if sweep.folder is None else [CSV, JSON, SHEET],
    }
    title = f"{sweep.title}: {', '.join(short_names([axis.key for axis in sweep.axes]))}"
    return html.page("sweep", title, data, parts=("wipe", "gallery"))


def _point(result: PointResult, shown: tuple[str | None, str | None], axes: int) -> dict[str, Any]:
    picture, thumb = shown
    return {
        "index": result.point.index[:axes],
        "name": result.point.name,
        "status": result.status,
        "reason": result.reason,
        "warnings": result.warnings,
        "picture": picture,
        "thumb": thumb,
        "files": result.files,
        "numbers": point_numbers(result),
    }


def _columns(result: Sequence[PointResult]) -> list[dict[str, Any]]:
    """List the columns of numbers, in the order in which points name them."""
    keys = dict.fromkeys(key for point in result for key in point_numbers(point))
    if not any(point.nan_samples for point in result):
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
    count = len(sweep.results)
    failed, missing = (sum(result.status == status for result in sweep.results) for status in ("failed", "missing"))
    notes = []
    if failed:
        notes.append(f"{failed} of {count} points failed.")
    if missing:
        notes.append(f"The sweep was ended early, with {missing} of {count} points to go.")
    return notes


def _embed_images(
    sweep: Sweep, images: Images
) -> tuple[list[tuple[str | None, str | None]], tuple[int, int], list[str]]:
    """Embed the images of the points.

    Returns
    -------
    addresses of each image, and of its thumbnail unless it is small itself ; size (px) of the first ; notes.
    """
    done = [result for result in sweep.results if result.status == "done"]
    first = next((picture for picture in map(images, done) if picture is not None), None)
    if first is None:
        return [(None, None)] * len(sweep.results), (320, 180), []
    pixels = float(first.shape[0] * first.shape[1] * len(done))
    scale = min(1.0, math.sqrt(_MOST_PIXELS / pixels))
    exact = pixels <= _EXACT_PIXELS
    width = max(1, round(scale * first.shape[1]))

    def shown(result: PointResult) -> tuple[str | None, str | None]:
        picture = images(result)
        if picture is None:
            return None, None
        if exact:
            return _file_uri(sweep, result) or html.webp(picture), _thumb(picture)
        picture = _resize(picture, max(1, round(scale * picture.shape[1])))
        return html.webp(picture, _QUALITY), _thumb(picture)

    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as threads:
        entries = list(threads.map(shown, sweep.results))
    size = width, max(1, round(first.shape[0] * width / first.shape[1]))
    if exact:
        return entries, size, []
    smaller = f"scaled to {100.0 * scale:.0f} % and " if scale < 1.0 else ""
    note = f"To be held by a browser, the pictures on this page are {smaller}compressed; the files are not."
    return entries, size, [note]


def _file_uri(sweep: Sweep, result: PointResult) -> str | None:
    """Encode the point's file as a data URI, if browsers can show it: encoding the image anew would take longer."""
    if sweep.folder is None or not result.files:
        return None
    path = sweep.folder / result.files[0]
    media_type = image_formats()[path.suffix.lower()].media_type
    return html.data_uri(path.read_bytes(), media_type) if media_type else None


def _thumb(picture: NDArray[np.uint8]) -> str | None:
    if picture.shape[1] <= 1.25 * _THUMB_WIDTH:
        return None
    return html.webp(_resize(picture, _THUMB_WIDTH), _THUMB_QUALITY)


def _resize(picture: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    import PIL.Image

    if width == picture.shape[1]:
        return picture
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    with PIL.Image.fromarray(picture) as image:
        return np.asarray(image.resize((width, height), PIL.Image.Resampling.LANCZOS))
