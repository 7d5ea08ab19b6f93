"""The plan of a quilt: its views, their places, and what of them it shows.

References: as `raytracer.lightfield.formats.quilt`.
"""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.formats.base.light_field_format import ExportOptions
from raytracer.util.errors import InputError


class Device(NamedTuple):
    """Settings of a display.

    columns, rows : views of its quilts.
    size (px) : width and height of these.
    aspect : width over height of the display.
    view_cone (degrees) : angle over which it spreads the views; None if not published.
    """

    columns: int
    rows: int
    size: tuple[int, int]
    aspect: float
    view_cone: float | None


DEVICES = {
    "portrait": Device(8, 6, (3360, 3360), 3.0 / 4.0, 40.0),
    "go": Device(11, 6, (4092, 4092), 9.0 / 16.0, 54.0),
    "16-landscape": Device(7, 7, (5999, 5999), 16.0 / 9.0, 50.0),
    "16-portrait": Device(11, 6, (5995, 6000), 9.0 / 16.0, 50.0),
    "32-landscape": Device(7, 7, (8190, 8190), 16.0 / 9.0, 50.0),
    "32-portrait": Device(11, 6, (8184, 8184), 9.0 / 16.0, 54.0),
    "65": Device(8, 9, (8192, 8192), 16.0 / 9.0, None),
    # Of the second generation, as the older table of the manual has them.
    "16-gen2": Device(5, 9, (4096, 4096), 16.0 / 9.0, None),
    "32-gen2": Device(5, 9, (8192, 8192), 16.0 / 9.0, None),
}
"""Displays by name, with the settings of their manual."""

NAME = re.compile(r".*_qs(\d{1,3})x(\d{1,3})a(\d{1,3}(?:\.\d{1,12})?)")
"""Names of quilts, without the suffix: columns, rows and aspect."""

_MOST_SIDE = 32_768
"""Most pixels along a side of a quilt: four times those of the largest display."""

_SLACK = 1e-9
"""Share of the views' extent by which rounding may move a place beyond them."""

PIXEL_ASPECT = "pixel_aspect"
"""The setting of a light field whose pixels are not square on the display: their width over their height."""


class QuiltPlan(NamedTuple):
    """Layout and geometry of a quilt.

    columns, rows : of views.
    size (px) : width and height of the quilt.
    tile (px) : width and height of a view in it.
    aspect : of what a view shows.
    places (m) : float64 (views, 2), right and up, from left to right.
    inverse_convergence (1/m) : of the plane that stands still.
    shift (px) : float64 (views, 2), right and down in each view, of what stands still, against the middle.
    box (px) : left, top, width and height of what all views see, in the pixels of a view that is not shifted.
    """

    columns: int
    rows: int
    size: tuple[int, int]
    tile: tuple[int, int]
    aspect: float
    places: NDArray[np.float64]
    inverse_convergence: float
    shift: NDArray[np.float64]
    box: tuple[float, float, float, float]


def plan_quilt(field: LightField, path: Path, options: ExportOptions) -> QuiltPlan:
    """Plan a quilt: options first, then a device's settings, the name's, and those of the light field.

    Raises InputError: options contradict each other or the name, or the light field has not the views.
    """
    views = field.views
    device = _device(path, options)
    named = NAME.fullmatch(path.stem)
    columns, rows = (
        asked or (getattr(device, name) if device else None) or (int(named[number]) if named else None)
        for asked, name, number in ((options.columns, "columns", 1), (options.rows, "rows", 2))
    )
    if not columns or not rows:
        raise InputError(f"{path}: a quilt needs --device, or --columns and --rows, or a name such as a_qs8x6a0.75.png")
    if named and (int(named[1]), int(named[2])) != (columns, rows):
        raise InputError(f"{path}: its name says {named[1]} x {named[2]} views, and it is to have {columns} x {rows}")
    row = views.rows // 2 if options.row is None else options.row
    if not 0 <= row < views.rows:
        raise InputError(f"{path}: --row {row}: views are in rows 0 to {views.rows - 1}")
    if views.columns < 2:
        raise InputError(f"{path}: a quilt needs at least two views in a row")
    places, inverse = _places(field, path, options, device, row, columns * rows)
    # Points of the new plane are there in each view; the height of the row as a whole is that of the picture.
    away = places - np.array([0.0, places[:, 1].mean()])
    shift = away * ((views.inverse_focus - inverse) / views.plane.pixel) * np.array([1.0, -1.0])
    pixel_aspect = float(field.settings.get(PIXEL_ASPECT, 1.0))
    size, tile, aspect = _sizes(views, path, options, device, (columns, rows), pixel_aspect)
    if named:
        _check_named_aspect(path, named[3], aspect)
    box = _common_box(views, shift, aspect / pixel_aspect)
    if box[2] < 1.0 or box[3] < 1.0:
        raise InputError(f"{path}: views that converge there have nothing in common: choose another --convergence")
    return QuiltPlan(columns, rows, size, tile, aspect, places, inverse, shift, box)


def _check_named_aspect(path: Path, stated: str, aspect: float) -> None:
    """Refuse a name that says another aspect than the quilt has, in the digits that it has: two at least."""
    digits = max(len(stated.partition(".")[2]), 2)
    if abs(float(stated) - aspect) > 0.5 * 10.0**-digits:
        raise InputError(f"{path}: its name says an aspect of {stated}, and it is to have {aspect:.6g}")


def _device(path: Path, options: ExportOptions) -> Device | None:
    if options.device is not None and options.device not in DEVICES:
        raise InputError(f"{path}: --device {options.device}: must be {', '.join(DEVICES)}")
    return None if options.device is None else DEVICES[options.device]


def _places(
    field: LightField, path: Path, options: ExportOptions, device: Device | None, row: int, count: int
) -> tuple[NDArray[np.float64], float]:
    """Find the places of the views of a quilt, from left to right, and 1 / distance of the plane of convergence."""
    views = field.views
    own = views.position[row]
    inverse = views.inverse_focus if options.convergence is None else 1.0 / options.convergence
    if options.baseline is not None and options.view_cone is not None:
        raise InputError(f"{path}: --baseline and --view-cone: give one of them")
    extent = float(np.ptp(own[:, 0]))
    baseline = extent if options.baseline is None else options.baseline
    cone = options.view_cone
    if cone is None and options.baseline is None and device is not None and inverse > 0.0 and field.is_metric:
        # A light field narrower than the display's cone is shown whole.
        known = math.inf if device.view_cone is None else device.view_cone
        baseline = min(extent, _cone_baseline(known, inverse) if known < 180.0 else extent)
    elif cone is not None:
        if not field.is_metric or not inverse > 0.0:
            raise InputError(f"{path}: --view-cone needs metres and a plane of convergence at a finite distance")
        baseline = _cone_baseline(cone, inverse)
    if baseline > extent * (1.0 + _SLACK):
        raise InputError(f"{path}: a baseline of {baseline:g} m is wider than that of the views, {extent:g} m")
    if count == len(own) and baseline == extent:
        return own, inverse
    middle = 0.5 * (own[0] + own[-1])
    right = middle[0] + np.linspace(-0.5, 0.5, count) * baseline if count > 1 else np.array([middle[0]])
    return np.stack([right, np.interp(right, own[:, 0], own[:, 1])], axis=-1), inverse


def _cone_baseline(cone: float, inverse: float) -> float:
    """Compute the distance (m) between two places that see a point at 1 / inverse under an angle (degrees)."""
    return 2.0 * math.tan(math.radians(0.5 * cone)) / inverse


def _sizes(
    views: Views,
    path: Path,
    options: ExportOptions,
    device: Device | None,
    layout: tuple[int, int],
    pixel_aspect: float,
) -> tuple[tuple[int, int], tuple[int, int], float]:
    """Find width and height of the quilt and of its views (px), and the aspect of what a view shows."""
    columns, rows = layout
    named = NAME.fullmatch(path.stem)
    aspect = options.aspect or (device.aspect if device else None) or (float(named[3]) if named else None)
    size = options.size or (device.size if device else None)
    if size is None:
        # The views as they are: as high, and as wide as the aspect asks for if that differs by more than rounding.
        own = pixel_aspect * views.width / views.height
        is_own = aspect is None or abs(aspect - own) * views.height < 0.5 * (1.0 + own)
        width = views.width if is_own or aspect is None else max(1, round(aspect / pixel_aspect * views.height))
        size = columns * width, rows * views.height
        aspect = own if aspect is None else aspect
    tile = size[0] // columns, size[1] // rows
    if min(tile) < 1 or max(size) > _MOST_SIDE:
        raise InputError(f"{path}: a quilt of {size[0]} x {size[1]} pixels cannot hold {columns} x {rows} views")
    aspect = tile[0] / tile[1] if aspect is None else aspect
    if not 0.0 < aspect < math.inf:
        raise InputError(f"{path}: the aspect of a quilt must be greater than 0")
    return size, tile, aspect


def _common_box(views: Views, shift: NDArray[np.float64], aspect: float) -> tuple[float, float, float, float]:
    """Find the largest rectangle of an aspect in pixels that all shifted views see, about its middle (px)."""
    low = np.maximum(-shift.min(axis=0), 0.0)
    high = np.array([views.width, views.height]) - np.maximum(shift.max(axis=0), 0.0)
    middle = 0.5 * (low + high)
    width, height = (float(size) for size in high - low)
    # All pixels, where the aspect is theirs but for the rounding of sizes to whole ones.
    if abs(aspect * height - width) >= 0.5 * (1.0 + aspect):
        width, height = min(width, aspect * height), min(height, width / aspect)
    return float(middle[0]) - 0.5 * width, float(middle[1]) - 0.5 * height, width, height
