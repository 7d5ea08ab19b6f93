"""Corners of a checkerboard in the views of a light field: found in the middle one, and followed to the others."""

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LIT_LAYER, LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.calibrating.bundle_adjustment import FEWEST_VIEWS, BoardView, view_steps
from raytracer.lightfield.calibrating.checkerboard import differentiate, find_board, refine_corners
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.util.errors import InputError

Floats = NDArray[np.float64]

_MOST_VIEWS = 49
"""Views of which corners are taken, evenly over the lens: more tell little more, and take as much longer."""

_WHOLE, _FEWEST_VIEWS = 0.99, 5
"""Share of the light of a view whose cell the lens fills, and fewest of these, without which all views are taken."""

_FOLLOWED = 0.4
"""Distance that a corner may move from view to view, as a share of the distance of corners."""

_LEAST_SEEN = 0.5
"""Least share of a view's corners that are found, and least share of the views."""


def find_corners(field: LightField, rows: int, columns: int, name: str) -> BoardView:
    """Find the inner corners of a board with rows x columns of them, in at most `_MOST_VIEWS` views of a light field.

    Raises
    ------
    InputError : there are too few views, or the board is not to be seen in the middle one, or in too few others.
    """
    views = field.views
    if views.rows * views.columns < FEWEST_VIEWS:
        raise InputError(
            f"{name}: has {views.columns} x {views.rows} views, and a calibration needs at least {FEWEST_VIEWS}"
        )
    middle = (views.rows // 2, views.columns // 2)
    board = find_board(_brightness(field, middle), rows, columns)
    if board is None:
        raise InputError(f"{name}: shows no whole checkerboard of {columns} x {rows} inner corners in its middle view")
    chosen = _choose_views(views, middle)
    steps = view_steps(views.rows, views.columns)
    known = {middle: board.reshape(-1, 2)}
    reach = _FOLLOWED * float(np.hypot(*(board[:, 1:] - board[:, :-1]).reshape(-1, 2).T).min())
    # From the middle outwards, each from where a line through the views that are known expects it.
    for view in sorted(chosen, key=lambda at: float(np.hypot(*(steps[at] - steps[middle])))):
        if view == middle:
            continue
        expected = _expect(known, steps, view)
        found = refine_corners(differentiate(_brightness(field, view)), expected, reach)
        if np.isfinite(found[:, 0]).mean() >= _LEAST_SEEN:
            known[view] = found
    if len(known) < _LEAST_SEEN * len(chosen):
        raise InputError(
            f"{name}: shows the checkerboard in {len(known)} of {len(chosen)} views only: is it in motion?"
        )
    order = sorted(known)
    corners = np.stack([known[view] for view in order]).reshape(len(order), rows, columns, 2)
    # Places are counted from the middle of a pixel, and geometry from its edge.
    return BoardView(name, np.array([steps[view] for view in order]), corners + 0.5)


def _choose_views(views: Views, middle: tuple[int, int]) -> list[tuple[int, int]]:
    """Choose views evenly, with the middle one, as rows and columns.

    The lens covers a part of the cells at its rim: their light comes from elsewhere than from the cells' middles.
    """
    weight = cell_weights(views)
    is_whole = weight >= _WHOLE * weight.max()
    if np.count_nonzero(is_whole) < _FEWEST_VIEWS:
        is_whole = weight > 0.0
    extent = [int(np.count_nonzero(is_whole.any(axis=1 - axis))) for axis in (0, 1)]
    side = max(1, int(np.sqrt(_MOST_VIEWS)))

    # Steps that leave at most `side` of them.
    steps = [-(-count // side) for count in extent]
    places = np.argwhere(is_whole)
    on_grid = ((places - middle) % steps == 0).all(axis=1)
    return [(int(row), int(column)) for row, column in places[on_grid]]


def _brightness(field: LightField, view: tuple[int, int]) -> Floats:
    """Take the square root of a view's light, where it is lit: noise of photons is the same everywhere then."""
    light = np.asarray(field.view(*view), np.float64).mean(axis=2)
    if LIT_LAYER in field.layers:
        light = np.where(np.asarray(field.layers[LIT_LAYER][view]) > 0, light, 0.0)
    return np.asarray(np.sqrt(np.maximum(light, 0.0)))


def _expect(known: dict[tuple[int, int], Floats], steps: Floats, view: tuple[int, int]) -> Floats:
    """Expect corners (n, 2) in a view: those of the nearest known one, moved as the others tell."""
    nearest = min(known, key=lambda at: float(np.hypot(*(steps[at] - steps[view]))))
    start = known[nearest]
    middle = next(iter(known))
    away = np.array([steps[at] - steps[nearest] for at in known])
    moved = np.array([np.nanmean(known[at] - start, axis=0) for at in known])
    total = float((away**2).sum())
    slope = float((away * moved).sum()) / total if total > 0.0 else 0.0
    # What one view has lost is expected where the middle one has it.
    aside = known[middle] + slope * (steps[view] - steps[middle])
    return np.asarray(np.where(np.isfinite(start), start + slope * (steps[view] - steps[nearest]), aside))
