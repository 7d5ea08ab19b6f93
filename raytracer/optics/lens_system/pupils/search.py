"""Search for the pupil of a lens as seen from places of the film."""

import functools
import itertools
import math
import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raytracer.core.simd import WIDTH
from raytracer.optics.lens_system.first_order import exit_pupil
from raytracer.optics.lens_system.pupils.transmission import exit_pupil_plane, transmitted_fraction
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces, aperture_extent, slice_surfaces

Points = NDArray[np.float64]

# Cells along an edge of the coarse and the fine grid in which the pupil is searched, boxes that are tried, and
# bisections that find its edge; rays from the middle of the stop that show where it may be.
_COARSE, _FINE, _MAX_BOXES, _HALVINGS = 32, 160, 16, 14
_CHIEF_RAYS = 500

# Rings round an ellipse, in units of its own size, that show how far the pupil reaches out of it; and their points.
_RINGS = 1.001 * 1.01 ** np.arange(48.0)
_RING_POINTS = 360

# Directions in which what is farthest out stands for an outline.
_OUTLINE_DIRECTIONS = 128

# Points along an edge of the grid by which the light of a pupil of any shape is integrated.
_GRID_POINTS = 512

MAX_CROSSINGS = 2**29
"""Surfaces that rays may cross in all while the pupil is searched.

Of the shipped lenses the anamorphic one takes the most, 1.7e8, in 3 s; this is three times as many.
"""


class WorkCounter:
    """Counter of the surfaces that rays cross while a pupil is searched; threads may share it."""

    def __init__(self) -> None:
        self.crossings = 0
        self._lock = threading.Lock()

    def add(self, rays: int, surfaces: int) -> None:
        """Count rays before they are traced.

        Raises
        ------
        ValueError : they would cross more surfaces than `MAX_CROSSINGS` in all.
        """
        with self._lock:
            self.crossings += rays * surfaces
            if self.crossings > MAX_CROSSINGS:
                raise ValueError(
                    "where light passes the lens is not found by rays that cross surfaces "
                    f"{MAX_CROSSINGS:,} times, the limit: its pupil is too irregular, or its surfaces too many"
                )


class _EdgeSearch:
    """Search for the edge of a lens's pupil as seen from places of the film, at one wavelength."""

    def __init__(self, lens: LensSurfaces, film_z: float, wavelength: float, work: WorkCounter) -> None:
        self._lens, self._film_z, self._wavelength, self._work = lens, film_z, wavelength, work
        self._plane = exit_pupil_plane(lens, film_z)
        self._chief_rays = [self._trace_chief_rays(across) for across in "xy"]
        self._last: tuple[Points, Points] | None = None
        self._is_near_light = True

    def edge(self, x: float, y: float) -> Points:
        """Find points (n, 2) just outside of the pupil's edge, all around; none where no light arrives."""
        film = (x, y, self._film_z)
        # Between the points of a grid there may be a small pupil, but none far from a place that is dark altogether.
        for count in (_COARSE, _FINE) if self._is_near_light else (_COARSE,):
            for box in (self._last_box, self._chief_ray_box, self._rear_surface_box):
                points = self._edge_within(film, *box(x, y), count)
                if len(points):
                    low, high = points.min(axis=0), points.max(axis=0)
                    self._last = low - 0.2 * (high - low), high + 0.2 * (high - low)
                    self._is_near_light = True
                    return points
        self._is_near_light = False
        return np.empty((0, 2))

    def passes(self, x: float, y: float, points: Points) -> NDArray[np.bool_]:
        """Tell which points (n, 2) lie in the pupil."""
        self._work.add(-(-len(points) // WIDTH) * WIDTH, len(self._lens.vertex))
        return transmitted_fraction(self._lens, (x, y, self._film_z), points, self._wavelength, self._plane) > 0.0

    def _last_box(self, x: float, y: float) -> tuple[Points, Points]:
        """Return the box of the place before this one."""
        return self._chief_ray_box(x, y) if self._last is None else self._last

    def _chief_ray_box(self, x: float, y: float) -> tuple[Points, Points]:
        """Return a box of the size of the paraxial pupil, about the chief ray."""
        middle, size = np.empty(2), np.empty(2)
        for axis, (place, (film, plane, half)) in enumerate(zip((x, y), self._chief_rays, strict=True)):
            middle[axis] = math.copysign(float(np.interp(abs(place), film, plane)), place)
            size[axis] = half
        return middle - 1.3 * size, middle + 1.3 * size

    def _trace_chief_rays(self, across: str) -> tuple[Points, Points, float]:
        """Trace rays from the middle of the stop to the film and to the plane, by distance on the film.

        Returns
        -------
        Places on the film, places on the plane, and half the paraxial pupil: all in mm, in the plane of the axis and x
        or y, negative on the other side of the axis.
        """
        lens, stop, axis = self._lens, self._lens.stop, "xy".index(across)
        turns = np.linspace(0.0, 0.5 * math.pi, _CHIEF_RAYS, endpoint=False)
        ways = np.zeros((_CHIEF_RAYS, 3))
        ways[:, axis], ways[:, 2] = np.sin(turns), np.cos(turns)
        bare = slice_surfaces(lens._replace(diaphragm=None), stop, len(lens.vertex))
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

    def _rear_surface_box(self, x: float, y: float) -> tuple[Points, Points]:
        """Return the box in which rays through the last surface cross the plane."""
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

    def _edge_within(self, film: tuple[float, float, float], low: Points, high: Points, count: int) -> Points:
        """Find the pupil's edge in a box that may hold it, or some of it."""
        for _round in range(_MAX_BOXES):
            points, step = _grid(low, high, count)
            inside = self._passing(film, points)
            if not inside.any():
                return np.empty((0, 2))
            own = points.reshape(-1, 2)[inside.ravel()]
            tight_low, tight_high = own.min(axis=0) - step, own.max(axis=0) + step
            # Where it reaches an edge of the box, it may reach farther; where it is small, its edge is inaccurate.
            beyond = (tight_low < low) | (tight_high > high)
            if beyond.any():
                size = high - low
                low, high = np.where(tight_low < low, low - size, low), np.where(tight_high > high, high + size, high)
            elif (2.0 * (tight_high - tight_low) < high - low).any():
                low, high = tight_low - step, tight_high + step
            else:
                break
        return self._bisect_edge(film, points, inside)

    def _passing(self, film: tuple[float, float, float], points: Points) -> NDArray[np.bool_]:
        flat = np.ascontiguousarray(points.reshape(-1, 2))
        return self.passes(*film[:2], flat).reshape(points.shape[:-1])

    def _bisect_edge(self, film: tuple[float, float, float], points: Points, inside: NDArray[np.bool_]) -> Points:
        """Bisect, on the lines of a grid, between a point inside of the edge and one outside."""
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
    """Make a grid over a box: the middles of its cells (n, n, 2), and the cells' sizes (2,)."""
    step = (high - low) / count
    places = np.arange(count) + 0.5
    x, y = low[0] + step[0] * places, low[1] + step[1] * places
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1), step


class PupilSampler:
    """The pupil as seen from places of the film, at several wavelengths together."""

    def __init__(self, lens: LensSurfaces, film_z: float, wavelengths: Sequence[float], work: WorkCounter) -> None:
        if lens.diaphragm is not None:
            # A round opening that holds the one that is not round.
            radius = lens.radius.copy()
            radius[lens.stop] *= aperture_extent(lens.diaphragm)
            lens = lens._replace(radius=radius, diaphragm=None)
        self._searches = [_EdgeSearch(lens, film_z, wavelength, work) for wavelength in wavelengths]

    def is_lit(self, radius: float) -> bool:
        """Return True if light arrives at a distance from the axis (mm)."""
        return any(len(search.edge(radius, 0.0)) for search in self._searches)

    def hull(self, x: float, y: float) -> Points:
        """Find points (n, 2) whose convex hull approximates the pupil; none where no light arrives."""
        points = np.concatenate([search.edge(x, y) for search in self._searches])
        return outline(points) if len(points) else points

    def growth_factor(self, x: float, y: float, ellipse: Points) -> float:
        """Find the factor by which an ellipse (middle x, y, half axes) must grow to hold the pupil."""

        def passes(factor: float, directions: int) -> bool:
            ring = np.ascontiguousarray(factor * ellipse[2:] * unit_circle(directions) + ellipse[:2])
            return any(search.passes(x, y, ring).any() for search in self._searches)

        # What reaches out of an ellipse crosses a ring just round it, and each ring that it reaches beyond.
        if not passes(float(_RINGS[0]), _RING_POINTS):
            return 1.0
        last = 0
        while last + 1 < len(_RINGS) and passes(float(_RINGS[last + 1]), _RING_POINTS // 2):
            last += 1
        return float(_RINGS[last] * _RINGS[1])


def pupil_center(lens: LensSurfaces, film_z: float, x: float, y: float, wavelength: float) -> Points | None:
    """Find the middle (2,) of the pupil, on the `exit_pupil_plane`, as seen from a place of the film; None if dark."""
    edge = PupilSampler(lens, film_z, [wavelength], WorkCounter()).hull(x, y)
    return np.asarray(0.5 * (edge.min(axis=0) + edge.max(axis=0))) if len(edge) else None


# ---- Ellipses round pupils


def fit_ellipse(points: Points, *, centred: bool) -> Points:
    """Fit a small ellipse with axes along x and y round points (n, 2): middle x, y, half axes; `centred` on y = 0.

    Its size is within 1/1000 of the smallest.  Grids over the ratio of its axes and the place of its middle, each finer
    than the one before, reduce it to the smallest circle.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if centred:
        low[1], high[1] = -np.abs(points[:, 1]).max(), np.abs(points[:, 1]).max()
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), np.finfo(np.float64).tiny)
    unit = outline((points - middle) / half)
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
    ellipse[2:] *= np.sqrt((((points - ellipse[:2]) / ellipse[2:]) ** 2).sum(axis=1)).max()
    return ellipse


@functools.cache
def unit_circle(count: int) -> Points:
    """List points of the unit circle (n, 2)."""
    turns = np.arange(count) * 2.0 * math.pi / count
    return np.stack([np.cos(turns), np.sin(turns)], axis=1)


def outline(points: Points) -> Points:
    """Select from points (n, 2) those that are farthest out in some direction, all around."""
    farthest = (points @ unit_circle(_OUTLINE_DIRECTIONS).T).argmax(axis=0)
    return np.asarray(points[farthest[np.append(True, farthest[1:] != farthest[:-1])]])


# ---- The light of a pupil


def on_axis_solid_angle(lens: LensSurfaces, film_z: float, wavelength: float, *, is_round: bool) -> float:
    """Compute the irradiance on the axis from a scene of radiance 1: the integral of cos^4 / Z^2 over the pupil (sr).

    Of a round pupil it is pi sin^2, with the angle at which the film sees its edge.

    Raises
    ------
    ValueError : no light gets through the lens.
    """
    plane = exit_pupil_plane(lens, film_z)
    behind = film_z - plane
    pupil = PupilSampler(lens, film_z, [wavelength], WorkCounter())
    edge = pupil.hull(0.0, 0.0)
    if not len(edge):
        raise ValueError("no light gets through the lens to the middle of the film")
    if is_round and lens.diaphragm is None:
        square = float((edge**2).sum(axis=1).min())
        return math.pi * square / (square + behind * behind)
    low, high = edge.min(axis=0), edge.max(axis=0)
    x, y = (low[axis] + (high[axis] - low[axis]) * (np.arange(_GRID_POINTS) + 0.5) / _GRID_POINTS for axis in (0, 1))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    weights = transmitted_fraction(lens, (0.0, 0.0, film_z), points, wavelength, plane)
    cosine2 = behind * behind / (behind * behind + (points**2).sum(axis=1))
    return float((weights * cosine2**2).sum() / behind**2 * np.prod((high - low) / _GRID_POINTS))
