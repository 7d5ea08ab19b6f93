"""A light field of views with poses of their own as one page of HTML, in which one goes round what they look at.

The page holds the views and their depth, and a graphics card draws the picture of them from any pose, as
`raytracer.lightfield.views.unstructured` does.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import DEPTH_LAYER
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.lightfield.viewer.page import DEFAULT_BYTES, MIN_BYTES, Page, fallback_image, losses
from raytracer.lightfield.viewer.size_budget import (
    BYTES_BESIDES_VIEWS,
    FittedViews,
    ViewPlan,
    choose_encoding,
    fit_to_size,
    plan_views,
    planned_views,
    require_room,
)
from raytracer.lightfield.views.free_camera import Point, free_camera
from raytracer.lightfield.views.view_surfaces import DepthOfView, layer_depth
from raytracer.report import page as html
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress

FloatArray = NDArray[np.float64]

_DEPTH_CODES = 65_535
"""Codes of a depth: 0 where it is not known, then squares, so that what is far is held as finely as what is near."""

_PROBES = 5
"""Pixels in a row and in a column of a view at which the page compares it with its camera."""

_DIGITS = 5

_FINER = 2
"""Pixels of the picture for each of a view, in a row and in a column, so that one can come nearer."""

_LONGEST_PICTURE = 1280

_LEVEL = math.sin(math.radians(45.0))
"""Sine of the angle up or down within which a view counts as level."""

_LONGEST_VIEW = 512
"""Pixels of a view along its longer side: surfaces of 16 views, at 36 bytes a pixel, take 150 MB of a graphics card."""


def page(
    field: PosedLightField,
    *,
    title: str = "light field",
    size: int = DEFAULT_BYTES,
    exposure: float | None = None,
    update: Update | None = None,
) -> Page:
    """Make one self-contained HTML file in which one goes round what the views look at, or looks around between them.

    Views that do not fit into its size are held with losses as in `page.page`; their depth is held without any.

    Parameters
    ----------
    title : of the page.
    size : bytes that the page has at most; at least a million.
    exposure : EV with which the picture is first shown; default: as in `page.page`.
    update : called with the progress.

    Raises
    ------
    ValueError : the size is less than a million bytes.
    InputError : nothing is known of the views' depth, and they look at no point.
    """
    if size < MIN_BYTES:
        raise ValueError(f"a page has at least {MIN_BYTES} bytes, got {size}")
    views = field.views
    up = _up(views)
    start = _start_view(views, up)
    focus = _place_looked_at(views)
    has_depth = DEPTH_LAYER in field.layers
    if not has_depth and focus is None:
        raise InputError("nothing is known of its depth, and its views look at no point: render it with --aov depth")
    plan = plan_views(field, _LONGEST_VIEW)
    require_room(plan, size)
    code, exposure = choose_encoding(planned_views(field, plan), len(plan.places), exposure)
    depths = _Depths(layer_depth(field), update) if has_depth else None
    fitted = fit_to_size(
        field, plan, code, size - BYTES_BESIDES_VIEWS, encode_maps=lambda plan: () if depths is None else depths(plan)
    )
    notes = losses(field, fitted.plan, fitted.quality, size)
    if not has_depth:
        notes.append("Nothing is known of its depth: surfaces are taken for a plane, and edges are doubled.")
    center = views.pose[..., 0, :].mean(axis=(0, 1)) if focus is None else focus
    eye, ahead = views.pose[start][0], views.pose[start][3]
    ends = _point(eye), _point(eye + ahead if focus is None else focus)
    camera = free_camera(*ends, views, up=up)
    width, height = fitted.plan.width, fitted.plan.height
    finer = min(_FINER, _LONGEST_PICTURE / max(width, height))
    data = {
        "name": title,
        "extent": f"{views.rows} \u00d7 {views.columns} views of {views.width} \u00d7 {views.height} pixels",
        "notes": notes,
        "width": width,
        "height": height,
        "picture": [round(finer * width), round(finer * height)],
        "code": code._asdict(),
        "exposure": exposure,
        "center": center,
        "reach": views.farthest(center),
        "inward": focus is not None,
        "up": up,
        "start": {"from": ends[0], "toward": ends[1], "vfov": 2.0 * np.degrees(np.arctan(camera.plane.top))},
        "views": _views(field, fitted, depths),
        "still": fallback_image(field, start, exposure),
    }
    return Page(html.page("posed_lightfield", title, data, parts=("view_textures", "posed_shaders")), tuple(notes))


def _place_looked_at(views: PosedViews) -> FloatArray | None:
    """Find the point that the views look at; None if they look away from it, as in a room, or at none."""
    point = views.focus_point()
    if point is None:
        return None
    ahead = ((point - views.pose[..., 0, :]) * views.pose[..., 3, :]).sum(axis=-1)
    return point if np.median(ahead) > 0.0 else None


def _start_view(views: PosedViews, up: Point) -> tuple[int, int]:
    """Choose the view to begin with: of those that are level, which a drag turns best, the one in the middle."""
    slope = np.abs(views.pose[..., 3, :] @ np.array(up))
    rows, columns = np.indices(slope.shape)
    away = np.abs(rows - views.rows // 2) + np.abs(columns - views.columns // 2)
    first = int(np.lexsort((away.ravel(), np.maximum(slope, _LEVEL).ravel()))[0])
    return first // views.columns, first % views.columns


def _up(views: PosedViews) -> Point:
    """Choose the axis of the scene that is most like what is up in the views."""
    mean = views.pose[..., 2, :].sum(axis=(0, 1))
    axis = int(np.argmax(np.abs(mean)))
    up = np.zeros(3)
    up[axis] = 1.0 if mean[axis] >= 0.0 else -1.0
    return _point(up)


def _point(values: FloatArray) -> Point:
    x, y, z = values.tolist()
    return x, y, z


class _Depths:
    """Depth of the views of a plan, encoded in 16 bits.

    high, probes : of each view that was encoded last: greatest one over its depth (1/m), and some of its depths (1/m).
    """

    def __init__(self, depth: DepthOfView, update: Update | None) -> None:
        self._depth, self._update = depth, update
        self.high: list[float] = []
        self.probes: list[FloatArray] = []

    def __call__(self, plan: ViewPlan) -> list[str]:
        self.high, self.probes = [], []
        return [self._encode(plan, *place) for place in report_progress(plan.places, self._update)]

    def _encode(self, plan: ViewPlan, row: int, column: int) -> str:
        """Encode one over the depth as a lossless picture of high and low bytes."""
        whole = self._depth(row, column)
        # A mean of what is before and behind an edge would lie nowhere.
        inverse = whole[np.ix_(_middles(plan.height, whole.shape[0]), _middles(plan.width, whole.shape[1]))]
        high = float(np.nanmax(inverse, initial=0.0))
        part = np.sqrt(inverse / (high or 1.0))
        codes = np.where(np.isnan(part), 0, 1 + np.rint(np.nan_to_num(part) * (_DEPTH_CODES - 1))).astype(np.uint16)
        self.high.append(high)
        self.probes.append(inverse[np.ix_(*(_middles(_PROBES, number) for number in inverse.shape))])
        return html.webp(np.stack([codes >> 8, codes & 255, np.zeros_like(codes)], axis=-1).astype(np.uint8))


def _middles(parts: int, whole: int) -> NDArray[np.int64]:
    """Choose the pixels in the middles of equal parts of a row."""
    return np.floor((np.arange(parts) + 0.5) * whole / parts).astype(np.int64)


def _views(field: PosedLightField, fitted: FittedViews, depths: _Depths | None) -> list[dict[str, Any]]:
    """Describe the views: pose, image plane (size of a pixel right and down, left and top), picture, and depth."""
    views, plan = field.views, fitted.plan
    described = []
    for number, (place, picture) in enumerate(zip(plan.places, fitted.pictures, strict=True)):
        pixel, left, top = views.plane[place].tolist()
        sizes = [pixel * views.width / plan.width, pixel * views.height / plan.height]
        view = {"pose": views.pose[place], "plane": [*sizes, left, top], "picture": picture}
        if depths is not None:
            probes = [float(f"{inverse:.{_DIGITS}g}") for inverse in depths.probes[number].ravel()]
            view |= {"depth": fitted.maps[number], "high": depths.high[number], "probes": probes}
        described.append(view)
    return described
