"""Where the microlenses are: pitch, rotation and offset of their grid, from a picture of something evenly white.

The grid's two frequencies are first taken from the peaks of a spectrum.  Then the picture is cut into blocks of a few
microlenses each, and the phase of both frequencies in a block says where its microlenses are; a plane through the
phases of all blocks, fitted by robust least squares, corrects the frequencies and gives the offset.  A block's phase
is the middle of its sub-images whatever their shape, as long as that is symmetric; it takes no thresholds, a slope of
the light over the block does not move it, and blocks with dust or without light fall out.

References: Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic
Cameras", sec. 3 (grid from a white picture); Schambach, Puente Leon 2020, "Microlens Array Grid Estimation, Light Field
Decoding, and Calibration", IEEE Trans. Comput. Imaging 6 (what vignetting does to it).
"""

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.plenoptic.resampling import Lattice
from raytracer.untrusted import contents

Floats = NDArray[np.float64]

SMALLEST_PITCH, LARGEST_PITCH = 4.0, 64.0
"""Distances (pixels) of microlenses that are looked for."""

_SPECTRUM_SIZE = 1536
"""Pixels a side of the part whose spectrum is taken: a hundred microlenses and more, in a fraction of a second."""

_BLOCK = 6.0
"""Microlenses a side of a block: few enough to lose little to a speck of dust, enough to tell frequencies apart."""

_FEWEST = 8
"""Microlenses a side that a picture must hold: a block, and its neighbours."""

_LEAST_PROMINENCE = 6.0
"""Of a peak over the root mean square of the spectrum around it: noise reaches it once in 10^15 places."""

_RELATED = 0.2
"""Part of the strongest peak's height from which on another one counts."""

_PEAKS = 24
"""Peaks that are looked at: a grid has six of its first kind, and as many of the second and the third."""

_AROUND = 63
"""Frequencies a side of what is around a peak: many times a peak's own width, which is a few."""

_ALIKE, _SQUARE, _HEXAGONAL = 1.2, 0.15, (0.35, 0.62)
"""Of two frequencies that may span a grid: the ratio of their lengths at most, and the cosine between them, of 90 or of
60 degrees; both are 1 and 0 or 0.5 but for the error of a first guess."""

_AS_GOOD = 0.02
"""Share of the peaks' heights by which one pair must explain more than another not to be as good."""

_DARKEST_BLOCK = 0.05
"""Of the blocks' median: darker ones are not made brighter than this would be."""

_ROUNDS = 3
"""Of the fit: each starts from frequencies so much better that the third changes nothing that matters."""

_LEAST_AMPLITUDE = 0.4
"""Of the blocks' median: less contrast is a block that is covered, clipped, or half outside the light."""

_PHASE_NOISE = 0.02
"""Cycles by which a block's phase may be off before it counts as wrong."""

_LEAST_PHASE_NOISE = 0.001
"""Cycles below which a block's phase is never told to be wrong."""

_OBLIQUE = 0.25
"""Cosine between two steps of a lattice from which on it is hexagonal (0.5) and not square (0)."""

_LARGEST_CHANGE = 0.05
"""Part by which the light may change from one microlens to the next, where it does not do so all over the picture."""

_LARGEST_RESIDUAL = 0.06
"""Cycles that the median of the blocks may be off; of phases at random it is 0.25."""

_LEAST_SHARE = 0.25
"""Of all blocks that must show the grid."""

_TEMPLATE = 12.0
"""Microlenses a side of the part in the picture's middle over which sub-images are averaged."""

_LARGEST_FILE, _LARGEST_NUMBER = 1 << 20, 1e9
"""Bytes of a file with a grid, and pixels of its lengths: far above all that there are."""

_CLIPPED_SHARE = 0.98
"""Of a picture's pixels at one and the same largest value: nothing is left to see."""


@dataclass(frozen=True)
class Grid:
    """A grid of microlenses, as found.

    Attributes
    ----------
    lattice : the middles of the sub-images, counted from the one nearest to the picture's middle.
    width, height : pixels of the raw pictures that it is of.
    residual : how far blocks of microlenses are from it (raw pixels, root mean square of those that were used).
    blocks : how many of those there were, and of how many.
    diameter : of a sub-image (raw pixels): of the disc as large as the part that is at least half as bright as its
        middle.
    """

    lattice: Lattice
    width: int
    height: int
    residual: float = 0.0
    blocks: tuple[int, int] = (0, 0)
    diameter: float = 0.0

    @property
    def layout(self) -> str:
        """Of the microlenses: `square` or `hexagonal`."""
        return "hexagonal" if self.lattice.hexagonal else "square"

    def as_dict(self) -> dict[str, Any]:
        """For a file: lengths in raw pixels, right and down from the picture's top left corner, angles in degrees."""
        lattice = self.lattice
        return {
            "layout": self.layout,
            "pitch": lattice.pitch,
            "rotation": lattice.rotation,
            "offset": list(lattice.origin),
            "along": list(lattice.along),
            "across": list(lattice.across),
            "diameter": self.diameter,
            "residual": self.residual,
            "blocks_used": self.blocks[0],
            "blocks": self.blocks[1],
            "width": self.width,
            "height": self.height,
        }


def grid_of(values: Mapping[str, Any], name: str) -> Grid:
    """The grid that `Grid.as_dict` wrote.

    Raises
    ------
    InputError : a key is missing or wrong; the message begins with `name`.
    """

    def vector(key: str) -> tuple[float, float]:
        found = values.get(key)
        if not (isinstance(found, list | tuple) and len(found) == 2):
            raise InputError(f"{name}: {key}: must be two numbers, right and down in pixels")
        return number(key, found[0]), number(key, found[1])

    def number(key: str, found: Any) -> float:
        if isinstance(found, bool) or not isinstance(found, int | float) or not abs(found) <= _LARGEST_NUMBER:
            raise InputError(f"{name}: {key}: must be a number, of at most {_LARGEST_NUMBER:g} pixels")
        return float(found)

    if not isinstance(values, Mapping):
        raise InputError(f"{name}: a grid is a JSON object with offset, along, across, width and height")
    missing = [key for key in ("offset", "along", "across", "width", "height") if key not in values]
    if missing:
        raise InputError(f"{name}: {missing[0]} is missing: a grid has offset, along, across, width and height")
    try:
        lattice = Lattice(vector("offset"), vector("along"), vector("across"))
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if lattice.pitch < 1.0 or lattice.area < 1.0:
        raise InputError(f"{name}: along, across: microlenses must be at least a pixel apart")
    width, height = number("width", values["width"]), number("height", values["height"])
    diameter = number("diameter", values.get("diameter", lattice.pitch))
    return Grid(lattice, int(width), int(height), number("residual", values.get("residual", 0.0)), (0, 0), diameter)


def read_grid(path: str | Path) -> Grid:
    """The grid in a JSON file, as `rt lightfield decode --json` prints it.

    Raises
    ------
    InputError : the file is missing, or holds no grid.
    """
    path = Path(path)
    try:
        values = json.loads(contents(path, _LARGEST_FILE).decode("utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no JSON file") from error
    return grid_of(values, str(path))


def find_grid(white: NDArray[Any], name: str = "white") -> Grid:
    """The grid of microlenses in a picture (height, width) of something evenly white, or of anything bright enough.

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
        why = (
            "is black" if high <= 0.0 else "is of one value everywhere: it is clipped, or not a picture of microlenses"
        )
        raise InputError(f"{name}: {why}; a white picture must show microlenses with darker gaps: expose it to match")

    # Single bright or dead pixels must not decide.
    sample = white[:: max(1, height // _SPECTRUM_SIZE), :: max(1, width // _SPECTRUM_SIZE)]
    bottom, top = np.quantile(sample, (0.001, 0.999))
    frequencies = _frequencies(_middle_part(white), float(bottom), float(top), name)

    rows = 1.0 / float(np.linalg.norm(frequencies, axis=1).mean())
    # The rows of hexagons are closer than their microlenses, of squares as close.
    apart = abs(float(frequencies[0] @ frequencies[1])) > _OBLIQUE * float(frequencies[0] @ frequencies[0])
    pitch = (2.0 / math.sqrt(3.0) if apart else 1.0) * rows
    if min(width, height) < _FEWEST * pitch:
        raise InputError(
            f"{name}: has {width} x {height} pixels, which are fewer than {_FEWEST} microlenses of {pitch:.3g} pixels "
            "a side: too few to measure"
        )
    tilts = np.zeros((2, 2), dtype=np.complex128)
    for _ in range(_ROUNDS):
        measured = _block_phases(white, frequencies, tilts, pitch, float(bottom), float(top))
        fits = [_plane(one, width, height) for one in measured]
        frequencies = frequencies + np.array([fit.slope for fit in fits])
        phases = np.array([fit.phase for fit in fits])
        residual = max(fit.residual for fit in fits)
        used, blocks = min(fit.used for fit in fits), measured[0].phasor.size
        if not math.isfinite(residual):
            raise _no_grid(name)
        lattice = _lattice(frequencies, phases, (0.5 * width, 0.5 * height))
        subimages = _subimages(white, lattice, float(bottom), float(top))
        tilts = np.array([_tilt(subimages, frequency) for frequency in frequencies])
    return Grid(lattice, width, height, residual * lattice.pitch, (used, blocks), _lit_diameter(subimages, lattice))


def _no_grid(name: str) -> InputError:
    return InputError(
        f"{name}: shows no regular grid of microlenses {SMALLEST_PITCH:g} to {LARGEST_PITCH:g} pixels apart; take an "
        "evenly bright picture with the same camera for --white, or give the grid with --grid"
    )


# ---- first guess, from the spectrum


def _middle_part(picture: NDArray[Any]) -> NDArray[Any]:
    height, width = picture.shape
    rows, columns = min(height, _SPECTRUM_SIZE), min(width, _SPECTRUM_SIZE)
    top, left = (height - rows) // 2, (width - columns) // 2
    return picture[top : top + rows, left : left + columns]


def _frequencies(part: NDArray[Any], bottom: float, top: float, name: str) -> Floats:
    """The two shortest frequencies (2, 2) of a grid, right and down (cycles a pixel)."""
    from scipy.fft import fft2, fftshift
    from scipy.ndimage import maximum_filter, uniform_filter

    height, width = part.shape
    if min(height, width) < _FEWEST * SMALLEST_PITCH:
        raise InputError(f"{name}: has {width} x {height} pixels, too few to hold microlenses")
    values = np.clip(part.astype(np.float64), bottom, top)
    values = (values - values.mean()) * np.hanning(height)[:, None] * np.hanning(width)
    power = np.abs(fftshift(fft2(values)))
    fx = (np.arange(width) - width // 2) / width
    fy = (np.arange(height) - height // 2) / height
    radius = np.hypot(fx, fy[:, None])

    # The rows of hexagons are closer to one another than microlenses, and their frequency is higher for it.
    usable = (radius > 1.0 / LARGEST_PITCH) & (radius < 2.0 / math.sqrt(3.0) / SMALLEST_PITCH)
    if not usable.any():
        raise _no_grid(name)
    around = np.sqrt(uniform_filter(power * power, size=(min(height, _AROUND), min(width, _AROUND))))
    peaks = (power == maximum_filter(power, size=5)) & usable & (fy[:, None] >= 0.0)
    rows, columns = np.nonzero(peaks)
    order = np.argsort(power[rows, columns])[::-1][:_PEAKS]
    rows, columns = rows[order], columns[order]
    heights = power[rows, columns]
    if not len(heights):
        raise _no_grid(name)
    keep = (heights > _LEAST_PROMINENCE * around[rows, columns]) & (heights > _RELATED * heights[0])
    found = np.array([_finer(power, row, column) for row, column in zip(rows[keep], columns[keep], strict=True)])
    if len(found) < 2:
        raise _no_grid(name)
    found[:, 0] = (found[:, 0] - width // 2) / width
    found[:, 1] = (found[:, 1] - height // 2) / height
    return _basis(found, heights[keep], 2.0 / min(width, height), name)


def _finer(power: Floats, row: int, column: int) -> tuple[float, float]:
    """Column and row of a peak, by a parabola through the logarithms of three neighbours each way."""
    rows, columns = power.shape

    def top(before: float, at: float, after: float) -> float:
        a, b, c = (math.log(max(value, np.finfo(float).tiny)) for value in (before, at, after))
        curve = a - 2.0 * b + c
        return 0.0 if curve >= 0.0 else 0.5 * (a - c) / curve

    x = top(power[row, column - 1], power[row, column], power[row, (column + 1) % columns])
    y = top(power[row - 1, column], power[row, column], power[(row + 1) % rows, column])
    return column + x, row + y


def _basis(peaks: Floats, heights: Floats, tolerance: float, name: str) -> Floats:
    """Of all pairs of peaks that may span a square or hexagonal grid, the coarsest of those that explain most."""
    best: tuple[float, float, Floats] | None = None
    for i, j in itertools.combinations(range(len(peaks)), 2):
        pair = peaks[[i, j]]
        lengths = np.linalg.norm(pair, axis=1)
        cosine = abs(float(pair[0] @ pair[1]) / float(lengths.prod()))
        is_known = cosine < _SQUARE or _HEXAGONAL[0] < cosine < _HEXAGONAL[1]
        if max(lengths) > _ALIKE * min(lengths) or not is_known:
            continue
        orders = peaks @ np.linalg.inv(pair)
        away = np.linalg.norm((orders - np.rint(orders)) @ pair, axis=1)
        explained = float(heights[away < tolerance].sum() / heights.sum())
        size = abs(float(np.linalg.det(pair)))
        # A finer grid of frequencies explains all that a coarser one does, and must explain more to be preferred.
        more = math.inf if best is None else explained - best[0]
        if best is None or more > _AS_GOOD or (more > -_AS_GOOD and size > best[1]):
            best = (explained, size, pair)
    if best is None:
        raise _no_grid(name)
    return best[2]


# ---- phases of blocks


class _Blocks(NamedTuple):
    """Blocks of a picture.

    middle (rows, columns, 2), right and down; phasor, mean of the light times the frequency's wave; change, by what
    part the light changes from one microlens to the next.
    """

    middle: Floats
    phasor: NDArray[np.complex128]
    change: Floats


class _Plane(NamedTuple):
    """Phase (cycles) at the picture's corner and its slope (2,), right and down (cycles a pixel); residual (cycles)."""

    phase: float
    slope: Floats
    residual: float
    used: int


def _block_phases(
    white: NDArray[Any], frequencies: Floats, tilts: NDArray[np.complex128], pitch: float, bottom: float, top: float
) -> list[_Blocks]:
    """Blocks of the picture, for each frequency; `tilts` (frequencies, 2) as of `_tilt`."""
    sliding_window_view = np.lib.stride_tricks.sliding_window_view
    height, width = white.shape
    size = min(math.ceil(_BLOCK * pitch), width, height)
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
    floor = _DARKEST_BLOCK * float(np.median(mean)) + np.finfo(float).tiny
    phasors /= np.maximum(mean, floor)
    down, right = (
        np.gradient(mean, step, axis=axis) / np.maximum(mean, floor) if mean.shape[axis] > 1 else np.zeros(mean.shape)
        for axis in (0, 1)
    )
    phasors /= 1.0 - right * tilts[:, 0, None, None] - down * tilts[:, 1, None, None]
    change = pitch * np.hypot(right, down)
    return [_Blocks(middle, phasor, change) for phasor in phasors]


def _plane(blocks: _Blocks, width: int, height: int) -> _Plane:
    """The plane through the phases of blocks, from those in the middle outwards, where phases wrap at first."""
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
        if np.count_nonzero(inside) < _FEWEST:
            continue
        # What is left of the phases is about 0, and wraps only for blocks that are wrong.
        left = _left(phasor[inside], rows[inside], plane)
        fit = least_squares(
            lambda p, a, b: a @ p - b, np.zeros(3), loss="cauchy", f_scale=tolerance, args=(rows[inside], left)
        )
        plane = plane + fit.x
        spread = float(np.median(np.abs(_left(phasor[inside], rows[inside], plane))))
        tolerance = min(_PHASE_NOISE, max(_LEAST_PHASE_NOISE, 2.0 * spread))
    left = np.abs(_left(phasor, rows, plane))
    right = lit & (left < 3.0 * _PHASE_NOISE)
    used = int(np.count_nonzero(right))
    residual = float(np.sqrt(np.mean(left[right] ** 2))) if used else math.inf
    # Of phases at random some are right by chance, and the better half is not.
    if used < _LEAST_SHARE * len(left) or float(np.median(left[lit])) > _LARGEST_RESIDUAL:
        residual = math.inf
    slope = plane[1:] / scale
    return _Plane(float(plane[0] - slope @ centre), slope, residual, used)


def _left(phasor: NDArray[np.complex128], rows: Floats, plane: Floats) -> Floats:
    """What a plane leaves of phases (cycles)."""
    return np.asarray(np.angle(phasor * np.exp(-2j * np.pi * (rows @ plane))) / (2.0 * np.pi))


# ---- the lattice


def _lattice(frequencies: Floats, phases: Floats, middle: tuple[float, float]) -> Lattice:
    # A block's wave is c exp(-2 pi i k . o): the origin o is where both phases are 0.
    origin = np.linalg.solve(frequencies, -phases)
    steps = np.asarray(np.linalg.inv(frequencies), np.float64)
    along, across = _canonical(steps[:, 0], steps[:, 1])
    return Lattice((float(origin[0]), float(origin[1])), along, across).near(middle)


def _canonical(a: Floats, b: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """The shortest steps of a lattice: along rows, as far as they lead to the right, and to the next row below."""
    # Lagrange's reduction: the shorter is taken off the longer until neither gets shorter.
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
    # Of hexagons two neighbours are in the next row: the one to the right.
    across = max(others, key=lambda v: float(v @ along))
    return (float(along[0]), float(along[1])), (float(across[0]), float(across[1]))


class _Subimages(NamedTuple):
    """Pixels in the middle of a picture.

    light (n,) above black; offset (n, 2) from the middle of the nearest sub-image, right and down.
    """

    light: Floats
    offset: Floats


def _subimages(white: NDArray[Any], lattice: Lattice, bottom: float, top: float) -> _Subimages:
    height, width = white.shape
    size = math.ceil(_TEMPLATE * lattice.pitch)
    first_row, first = max(0, (height - size) // 2), max(0, (width - size) // 2)
    part = np.clip(white[first_row : first_row + size, first : first + size].astype(np.float64), bottom, top) - bottom
    x, y = first + np.arange(part.shape[1]) + 0.5, first_row + np.arange(part.shape[0]) + 0.5
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # The nearest by index may, of hexagons, be a neighbour of the nearest.
    base = np.rint(lattice.index(place))
    around = [place - lattice.place(base[:, 0] + i, base[:, 1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    offsets = np.stack(around)
    nearest = (offsets**2).sum(axis=-1).argmin(axis=0)
    return _Subimages(part.reshape(-1), offsets[nearest, np.arange(len(place))])


def _tilt(subimages: _Subimages, frequency: Floats) -> NDArray[np.complex128]:
    """What light that falls off from microlens to microlens does to a wave in it (2,), for each part of it a pixel.

    The light under one microlens is that at its middle, so that with a fall-off g from one to the next a block holds
    f (1 + g . (x - offset)): besides the wave c of f the first moments m of one sub-image, c - g . m.
    """
    wave = subimages.light * np.exp(-2j * np.pi * (subimages.offset @ frequency))
    return np.asarray((wave @ subimages.offset) / wave.sum())


def _lit_diameter(subimages: _Subimages, lattice: Lattice) -> float:
    """Of the disc as large as the part of a sub-image that is at least half as bright as its middle (pixels)."""
    light, away = subimages.light, np.hypot(subimages.offset[:, 0], subimages.offset[:, 1])
    bright = float(np.median(light[away < 0.25 * lattice.pitch]))
    share = np.count_nonzero(light >= 0.5 * bright) / light.size
    return min(lattice.pitch, 2.0 * math.sqrt(share * lattice.area / math.pi))
