"""Where a lens's pupil is, as seen from each place of the film: what a camera aims its rays at.

On a plane across the axis, that of the exit pupil if it can be, an ellipse is put round all points through which light
of any wavelength gets from a place of the film to the scene.  Points of the ellipse are drawn evenly, so that its area,
which the weight of each ray has, is one over their density.  The ellipse is smallest at the places of a table, and
between these its middle and its axes are interpolated: what a picture shows does not depend on it, as long as it holds
the pupil.  So no rings come from steps between the places; in other renderers they came from areas that were not in the
weight.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH, sec. 3.3; Pharr,
Jakob, Humphreys 2023, "Physically Based Rendering", 4th ed., sec. 5.4.4 (bounds by radius, as boxes).
"""

import functools
import hashlib
import io
import itertools
import math
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.jit import CACHE_FOLDER, entry, generic
from raytracer.kernel_files import keep, kept
from raytracer.lanes import WIDTH
from raytracer.lenses.diaphragm import reach
from raytracer.lenses.first_order import cardinal_points, exit_pupil
from raytracer.lenses.packets import DIRECTION, ORIGIN, ROWS, WAVELENGTH, WEIGHT, trace_packet
from raytracer.lenses.surfaces import LensSurfaces, part, trace_rays

Points = NDArray[np.float64]

# Places of the table along the radius of the film, and along each side of a quadrant of it.
_RADII, _SIDES = 24, 6

# Points along an edge of the grids in which the pupil is looked for, boxes that are tried, and halvings that find its
# edge; rays from the middle of the stop that tell where it may be.
_GRID, _FINEST, _MOST_BOXES, _HALVINGS = 32, 160, 16, 14
_CHIEF_RAYS = 500

# Halvings that find where the picture ends, and parts of the radius that are worked on at once.
_EDGE_HALVINGS, _PIECES = 14, 7

# Directions in which what is farthest out stands for an outline.
_FITTED = 128

# Steps between two places of the table, and in the last step of the radius, at which it is seen whether what is
# interpolated holds the pupil; and rounds in which ellipses grow until it does.
_BETWEEN, _CLOSE, _MOST_ROUNDS = 8, 64, 12

# Rings round an ellipse, in units of its own size, that tell how far the pupil reaches out of it; their points; and by
# how much ellipses are larger in the end, for what lies between these.
_RINGS = 1.001 * 1.01 ** np.arange(48.0)
_AROUND = 360
_SPARE = 1.003

# Points along an edge of the grid by which the light of a pupil of any shape is added up.
_FINE = 512

# Surfaces that rays may cross in all while the pupil is looked for.  Of the shipped lenses the anamorphic one takes the
# most, 1.7e8, in 3 s; this is three times as many.
_MOST_CROSSINGS = 2**29


class RoundPupils(NamedTuple):
    """Packed, of a lens that is alike all around its axis: an ellipse for each radius on the film.

    ellipses (n, 3) float64: its middle, along the direction in which the place on the film is from the axis, half its
    axis along that, and half the one across (mm); per_mm, places of the table per mm of radius; edge, radius from which
    on no light arrives (mm).
    """

    ellipses: Points
    per_mm: float
    edge: float


class SquarePupils(NamedTuple):
    """Packed, of a lens that is alike on both sides of each of two planes: an ellipse for each place of a quadrant.

    ellipses (n, m, 4) float64, by |y| and |x| on the film: its middle (x, y), on the side of the place, and half its
    axes along x and y (mm); per_mm_x and per_mm_y, places of the table per mm.
    """

    ellipses: Points
    per_mm_x: float
    per_mm_y: float


@generic
def aim(pupils, x, y, u, v):
    """A point of the plane that is aimed at for a place (x, y) of the film, by a point (u, v) of the unit disc.

    Returns
    -------
    (x, y, area of what such points are drawn from); the area is 0 where no light arrives.  All in mm.
    """
    raise NotImplementedError


@aim.register(RoundPupils)
def _(pupils, x, y, u, v):
    radius = math.sqrt(x * x + y * y)
    place = radius * pupils.per_mm
    # Beyond the table nothing is known.
    if not (radius < pupils.edge and place <= len(pupils.ellipses) - 1.0):
        return x, y, 0.0
    row = min(int(place), len(pupils.ellipses) - 2)
    part = place - row
    rest = 1.0 - part
    middle = rest * pupils.ellipses[row, 0] + part * pupils.ellipses[row + 1, 0]
    along = rest * pupils.ellipses[row, 1] + part * pupils.ellipses[row + 1, 1]
    across = rest * pupils.ellipses[row, 2] + part * pupils.ellipses[row + 1, 2]
    # On the axis all directions are alike.
    cosine, sine = (x / radius, y / radius) if radius > 0.0 else (1.0, 0.0)
    # The disc keeps its own directions as far as it can, so that well spread points stay so from place to place.
    a, b = middle + along * (cosine * u + sine * v), across * (cosine * v - sine * u)
    return cosine * a - sine * b, sine * a + cosine * b, math.pi * along * across


@aim.register(SquarePupils)
def _(pupils, x, y, u, v):
    across, up = abs(x) * pupils.per_mm_x, abs(y) * pupils.per_mm_y
    rows, columns = pupils.ellipses.shape[0], pupils.ellipses.shape[1]
    if not (across <= columns - 1.0 and up <= rows - 1.0):
        return x, y, 0.0
    column, row = min(int(across), columns - 2), min(int(up), rows - 2)
    right, above = across - column, up - row
    left, below = 1.0 - right, 1.0 - above
    w00, w01, w10, w11 = below * left, below * right, above * left, above * right
    e00, e01 = pupils.ellipses[row, column], pupils.ellipses[row, column + 1]
    e10, e11 = pupils.ellipses[row + 1, column], pupils.ellipses[row + 1, column + 1]
    middle_x = w00 * e00[0] + w01 * e01[0] + w10 * e10[0] + w11 * e11[0]
    middle_y = w00 * e00[1] + w01 * e01[1] + w10 * e10[1] + w11 * e11[1]
    half_x = w00 * e00[2] + w01 * e01[2] + w10 * e10[2] + w11 * e11[2]
    half_y = w00 * e00[3] + w01 * e01[3] + w10 * e10[3] + w11 * e11[3]
    a = math.copysign(1.0, x) * middle_x + half_x * u
    b = math.copysign(1.0, y) * middle_y + half_y * v
    return a, b, math.pi * half_x * half_y


# ---- Which rays get through


@entry
def _through(lens, film, plane, wavelength, targets, packet, weights):
    """Weights of rays from a place of the film to points (n, 2) of a plane across the axis, with n / WIDTH whole."""
    for first in range(0, len(targets), WIDTH):
        for lane in range(WIDTH):
            x, y = targets[first + lane, 0] - film[0], targets[first + lane, 1] - film[1]
            z = plane - film[2]
            length = math.sqrt(x * x + y * y + z * z)
            for axis in range(3):
                packet[ORIGIN + axis, lane] = film[axis]
            packet[DIRECTION, lane] = x / length
            packet[DIRECTION + 1, lane] = y / length
            packet[DIRECTION + 2, lane] = z / length
            packet[WAVELENGTH, lane] = wavelength
            packet[WEIGHT, lane] = 1.0
        trace_packet(lens, packet)
        for lane in range(WIDTH):
            weights[first + lane] = packet[WEIGHT, lane]


# How many focal lengths from the film the plane is at most that is aimed at.
_FARTHEST = 20.0


def aiming_plane(lens: LensSurfaces, film_z: float) -> float:
    """Where on the axis (mm) the plane is on which pupils are told: at the exit pupil, if that is before the film.

    There the pupil is nearly the same for all places; how far it is from the film does not matter else.
    """
    nearest = film_z - float(lens.vertex[-1])
    size = max(nearest, abs(cardinal_points(lens).focal_length))
    away = film_z - exit_pupil(lens).z
    if not away > 0.0:
        return film_z - size
    return film_z - min(max(away, nearest), _FARTHEST * size)


def transmitted(
    lens: LensSurfaces, film: Sequence[float], targets: Points, wavelength: float, plane: float | None = None
) -> Points:
    """Which part of the light gets from the scene to a place of the film.

    Parameters
    ----------
    film : the place (mm), (3,) in the lens's frame.
    targets : (n, 2), where the rays cross a plane across the axis (mm).
    plane : where that is; `aiming_plane` by default.
    wavelength : in air (nm); without effect for a lens without a table of indices.

    Returns
    -------
    float64 (n,), from 0 to 1.
    """
    count = len(targets)
    padded = np.zeros((-(-count // WIDTH) * WIDTH, 2))
    padded[:count] = targets
    weights = np.empty(len(padded))
    if plane is None:
        plane = aiming_plane(lens, film[2])
    _through(lens, np.array(film, np.float64), plane, float(wavelength), padded, np.zeros((ROWS, WIDTH)), weights)
    return weights[:count]


class _Work:
    """Counts the surfaces that rays cross while a pupil is looked for; threads may share it."""

    def __init__(self) -> None:
        self.crossings = 0
        self._lock = threading.Lock()

    def add(self, rays: int, surfaces: int) -> None:
        """Count rays before they are traced.

        Raises
        ------
        ValueError : they would cross more surfaces than `_MOST_CROSSINGS`, with all before them.
        """
        with self._lock:
            self.crossings += rays * surfaces
            if self.crossings > _MOST_CROSSINGS:
                raise ValueError(
                    "where light passes the lens is not found by rays that cross surfaces "
                    f"{_MOST_CROSSINGS:,} times, the limit: its pupil is too irregular, or its surfaces too many"
                )


class _Search:
    """Looks for the pupil of a lens as seen from places of the film, at one wavelength."""

    def __init__(self, lens: LensSurfaces, film_z: float, wavelength: float, work: _Work) -> None:
        self._lens, self._film_z, self._wavelength, self._work = lens, film_z, wavelength, work
        self._plane = aiming_plane(lens, film_z)
        self._chief_rays = [self._chief(across) for across in "xy"]
        self._last: tuple[Points, Points] | None = None
        self._is_near_light = True

    def edge(self, x: float, y: float) -> Points:
        """Points (n, 2) just outside of the pupil's edge, all around; none where no light arrives."""
        film = (x, y, self._film_z)
        # Between the points of a grid there may be a small pupil, but none far from a place that is dark altogether.
        for count in (_GRID, _FINEST) if self._is_near_light else (_GRID,):
            for box in (self._before, self._about_the_chief_ray, self._whole):
                found = self._within(film, *box(x, y), count)
                if len(found):
                    low, high = found.min(axis=0), found.max(axis=0)
                    self._last = low - 0.2 * (high - low), high + 0.2 * (high - low)
                    self._is_near_light = True
                    return found
        self._is_near_light = False
        return np.empty((0, 2))

    def passes(self, x: float, y: float, points: Points) -> NDArray[np.bool_]:
        """Which points (n, 2) lie in the pupil."""
        self._work.add(-(-len(points) // WIDTH) * WIDTH, len(self._lens.vertex))
        return transmitted(self._lens, (x, y, self._film_z), points, self._wavelength, self._plane) > 0.0

    def _before(self, x: float, y: float) -> tuple[Points, Points]:
        """The box of the place before this one."""
        return self._about_the_chief_ray(x, y) if self._last is None else self._last

    def _about_the_chief_ray(self, x: float, y: float) -> tuple[Points, Points]:
        """The box of what the pupil would be near the axis, about the ray through the middle of the stop."""
        middle, size = np.empty(2), np.empty(2)
        for axis, (place, (film, plane, half)) in enumerate(zip((x, y), self._chief_rays, strict=True)):
            middle[axis] = math.copysign(float(np.interp(abs(place), film, plane)), place)
            size[axis] = half
        return middle - 1.3 * size, middle + 1.3 * size

    def _chief(self, across: str) -> tuple[Points, Points, float]:
        """Where rays from the middle of the stop cross the film and the plane, by distance on the film; half the pupil.

        All in mm, in the plane of the axis and x or y.  What is on the other side of the axis is negative.
        """
        lens, stop, axis = self._lens, self._lens.stop, "xy".index(across)
        turns = np.linspace(0.0, 0.5 * math.pi, _CHIEF_RAYS, endpoint=False)
        ways = np.zeros((_CHIEF_RAYS, 3))
        ways[:, axis], ways[:, 2] = np.sin(turns), np.cos(turns)
        bare = part(lens._replace(diaphragm=None), stop, len(lens.vertex))
        start = (0.0, 0.0, float(lens.vertex[stop]))
        weights, points, onward = trace_rays(bare, start, ways, True, self._wavelength)
        lit = (weights > 0.0) & (onward[:, 2] > 0.0)
        points, onward = points[lit], onward[lit]
        slopes, heights = onward[:, axis] / onward[:, 2], points[:, axis]
        film, plane = (heights + slopes * (z - points[:, 2]) for z in (self._film_z, self._plane))
        # Up to where more inclined rays come nearer to the axis again.
        count = int(np.argmax(np.append(np.diff(film) <= 0.0, True))) + 1
        pupil = exit_pupil(lens, across)
        size = float(lens.radius[-1])
        if math.isfinite(pupil.z):
            size = pupil.radius * abs((self._film_z - self._plane) / (self._film_z - pupil.z))
        return film[:count], plane[:count], size

    def _whole(self, x: float, y: float) -> tuple[Points, Points]:
        """The box in which rays through the last surface cross the plane."""
        lens, place = self._lens, np.array([x, y])
        radius, behind = float(lens.radius[-1]), self._film_z - float(lens.vertex[-1])
        bend, away = float(lens.curvature[-1]), self._film_z - self._plane
        sags = [0.0]
        if abs(bend) * radius <= 1.0:
            sags.append(bend * radius**2 / (1.0 + math.sqrt(1.0 - (bend * radius) ** 2)))
        corners = [
            place + (sign * radius - place) * away / (behind - sag)
            for sag, sign in itertools.product(sags, (-1.0, 1.0))
            if sag < behind
        ]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        spare = 0.02 * (high - low)
        return low - spare, high + spare

    def _within(self, film: tuple[float, float, float], low: Points, high: Points, count: int) -> Points:
        """The pupil's edge in a box that may hold it, or some of it."""
        for _round in range(_MOST_BOXES):
            points, step = _grid(low, high, count)
            inside = self._passing(film, points)
            if not inside.any():
                return np.empty((0, 2))
            own = points.reshape(-1, 2)[inside.ravel()]
            tight_low, tight_high = own.min(axis=0) - step, own.max(axis=0) + step
            # Where it reaches an edge of the box, it may reach farther; where it is small, its edge is told badly.
            beyond = (tight_low < low) | (tight_high > high)
            if beyond.any():
                size = high - low
                low, high = np.where(tight_low < low, low - size, low), np.where(tight_high > high, high + size, high)
            elif (2.0 * (tight_high - tight_low) < high - low).any():
                low, high = tight_low - step, tight_high + step
            else:
                break
        return self._refined(film, points, inside)

    def _passing(self, film: tuple[float, float, float], points: Points) -> NDArray[np.bool_]:
        flat = np.ascontiguousarray(points.reshape(-1, 2))
        return self.passes(*film[:2], flat).reshape(points.shape[:-1])

    def _refined(self, film: tuple[float, float, float], points: Points, inside: NDArray[np.bool_]) -> Points:
        """Where lines of a grid cross the edge, found by halving what lies between a point inside and one outside."""
        changes = (inside[1:] != inside[:-1], inside[:, 1:] != inside[:, :-1])
        lower = np.concatenate([points[:-1][changes[0]], points[:, :-1][changes[1]]])
        upper = np.concatenate([points[1:][changes[0]], points[:, 1:][changes[1]]])
        first = np.concatenate([inside[:-1][changes[0]], inside[:, :-1][changes[1]]])[:, None]
        near, far = np.where(first, lower, upper), np.where(first, upper, lower)
        for _halving in range(_HALVINGS):
            middle = 0.5 * (near + far)
            within = self._passing(film, middle)[:, None]
            near, far = np.where(within, middle, near), np.where(within, far, middle)
        return far


def _grid(low: Points, high: Points, count: int) -> tuple[Points, Points]:
    """Points of a grid over a box (n, n, 2), the middles of its cells, and the cells' sizes (2,)."""
    step = (high - low) / count
    places = np.arange(count) + 0.5
    x, y = low[0] + step[0] * places, low[1] + step[1] * places
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1), step


# ---- Ellipses


def _excess(points: Points, ellipse: Points) -> float:
    """By which factor an ellipse (middle x, y, half axes) must grow to hold points (n, 2)."""
    if not len(points):
        return 0.0
    return float(np.sqrt((((points - ellipse[:2]) / ellipse[2:]) ** 2).sum(axis=1)).max())


def _ellipse(points: Points, *, centred: bool) -> Points:
    """A small ellipse with axes along x and y that holds points (n, 2): middle x, y, half axes; `centred` on y = 0.

    It is found to a part in 10^3 by grids over the ratio of its axes and the place of its middle, each finer than the
    one before, in which what is left is the smallest circle.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if centred:
        low[1], high[1] = -np.abs(points[:, 1]).max(), np.abs(points[:, 1]).max()
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), np.finfo(np.float64).tiny)
    unit = _outline((points - middle) / half)
    steps = np.linspace(-1.0, 1.0, 5)
    offsets = np.array(list(itertools.product(steps, steps, [0.0] if centred else steps)))
    best, spread = np.zeros(3), 0.5
    for _round in range(11):
        tried = best + spread * offsets
        stretch = np.exp(tried[:, 0])[:, None]
        x, y = stretch * (unit[:, 0] - tried[:, 1:2]), (unit[:, 1] - tried[:, 2:3]) / stretch
        best = tried[int((x * x + y * y).max(axis=1).argmin())]
        spread = 0.5 * spread
    ellipse = np.concatenate([middle + half * best[1:], half * np.exp([-best[0], best[0]])])
    ellipse[2:] *= _excess(points, ellipse)
    return ellipse


@functools.cache
def _circle(count: int) -> Points:
    """Points of the unit circle (n, 2)."""
    turns = np.arange(count) * 2.0 * math.pi / count
    return np.stack([np.cos(turns), np.sin(turns)], axis=1)


def _outline(points: Points) -> Points:
    """Of points (n, 2) those that are farthest out in some direction, all around."""
    farthest = (points @ _circle(_FITTED).T).argmax(axis=0)
    return np.asarray(points[farthest[np.append(True, farthest[1:] != farthest[:-1])]])


class _Places:
    """The pupil as seen from places of the film, at all wavelengths that are asked for."""

    def __init__(self, lens: LensSurfaces, film_z: float, wavelengths: Sequence[float], work: _Work) -> None:
        if lens.diaphragm is not None:
            # A round opening that holds the one that is not round.
            radius = lens.radius.copy()
            radius[lens.stop] *= reach(lens.diaphragm)
            lens = lens._replace(radius=radius, diaphragm=None)
        self._searches = [_Search(lens, film_z, wavelength, work) for wavelength in wavelengths]

    def is_lit(self, radius: float) -> bool:
        """Whether light arrives at a distance from the axis (mm)."""
        return any(len(search.edge(radius, 0.0)) for search in self._searches)

    def at(self, x: float, y: float) -> Points:
        """Points (n, 2) whose convex hull is the pupil, but for what lies between them; none where no light arrives."""
        points = np.concatenate([search.edge(x, y) for search in self._searches])
        return _outline(points) if len(points) else points

    def excess(self, x: float, y: float, ellipse: Points) -> float:
        """By which factor an ellipse (middle x, y, half axes) must grow to hold the pupil."""

        def passes(factor: float, directions: int) -> bool:
            ring = np.ascontiguousarray(factor * ellipse[2:] * _circle(directions) + ellipse[:2])
            return any(search.passes(x, y, ring).any() for search in self._searches)

        # What reaches out of an ellipse crosses a ring just round it, and each ring that it reaches beyond.
        if not passes(float(_RINGS[0]), _AROUND):
            return 1.0
        last = 0
        while last + 1 < len(_RINGS) and passes(float(_RINGS[last + 1]), _AROUND // 2):
            last += 1
        return float(_RINGS[last] * _RINGS[1])


class _Place(NamedTuple):
    """A place of the film (mm), and the ellipses between which its own is interpolated, with their weights."""

    x: float
    y: float
    rows: tuple[int, ...]
    weights: tuple[float, ...]


def _hold(ellipses: Points, places: Sequence[_Place], pupil: _Places) -> None:
    """Let ellipses (n, 4) hold the pupil at all of these places.

    Raises
    ------
    ValueError : they still do not after `_MOST_ROUNDS`.
    """

    def excess(place: _Place) -> float:
        return pupil.excess(place.x, place.y, np.asarray(place.weights) @ ellipses[list(place.rows)])

    # An ellipse that has grown holds what it held before.
    for _round in range(_MOST_ROUNDS):
        if not places:
            return
        factors = _in_parallel(excess, places)
        growth = np.ones(len(ellipses))
        for place, factor in zip(places, factors, strict=True):
            for row, weight in zip(place.rows, place.weights, strict=True):
                growth[row] = max(growth[row], factor if weight > 0.0 else 1.0)
        ellipses[:, 2:] *= growth[:, None]
        places = [place for place, factor in zip(places, factors, strict=True) if factor > 1.0]
    if places:
        raise ValueError(
            f"where light passes the lens is not found in {_MOST_ROUNDS} rounds, the limit: its pupil is too irregular "
            f"at {len(places)} places of the film"
        )


def _in_parallel(work: Any, pieces: Sequence[Any]) -> list[Any]:
    with ThreadPoolExecutor(min(len(pieces), os.cpu_count() or 1)) as pool:
        return list(pool.map(work, pieces))


def _round_pupils(lens: LensSurfaces, film_z: float, radius: float, wavelengths: Sequence[float]) -> RoundPupils:
    """The table for places up to a distance from the axis (mm)."""
    work = _Work()
    edge, reached = math.inf, _reached(_Places(lens, film_z, wavelengths, work), radius)
    if reached < radius:
        radius, edge = reached, reached
    if radius == 0.0:
        return RoundPupils(np.zeros((2, 3)), 1.0, 0.0)

    def seen(part: Points) -> list[Points]:
        pupil = _Places(lens, film_z, wavelengths, work)
        return [pupil.at(float(place) * radius / _RADII, 0.0) for place in part]

    found = list(itertools.chain(*_in_parallel(seen, np.array_split(np.arange(_RADII + 1), _PIECES))))
    # What is lit at the very edge may be too little to be found again.
    lit = [points for points in found if len(points)]
    ellipses = np.array([_ellipse(points if len(points) else lit[-1], centred=True) for points in found])

    # Where the picture ends, the pupil shrinks the faster the smaller it is.
    between = np.append(np.arange(_BETWEEN * _RADII + 1) / _BETWEEN, _RADII - np.arange(_CLOSE) / _CLOSE)
    places = []
    for place in between.tolist():
        row = min(int(place), _RADII - 1)
        part = place - row
        places.append(_Place(place * radius / _RADII, 0.0, (row, row + 1), (1.0 - part, part)))
    _hold(ellipses, places, _Places(lens, film_z, wavelengths, work))
    ellipses[:, 2:] *= _SPARE
    return RoundPupils(np.ascontiguousarray(ellipses[:, [0, 2, 3]]), _RADII / radius, edge)


def _reached(places: _Places, radius: float) -> float:
    """Up to which distance from the axis (mm) light arrives: `radius`, or 0, or a place where it does, just."""
    if places.is_lit(radius):
        return radius
    lit, dark = 0.0, radius
    if not places.is_lit(0.0):
        return 0.0
    for _halving in range(_EDGE_HALVINGS):
        middle = 0.5 * (lit + dark)
        lit, dark = (middle, dark) if places.is_lit(middle) else (lit, middle)
    return lit


def _square_pupils(
    lens: LensSurfaces, film_z: float, half: tuple[float, float], wavelengths: Sequence[float]
) -> SquarePupils:
    """The table for places of a quadrant with these sides (mm)."""
    count, work = _SIDES + 1, _Work()

    def seen(row: int) -> list[Points]:
        pupil = _Places(lens, film_z, wavelengths, work)
        return [pupil.at(half[0] * column / _SIDES, half[1] * row / _SIDES) for column in range(count)]

    found = list(itertools.chain(*_in_parallel(seen, range(count))))
    lit = np.array([number for number, points in enumerate(found) if len(points)], np.int64)
    if not len(lit):
        return SquarePupils(np.zeros((2, 2, 4)), 1.0 / half[0], 1.0 / half[1])
    # What is dark may lie beside what is not, and has its ellipse.
    nearest = [
        int(lit[np.hypot(lit // count - number // count, lit % count - number % count).argmin()])
        for number in range(len(found))
    ]
    ellipses = np.array([_ellipse(found[number], centred=False) for number in nearest])

    places = []
    between = range(_BETWEEN * _SIDES + 1)
    for v, u in itertools.product(between, between):
        up, across = v / _BETWEEN, u / _BETWEEN
        row, column = min(int(up), _SIDES - 1), min(int(across), _SIDES - 1)
        below, left = row + 1 - up, column + 1 - across
        rows = tuple(count * (row + i) + column + j for i, j in itertools.product((0, 1), repeat=2))
        weights = tuple(a * b for a, b in itertools.product((below, 1.0 - below), (left, 1.0 - left)))
        places.append(_Place(half[0] * across / _SIDES, half[1] * up / _SIDES, rows, weights))
    _hold(ellipses, places, _Places(lens, film_z, wavelengths, work))
    ellipses[:, 2:] *= _SPARE
    return SquarePupils(ellipses.reshape(count, count, 4), _SIDES / half[0], _SIDES / half[1])


# ---- Tables, made once


def pupils_of(
    lens: LensSurfaces, film_z: float, half: tuple[float, float], wavelengths: Sequence[float], *, is_round: bool
) -> RoundPupils | SquarePupils:
    """The pupils of a lens for all places of a film; from the disk, where they were made before.

    Parameters
    ----------
    lens : as the camera packs it, focused and stopped down.
    film_z : where the film is (mm), in the lens's frame.
    half : half the film's width and height (mm).
    wavelengths : those (nm) between which all are that will be seen; without effect for a lens without indices.
    is_round : whether the lens is alike all around its axis.

    Raises
    ------
    ValueError : that takes more than `_MOST_CROSSINGS`, or the pupil is too irregular for ellipses.
    """
    name = f"pupils-{_digest(lens, film_z, half, wavelengths, is_round)}.npz"
    held = _read(name)
    if held is not None:
        kind: type[RoundPupils | SquarePupils] = RoundPupils if is_round else SquarePupils
        return kind(np.ascontiguousarray(held["ellipses"]), float(held["first"]), float(held["second"]))
    made: RoundPupils | SquarePupils
    if is_round:
        made = _round_pupils(lens, film_z, math.hypot(*half), wavelengths)
    else:
        made = _square_pupils(lens, film_z, half, wavelengths)
    _write(name, made)
    return made


def _digest(*parts: Any) -> str:
    """What tables depend on besides the program, which their folder is named by."""
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


def _read(name: str) -> Any:
    content = kept(CACHE_FOLDER / name)
    if content is None:
        return None
    with np.load(io.BytesIO(content)) as held:
        return {key: held[key] for key in ("ellipses", "first", "second")}


def _write(name: str, made: RoundPupils | SquarePupils) -> None:
    """Keep a table; where that cannot be, it is made anew each time."""
    ellipses, first, second = made
    buffer = io.BytesIO()
    np.savez(buffer, ellipses=ellipses, first=first, second=second)
    keep(CACHE_FOLDER / name, buffer.getvalue())


# ---- Light


def light_on_axis(lens: LensSurfaces, film_z: float, wavelength: float, *, is_round: bool) -> float:
    """What a film gathers on the axis of a scene of radiance 1: the integral of cos^4 / Z^2 over the pupil (sr).

    That of a round pupil is pi sin^2, with the angle at which the film sees its edge.

    Raises
    ------
    ValueError : no light gets through the lens.
    """
    plane = aiming_plane(lens, film_z)
    behind = film_z - plane
    places = _Places(lens, film_z, [wavelength], _Work())
    edge = places.at(0.0, 0.0)
    if not len(edge):
        raise ValueError("no light gets through the lens to the middle of the film")
    if is_round and lens.diaphragm is None:
        square = float((edge**2).sum(axis=1).min())
        return math.pi * square / (square + behind * behind)
    low, high = edge.min(axis=0), edge.max(axis=0)
    x, y = (low[axis] + (high[axis] - low[axis]) * (np.arange(_FINE) + 0.5) / _FINE for axis in (0, 1))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    weights = transmitted(lens, (0.0, 0.0, film_z), points, wavelength, plane)
    cosine2 = behind * behind / (behind * behind + (points**2).sum(axis=1))
    return float((weights * cosine2**2).sum() / behind**2 * np.prod((high - low) / _FINE))


def middle(lens: LensSurfaces, film_z: float, x: float, y: float, wavelength: float) -> Points | None:
    """The middle (2,) of the pupil as seen from a place of the film, on the `aiming_plane`; None if it is dark."""
    edge = _Places(lens, film_z, [wavelength], _Work()).at(x, y)
    return np.asarray(0.5 * (edge.min(axis=0) + edge.max(axis=0))) if len(edge) else None


def rear_reach(lens: LensSurfaces, film_z: float, film_radius: float) -> float:
    """How far from the axis rays from a film to the last surface cross the plane of its vertex, at most (mm)."""
    radius, behind = float(lens.radius[-1]), film_z - float(lens.vertex[-1])
    bend = float(lens.curvature[-1])
    sag = bend * radius**2 / (1.0 + math.sqrt(max(0.0, 1.0 - (bend * radius) ** 2)))
    crossing = film_radius + (radius + film_radius) * behind / (behind - sag) - 2.0 * film_radius
    other = film_radius + (radius - film_radius) * behind / (behind - sag)
    return max(radius, abs(crossing), abs(other))
