"""View synthesis: what a pinhole between the views of a light field sees.

References: Gortler et al. 1996, "The Lumigraph", sec. 3.4 (views between others, with what is known of the depth);
    Buehler et al. 2001, "Unstructured Lumigraph Rendering".
"""

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import lit_at_nearest, lit_view, within_lens
from raytracer.lightfield.depth.depth_map import Depth
from raytracer.lightfield.depth.estimate import HIDING_PARALLAX
from raytracer.lightfield.splines import Spline

FloatArray = NDArray[np.float64]

_LEAST_WEIGHT = 1e-9
"""Weight of a view below which it is left out: its part is less than a picture resolves."""


class ViewWeight(NamedTuple):
    """Weight of a view in one between others."""

    row: int
    column: int
    weight: float


def view_weights(views: Views, right: float, up: float) -> list[ViewWeight]:
    """Find the views around a place in their plane (m), and their linear weights; outside, those of the nearest place.

    Four views where they stand in rows and columns, else three.
    """
    place = np.array([right, up])
    grid = within_lens(views)
    columns, rows = views.position[0, :, 0], views.position[:, 0, 1]
    is_aligned = (views.position[..., 0] == columns) & (views.position[..., 1] == rows[:, None])
    if (grid & is_aligned).all() and (np.diff(columns) > 0.0).all() and (np.diff(rows) < 0.0).all():
        pairs = itertools.product(_linear_weights(-rows, -up), _linear_weights(columns, right))
        shares = [ViewWeight(r, c, weight_r * weight_c) for (r, weight_r), (c, weight_c) in pairs]
    else:
        shares = _triangle_weights(views.position, grid, place)
    shares = [share for share in shares if share.weight > _LEAST_WEIGHT]
    total = sum(share.weight for share in shares)
    return [share._replace(weight=share.weight / total) for share in shares]


def _linear_weights(places: NDArray[np.float64], at: float) -> list[tuple[int, float]]:
    """Find the two of rising places around one, and their linear weights; beyond an end that alone."""
    at = float(np.clip(at, places[0], places[-1]))
    last = min(int(np.searchsorted(places, at)), len(places) - 1)
    if places[last] == at or last == 0:
        return [(last, 1.0)]
    part = (at - places[last - 1]) / (places[last] - places[last - 1])
    return [(last - 1, 1.0 - float(part)), (last, float(part))]


def _triangle_weights(
    position: NDArray[np.float64], grid: NDArray[np.bool_], place: NDArray[np.float64]
) -> list[ViewWeight]:
    """Find the triangle of views around a place, and their linear weights; the nearest view where there is none."""
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
        row, column = indices[nearest].tolist()
        return [ViewWeight(row, column, 1.0)]
    transform = mesh.transform[number]
    two = transform[:2] @ (place - transform[2])
    weights = [float(two[0]), float(two[1]), float(1.0 - two.sum())]
    corners = indices[mesh.simplices[number]].tolist()
    return [ViewWeight(row, column, weight) for (row, column), weight in zip(corners, weights, strict=True)]


def view_at(
    field: LightField, right: float, up: float, *, depth: Depth | None = None, distance: float | None = None
) -> FloatArray:
    """Render the view of a pinhole at a place in the plane of the views, float64 (height, width, 3).

    At the place of a view it is that view; else the linear mean of the four views around (three, where views are not in
    rows and columns).  Outside all views it is as at their edge.

    Parameters
    ----------
    right, up : the place, from the middle (m).
    depth : of some view: each pixel is taken from the place of its own point in the views around, without those in
        which something hides it.
    distance : of the plane (m) that is sharp without `depth`; default: that in which all views see the same.
    """
    around = view_weights(field.views, right, up)
    if len(around) == 1:
        return field.view(around[0].row, around[0].column)
    views = field.views
    place = sum(share.weight * views.position[share.row, share.column] for share in around)
    inverse = views.inverse_focus if distance is None else 1.0 / distance
    if depth is None:
        blended = np.zeros((views.height, views.width, 3))
        for share in around:
            right_of, down_of = pixel_shifts(views, views.position[share.row, share.column] - place, inverse)
            view = Spline(lit_view(field, share.row, share.column)[0])
            blended += share.weight * view.shifted(float(right_of), float(down_of))[0]
        return blended

    here = reproject_depth(depth, views, place)
    total, weight = np.zeros((views.height, views.width, 3)), np.zeros((views.height, views.width, 1))
    plain = np.zeros_like(total)
    for share in around:
        there = views.position[share.row, share.column]
        right_of, down_of = pixel_shifts(views, there - place, here)
        value, is_seen = sample_view(field, share.row, share.column, right_of, down_of)
        # A nearer point in that view hides this one.
        other_inverse = Spline(reproject_depth(depth, views, there)).at(*_places(right_of, down_of))[0]
        step = np.hypot(*(there - place)) / views.plane.pixel
        is_free = is_seen & ((other_inverse - here) * step < HIDING_PARALLAX)
        total += share.weight * np.where(is_free[..., None], value, 0.0)
        weight += share.weight * is_free[..., None]
        plain += share.weight * value
    return np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), plain)


def pixel_shifts(
    views: Views, offset: NDArray[np.float64], inverse: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Compute the pixels, right and down, by which points at 1 / distance move in a view `offset` (m) away."""
    moved = (views.inverse_focus - np.asarray(inverse)) / views.plane.pixel
    return offset[0] * moved, -offset[1] * moved


def _places(right: FloatArray, down: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Move all pixels by their shifts: rows and columns."""
    height, width = right.shape
    return np.arange(height)[:, None] + down, np.arange(width)[None, :] + right


def sample_view(
    field: LightField, row: int, column: int, right: FloatArray, down: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Sample a view at all pixels, moved right and down: values, and True for those within the view and lit."""
    view, lit = lit_view(field, row, column)
    rows, columns = _places(right, down)
    values, is_in = Spline(view).at(rows, columns)
    return values, is_in if lit is None else is_in & lit_at_nearest(lit, rows, columns)


def reproject_depth(depth: Depth, views: Views, place: NDArray[np.float64]) -> FloatArray:
    """Reproject 1 / distance to another place in the plane of the views (m), float64 (height, width).

    Each pixel is moved there, and nearer ones hide those behind.  Pixels that none reaches lie behind an edge, and get
    the farther distance beside it.
    """
    from scipy import ndimage

    inverse = depth.inverse
    height, width = inverse.shape
    right, down = pixel_shifts(views, place - views.position[depth.row, depth.column], inverse)
    rows, columns = _places(right, down)
    moved = np.full((height, width), -np.inf)
    # All pixels that a moved one covers in part.
    for round_row, round_column in itertools.product((np.floor, np.ceil), repeat=2):
        r, c = round_row(rows).astype(np.int64), round_column(columns).astype(np.int64)
        is_in = (r >= 0) & (r < height) & (c >= 0) & (c < width)
        np.maximum.at(moved, (r[is_in], c[is_in]), inverse[is_in])
    missing = np.isneginf(moved)
    while missing.any() and not missing.all():
        grown = ndimage.minimum_filter(np.where(missing, np.inf, moved), 3, mode="nearest")
        moved = np.where(missing & np.isfinite(grown), grown, moved)
        missing = np.isneginf(moved)
    return np.where(missing, inverse, moved)
