"""Size budget of the page: which views it holds, of how many pixels, and with what losses.

Views that do not fit are first compressed with the losses of a JPEG; then every second one is left out, where there are
many; then they get fewer pixels.  A view's light is held in 8 bits: sRGB up to white, and logarithms of what is
brighter.
"""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import FieldArrays
from raytracer.lightfield.coverage import lit_view
from raytracer.lightfield.memory import require_memory
from raytracer.report import page as html
from raytracer.report.wording import megabytes
from raytracer.util import srgb

BYTES_BESIDES_VIEWS = 500_000
"""Bytes of all but the views: scripts, styles, geometry, the still picture."""

# Bytes a pixel of all views while they are encoded, and when they are, without losses; and copies of the page's text.
_PIXEL_BYTES, _CODED_BYTES, _PAGE_COPIES = 8, 6, 3

_SHARE = 0.8
"""Share of the 8-bit codes that holds light up to white, where some is brighter."""

_PEAK = 1024.0
"""Brighter light is clipped to this multiple of white."""

_DARK, _BRIGHT = 1 / 8, 4.0
"""A picture whose 99th percentile is below the one, or whose median is above the other, starts with an exposure."""

_EV_STEP = 0.25


class Encoding(NamedTuple):
    """Encoding of light in 8 bits.

    unit : light of white, in the light field's numbers.
    share : of the codes that holds light up to white.
    peak : brightest light, in units of white.
    """

    unit: float
    share: float
    peak: float

    def __call__(self, light: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Encode linear light."""
        relative = np.clip(np.nan_to_num(light / self.unit, nan=0.0, posinf=self.peak), 0.0, self.peak)
        codes = self.share * srgb.encode(relative)
        if self.peak > 1.0:
            beyond = np.log(np.maximum(relative, 1.0)) / math.log(self.peak)
            codes = np.where(relative > 1.0, self.share + (1.0 - self.share) * beyond, codes)
        return np.rint(255.0 * codes).astype(np.uint8)


def choose_encoding(views: Iterable[NDArray[np.float64]], count: int, exposure: float | None) -> tuple[Encoding, float]:
    """Choose the encoding of `count` views, and the exposure (EV) with which they are first shown, unless given."""
    peak, samples = 0.0, []
    for view in views:
        finite = view[np.isfinite(view)]
        peak = max(peak, float(finite.max(initial=0.0)))
        # As many pixels from all views together as one has.
        samples.append(view.mean(axis=-1).ravel()[::count])
    grey = np.concatenate(samples)
    grey = grey[np.isfinite(grey)]
    if exposure is None:
        exposure = _initial_exposure(grey, peak)
    white = 2.0**-exposure
    if peak <= white:
        return Encoding(white, 1.0, 1.0), exposure
    return Encoding(white, _SHARE, min(_PEAK, peak / white)), exposure


def _initial_exposure(grey: NDArray[np.float64], peak: float) -> float:
    """Choose an exposure (EV) for the display: 0 where the picture is within its range."""
    if peak <= 0.0 or grey.size == 0:
        return 0.0
    bright = float(np.percentile(grey, 99.0)) or peak
    if bright >= _DARK and float(np.median(grey)) <= _BRIGHT:
        return 0.0
    return _EV_STEP * round(-math.log2(bright) / _EV_STEP)


# Least limits of WebGL 2: layers of a texture, and pixels along its side.
_MOST_VIEWS = 256
LONGEST_SIDE = 2048

# Pixels of all views together: 4 bytes each in the memory of a graphics card, 8 where something is beyond white.
_MOST_PIXELS = 32e6

# With more views in a row or column every second one is left out before pixels are.
_MANY_IN_ROW = 12

# Qualities that are tried, in this order: lossless, then JPEG with colours of full size.
_QUALITIES = (None, 95, 90, 80)
_SMALLEST_SIDE = 32

# Views that are encoded to estimate the size of all, and the factor by which that may be wrong.
_PROBES = 5
_MARGIN = 1.02


@dataclass(frozen=True)
class ViewPlan:
    """Views that a page holds.

    rows, columns : of the views.
    width, height : pixels of each.
    """

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    width: int
    height: int

    @property
    def places(self) -> list[tuple[int, int]]:
        """Row and column of each view."""
        return [(row, column) for row in self.rows for column in self.columns]

    @property
    def pixels(self) -> int:
        """Pixels of all views together."""
        return len(self.rows) * len(self.columns) * self.width * self.height


def plan_views(field: FieldArrays, longest: int = LONGEST_SIDE) -> ViewPlan:
    """Plan all of the views, or as many and as large as WebGL and the memory of graphics cards hold.

    longest (px) : side that a view has at most.
    """
    views = field.views
    plan = ViewPlan(tuple(range(views.rows)), tuple(range(views.columns)), views.width, views.height)
    plan = _scale_plan(plan, min(1.0, longest / max(plan.width, plan.height)))
    while len(plan.places) > _MOST_VIEWS:
        plan = _halve_views(plan)
    return _shrink_plan(plan, _MOST_PIXELS / plan.pixels) if plan.pixels > _MOST_PIXELS else plan


def require_room(plan: ViewPlan, size: int) -> None:
    """Refuse a page of `size` bytes that takes more memory than is given.

    Raises
    ------
    InputError : it takes more.
    """
    needed = _PIXEL_BYTES * plan.pixels + _PAGE_COPIES * min(size, BYTES_BESIDES_VIEWS + _CODED_BYTES * plan.pixels)
    require_memory(needed, f"a page of {megabytes(size)}", "a smaller one, by --size, may take less")


def _shrink_plan(plan: ViewPlan, part: float) -> ViewPlan:
    """Reduce a plan to about that part of its pixels: to fewer views where there are many, else to smaller ones."""
    if max(len(plan.rows), len(plan.columns)) > _MANY_IN_ROW:
        plan, before = _halve_views(plan), plan
        part *= before.pixels / plan.pixels
    return plan if part >= 1.0 else _scale_plan(plan, math.sqrt(part))


def _halve_views(plan: ViewPlan) -> ViewPlan:
    """Keep every second view, along the axis that has more of them."""
    most = max(len(plan.rows), len(plan.columns))

    def halved(lines: tuple[int, ...]) -> tuple[int, ...]:
        # An odd number keeps its middle and, with the ends, all of the aperture.
        return lines[::2] if 2 * len(lines) > most else lines

    return replace(plan, rows=halved(plan.rows), columns=halved(plan.columns))


def _scale_plan(plan: ViewPlan, scale: float) -> ViewPlan:
    """Reduce the width and height of the views of a plan; never enlarge them."""
    if scale >= 1.0:
        return plan
    return replace(plan, width=max(1, int(scale * plan.width)), height=max(1, int(scale * plan.height)))


def planned_views(field: FieldArrays, plan: ViewPlan) -> Iterator[NDArray[np.float64]]:
    """Yield the views of a plan, in its size, one after the other."""
    for row, column in plan.places:
        yield resize_view(lit_view(field, row, column)[0], plan.width, plan.height)


def resize_view(view: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    """Resize a view to fewer pixels, in linear light."""
    if view.shape[:2] == (height, width):
        return view
    import PIL.Image

    channels = [
        PIL.Image.fromarray(np.nan_to_num(channel).astype(np.float32)).resize((width, height), PIL.Image.Resampling.BOX)
        for channel in np.moveaxis(view, -1, 0)
    ]
    return np.stack([np.asarray(channel, dtype=np.float64) for channel in channels], axis=-1)


class FittedViews(NamedTuple):
    """Views as they stand in a page.

    plan : reduced where needed.
    pictures : data URIs.
    quality : of the pictures; None if they are lossless.
    maps : what goes with the pictures: a data URI for each, or none at all.
    """

    plan: ViewPlan
    pictures: Sequence[str]
    quality: int | None
    maps: Sequence[str]


def fit_to_size(
    field: FieldArrays,
    plan: ViewPlan,
    code: Encoding,
    size: float,
    encode_maps: Callable[[ViewPlan], Sequence[str]] = lambda plan: (),
) -> FittedViews:
    """Encode the views as data URIs of at most so many bytes together.

    encode_maps : encodes what goes with the views of a plan, as data URIs, without losses.
    """
    while True:
        coded = [code(view) for view in planned_views(field, plan)]
        maps = encode_maps(plan)
        taken = sum(map(len, maps))
        for quality in _QUALITIES:
            pictures = _encode_within(coded, quality, size - taken)
            if pictures is not None:
                return FittedViews(plan, pictures, quality, maps)
        estimate = taken + _estimate_bytes(coded, _QUALITIES[-1])
        if max(plan.width, plan.height) <= _SMALLEST_SIDE:
            plan = _halve_views(plan)
        else:
            # The fewer pixels, the more bytes each takes.
            plan = _shrink_plan(plan, 0.9 * min(1.0, size / estimate))


def _estimate_bytes(coded: Sequence[NDArray[np.uint8]], quality: int | None) -> float:
    """Estimate the bytes of all views from a few of them."""
    some = coded[:: max(1, len(coded) // _PROBES)]
    return _MARGIN * len(coded) / len(some) * sum(len(_data_url(view, quality)) for view in some)


def _encode_within(coded: Sequence[NDArray[np.uint8]], quality: int | None, size: float) -> Sequence[str] | None:
    """Encode the views as data URIs; None if they take more than `size` bytes."""
    if _estimate_bytes(coded, quality) > size:
        return None
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as threads:
        pictures = list(threads.map(lambda view: _data_url(view, quality), coded))
    return pictures if sum(map(len, pictures)) <= size else None


def _data_url(view: NDArray[np.uint8], quality: int | None) -> str:
    """Encode a view as a data URI, lossless without a quality."""
    return html.webp(view) if quality is None else html.jpeg(view, quality, full_colour=True)
