"""A light field as one page of HTML: a click focuses, a drag looks around, a slider opens the aperture.

The page holds the views themselves and makes the picture of them as `raytracer.lightfield.refocusing` does by
shift-and-sum, with linear interpolation.  Views are held as 8 bits of sRGB, which is what a display shows of one of
them; where something is brighter than white, as 8 bits of which the upper fifth are logarithms of it.
"""

import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import pages
from raytracer.errors import InputError
from raytracer.film import srgb
from raytracer.film.output import write_bytes
from raytracer.lightfield.coverage import lit_view
from raytracer.lightfield.depth import Update, depth_map
from raytracer.lightfield.gathering import gathered
from raytracer.lightfield.openings import cell_weights
from raytracer.plenoptic.field import LightField

SIZE = 40_000_000
"""Bytes that a page has at most, unless it is told otherwise."""

LEAST_SIZE = 1_000_000
"""Bytes in which any light field can be shown."""

# What WebGL 2 promises: so many layers of a texture, and so many pixels in a row of it.
_MOST_VIEWS = 256
_LONGEST = 2048

# Pixels of all views together: 4 bytes each in the memory of a graphics card, 8 where something is beyond white.
_MOST_PIXELS = 32e6

# With so many views in a row or column every second one is left out before pixels are.
_MANY = 12

# Losses are tried in this order: none, then those of a JPEG without colours of half the size.
_QUALITIES = (None, 95, 90, 80)
_COARSEST = 32

# Bytes that are not views: scripts, styles, the map of distances, the still picture.
_REST = 500_000
_STILL_SIZE = 480

# Views that are encoded to find out how large all of them would be, and by how much that may be wrong.
_PROBES = 5
_MARGIN = 1.02

_SHARE = 0.8
"""Part of the 8-bit codes that holds light up to white, where there is more."""

_PEAK = 1024.0
"""Light beyond so many times white is taken for that."""

_DARK, _BRIGHT = 1 / 8, 4.0
"""A picture whose brightest hundredth is below the one, or whose median is above the other, starts with an exposure."""

_EV_STEP = 0.25

# Pixels along the longer side: of the map as it is told, and of views in which it is looked for.
_MAP_SIZE = 256
_FOUND_SIZE = 192
_MAP_CODES = 65_535
_OUTLIERS = 0.1
"""Percent of the distances at each end of the map that do not widen the range of focus."""

_MARGIN_OF_RANGE = 0.05
_DISPARITY = 3.0
"""Where no distances are known the range of focus is that of so many pixels between neighbouring views."""


class Page(NamedTuple):
    """A page, UTF-8, and what it says of what was left out of it."""

    html: bytes
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Plan:
    """What of the views a page holds."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    width: int
    height: int

    @property
    def places(self) -> list[tuple[int, int]]:
        return [(row, column) for row in self.rows for column in self.columns]

    @property
    def pixels(self) -> int:
        return len(self.rows) * len(self.columns) * self.width * self.height


class _Code(NamedTuple):
    """How 8 bits hold light: `unit` is white (in the light field's numbers), `peak` the brightest (in units of it)."""

    unit: float
    share: float
    peak: float

    def __call__(self, light: NDArray[np.float64]) -> NDArray[np.uint8]:
        relative = np.clip(np.nan_to_num(light / self.unit, nan=0.0, posinf=self.peak), 0.0, self.peak)
        codes = self.share * srgb.encode(relative)
        if self.peak > 1.0:
            beyond = np.log(np.maximum(relative, 1.0)) / math.log(self.peak)
            codes = np.where(relative > 1.0, self.share + (1.0 - self.share) * beyond, codes)
        return np.rint(255.0 * codes).astype(np.uint8)


def page(
    field: LightField,
    *,
    title: str = "light field",
    size: int = SIZE,
    exposure: float | None = None,
    update: Update | None = None,
) -> Page:
    """One self-contained HTML file in which a light field is focused and looked around in.

    Views that do not fit into its size are held with the losses of a JPEG; then, of more than 12 in a row or column,
    every second one; then with fewer pixels.  The page says so, and so do its notes.

    Parameters
    ----------
    title : of the page.
    size : bytes that the page has at most; at least a million.
    exposure : EV with which the picture is first shown.  None: 0, or what brings the picture to the display's range
        where it is far from it.
    update : told of the progress of the search for distances, where there is one.

    Raises
    ------
    ValueError : the size is less than a million bytes.
    """
    if size < LEAST_SIZE:
        raise ValueError(f"a page has at least {LEAST_SIZE} bytes, got {size}")
    notes: list[str] = []
    if field.rays is not None and len(field.rays.weight) and field.views.rows * field.views.columns == 1:
        field, note = gathered(field)
        notes.append(note)
    views = field.views
    plan = _plan(field)
    code, exposure = _code(field, plan, exposure)
    plan, pictures, quality = _fitted(field, plan, code, size - _REST)
    notes += _notes(field, plan, quality, size)

    shares = _shares(field)
    metric = field.is_metric
    spacing = _spacing(views.position[np.ix_(plan.rows, plan.columns)])
    depth = _depth_map(field, metric=metric, update=update)
    farthest, nearest = _range(field, depth, spacing, metric=metric)
    start = min(nearest, max(farthest, views.inverse_focus))
    data = {
        "name": title,
        "extent": _extent(field, metric=metric),
        "notes": notes,
        "width": plan.width,
        "height": plan.height,
        "pixel": views.plane.pixel * views.width / plan.width,
        "inverse_focus": views.inverse_focus,
        "aperture": views.aperture,
        "focal_length": views.focal_length,
        "unit": "m" if metric else None,
        "spacing": spacing,
        "code": code._asdict(),
        "exposure": exposure,
        "nearest": nearest,
        "farthest": farthest,
        "start": start,
        "depth": depth and _encoded_map(depth),
        "views": [
            {"at": views.position[place], "share": shares[place], "picture": picture}
            for place, picture in zip(plan.places, pictures, strict=True)
        ],
        "still": _still(field, exposure),
    }
    return Page(pages.page("lightfield", title, data), tuple(notes))


def write_page(
    path: str | Path,
    field: LightField,
    *,
    title: str = "light field",
    size: int = SIZE,
    exposure: float | None = None,
    update: Update | None = None,
) -> tuple[str, ...]:
    """Write the page of a light field (`page`) to a file.

    Returns
    -------
    What the page says of what was left out of it.

    Raises
    ------
    ValueError : as `page`.
    OutputError : the file cannot be written.
    """
    made = page(field, title=title, size=size, exposure=exposure, update=update)
    write_bytes(path, made.html)
    return made.notes


# ---- what the page holds ----


def _plan(field: LightField) -> _Plan:
    """All of the views, or as many and as large as WebGL and the memory of graphics cards hold."""
    views = field.views
    plan = _Plan(tuple(range(views.rows)), tuple(range(views.columns)), views.width, views.height)
    plan = _scaled(plan, min(1.0, _LONGEST / max(plan.width, plan.height)))
    while len(plan.places) > _MOST_VIEWS:
        plan = _thinned(plan)
    return _smaller(plan, _MOST_PIXELS / plan.pixels) if plan.pixels > _MOST_PIXELS else plan


def _smaller(plan: _Plan, part: float) -> _Plan:
    """A plan with about that part of the pixels: of fewer views where there are many, else of smaller ones."""
    if max(len(plan.rows), len(plan.columns)) > _MANY:
        plan, before = _thinned(plan), plan
        part *= before.pixels / plan.pixels
    return plan if part >= 1.0 else _scaled(plan, math.sqrt(part))


def _thinned(plan: _Plan) -> _Plan:
    """Every second view, where there are the more of them."""
    most = max(len(plan.rows), len(plan.columns))

    def kept(lines: tuple[int, ...]) -> tuple[int, ...]:
        # An odd number keeps its middle and, with the ends, all of the aperture.
        return lines[::2] if 2 * len(lines) > most else lines

    return replace(plan, rows=kept(plan.rows), columns=kept(plan.columns))


def _scaled(plan: _Plan, scale: float) -> _Plan:
    if scale >= 1.0:
        return plan
    return replace(plan, width=max(1, int(scale * plan.width)), height=max(1, int(scale * plan.height)))


def _seen(field: LightField, plan: _Plan) -> Iterator[NDArray[np.float64]]:
    for row, column in plan.places:
        yield _resized(lit_view(field, row, column)[0], plan.width, plan.height)


def _resized(view: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    """A view on fewer pixels, in linear light."""
    if view.shape[:2] == (height, width):
        return view
    import PIL.Image

    channels = [
        PIL.Image.fromarray(np.nan_to_num(channel).astype(np.float32)).resize((width, height), PIL.Image.Resampling.BOX)
        for channel in np.moveaxis(view, -1, 0)
    ]
    return np.stack([np.asarray(channel, dtype=np.float64) for channel in channels], axis=-1)


def _code(field: LightField, plan: _Plan, exposure: float | None) -> tuple[_Code, float]:
    """How the light is held, and the exposure (EV) with which it is first shown."""
    peak, samples = 0.0, []
    for view in _seen(field, plan):
        finite = view[np.isfinite(view)]
        peak = max(peak, float(finite.max(initial=0.0)))
        # As many pixels from all views together as one has.
        samples.append(view.mean(axis=-1).ravel()[:: len(plan.places)])
    grey = np.concatenate(samples)
    grey = grey[np.isfinite(grey)]
    if exposure is None:
        exposure = _exposure(grey, peak)
    white = 2.0**-exposure
    if peak <= white:
        return _Code(white, 1.0, 1.0), exposure
    return _Code(white, _SHARE, min(_PEAK, peak / white)), exposure


def _exposure(grey: NDArray[np.float64], peak: float) -> float:
    """EV: 0 where the picture is about what a display shows."""
    if peak <= 0.0 or grey.size == 0:
        return 0.0
    bright = float(np.percentile(grey, 99.0)) or peak
    if bright >= _DARK and float(np.median(grey)) <= _BRIGHT:
        return 0.0
    return _EV_STEP * round(-math.log2(bright) / _EV_STEP)


def _fitted(field: LightField, plan: _Plan, code: _Code, size: float) -> tuple[_Plan, Sequence[str], int | None]:
    """The views as addresses of pictures that have so many bytes together, and the quality at which they do."""
    while True:
        coded = [code(view) for view in _seen(field, plan)]
        for quality in _QUALITIES:
            pictures = _encoded(coded, quality, size)
            if pictures is not None:
                return plan, pictures, quality
        estimate = _estimate(coded, _QUALITIES[-1])
        if max(plan.width, plan.height) <= _COARSEST:
            plan = _thinned(plan)
        else:
            # Of fewer pixels each has the more bytes.
            plan = _smaller(plan, 0.9 * min(1.0, size / estimate))


def _estimate(coded: Sequence[NDArray[np.uint8]], quality: int | None) -> float:
    """Bytes of all views, by some of them."""
    some = coded[:: max(1, len(coded) // _PROBES)]
    return _MARGIN * len(coded) / len(some) * sum(len(_address(view, quality)) for view in some)


def _encoded(coded: Sequence[NDArray[np.uint8]], quality: int | None, size: float) -> Sequence[str] | None:
    """The views as addresses; None if they have too many bytes."""
    if _estimate(coded, quality) > size:
        return None
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as threads:
        pictures = list(threads.map(lambda view: _address(view, quality), coded))
    return pictures if sum(map(len, pictures)) <= size else None


def _address(view: NDArray[np.uint8], quality: int | None) -> str:
    return pages.webp(view) if quality is None else pages.jpeg(view, quality, full_colour=True)


def _notes(field: LightField, plan: _Plan, quality: int | None, size: int) -> list[str]:
    """What is to be said of what the page does not hold."""
    views = field.views
    left_out = []
    if len(plan.places) < views.rows * views.columns:
        left_out.append(
            f"{len(plan.rows)} x {len(plan.columns)} of its {views.rows} x {views.columns} views, evenly chosen"
        )
    if (plan.width, plan.height) != (views.width, views.height):
        left_out.append(f"views of {plan.width} x {plan.height} pixels in place of {views.width} x {views.height}")
    notes = []
    if left_out:
        held = ", and ".join(left_out)
        notes.append(f"To stay under {_megabytes(size)} and in a browser's memory, this page holds {held}.")
    if quality is not None:
        notes.append(f"To stay under {_megabytes(size)}, views are compressed with losses (JPEG, quality {quality}).")
    if views.rows * views.columns == 1:
        notes.append("This light field has one view: there is nothing to focus, or to look around in.")
    return notes


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.3g} MB"


def _still(field: LightField, exposure: float) -> str:
    """The view from the middle, for browsers without WebGL."""
    views = field.views
    scale = min(1.0, _STILL_SIZE / max(views.width, views.height))
    view = _resized(
        field.view(*views.nearest()), max(1, round(scale * views.width)), max(1, round(scale * views.height))
    )
    return pages.jpeg(srgb.to_uint8(2.0**exposure * view))


# ---- where views are, and how far away things are ----


def _shares(field: LightField) -> NDArray[np.float64]:
    """The part of each view's cell that the whole aperture covers, (rows, columns)."""
    return cell_weights(field.views)


def _spacing(position: NDArray[np.float64]) -> tuple[float, float]:
    """From view to view, right and up (m); 0 where there is only one."""

    def step(places: NDArray[np.float64], axis: int) -> float:
        return float(np.median(np.abs(np.diff(places, axis=axis)))) if places.shape[axis] > 1 else 0.0

    return step(position[..., 0], 1), step(position[..., 1], 0)


class _Depth(NamedTuple):
    """One over the distance, (height, width), NaN where it is not known, in the view at a place (m)."""

    inverse: NDArray[np.float64]
    at: tuple[float, float]

    @property
    def ends(self) -> tuple[float, float]:
        known = self.inverse[np.isfinite(self.inverse)]
        low, high = np.percentile(known, (_OUTLIERS, 100.0 - _OUTLIERS))
        return float(low), float(high)


def _depth_map(field: LightField, *, metric: bool, update: Update | None) -> _Depth | None:
    """How far away what the middle view sees is: the layer `depth`, or found from the views; None if neither is."""
    views = field.views
    middle = views.nearest()
    if metric and "depth" in field.layers:
        inverse = _inverse(np.asarray(field.layers["depth"][middle], dtype=np.float64))
    elif views.rows * views.columns > 1:
        return _found(field, update)
    else:
        return None
    step = max(1, -(-max(inverse.shape) // _MAP_SIZE))
    inverse = inverse[step // 2 :: step, step // 2 :: step]
    right, up = (float(place) for place in views.position[middle])
    return _Depth(inverse, (right, up)) if np.isfinite(inverse).any() else None


def _found(field: LightField, update: Update | None) -> _Depth | None:
    """The map from the views: smaller ones, of which many a pixel sees more light and takes less time."""
    views = field.views
    scale = min(1.0, _FOUND_SIZE / max(views.width, views.height))
    width, height = max(1, round(scale * views.width)), max(1, round(scale * views.height))
    radiance = np.empty((views.rows, views.columns, height, width, 3), dtype=np.float32)
    for place in np.ndindex(views.rows, views.columns):
        radiance[place] = _resized(lit_view(field, *place)[0], width, height)
    plane = views.plane._replace(pixel=views.plane.pixel * views.width / width)
    smaller = LightField(radiance, replace(views, plane=plane, width=width, height=height), settings=field.settings)
    try:
        found = depth_map(smaller, update=update)
    except InputError:
        return None
    right, up = (float(place) for place in views.position[found.row, found.column])
    return _Depth(found.inverse, (right, up)) if np.isfinite(found.inverse).any() else None


def _inverse(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """One over distances: 0 at infinity, NaN where there is none."""
    known = np.where(distance > 0.0, distance, np.nan)
    return np.asarray(1.0 / known)


def _encoded_map(depth: _Depth) -> dict[str, Any]:
    """The map in 16 bits: 0 where it is not known, then evenly from the lowest to the highest."""
    low, high = depth.ends
    height, width = depth.inverse.shape
    part = (np.clip(depth.inverse, low, high) - low) / (high - low or 1.0)
    codes = np.where(np.isnan(part), 0, 1 + np.rint(np.nan_to_num(part) * (_MAP_CODES - 1))).astype("<u2")
    values = pages.data_uri(codes.tobytes(), "").partition(",")[2]
    return {"width": width, "height": height, "low": low, "high": high, "at": depth.at, "values": values}


def _range(
    field: LightField, depth: _Depth | None, spacing: tuple[float, float], *, metric: bool
) -> tuple[float, float]:
    """One over the farthest and the nearest distance that can be focused."""
    views = field.views
    step = max(spacing)
    pixel = views.plane.pixel / step if step > 0.0 else max(views.inverse_focus, 1.0)
    if depth is None:
        low, high = views.inverse_focus - _DISPARITY * pixel, views.inverse_focus + _DISPARITY * pixel
    else:
        low, high = depth.ends
        margin = _MARGIN_OF_RANGE * (high - low)
        # What moves by a pixel from view to view is always within: a flat thing can be put out of focus.
        low, high = min(low - margin, views.inverse_focus - pixel), max(high + margin, views.inverse_focus + pixel)
    return (max(low, 0.0) if metric else low), high


# ---- words ----


def _extent(field: LightField, *, metric: bool) -> str:
    views = field.views
    count = "1 view" if views.rows * views.columns == 1 else f"{views.rows} \u00d7 {views.columns} views"
    words = [f"{count} of {views.width} \u00d7 {views.height} pixels"]
    across = [1000.0 * step for step in _spacing(views.position)]
    steps = dict.fromkeys(f"{step:.3g}" for step in across if step > 0.0)
    if metric and steps:
        apart = " \u00d7 ".join(steps)
        words.append(f"{apart} mm apart")
    if metric and views.aperture is not None:
        words.append(f"behind an aperture of {1000.0 * views.aperture:.3g} mm")
    return ", ".join(words)
