"""Calibration of a microlens grid: its pitch, rotation and offset, from a picture of something evenly white.

The grid's two frequencies are first taken from the peaks of a spectrum (`grid_frequencies`).  Then the picture is cut
into blocks of a few microlenses each, and the phase of both frequencies in a block gives the place of its microlenses;
a plane through the phases of all blocks, fitted by robust least squares, corrects the frequencies and gives the offset.
A block's phase is the middle of its sub-images whatever their shape, as long as that is symmetric; it takes no
thresholds, a slope of the light over the block does not move it, and blocks with dust or without light fall out.

References: Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic
Cameras", sec. 3 (grid from a white picture); Schambach, Puente Leon 2020, "Microlens Array Grid Estimation, Light Field
Decoding, and Calibration", IEEE Trans. Comput. Imaging 6 (what vignetting does to it).
"""

import math
from typing import Any, NamedTuple

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
from raytracer.lightfield.decoding.microlens_grid import Grid
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
        tilts = np.array([wave_tilt(*subimages, frequency) for frequency in frequencies])
    return Grid(lattice, width, height, residual * lattice.pitch, (used, blocks), lit_diameter(*subimages, lattice))


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


_BLOCK_SIZE = 6.0
"""Microlenses a side of a block: few enough to lose little to a speck of dust, enough to separate frequencies."""

_DARKEST_BLOCK_SIZE = 0.05
"""Least light by which a block's phasor is divided, as a share of the blocks' median."""

_LEAST_AMPLITUDE = 0.4
"""Least contrast of a block, as a share of the blocks' median: less is covered, clipped, or half outside the light."""

_PHASE_NOISE = 0.02
"""Error of a block's phase (cycles) above which it counts as an outlier."""

_LEAST_PHASE_NOISE = 0.001
"""Error of a block's phase (cycles) below which it never counts as an outlier."""

_LARGEST_CHANGE = 0.05
"""Most change of the light from one microlens to the next, as a share, unless it is like that all over the picture."""

_LARGEST_RESIDUAL = 0.06
"""Most error of the median block (cycles); that of random phases is 0.25."""

_LEAST_SHARE = 0.25
"""Least share of the blocks that must show the grid."""


class BlockPhases(NamedTuple):
    """Phases of one frequency in the blocks of a picture.

    middle : of the blocks (pixels), right and down, (rows, columns, 2).
    phasor : mean of the light times the frequency's wave, (rows, columns).
    change : of the light from one microlens to the next, as a share, (rows, columns).
    """

    middle: Floats
    phasor: NDArray[np.complex128]
    change: Floats


class PhasePlane(NamedTuple):
    """Plane through the phases of blocks.

    phase : at the picture's corner (cycles).
    slope : (2,), right and down (cycles a pixel).
    residual : RMS of the blocks that were used (cycles); inf if the fit fails.
    used : number of these blocks.
    """

    phase: float
    slope: Floats
    residual: float
    used: int


def measure_blocks(
    white: NDArray[Any], frequencies: Floats, tilts: NDArray[np.complex128], pitch: float, bottom: float, top: float
) -> list[BlockPhases]:
    """Measure the phases of each frequency in all blocks of the picture; `tilts` (frequencies, 2) as of `wave_tilt`."""
    sliding_window_view = np.lib.stride_tricks.sliding_window_view
    height, width = white.shape
    size = min(math.ceil(_BLOCK_SIZE * pitch), width, height)
    step = max(1, size // 2)
    # Half a pixel in, a window that is 0 just outside the block.
    window = np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 2
    tops, lefts = (np.arange(0, extent - size + 1, step) for extent in (height, width))

    waves_x = np.exp(-2j * np.pi * frequencies[:, :1] * (np.arange(width) + 0.5))
    phasors = np.empty((len(frequencies), len(tops), len(lefts)), dtype=np.complex128)
    mean = np.empty(phasors.shape[1:])
    for i, start in enumerate(tops):
        strip = np.clip(white[start : start + size].astype(np.float64), bottom, top) - bottom
        waves_y = window * np.exp(-2j * np.pi * frequencies[:, 1:] * (start + np.arange(size) + 0.5))
        # One product of contiguous matrices: single vectors would go through the strip column by column.
        lines = np.concatenate([waves_y.real, waves_y.imag, window[None]]) @ strip
        count = len(frequencies)
        waves = (lines[:count] + 1j * lines[count : 2 * count]) * waves_x
        phasors[:, i] = sliding_window_view(waves, size, axis=1)[:, ::step] @ window
        mean[i] = sliding_window_view(lines[-1], size)[::step] @ window
    middle = np.stack(np.meshgrid(lefts + 0.5 * size, tops + 0.5 * size), axis=-1)
    # Of the light that there is, so that a darker border counts as much as the middle.
    floor = _DARKEST_BLOCK_SIZE * float(np.median(mean)) + np.finfo(float).tiny
    phasors /= np.maximum(mean, floor)
    down, right = (
        np.gradient(mean, step, axis=axis) / np.maximum(mean, floor) if mean.shape[axis] > 1 else np.zeros(mean.shape)
        for axis in (0, 1)
    )
    phasors /= 1.0 - right * tilts[:, 0, None, None] - down * tilts[:, 1, None, None]
    change = pitch * np.hypot(right, down)
    return [BlockPhases(middle, phasor, change) for phasor in phasors]


def fit_plane(blocks: BlockPhases, width: int, height: int) -> PhasePlane:
    """Fit a plane to the phases of blocks by robust least squares, from the middle outwards, since phases wrap."""
    from scipy.optimize import least_squares

    middle, phasor, change = blocks.middle.reshape(-1, 2), blocks.phasor.reshape(-1), blocks.change.reshape(-1)
    amplitude = np.abs(phasor)
    lit = amplitude > _LEAST_AMPLITUDE * float(np.median(amplitude))
    lit &= change < max(_LARGEST_CHANGE, 3.0 * float(np.median(change)))
    centre = np.array([0.5 * width, 0.5 * height])
    scale = 0.5 * max(width, height)
    at = (middle - centre) / scale
    rows = np.column_stack([np.ones(len(at)), at])
    radius = np.abs(at).max(axis=1)

    plane = np.zeros(3)
    plane[0] = np.angle(phasor[lit & (radius <= max(0.25, float(radius.min())))].sum()) / (2.0 * np.pi)
    tolerance = _PHASE_NOISE
    for reach in (0.25, 0.5, 1.0, 1.0):
        inside = lit & (radius <= reach)
        if np.count_nonzero(inside) < MIN_MICROLENSES:
            continue
        # Residual phases are about 0, and wrap only for outliers.
        residuals = _phase_residual(phasor[inside], rows[inside], plane)
        fit = least_squares(
            lambda p, a, b: a @ p - b, np.zeros(3), loss="cauchy", f_scale=tolerance, args=(rows[inside], residuals)
        )
        plane = plane + fit.x
        spread = float(np.median(np.abs(_phase_residual(phasor[inside], rows[inside], plane))))
        tolerance = min(_PHASE_NOISE, max(_LEAST_PHASE_NOISE, 2.0 * spread))
    residuals = np.abs(_phase_residual(phasor, rows, plane))
    inliers = lit & (residuals < 3.0 * _PHASE_NOISE)
    used = int(np.count_nonzero(inliers))
    residual = float(np.sqrt(np.mean(residuals[inliers] ** 2))) if used else math.inf
    # Some random phases fit by chance, but not the better half of them.
    if used < _LEAST_SHARE * len(residuals) or float(np.median(residuals[lit])) > _LARGEST_RESIDUAL:
        residual = math.inf
    slope = plane[1:] / scale
    return PhasePlane(float(plane[0] - slope @ centre), slope, residual, used)


def _phase_residual(phasor: NDArray[np.complex128], rows: Floats, plane: Floats) -> Floats:
    """Subtract a plane from phases (cycles), wrapped to -0.5..0.5."""
    return np.asarray(np.angle(phasor * np.exp(-2j * np.pi * (rows @ plane))) / (2.0 * np.pi))


_SAMPLE_SIZE = 12.0
"""Microlenses a side of the part in the picture's middle whose sub-images are taken together."""


def collect_subimages(white: NDArray[Any], lattice: Lattice, bottom: float, top: float) -> tuple[Floats, Floats]:
    """Collect the pixels in the middle of a picture, clipped to `bottom` ... `top`, by their place in a sub-image.

    Their light above black (n), and their offset from the middle of the nearest sub-image, right and down (px, n x 2).
    """
    height, width = white.shape
    size = math.ceil(_SAMPLE_SIZE * lattice.pitch)
    first_row, first = max(0, (height - size) // 2), max(0, (width - size) // 2)
    part = np.clip(white[first_row : first_row + size, first : first + size].astype(np.float64), bottom, top) - bottom
    x, y = first + np.arange(part.shape[1]) + 0.5, first_row + np.arange(part.shape[0]) + 0.5
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # The nearest by index may, of hexagons, be a neighbour of the nearest.
    base = np.rint(lattice.index(place))
    around = [place - lattice.place(base[:, 0] + i, base[:, 1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    offsets = np.stack(around)
    nearest = (offsets**2).sum(axis=-1).argmin(axis=0)
    return part.reshape(-1), offsets[nearest, np.arange(len(place))]


def wave_tilt(light: Floats, offset: Floats, frequency: Floats) -> NDArray[np.complex128]:
    """Compute the tilt (2,) of a wave for each unit of fall-off of the light a pixel.

    The light under one microlens is that at its middle, so that with a fall-off g from one to the next a block holds
    f (1 + g . (x - offset)): besides the wave c of f the first moments m of one sub-image, c - g . m.
    """
    wave = light * np.exp(-2j * np.pi * (offset @ frequency))
    return np.asarray((wave @ offset) / wave.sum())


def lit_diameter(light: Floats, offset: Floats, lattice: Lattice) -> float:
    """Measure the diameter (pixels) of the disc as large as the part of a sub-image above half its peak light."""
    bright = float(np.median(light[np.hypot(offset[:, 0], offset[:, 1]) < 0.25 * lattice.pitch]))
    share = np.count_nonzero(light >= 0.5 * bright) / light.size
    return min(lattice.pitch, 2.0 * math.sqrt(share * lattice.area / math.pi))
