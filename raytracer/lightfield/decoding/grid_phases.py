"""Fit of a microlens grid: phases of its frequencies in blocks of the picture, and the plane through these.

A block's phase is the middle of its sub-images whatever their shape, as long as that is symmetric; it takes no
thresholds, a slope of the light over the block does not move it, and blocks with dust or without light fall out.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lightfield.decoding.grid_frequencies import MIN_MICROLENSES

Floats = NDArray[np.float64]

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
