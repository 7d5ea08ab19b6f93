"""Calibration of a microlens grid: its pitch, rotation and offset, from a picture of something evenly white.

The grid's two frequencies are first taken from the peaks of a spectrum (`grid_frequencies`).  Then the middles of
single sub-images are measured (`subimage_phases`), from the middle of what is lit outwards, and a lattice is fitted to
them by robust least squares: sub-images with dust, or at the edge of the light, fall out.  Last, the error that pixels
make is taken off the middles (`subimage_shape`), and the lattice is fitted once more.

Where a rim of the lens cuts sub-images, towards the border, they are moved by up to some pixels, and all to the same
side: no outliers, but a smaller pitch.  They also have another shape than those in the middle; the more a shape
differs, the less its sub-image counts.

References: Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic
Cameras", sec. 3 (grid from a white picture); Schambach, Puente Leon 2020, "Microlens Array Grid Estimation, Light Field
Decoding, and Calibration", IEEE Trans. Comput. Imaging 6 (what vignetting does to it).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.lattice import Lattice, rows_within
from raytracer.lightfield.decoding.grid_frequencies import (
    MIN_MICROLENSES,
    find_frequencies,
    no_grid_error,
)
from raytracer.lightfield.decoding.microlens_grid import Grid
from raytracer.lightfield.decoding.subimage_phases import (
    Levels,
    Subimages,
    inside_margin,
    measure_subimages,
    take_cells,
)
from raytracer.lightfield.decoding.subimage_shape import PixelBias, fit_shape, measure_bias
from raytracer.util.errors import InputError

Floats = NDArray[np.float64]

_OBLIQUE = 0.25
"""Least cosine between two steps of a lattice that is hexagonal (0.5) and not square (0)."""

_CLIPPED_SHARE = 0.98
"""Share of the pixels at one and the same largest value from which on a picture is clipped everywhere."""

_REACHES = (0.1, 0.2, 0.4, 1.0)
"""Parts of the picture, about the middle of what is lit, that are fitted in turn: a lattice that is right to a fifth
of a pitch at the edge of one part is right to half a pitch at that of the next."""


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
    levels = _check_levels(white, name)
    part, frequencies = find_frequencies(white, levels, name)
    rows = 1.0 / float(np.linalg.norm(frequencies, axis=1).mean())
    # The rows of hexagons are closer than their microlenses, of squares as close.
    is_hexagonal = abs(float(frequencies[0] @ frequencies[1])) > _OBLIQUE * float(frequencies[0] @ frequencies[0])
    pitch = (2.0 / math.sqrt(3.0) if is_hexagonal else 1.0) * rows
    if min(width, height) < MIN_MICROLENSES * pitch:
        raise InputError(
            f"{name}: has {width} x {height} pixels, which are fewer than {MIN_MICROLENSES} microlenses of {pitch:.3g} "
            "pixels a side: too few to measure"
        )
    lattice = _make_lattice(frequencies, part.phases(frequencies), part.middle)
    diagonal = math.hypot(width, height)
    for reach in _REACHES:
        lattice = fit_lattice(white, lattice, levels, reach * diagonal, name).lattice
    fit = fit_lattice(white, lattice, levels, diagonal, name)
    bias = measure_bias(fit_shape(white, fit.lattice, fit.sample, levels), fit.lattice, levels)
    fit = fit_lattice(white, fit.lattice, levels, diagonal, name, bias)
    lattice = _shortest(fit.lattice).near((0.5 * width, 0.5 * height))
    diameter = lit_diameter(white, lattice, fit.sample, levels)
    return Grid(lattice, width, height, fit.residual, (fit.used, fit.measured), diameter)


def _check_levels(white: NDArray[Any], name: str) -> Levels:
    """Find the levels between which a picture is clipped; an InputError says that it cannot show microlenses."""
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
    step = max(1, math.isqrt(white.size // _SAMPLE))
    bottom, top = np.quantile(white[::step, ::step], (0.001, 0.999))
    return Levels(float(bottom), float(top))


_SAMPLE = 2_000_000
"""Pixels from which quantiles are computed."""


def _make_lattice(frequencies: Floats, phases: Floats, middle: tuple[float, float]) -> Lattice:
    """Make the lattice of two frequencies and their phases (cycles), counted from near `middle`."""
    # A lattice's wave is c exp(-2 pi i k . o): the origin o is where both phases are 0.
    origin = np.linalg.solve(frequencies, -phases)
    steps = np.asarray(np.linalg.inv(frequencies), np.float64)
    along, across = _reduce_basis(steps[:, 0], steps[:, 1])
    return Lattice((float(origin[0]), float(origin[1])), along, across).near(middle)


def _shortest(lattice: Lattice) -> Lattice:
    """Return the same lattice by its shortest steps."""
    along, across = _reduce_basis(np.array(lattice.along), np.array(lattice.across))
    return Lattice(lattice.origin, along, across)


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


_MOST_MEASURED = 12_000
"""Sub-images that are measured, evenly over the picture: with errors of 0.05 pixels of each, the mean has 0.0005."""

_LEAST_LIGHT = 0.05
"""Least light of a sub-image that is measured, as a share of that of bright ones: less is noise and stray light."""

_LEAST_AMPLITUDE = 0.4
"""Least contrast of a sub-image, as a share of the median: less is covered, or half outside the light."""

_REFERENCE_SHARE = 0.05
"""Share of the sub-images, nearest to the picture's middle, whose shape is that of whole ones."""

_HARMLESS = 0.001
"""Error of a sub-image's middle (px) that is none: pictures without noise must not be judged by rounding."""

_SHAPE_NOISE = 2.0
"""Change of shape, in units of the median one of whole sub-images, at which a sub-image counts for a quarter."""

_AROUND = 9
"""Sub-images, about, over which a mean of shapes is taken."""

_LARGEST_RESIDUAL = 0.12
"""Distance (pitches) from the lattice up to which a sub-image can belong to it, if a rim cuts it."""

_LEAST_SHARE = 0.5
"""Least share of the lit sub-images that must be that near to the lattice; of random places it would be 0.05."""

_SAMPLE_SIZE = 144
"""Sub-images, nearest to the picture's middle, that are taken together."""

_OUTLIER = 4.0
"""Residual, in standard deviations, from which on a sub-image is not counted as used."""

_FIT_ROUNDS = 12
"""Rounds of reweighting: weights of a later one differ by less than matters."""


class LatticeFit(NamedTuple):
    """Lattice through the middles of sub-images.

    residual : of the sub-images that were used (px, RMS).
    used, measured : number of sub-images that fit, and of all that were measured.
    sample : middles of sub-images that fit, nearest to the picture's middle (px).
    """

    lattice: Lattice
    residual: float
    used: int
    measured: int
    sample: Floats


def fit_lattice(
    white: NDArray[Any], guess: Lattice, levels: Levels, reach: float, name: str, bias: PixelBias | None = None
) -> LatticeFit:
    """Measure sub-images at most `reach` (px) from the guess's origin, and fit a lattice to them.

    Parameters
    ----------
    bias : error of the middles that is taken off, once it is known.

    Raises
    ------
    InputError : too few sub-images are on one lattice.
    """
    height, width = white.shape
    middles = rows_within(guess, width, height, inside_margin(guess)).middles
    middles = middles[np.hypot(*(middles - guess.origin).T) <= max(reach, MIN_MICROLENSES * guess.pitch)]
    index = np.rint(guess.index(middles))
    if len(middles) > _MOST_MEASURED:
        # Of a regular part of them none would be next to another, but all might have the same place among pixels.
        chosen = np.random.default_rng(0).permutation(len(middles))[:_MOST_MEASURED]
        middles, index = middles[chosen], index[chosen]
    if len(middles) < MIN_MICROLENSES:
        raise no_grid_error(name)
    measured = measure_subimages(white, guess, middles, levels)
    lit = _lit(measured)
    if np.count_nonzero(lit) < MIN_MICROLENSES:
        raise no_grid_error(name)
    number = len(middles)
    middles, index = middles[lit], index[lit]
    measured = Subimages(*(values[lit] for values in measured))
    nearness = np.argsort(np.hypot(*(middles - (0.5 * width, 0.5 * height)).T), kind="stable")
    trust = _trust_by_shape(measured, index, nearness, guess.pitch)
    design = np.column_stack([np.ones(len(index)), index])
    places = middles + measured.away
    if bias is not None:
        places = places - bias.at(places)
    steps, away, scale = _robust_fit(design, places, trust)
    good = away <= _OUTLIER * scale
    used = int(np.count_nonzero(good))
    near = np.count_nonzero(away < _LARGEST_RESIDUAL * guess.pitch)
    if near < _LEAST_SHARE * len(index):
        raise no_grid_error(name)
    origin, along, across = ((float(x), float(y)) for x, y in steps)
    lattice = Lattice(origin, along, across)
    residual = float(np.sqrt(np.mean(away[good] ** 2)))
    sample = lattice.place(*index[nearness[good[nearness]][:_SAMPLE_SIZE]].T)
    return LatticeFit(lattice, residual, used, number, sample)


def _lit(measured: Subimages) -> NDArray[np.bool_]:
    """Tell which sub-images (n,) have light, and contrast."""
    lit = measured.light > _LEAST_LIGHT * float(np.quantile(measured.light, 0.9))
    amplitude = measured.amplitude.mean(axis=1)
    return np.asarray(
        lit & (amplitude > _LEAST_AMPLITUDE * float(np.median(amplitude[lit] if lit.any() else amplitude)))
    )


def _trust_by_shape(measured: Subimages, index: Floats, nearness: NDArray[np.intp], pitch: float) -> Floats:
    """Compute the weights of sub-images (n,), 0..1, which fall off as their shape is less that of the middle ones.

    What is cut off at the edge of a sub-image changes the amplitude of a wave by at least as much as its phase.
    """
    middle = nearness[: max(2 * MIN_MICROLENSES, round(_REFERENCE_SHARE * len(nearness)))]
    harmless = 2.0 * np.pi * _HARMLESS / pitch
    change = measured.amplitude / np.median(measured.amplitude[middle], axis=0) - 1.0
    trust = np.ones(len(index))
    # A single one, for what covers it, and those around it, of which the mean tells more than noise does.
    for each in (change, _mean_around(change, index)):
        size = np.abs(each - np.median(each[middle], axis=0)).max(axis=1)
        noise = max(float(np.median(size[middle])), harmless)
        trust /= (1.0 + (size / (_SHAPE_NOISE * noise)) ** 2) ** 2
    return trust


def _mean_around(values: Floats, index: Floats) -> Floats:
    """Compute the mean of values (n, k) over sub-images around each, by column and row (n, 2)."""
    from scipy.ndimage import uniform_filter

    first = index.min(axis=0)
    column, row = (index - first).astype(np.intp).T
    shape = (int(row.max()) + 1, int(column.max()) + 1)
    # Lattices of hexagons, counted along both of their steps, fill but a part of this rectangle.
    size = max(3, 2 * round(0.5 * math.sqrt(_AROUND * column.max() * row.max() / len(index))) + 1)
    present = np.zeros(shape)
    present[row, column] = 1.0
    number = uniform_filter(present, size, mode="constant")[row, column]
    sums = np.zeros((*shape, values.shape[1]))
    sums[row, column] = values
    return np.asarray(uniform_filter(sums, (size, size, 1), mode="constant")[row, column] / number[:, None])


def _robust_fit(design: Floats, places: Floats, trust: Floats) -> tuple[Floats, Floats, float]:
    """Fit `design @ steps` to places, with weights that are `trust` times what falls off with residuals.

    The steps (3, 2), the residuals (n,), and the scale of the errors along an axis.
    """
    weight = trust
    for _ in range(_FIT_ROUNDS):
        root = np.sqrt(weight)[:, None]
        steps = np.linalg.lstsq(design * root, places * root, rcond=None)[0]
        away = np.asarray(np.hypot(*(places - design @ steps).T), np.float64)
        # The median of a Rayleigh distribution is 1.18 of its errors along each axis.
        scale = max(_weighted_median(away, trust) / 1.1774, _HARMLESS)
        weight = trust / (1.0 + (away / scale) ** 2)
    return np.asarray(steps, np.float64), away, scale


def _weighted_median(values: Floats, weight: Floats) -> float:
    """Return the value that has half of the weight below it."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def lit_diameter(white: NDArray[Any], lattice: Lattice, middles: Floats, levels: Levels) -> float:
    """Measure the diameter (pixels) of the disc as large as the part of a sub-image above half its peak light."""
    cells = take_cells(white, lattice, middles, levels)
    light = cells.light * cells.share
    away = np.hypot(cells.x[:, None, :], cells.y[:, :, None])
    bright = float(np.median(light[away < 0.25 * lattice.pitch]))
    share = np.count_nonzero(light >= 0.5 * bright) / (len(middles) * lattice.area)
    return min(lattice.pitch, 2.0 * math.sqrt(share * lattice.area / math.pi))
