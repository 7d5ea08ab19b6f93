"""A light field as one page of HTML: a click focuses, a drag moves the viewpoint, a slider opens the aperture.

The page holds the views themselves and makes the picture of them as `raytracer.lightfield.refocusing` does by
shift-and-sum, with linear interpolation.  Views are held as 8 bits of sRGB, which is what a display shows of one of
them; where something is brighter than white, as 8 bits of which the upper fifth are logarithms of it.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import DEPTH_LAYER, FieldArrays, LightField
from raytracer.lightfield.coverage import lit_view
from raytracer.lightfield.depth.depth_map import depth_map
from raytracer.lightfield.ray_binning import rays_to_views
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.lightfield.viewer.size_budget import (
    BYTES_BESIDES_VIEWS,
    ViewPlan,
    choose_encoding,
    fit_to_size,
    plan_views,
    planned_views,
    require_room,
    resize_view,
)
from raytracer.report import page as html
from raytracer.report.wording import megabytes
from raytracer.util import srgb
from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import InputError
from raytracer.util.progress import Update

DEFAULT_BYTES = 40_000_000
"""Default of the most bytes of a page."""

MIN_BYTES = 1_000_000
"""Bytes in which any light field can be shown."""

_STILL_SIZE = 480


class Page(NamedTuple):
    """Page of a light field.

    html : UTF-8.
    notes : sentences about what was left out.
    """

    html: bytes
    notes: tuple[str, ...]

    def write(self, path: str | Path) -> tuple[str, ...]:
        """Write the page to a file, and return its notes; an OutputError says that this fails."""
        write_bytes(path, self.html)
        return self.notes


def page(
    field: LightField,
    *,
    title: str = "light field",
    size: int = DEFAULT_BYTES,
    exposure: float | None = None,
    update: Update | None = None,
) -> Page:
    """Make one self-contained HTML file in which a light field is focused and its viewpoint moved.

    Views that do not fit into its size are held with the losses of a JPEG; then, of more than 12 in a row or column,
    every second one; then with fewer pixels.  The page says so, and so do its notes.

    Parameters
    ----------
    title : of the page.
    size : bytes that the page has at most; at least a million.
    exposure : EV with which the picture is first shown.  None: 0, or what brings the picture to the display's range
        where it is far from it.
    update : called with the progress of the search for depth, where there is one.

    Raises
    ------
    ValueError : the size is less than a million bytes.
    """
    if size < MIN_BYTES:
        raise ValueError(f"a page has at least {MIN_BYTES} bytes, got {size}")
    notes: list[str] = []
    if field.rays is not None and len(field.rays.weight) and field.views.rows * field.views.columns == 1:
        field, note = rays_to_views(field)
        notes.append(note)
    views = field.views
    plan = plan_views(field)
    require_room(plan, size)
    code, exposure = choose_encoding(planned_views(field, plan), len(plan.places), exposure)
    plan, pictures, quality, _ = fit_to_size(field, plan, code, size - BYTES_BESIDES_VIEWS)
    notes += losses(field, plan, quality, size)

    # The part of each view's cell that the whole aperture covers.
    shares = cell_weights(field.views)
    metric = field.is_metric
    spacing = _view_steps(views.position[np.ix_(plan.rows, plan.columns)])
    depth = viewer_depth(field, metric=metric, update=update)
    farthest, nearest = focus_range(field, depth, spacing, metric=metric)
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
        "depth": depth and encode_depth(depth),
        "views": [
            {"at": views.position[place], "share": shares[place], "picture": picture}
            for place, picture in zip(plan.places, pictures, strict=True)
        ],
        "still": fallback_image(field, views.nearest(), exposure),
    }
    return Page(html.page("lightfield", title, data, parts=("view_textures",)), tuple(notes))


def write_page(
    path: str | Path,
    field: LightField,
    *,
    title: str = "light field",
    size: int = DEFAULT_BYTES,
    exposure: float | None = None,
    update: Update | None = None,
) -> tuple[str, ...]:
    """Write the page of a light field (`page`) to a file; return sentences about what was left out.

    Raises
    ------
    ValueError : as `page`.
    OutputError : the file cannot be written.
    """
    return page(field, title=title, size=size, exposure=exposure, update=update).write(path)


def losses(field: FieldArrays, plan: ViewPlan, quality: int | None, size: int) -> list[str]:
    """Write sentences about views and layers that the page leaves out."""
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
        contents = ", and ".join(left_out)
        notes.append(f"To stay under {megabytes(size)} and in a browser's memory, this page holds {contents}.")
    if quality is not None:
        notes.append(f"To stay under {megabytes(size)}, views are compressed with losses (JPEG, quality {quality}).")
    if views.rows * views.columns == 1:
        notes.append("This light field has one view: there is nothing to focus, or to look around in.")
    return notes


def fallback_image(field: FieldArrays, place: tuple[int, int], exposure: float) -> str:
    """Encode a view, for browsers without WebGL."""
    view = resize_view(field.view(*place), *_fit_within(field, _STILL_SIZE))
    return html.jpeg(srgb.to_uint8(2.0**exposure * view))


def _fit_within(field: FieldArrays, longest: int) -> tuple[int, int]:
    """Compute the width and height of views that are reduced to so many pixels along the longer side."""
    width, height = field.views.width, field.views.height
    scale = min(1.0, longest / max(width, height))
    return max(1, round(scale * width)), max(1, round(scale * height))


def _view_steps(position: NDArray[np.float64]) -> tuple[float, float]:
    """Measure the median step from view to view, right and up (m); 0 where there is only one."""

    def step(places: NDArray[np.float64], axis: int) -> float:
        return float(np.median(np.abs(np.diff(places, axis=axis)))) if places.shape[axis] > 1 else 0.0

    return step(position[..., 0], 1), step(position[..., 1], 0)


def _extent(field: LightField, *, metric: bool) -> str:
    """Describe the number, size and spacing of the views."""
    views = field.views
    number = "1 view" if views.rows * views.columns == 1 else f"{views.rows} \u00d7 {views.columns} views"
    words = [f"{number} of {views.width} \u00d7 {views.height} pixels"]
    across = [1000.0 * step for step in _view_steps(views.position)]
    steps = dict.fromkeys(f"{step:.3g}" for step in across if step > 0.0)
    if metric and steps:
        apart = " \u00d7 ".join(steps)
        words.append(f"{apart} mm apart")
    if metric and views.aperture is not None:
        words.append(f"behind an aperture of {1000.0 * views.aperture:.3g} mm")
    return ", ".join(words)


# Pixels along the longer side: of the map in the page, and of the views from which it is estimated.
_MAP_SIZE = 256
_SEARCH_SIZE = 192
_MAP_CODES = 65_535

_OUTLIERS = 0.1
"""Percent of the distances at each end of the map that do not widen the range of focus."""

_RANGE_MARGIN = 0.05

_DISPARITY = 3.0
"""Pixels between neighbouring views that bound the range of focus where no distances are known."""


class ViewerDepth(NamedTuple):
    """Depth map of one view.

    inverse : one over the distance (1/m), (height, width); NaN where it is not known.
    at : place of the view (m), right and up.
    """

    inverse: NDArray[np.float64]
    at: tuple[float, float]

    @property
    def ends(self) -> tuple[float, float]:
        """Least and greatest one over the distance, without outliers."""
        known = self.inverse[np.isfinite(self.inverse)]
        low, high = np.percentile(known, (_OUTLIERS, 100.0 - _OUTLIERS))
        return float(low), float(high)


def viewer_depth(field: LightField, *, metric: bool, update: Update | None) -> ViewerDepth | None:
    """Get the depth of the middle view: from the layer `depth`, or estimated from the views; None if neither can be."""
    views = field.views
    middle = views.nearest()
    if metric and DEPTH_LAYER in field.layers:
        distance = np.asarray(field.layers[DEPTH_LAYER][middle], dtype=np.float64)
        inverse = 1.0 / np.where(distance > 0.0, distance, np.nan)
    elif views.rows * views.columns > 1:
        return _estimate_depth(field, update)
    else:
        return None
    step = max(1, -(-max(inverse.shape) // _MAP_SIZE))
    inverse = inverse[step // 2 :: step, step // 2 :: step]
    right, up = (float(place) for place in views.position[middle])
    return ViewerDepth(inverse, (right, up)) if np.isfinite(inverse).any() else None


def _estimate_depth(field: LightField, update: Update | None) -> ViewerDepth | None:
    """Estimate the map from the views, made smaller: that takes less time, and has less noise; None if it fails."""
    views = field.views
    width, height = _fit_within(field, _SEARCH_SIZE)
    radiance = np.empty((views.rows, views.columns, height, width, 3), dtype=np.float32)
    for place in np.ndindex(views.rows, views.columns):
        radiance[place] = resize_view(lit_view(field, *place)[0], width, height)
    plane = views.plane._replace(pixel=views.plane.pixel * views.width / width)
    smaller = LightField(radiance, replace(views, plane=plane, width=width, height=height), settings=field.settings)
    try:
        depth = depth_map(smaller, update=update)
    except InputError:
        return None
    right, up = (float(place) for place in views.position[depth.row, depth.column])
    return ViewerDepth(depth.inverse, (right, up)) if np.isfinite(depth.inverse).any() else None


def encode_depth(depth: ViewerDepth) -> dict[str, Any]:
    """Encode the map in 16 bits: 0 where it is not known, then evenly from the lowest to the highest."""
    low, high = depth.ends
    height, width = depth.inverse.shape
    part = (np.clip(depth.inverse, low, high) - low) / (high - low or 1.0)
    codes = np.where(np.isnan(part), 0, 1 + np.rint(np.nan_to_num(part) * (_MAP_CODES - 1))).astype("<u2")
    values = html.data_uri(codes.tobytes(), "").partition(",")[2]
    return {"width": width, "height": height, "low": low, "high": high, "at": depth.at, "values": values}


def focus_range(
    field: LightField, depth: ViewerDepth | None, spacing: tuple[float, float], *, metric: bool
) -> tuple[float, float]:
    """Choose the range of focus: one over the farthest and the nearest distance."""
    views = field.views
    step = max(spacing)
    pixel = views.plane.pixel / step if step > 0.0 else max(views.inverse_focus, 1.0)
    if depth is None:
        low, high = views.inverse_focus - _DISPARITY * pixel, views.inverse_focus + _DISPARITY * pixel
    else:
        low, high = depth.ends
        margin = _RANGE_MARGIN * (high - low)
        # At least a pixel from view to view to each side, so that a flat object can be put out of focus.
        low, high = min(low - margin, views.inverse_focus - pixel), max(high + margin, views.inverse_focus + pixel)
    return (max(low, 0.0) if metric else low), high
