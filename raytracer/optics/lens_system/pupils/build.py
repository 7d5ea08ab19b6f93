"""Tables of pupils: built by rays, and kept on the disk."""

import hashlib
import io
import itertools
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.cache import CACHE_FOLDER
from raytracer.core.compiler.kernel_files import load_signed, save_signed
from raytracer.optics.lens_system.pupils.search import PupilSampler, WorkCounter, fit_ellipse
from raytracer.optics.lens_system.pupils.tables import QuadrantPupilTable, RadialPupilTable
from raytracer.optics.lens_system.surfaces import LensSurfaces

Points = NDArray[np.float64]

# Places of the table along the radius of the film, and along each side of a quadrant of it.
_RADII, _SIDES = 24, 6

# Bisections that find where the picture ends, and parts of the radius that are worked on at once.
_EDGE_HALVINGS, _BATCHES = 14, 7

# Steps between two places of the table, and in the last step of the radius, at which it is checked that what is
# interpolated holds the pupil; and rounds in which ellipses grow until it does.
_BETWEEN, _CLOSE, _MAX_ROUNDS = 8, 64, 12

# Factor by which ellipses are enlarged in the end, for what lies between the points that were checked.
_MARGIN = 1.003


def load_pupil_table(
    lens: LensSurfaces, film_z: float, half: tuple[float, float], wavelengths: Sequence[float], *, is_round: bool
) -> RadialPupilTable | QuadrantPupilTable:
    """Load the pupils of a lens for all places of a film from the disk, or build them.

    Parameters
    ----------
    lens : as the camera packs it, focused and stopped down.
    film_z (mm) : place of the film, in the lens's frame.
    half (mm) : half the film's width and height.
    wavelengths (nm) : lowest and highest that will be sampled, or the only one; without effect for a lens without
        indices.
    is_round : whether the lens is symmetric about its axis.

    Raises
    ------
    ValueError : the search takes more than `MAX_CROSSINGS`, or the pupil is too irregular for ellipses.
    """
    path = CACHE_FOLDER / f"pupils-{_digest(lens, film_z, half, wavelengths, is_round)}.npz"
    content = load_signed(path)
    if content is not None:
        kind: type[RadialPupilTable | QuadrantPupilTable] = RadialPupilTable if is_round else QuadrantPupilTable
        with np.load(io.BytesIO(content)) as stored:
            return kind(np.ascontiguousarray(stored["ellipses"]), float(stored["first"]), float(stored["second"]))
    table: RadialPupilTable | QuadrantPupilTable
    if is_round:
        table = _build_radial_table(lens, film_z, math.hypot(*half), wavelengths)
    else:
        table = _build_quadrant_table(lens, film_z, half, wavelengths)
    buffer = io.BytesIO()
    np.savez(buffer, ellipses=table[0], first=table[1], second=table[2])
    # Where that fails, it is built each time.
    save_signed(path, buffer.getvalue())
    return table


def _digest(*parts: Any) -> str:
    """Hash the inputs of pupil tables besides the program, which their folder is named by."""
    digest = hashlib.sha256()

    def add(part: Any) -> None:
        if isinstance(part, tuple | list):
            digest.update(f"{type(part).__name__}{len(part)}(".encode())
            for item in part:
                add(item)
        elif isinstance(part, np.ndarray):
            digest.update(f"{part.dtype}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())

    add(parts)
    return digest.hexdigest()[:24]


def _build_radial_table(
    lens: LensSurfaces, film_z: float, radius: float, wavelengths: Sequence[float]
) -> RadialPupilTable:
    """Build the table for places up to a distance from the axis (mm)."""
    work = WorkCounter()
    edge, reached = math.inf, _lit_radius(PupilSampler(lens, film_z, wavelengths, work), radius)
    if reached < radius:
        radius, edge = reached, reached
    if radius == 0.0:
        return RadialPupilTable(np.zeros((2, 3)), 1.0, 0.0)

    def hulls(part: Points) -> list[Points]:
        pupil = PupilSampler(lens, film_z, wavelengths, work)
        return [pupil.hull(float(place) * radius / _RADII, 0.0) for place in part]

    points_by_place = list(itertools.chain(*_in_parallel(hulls, np.array_split(np.arange(_RADII + 1), _BATCHES))))
    # The pupil at the very edge may be too small to be points_by_place again.
    lit = [points for points in points_by_place if len(points)]
    ellipses = np.array([fit_ellipse(points if len(points) else lit[-1], centred=True) for points in points_by_place])

    # Where the picture ends, the pupil shrinks the faster the smaller it is.
    between = np.append(np.arange(_BETWEEN * _RADII + 1) / _BETWEEN, _RADII - np.arange(_CLOSE) / _CLOSE)
    places = []
    for place in between.tolist():
        row = min(int(place), _RADII - 1)
        part = place - row
        places.append(_FilmPoint(place * radius / _RADII, 0.0, (row, row + 1), (1.0 - part, part)))
    _grow_ellipses(ellipses, places, PupilSampler(lens, film_z, wavelengths, work))
    ellipses[:, 2:] *= _MARGIN
    return RadialPupilTable(np.ascontiguousarray(ellipses[:, [0, 2, 3]]), _RADII / radius, edge)


def _lit_radius(pupil: PupilSampler, radius: float) -> float:
    """Find the distance from the axis (mm) up to which light arrives: at most `radius`, 0 if it arrives nowhere."""
    if pupil.is_lit(radius):
        return radius
    lit, dark = 0.0, radius
    if not pupil.is_lit(0.0):
        return 0.0
    for _halving in range(_EDGE_HALVINGS):
        middle = 0.5 * (lit + dark)
        lit, dark = (middle, dark) if pupil.is_lit(middle) else (lit, middle)
    return lit


def _build_quadrant_table(
    lens: LensSurfaces, film_z: float, half: tuple[float, float], wavelengths: Sequence[float]
) -> QuadrantPupilTable:
    """Build the table for places of a quadrant with these sides (mm)."""
    count, work = _SIDES + 1, WorkCounter()

    def hulls(row: int) -> list[Points]:
        pupil = PupilSampler(lens, film_z, wavelengths, work)
        return [pupil.hull(half[0] * column / _SIDES, half[1] * row / _SIDES) for column in range(count)]

    points_by_place = list(itertools.chain(*_in_parallel(hulls, range(count))))
    lit = np.array([number for number, points in enumerate(points_by_place) if len(points)], np.int64)
    if not len(lit):
        return QuadrantPupilTable(np.zeros((2, 2, 4)), 1.0 / half[0], 1.0 / half[1])
    # What is dark may lie beside what is not, and has its ellipse.
    nearest = [
        int(lit[np.hypot(lit // count - number // count, lit % count - number % count).argmin()])
        for number in range(len(points_by_place))
    ]
    ellipses = np.array([fit_ellipse(points_by_place[number], centred=False) for number in nearest])

    places = []
    between = range(_BETWEEN * _SIDES + 1)
    for v, u in itertools.product(between, between):
        up, across = v / _BETWEEN, u / _BETWEEN
        row, column = min(int(up), _SIDES - 1), min(int(across), _SIDES - 1)
        below, left = row + 1 - up, column + 1 - across
        rows = tuple(count * (row + i) + column + j for i, j in itertools.product((0, 1), repeat=2))
        weights = tuple(a * b for a, b in itertools.product((below, 1.0 - below), (left, 1.0 - left)))
        places.append(_FilmPoint(half[0] * across / _SIDES, half[1] * up / _SIDES, rows, weights))
    _grow_ellipses(ellipses, places, PupilSampler(lens, film_z, wavelengths, work))
    ellipses[:, 2:] *= _MARGIN
    return QuadrantPupilTable(ellipses.reshape(count, count, 4), _SIDES / half[0], _SIDES / half[1])


class _FilmPoint(NamedTuple):
    """A place of the film (mm), and the ellipses between which its own is interpolated, with their weights."""

    x: float
    y: float
    rows: tuple[int, ...]
    weights: tuple[float, ...]


def _grow_ellipses(ellipses: Points, places: Sequence[_FilmPoint], pupil: PupilSampler) -> None:
    """Grow ellipses (n, 4) until they hold the pupil at all of these places.

    Raises
    ------
    ValueError : they do not after `_MAX_ROUNDS`.
    """

    def growth_factor(place: _FilmPoint) -> float:
        return pupil.growth_factor(place.x, place.y, np.asarray(place.weights) @ ellipses[list(place.rows)])

    # An ellipse that has grown holds what it held before.
    for _round in range(_MAX_ROUNDS):
        if not places:
            return
        factors = _in_parallel(growth_factor, places)
        growth = np.ones(len(ellipses))
        for place, factor in zip(places, factors, strict=True):
            for row, weight in zip(place.rows, place.weights, strict=True):
                growth[row] = max(growth[row], factor if weight > 0.0 else 1.0)
        ellipses[:, 2:] *= growth[:, None]
        places = [place for place, factor in zip(places, factors, strict=True) if factor > 1.0]
    if places:
        raise ValueError(
            f"where light passes the lens is not found in {_MAX_ROUNDS} rounds, the limit: its pupil is too irregular "
            f"at {len(places)} places of the film"
        )


def _in_parallel(work: Any, pieces: Sequence[Any]) -> list[Any]:
    with ThreadPoolExecutor(min(len(pieces), os.cpu_count() or 1)) as pool:
        return list(pool.map(work, pieces))
