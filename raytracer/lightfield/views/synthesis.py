"""Views of a light field: those that it has, those between them, and all of them on one picture.

References: Gortler et al. 1996, "The Lumigraph", sec. 3.4 (views between others, with what is known of the depth);
    Buehler et al. 2001, "Unstructured Lumigraph Rendering".
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.lightfield.coverage import at_nearest, lit_view, lit_views, within_lens
from raytracer.lightfield.depth import Depth
from raytracer.lightfield.warping import Spline
from raytracer.plenoptic.field import LightField
from raytracer.plenoptic.views import Views

_Picture = NDArray[np.float64]

_SAME = 1e-9
"""Share of a view in one between others below which it is left out: what it adds is less than a picture holds."""

_UNLIT = 0.2159
"""Of white: the grey 128 of sRGB, which stands for what is not known."""

_NEARER = 0.5
"""Pixels between two neighbouring views' places of a point, by which something must be nearer to hide another."""


class Share(NamedTuple):
    """A view, and how much of it is in one between others."""

    row: int
    column: int
    weight: float


def shares(views: Views, right: float, up: float) -> list[Share]:
    """The views around a place in their plane (m), weighted linearly; of places outside, those at the nearest within.

    Four views where they stand in rows and columns, else three.
    """
    place = np.array([right, up])
    grid = within_lens(views)
    columns, rows = views.position[0, :, 0], views.position[:, 0, 1]
    is_regular = (
        bool(grid.all())
        and bool(np.all(views.position[..., 0] == columns) and np.all(views.position[..., 1] == rows[:, None]))
        and bool(np.all(np.diff(columns) > 0.0) and np.all(np.diff(rows) < 0.0))
    )
    if is_regular:
        column, row = _between(columns, right), _between(-rows, -up)
        found = [
            Share(r, c, weight_r * weight_c)
            for r, weight_r in row
            for c, weight_c in column
            if weight_r * weight_c > _SAME
        ]
    else:
        found = _of_triangle(views.position, grid, place)
    total = sum(share.weight for share in found)
    return [share._replace(weight=share.weight / total) for share in found]


def _between(places: NDArray[np.float64], at: float) -> list[tuple[int, float]]:
    """The two of rising places around one, with linear weights; the end beyond it."""
    at = float(np.clip(at, places[0], places[-1]))
    last = min(int(np.searchsorted(places, at)), len(places) - 1)
    if places[last] == at or last == 0:
        return [(last, 1.0)]
    part = (at - places[last - 1]) / (places[last] - places[last - 1])
    return [(last - 1, 1.0 - float(part)), (last, float(part))]


def _of_triangle(position: NDArray[np.float64], grid: NDArray[np.bool_], place: NDArray[np.float64]) -> list[Share]:
    """The corners of the triangle of lit views that holds a place; the nearest view where there is none."""
    from scipy import spatial

    indices = np.argwhere(grid)
    places = position[grid]
    try:
        mesh = spatial.Delaunay(places)
        number = int(mesh.find_simplex(place))
    except (spatial.QhullError, ValueError):
        # Fewer than three views, or all of them in one line.
        number = -1
    if number < 0:
        nearest = int(np.hypot(*(places - place).T).argmin())
        return [Share(int(indices[nearest][0]), int(indices[nearest][1]), 1.0)]
    transform = mesh.transform[number]
    two = transform[:2] @ (place - transform[2])
    weights = [float(two[0]), float(two[1]), float(1.0 - two.sum())]
    return [
        Share(int(indices[corner][0]), int(indices[corner][1]), weight)
        for corner, weight in zip(mesh.simplices[number], weights, strict=True)
        if weight > _SAME
    ]


def view_at(
    field: LightField,
    right: float,
    up: float,
    *,
    depth: Depth | None = None,
    distance: float | None = None,
) -> _Picture:
    """What a pinhole at a place in the plane of the views sees, float64 (height, width, 3).

    A view of the field where the place is one's own; else of the four views around (three, where views do not stand in
    rows and columns) each pixel's own colours, weighted linearly.  Outside all views it is as at their edge.

    Parameters
    ----------
    right, up : the place, from the middle (m).
    depth : of some view: each pixel is taken from where its own point is in the views around, and not from those in
        which something hides it.
    distance : of the plane (m) that is sharp without `depth`; default: that in which all views see the same.
    """
    around = shares(field.views, right, up)
    if len(around) == 1:
        return field.view(around[0].row, around[0].column)
    views = field.views
    place = sum(share.weight * views.position[share.row, share.column] for share in around)
    inverse = views.inverse_focus if distance is None else 1.0 / distance
    if depth is None:
        return sum(
            share.weight
            * Spline(lit_view(field, share.row, share.column)[0]).moved(
                *_shift(views, views.position[share.row, share.column] - place, inverse)
            )[0]
            for share in around
        )  # type: ignore[return-value]

    here = carried(depth, views, place)
    total, weight = np.zeros((views.height, views.width, 3)), np.zeros((views.height, views.width, 1))
    plain = np.zeros_like(total)
    for share in around:
        there = views.position[share.row, share.column]
        right_of, down_of = shifts(views, there - place, here)
        value, is_seen = taken(field, share.row, share.column, right_of, down_of)
        # What is nearer there hides this point.
        theirs = Spline(carried(depth, views, there)).at(*_places(right_of, down_of))[0]
        step = np.hypot(*(there - place)) / views.plane.pixel
        is_free = is_seen & ((theirs - here) * step < _NEARER)
        total += share.weight * np.where(is_free[..., None], value, 0.0)
        weight += share.weight * is_free[..., None]
        plain += share.weight * value
    return np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), plain)


def shifts(views: Views, offset: NDArray[np.float64], inverse: _Picture) -> tuple[_Picture, _Picture]:
    """Pixels right and down by which points at 1 / distance are moved in a view `offset` (m) away."""
    moved = (views.inverse_focus - inverse) / views.plane.pixel
    return offset[0] * moved, -offset[1] * moved


def _shift(views: Views, offset: NDArray[np.float64], inverse: float) -> tuple[float, float]:
    right, down = shifts(views, offset, np.asarray(inverse))
    return float(right), float(down)


def _places(right: _Picture, down: _Picture) -> tuple[_Picture, _Picture]:
    """Rows and columns of all pixels, each moved by so much."""
    height, width = right.shape
    return np.arange(height)[:, None] + down, np.arange(width)[None, :] + right


def taken(
    field: LightField, row: int, column: int, right: _Picture, down: _Picture
) -> tuple[_Picture, NDArray[np.bool_]]:
    """Each pixel from a place of its own in a view, so far right and down of it: values, and whether they are in it."""
    view, lit = lit_view(field, row, column)
    rows, columns = _places(right, down)
    values, is_in = Spline(view).at(rows, columns)
    return values, is_in if lit is None else is_in & at_nearest(lit, rows, columns)


def carried(depth: Depth, views: Views, place: NDArray[np.float64]) -> _Picture:
    """1 / distance as seen from another place in the plane of the views (m), float64 (height, width).

    Each pixel is carried over, and what is nearer hides what is behind it; what no pixel reaches is seen past an edge,
    and as far as the farther thing there.
    """
    from scipy import ndimage

    inverse = depth.inverse
    height, width = inverse.shape
    right, down = shifts(views, place - views.position[depth.row, depth.column], inverse)
    rows, columns = _places(right, down)
    carried = np.full((height, width), -np.inf)
    # All pixels that a moved one covers in part.
    for floor_row in (np.floor(rows), np.ceil(rows)):
        for floor_column in (np.floor(columns), np.ceil(columns)):
            r, c = floor_row.astype(np.int64), floor_column.astype(np.int64)
            is_in = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            np.maximum.at(carried, (r[is_in], c[is_in]), inverse[is_in])
    missing = np.isneginf(carried)
    while missing.any() and not missing.all():
        grown = ndimage.minimum_filter(np.where(missing, np.inf, carried), 3, mode="nearest")
        carried = np.where(missing & np.isfinite(grown), grown, carried)
        missing = np.isneginf(carried)
    return np.where(missing, inverse, carried)


def montage(field: LightField, *, width: int | None = None, gap: int = 2) -> _Picture:
    """All views on one picture, as they stand, the highest row first: float64 (height, width, 3), gaps white.

    Views that no light came to are grey.  Views are read one at a time, and made smaller by averaging whole pixels.

    Parameters
    ----------
    width : of the picture in pixels, at most; default: views keep their size.
    gap : pixels between views.

    Raises
    ------
    InputError : there is no room for a pixel of each view.
    """
    views = field.views
    room = math.inf if width is None else (width - gap * (views.columns - 1)) / views.columns
    if room < 1.0:
        raise InputError(f"a picture {width} pixels wide has no room for {views.columns} views in a row")
    factor = max(1, math.ceil(views.width / room))
    factor = min(factor, views.width, views.height)
    small = views.height // factor, views.width // factor
    whole = np.ones(
        (views.rows * (small[0] + gap) - gap, views.columns * (small[1] + gap) - gap, 3),
    )
    lit = lit_views(field)
    for row in range(views.rows):
        for column in range(views.columns):
            view = field.view(row, column)[: small[0] * factor, : small[1] * factor]
            view = view.reshape(small[0], factor, small[1], factor, 3).mean(axis=(1, 3))
            view = view if lit[row, column] else np.full_like(view, _UNLIT)
            top, left = row * (small[0] + gap), column * (small[1] + gap)
            whole[top : top + small[0], left : left + small[1]] = view
    return whole
