"""A light field as one page of HTML: a click focuses, a drag moves the viewpoint, a slider opens the aperture.

The page holds the views themselves and makes the picture of them as `raytracer.lightfield.refocusing` does by
shift-and-sum, with linear interpolation.  Views are held as 8 bits of sRGB, which is what a display shows of one of
them; where something is brighter than white, as 8 bits of which the upper fifth are logarithms of it.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film import srgb
from raytracer.film.light_field.field import LightField
from raytracer.lightfield.ray_binning import rays_to_views
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.lightfield.viewer.depth_layer import encode_depth, focus_range, viewer_depth
from raytracer.lightfield.viewer.size_budget import (
    ViewPlan,
    choose_encoding,
    fit_to_size,
    plan_views,
    planned_views,
    resize_view,
)
from raytracer.report import page as html
from raytracer.report.wording import megabytes
from raytracer.util.atomic_write import write_bytes
from raytracer.util.progress import Update

DEFAULT_BYTES = 40_000_000
"""Default of the most bytes of a page."""

MIN_BYTES = 1_000_000
"""Bytes in which any light field can be shown."""


# Bytes of all but the views: scripts, styles, the depth map, the still picture.
_BYTES_BESIDES_VIEWS = 500_000
_STILL_SIZE = 480


class Page(NamedTuple):
    """Page of a light field.

    html : UTF-8.
    notes : sentences about what was left out.
    """

    html: bytes
    notes: tuple[str, ...]


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
    code, exposure = choose_encoding(planned_views(field, plan), len(plan.places), exposure)
    plan, pictures, quality = fit_to_size(field, plan, code, size - _BYTES_BESIDES_VIEWS)
    notes += _notes(field, plan, quality, size)

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
        "still": _fallback_image(field, exposure),
    }
    return Page(html.page("lightfield", title, data), tuple(notes))


def write_page(
    path: str | Path,
    field: LightField,
    *,
    title: str = "light field",
    size: int = DEFAULT_BYTES,
    exposure: float | None = None,
    update: Update | None = None,
) -> tuple[str, ...]:
    """Write the page of a light field (`page`) to a file.

    Returns
    -------
    Sentences about what was left out, which the page shows too.

    Raises
    ------
    ValueError : as `page`.
    OutputError : the file cannot be written.
    """
    made = page(field, title=title, size=size, exposure=exposure, update=update)
    write_bytes(path, made.html)
    return made.notes


def _notes(field: LightField, plan: ViewPlan, quality: int | None, size: int) -> list[str]:
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


def _fallback_image(field: LightField, exposure: float) -> str:
    """Encode the view from the middle, for browsers without WebGL."""
    views = field.views
    scale = min(1.0, _STILL_SIZE / max(views.width, views.height))
    view = resize_view(
        field.view(*views.nearest()), max(1, round(scale * views.width)), max(1, round(scale * views.height))
    )
    return html.jpeg(srgb.to_uint8(2.0**exposure * view))


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
