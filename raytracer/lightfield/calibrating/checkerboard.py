"""Corners of a checkerboard in views of a light field, to a fraction of a pixel.

A corner is a saddle of the brightness, which the zero of the gradient of a smoothed picture gives: by symmetry
smoothing
does not move it.  The corners of one view are put in order by their neighbours, and followed from view to view.

References: Lucchese, Mitra 2002, "Using Saddle Points for Subpixel Feature Detection in Camera Calibration Targets".
"""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BLUR = 1.0
"""Standard deviation of the smoothing (px): a little more than the edges of pictures have."""

_PEAK = 5
"""Pixels a side of the neighbourhood in which a corner is the strongest saddle."""

_CANDIDATES = 3
"""Saddles that are looked at, for each corner of the board."""

_WEAKEST = 0.1
"""Strength of a corner, as a share of that of the median one, below which it is none."""

_AWAY = 0.3
"""Distance of a corner from where its neighbours let expect it, as a share of their distance."""

_STEPS, _SMALL = 12, 1e-4
"""Newton's steps to a saddle, at most, and the step that ends them (px)."""


class Derivatives(NamedTuple):
    """Derivatives of a smoothed picture (height, width), right and down."""

    x: Floats
    y: Floats
    xx: Floats
    xy: Floats
    yy: Floats


def differentiate(picture: Floats) -> Derivatives:
    """Compute the derivatives of a picture (height, width)."""
    from scipy.ndimage import gaussian_filter

    orders = ((0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
    return Derivatives(*(gaussian_filter(picture, _BLUR, order=order, mode="nearest") for order in orders))


def refine_corners(slopes: Derivatives, places: Floats, reach: Floats | float) -> Floats:
    """Move places (n, 2) (px, of pixels' middles) to the saddles next to them; nan if none is within `reach` (px)."""
    from scipy.ndimage import map_coordinates

    height, width = slopes.x.shape
    moved = np.array(places, dtype=np.float64)
    step = np.full(moved.shape, np.inf)
    is_saddle = np.zeros(len(moved), bool)
    for _ in range(_STEPS):
        at = np.nan_to_num(moved[:, ::-1].T)
        x, y, xx, xy, yy = (map_coordinates(each, at, order=3, mode="nearest") for each in slopes)
        determinant = xx * yy - xy * xy
        is_saddle = determinant < 0.0
        safe = np.where(is_saddle, determinant, -1.0)
        step = np.column_stack([xy * y - yy * x, xy * x - xx * y]) / safe[:, None]
        length = np.hypot(*step.T)
        # No step leaves the pixel's neighbourhood, which the derivatives tell of.
        moved += step / np.maximum(1.0, length)[:, None]
        if length.max(initial=0.0) < _SMALL:
            break
    inside = (moved >= 0.0).all(axis=1) & (moved <= (width - 1, height - 1)).all(axis=1)
    good = is_saddle & inside & (np.hypot(*(moved - places).T) <= reach) & (np.hypot(*step.T) < 100.0 * _SMALL)
    moved[~good] = np.nan
    return moved


def find_board(picture: Floats, rows: int, columns: int) -> Floats | None:
    """Find the inner corners (rows, columns, 2) of a checkerboard in a picture (height, width); None if it is not seen.

    Places are right and down from the middle of the first pixel (px).
    """
    from scipy.ndimage import maximum_filter

    slopes = differentiate(picture)
    strength = np.maximum(0.0, slopes.xy**2 - slopes.xx * slopes.yy)
    peaks = np.argwhere((strength == maximum_filter(strength, _PEAK)) & (strength > 0.0))
    order = np.argsort(-strength[tuple(peaks.T)], kind="stable")
    peaks = peaks[order][: _CANDIDATES * rows * columns]
    if len(peaks) < rows * columns:
        return None
    heights = strength[tuple(peaks.T)]
    peaks = peaks[heights > _WEAKEST * np.median(heights[: rows * columns])]
    places = refine_corners(slopes, peaks[:, ::-1].astype(np.float64), _PEAK / 2.0)
    heights = strength[tuple(peaks.T)]
    good = np.isfinite(places).all(axis=1)
    places, heights = places[good], heights[good]
    if len(places) < rows * columns:
        return None
    # The board may not be in the middle: begin with each of some, until one has a whole board around it.
    centre = np.median(places, axis=0)
    for start in np.argsort(((places - centre) ** 2).sum(axis=1))[:_CANDIDATES]:
        board = _choose_block(_grow(places, int(start)), places, heights, rows, columns)
        if board is not None:
            return board
    return None


def _grow(places: Floats, start: int) -> dict[tuple[int, int], int]:
    """Number corners by column and row, from one to its neighbours and on."""
    away = places - places[start]
    nearest = np.argsort((away**2).sum(axis=1))[1:9]
    first = away[nearest[0]]
    cosines = (away[nearest] @ first) / (np.linalg.norm(away[nearest], axis=1) * np.linalg.norm(first))
    aside = nearest[np.abs(cosines) < 0.5]
    if not len(aside):
        return {}
    second = away[aside[0]]
    if first[0] * second[1] - first[1] * second[0] < 0.0:
        second = -second
    known = {(0, 0): start}
    steps = {(0, 0): (first, second)}
    queue = deque([(0, 0)])
    used = {start}
    while queue:
        place = queue.popleft()
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            beside = (place[0] + sign * (axis == 0), place[1] + sign * (axis == 1))
            if beside in known:
                continue
            step = sign * steps[place][axis]
            expected = places[known[place]] + step
            distance = np.hypot(*(places - expected).T)
            index = int(distance.argmin())
            if distance[index] > _AWAY * np.hypot(*step) or index in used:
                continue
            known[beside] = index
            used.add(index)
            new = [steps[place][0], steps[place][1]]
            new[axis] = sign * (places[index] - places[known[place]])
            steps[beside] = (new[0], new[1])
            queue.append(beside)
    return known


def _choose_block(
    known: dict[tuple[int, int], int], places: Floats, heights: Floats, rows: int, columns: int
) -> Floats | None:
    """Choose the strongest whole block of rows x columns, and turn it so that its rows run to the right."""
    if len(known) < rows * columns:
        return None
    numbers = np.array(list(known))
    first = numbers.min(axis=0)
    width, height = numbers.max(axis=0) - first + 1
    index = np.full((height, width), -1)
    for (column, row), number in known.items():
        index[row - first[1], column - first[0]] = number
    best: tuple[float, NDArray[np.int_]] | None = None
    # A quarter turn keeps the board's sense of rotation.
    for turned in (
        {(rows, columns): [index], (columns, rows): [np.rot90(index)]}.values() if rows != columns else [[index]]
    ):
        for grid in turned:
            for top in range(grid.shape[0] - rows + 1):
                for left in range(grid.shape[1] - columns + 1):
                    block = grid[top : top + rows, left : left + columns]
                    total = float(heights[block].sum())
                    if (block >= 0).all() and (best is None or total > best[0]):
                        best = (total, block)
    if best is None:
        return None
    board = places[best[1]]
    turns = range(4) if rows == columns else (0, 2)
    return max(
        (np.rot90(board, turn) for turn in turns), key=lambda each: float((each[:, -1] - each[:, 0])[:, 0].sum())
    )
