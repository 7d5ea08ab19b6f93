"""Middles of single sub-images, by the phases of the lattice's waves over the cell of each microlens.

The wave of a lattice's frequency k over the light of one sub-image, c = sum L(o) exp(-2 pi i k . o), turns by -2 pi k
. d if the sub-image is moved by d: its phase is the middle, for any symmetric shape, without a threshold.  The light of
other microlenses has no part in it, so that the edge of what is lit does no harm beyond the sub-images that it cuts.
The amplitude |c| / sum L is a measure of the shape: where a rim of the lens cuts sub-images ("cat's eyes"), and so
moves their middles, it changes as well.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import Lattice

Floats = NDArray[np.float64]

_CHUNK = 2_000_000
"""Pixels that are taken from the picture at a time."""


class Subimages(NamedTuple):
    """Measures of sub-images.

    light : sum over the cell (n,).
    away : of the middle from where the lattice has it, right and down (px, n x 2).
    amplitude : of each of the lattice's shortest waves, as a share of the light (n, 2 or 3).
    """

    light: Floats
    away: Floats
    amplitude: Floats


class Cells(NamedTuple):
    """Pixels around sub-images.

    light : above black (n, rows, columns).
    share : of a pixel that is in the cell of its microlens: a pixel on the side between two cells belongs to both.
    x, y : places of columns and rows from the middle (px), (n, columns) and (n, rows).
    """

    light: Floats
    share: Floats
    x: Floats
    y: Floats


class Levels(NamedTuple):
    """Values between which a picture is clipped, so that single bright or dead pixels do not decide."""

    bottom: float
    top: float


def shortest_frequencies(lattice: Lattice) -> Floats:
    """Compute the shortest frequencies of a lattice (cycles a pixel), right and down: 2 of squares, 3 of hexagons."""
    waves = np.linalg.inv(np.column_stack([lattice.along, lattice.across]))
    if not lattice.hexagonal:
        return np.asarray(waves)
    is_acute = np.dot(lattice.along, lattice.across) > 0.0
    return np.vstack([waves, waves[0] + waves[1] if is_acute else waves[0] - waves[1]])


def cell_steps(lattice: Lattice) -> Floats:
    """Find the steps to the neighbours whose sides bound the cell of a microlens, one of each opposite pair (px)."""
    steps = np.array([lattice.along, lattice.across])
    if not lattice.hexagonal:
        return steps
    is_acute = steps[0] @ steps[1] > 0.0
    return np.vstack([steps, steps[0] - steps[1] if is_acute else steps[0] + steps[1]])


def cell_radius(lattice: Lattice) -> float:
    """Compute how far the corners of a microlens's cell are from its middle, at most (px)."""
    longest = float(np.linalg.norm(cell_steps(lattice), axis=1).max())
    return longest / math.sqrt(3.0 if lattice.hexagonal else 2.0)


def measure_subimages(white: NDArray[Any], lattice: Lattice, middles: Floats, levels: Levels) -> Subimages:
    """Measure the sub-images that a lattice expects at `middles` (n, 2), whose cells must be inside the picture."""
    waves = shortest_frequencies(lattice)
    sums = np.empty(len(middles))
    phasors = np.empty((len(middles), len(waves)), np.complex128)
    number = max(1, _CHUNK // (2 * _reach(lattice) + 1) ** 2)
    for start in range(0, len(middles), number):
        part = slice(start, start + number)
        cells = take_cells(white, lattice, middles[part], levels)
        light = cells.light * cells.share
        sums[part] = light.sum(axis=(1, 2))
        # Real matrices, since NumPy multiplies those of mixed types without the library of linear algebra.
        turn = 2.0 * np.pi * cells.x[..., None] * waves[:, 0]
        across = light @ np.concatenate([np.cos(turn), -np.sin(turn)], axis=2)
        lines = across[..., : len(waves)] + 1j * across[..., len(waves) :]
        phasors[part] = (lines * np.exp(-2j * np.pi * cells.y[..., None] * waves[:, 1])).sum(axis=1)
    turns = np.angle(phasors) / (-2.0 * np.pi)
    away = turns @ np.linalg.pinv(waves).T
    amplitude = np.abs(phasors) / np.maximum(sums, np.finfo(float).tiny)[:, None]
    return Subimages(sums, np.asarray(away), amplitude)


def _reach(lattice: Lattice) -> int:
    """Return the pixels to each side of that of a sub-image's middle that its cell may touch."""
    return math.ceil(cell_radius(lattice) + 1.0)


def inside_margin(lattice: Lattice) -> float:
    """Return how far from the picture's edges middles must be for their cells to be inside (px)."""
    return _reach(lattice) + 1.0


def take_cells(white: NDArray[Any], lattice: Lattice, middles: Floats, levels: Levels) -> Cells:
    """Take the cells of microlenses out of a picture."""
    reach = _reach(lattice)
    around = np.arange(-reach, reach + 1)
    pixel = np.floor(middles).astype(np.intp)
    columns, rows = pixel[:, :1] + around, pixel[:, 1:] + around
    values = white[rows[:, :, None], columns[:, None, :]].astype(np.float64)
    light = np.clip(values, levels.bottom, levels.top) - levels.bottom
    x, y = columns + 0.5 - middles[:, :1], rows + 0.5 - middles[:, 1:]
    share = np.ones_like(light)
    for step in cell_steps(lattice):
        length = float(np.hypot(*step))
        across = (x * (step[0] / length))[:, None, :] + (y * (step[1] / length))[:, :, None]
        share *= np.clip(0.5 * length + 0.5 - np.abs(across), 0.0, 1.0)
    return Cells(light, share, x, y)
