"""Calibration of a microlens grid: its pitch, rotation and offset, from a picture of something evenly white.

The grid's two frequencies are first taken from the peaks of a spectrum (`grid_frequencies`).  Then the picture is cut
into blocks of a few microlenses each, and the phase of both frequencies in a block gives the place of its microlenses;
a plane through the phases of all blocks, fitted by robust least squares (`grid_phases`), corrects the frequencies and
gives the offset.

References: Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic
Cameras", sec. 3 (grid from a white picture); Schambach, Puente Leon 2020, "Microlens Array Grid Estimation, Light Field
Decoding, and Calibration", IEEE Trans. Comput. Imaging 6 (what vignetting does to it).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import Lattice
from raytracer.lightfield.decoding.grid_frequencies import (
    MIN_MICROLENSES,
    SPECTRUM_SIZE,
    find_frequencies,
    middle_part,
    no_grid_error,
)
from raytracer.lightfield.decoding.grid_phases import fit_plane, measure_blocks
from raytracer.lightfield.decoding.microlens_grid import Grid
from raytracer.lightfield.decoding.subimages import collect_subimages, lit_diameter, wave_tilt
from raytracer.util.errors import InputError

Floats = NDArray[np.float64]

_ROUNDS = 3
"""Rounds of the fit: each starts from so much better frequencies that the third changes nothing that matters."""


_OBLIQUE = 0.25
"""Least cosine between two steps of a lattice that is hexagonal (0.5) and not square (0)."""


_CLIPPED_SHARE = 0.98
"""Share of the pixels at one and the same largest value from which on a picture is clipped everywhere."""


def find_grid(white: NDArray[Any], name: str = "white") -> Grid:
    """Find the grid of microlenses in a picture (height, width) of something evenly white, or of anything bright.

    Parameters
    ----------
    name : of the picture, with which messages begin.

    Raises
    ------
    InputError : the picture is too small, black, clipped everywhere, or shows no regular grid.
    """
    height, width = white.shape
    low, high = float(white.min()), float(white.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError(f"{name}: holds values that are not numbers")
    if high == low or np.count_nonzero(white == high) > _CLIPPED_SHARE * white.size:
        reason = (
            "is black" if high <= 0.0 else "is of one value everywhere: it is clipped, or not a picture of microlenses"
        )
        raise InputError(
            f"{name}: {reason}; a white picture must show microlenses with darker gaps: expose it to match"
        )

    # Quantiles, so that single bright or dead pixels do not decide.
    sample = white[:: max(1, height // SPECTRUM_SIZE), :: max(1, width // SPECTRUM_SIZE)]
    bottom, top = np.quantile(sample, (0.001, 0.999))
    frequencies = find_frequencies(middle_part(white), float(bottom), float(top), name)

    rows = 1.0 / float(np.linalg.norm(frequencies, axis=1).mean())
    # The rows of hexagons are closer than their microlenses, of squares as close.
    is_hexagonal = abs(float(frequencies[0] @ frequencies[1])) > _OBLIQUE * float(frequencies[0] @ frequencies[0])
    pitch = (2.0 / math.sqrt(3.0) if is_hexagonal else 1.0) * rows
    if min(width, height) < MIN_MICROLENSES * pitch:
        raise InputError(
            f"{name}: has {width} x {height} pixels, which are fewer than {MIN_MICROLENSES} microlenses of {pitch:.3g} "
            "pixels a side: too few to measure"
        )
    tilts = np.zeros((2, 2), dtype=np.complex128)
    for _ in range(_ROUNDS):
        measured = measure_blocks(white, frequencies, tilts, pitch, float(bottom), float(top))
        fits = [fit_plane(one, width, height) for one in measured]
        frequencies = frequencies + np.array([fit.slope for fit in fits])
        phases = np.array([fit.phase for fit in fits])
        residual = max(fit.residual for fit in fits)
        used, blocks = min(fit.used for fit in fits), measured[0].phasor.size
        if not math.isfinite(residual):
            raise no_grid_error(name)
        lattice = _make_lattice(frequencies, phases, (0.5 * width, 0.5 * height))
        subimages = collect_subimages(white, lattice, float(bottom), float(top))
        tilts = np.array([wave_tilt(subimages, frequency) for frequency in frequencies])
    return Grid(lattice, width, height, residual * lattice.pitch, (used, blocks), lit_diameter(subimages, lattice))


def _make_lattice(frequencies: Floats, phases: Floats, middle: tuple[float, float]) -> Lattice:
    """Make the lattice of two frequencies and their phases (cycles), counted from near the picture's middle."""
    # A block's wave is c exp(-2 pi i k . o): the origin o is where both phases are 0.
    origin = np.linalg.solve(frequencies, -phases)
    steps = np.asarray(np.linalg.inv(frequencies), np.float64)
    along, across = _reduce_basis(steps[:, 0], steps[:, 1])
    return Lattice((float(origin[0]), float(origin[1])), along, across).near(middle)


def _reduce_basis(a: Floats, b: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """Find the shortest steps of a lattice: along rows, the most to the right, and to the next row below."""
    # Lagrange's reduction: subtract the shorter from the longer until neither gets shorter.
    while True:
        if a @ a > b @ b:
            a, b = b, a
        times = round(float(a @ b) / float(a @ a))
        if times == 0:
            break
        b = b - times * a
    neighbours = [a, b, b - a if a @ b > 0.0 else b + a]
    if abs(float(a @ b)) < _OBLIQUE * float(a @ a):
        neighbours = neighbours[:2]
    neighbours = [v if v[0] > 0.0 or (v[0] == 0.0 and v[1] > 0.0) else -v for v in neighbours]
    along = max(neighbours, key=lambda v: float(v[0]) / float(np.linalg.norm(v)))
    others = [v if v[1] * along[0] - v[0] * along[1] > 0.0 else -v for v in neighbours if v is not along]
    # A hexagon has two neighbours in the next row: take the one to the right.
    across = max(others, key=lambda v: float(v @ along))
    return (float(along[0]), float(along[1])), (float(across[0]), float(across[1]))
