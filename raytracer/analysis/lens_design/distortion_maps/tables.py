"""Tables of traced chief rays: points of the film to points of an ideal projection, and back."""

import math
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.lens_design.performance import chief_rays
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, normalize

FloatArray = NDArray[np.float64]

# Points along each side of the film at which models are fitted.
_FITTED = 41


class PixelGrid(NamedTuple):
    """Grid of the film's pixels, whose integer coordinates are their middles, as OpenCV's.

    width, height : number of pixels.
    pitch : edge of a pixel (mm).
    """

    width: int
    height: int
    pitch: float

    @property
    def centre(self) -> tuple[float, float]:
        """The middle of the picture (pixels)."""
        return 0.5 * (self.width - 1), 0.5 * (self.height - 1)

    def points(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the middles of all pixels (mm), (height, width, 2), or of the rows from `first` to before `last`."""
        cx, cy = self.centre
        rows = np.arange(first, self.height if last is None else min(last, self.height))
        x, y = np.meshgrid(np.arange(self.width) - cx, rows - cy)
        return self.pitch * np.stack([x, y], axis=-1)

    def pixels(self, points: FloatArray) -> FloatArray:
        """Convert points of the film (mm) to pixels."""
        return np.asarray(points / self.pitch + np.array(self.centre))


def fitted_points(grid: PixelGrid) -> FloatArray:
    """Spread points evenly over the film up to its corners (mm), (n, 2)."""
    half = 0.5 * grid.pitch * np.array([grid.width, grid.height])
    x, y = np.meshgrid(*(np.linspace(-h, h, _FITTED) for h in half))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


Ideal = Literal["rectilinear", "equidistant"]

# Step of numerical derivatives (tangents).
_SMALL = 1e-4

# Knots of the tables: their cubics and quintics are then off by less than a nanometre.
_KNOTS = 401
_KNOTS_ACROSS = 33

# Reach of the tables as a part of half the film's diagonal: an ideal picture asks for points outside the film.
_BEYOND = 1.3
_ROUNDS = 40

# Relative size of the steps at which Newton's method ends: a few roundings.
_SETTLED = 1e-13

# Points that are not reached within this part of the film have no value; places may lie as far outside.
_MISSED = 1e-9

# Least distance from a right angle (radians) at which a tangent is used, and the least field to fit.
GRAZING = 1e-6


class PointTable(NamedTuple):
    """Map of points of the film to ideal points, and back (mm).

    ideal : ideal points of points of the film; NaN where no light lands.
    real : points of the film of ideal points; NaN where there is none.
    """

    ideal: Callable[[FloatArray], FloatArray]
    real: Callable[[FloatArray], FloatArray]


TracedTables = tuple[Callable[[Ideal], PointTable], tuple[float, float], float]


def _ideal_projection(angle: FloatArray, ideal: Ideal) -> FloatArray:
    """Project angles (radians) ideally, for f = 1; NaN where that is not defined."""
    if ideal == "equidistant":
        return angle
    return np.where(np.abs(angle) < 0.5 * math.pi - GRAZING, np.tan(angle), np.nan)


def radial_tables(bench: OpticalBench) -> TracedTables:
    """Tabulate by the distance from the axis alone, for lenses of revolution.

    Returns
    -------
    A function that makes the table of an ideal projection, f in x and y (mm), and half the field of the film (degrees).

    Raises
    ------
    ValueError : no chief ray reaches the film.
    """
    from scipy.interpolate import CubicSpline

    nm = bench.primary
    rows = chief_rays.chief_ray_table(bench, "y", nm)
    half = 0.5 * math.hypot(*bench.settings.sensor_mm)
    reach = min(_BEYOND * half, float(rows.height[-1]))
    if not reach > 0.0:
        raise ValueError("no chief ray of the lens reaches the film")
    heights = np.linspace(0.0, reach, _KNOTS)
    angles = np.radians(chief_rays.chief_rays_at_heights(bench, "y", nm, heights).field_deg)
    lit = np.isfinite(angles)
    lit[0] = True
    angles[0] = 0.0
    count = int(np.argmin(lit)) if not lit.all() else _KNOTS
    heights, angles = heights[:count], angles[:count]
    if count < 4:
        raise ValueError("no chief ray of the lens reaches the film")

    def odd(heights: FloatArray, values: FloatArray) -> Any:
        return CubicSpline(np.concatenate([-heights[:0:-1], heights]), np.concatenate([-values[:0:-1], values]))

    scale = float(1.0 / odd(heights, angles)(0.0, 1))
    widest = math.degrees(float(np.interp(half, heights, angles)))

    def table(ideal: Ideal) -> PointTable:
        values = scale * _ideal_projection(angles, ideal)
        there = int(np.argmin(np.isfinite(values))) if not np.isfinite(values).all() else len(values)
        known, wanted = heights[:there], values[:there]
        spline = odd(known, wanted)

        def forth(points: FloatArray) -> FloatArray:
            r = np.linalg.norm(points, axis=-1)
            return scale_radially(points, r, np.where(r <= known[-1], spline(r), np.nan))

        def back(points: FloatArray) -> FloatArray:
            q = np.linalg.norm(points, axis=-1)
            r = np.interp(q, wanted, known, right=np.nan)
            for _ in range(_ROUNDS):
                step = (spline(r) - q) / spline(r, 1)
                r = r - step
                if not np.nanmax(np.abs(step), initial=0.0) > 10.0 * _SETTLED * known[-1]:
                    break
            return scale_radially(points, q, r)

        return PointTable(forth, back)

    return table, (scale, scale), widest


def scale_radially(points: FloatArray, lengths: FloatArray, wanted: FloatArray) -> FloatArray:
    """Move points along their direction from the middle, to other lengths."""
    ratio = np.divide(wanted, lengths, out=np.ones_like(lengths), where=lengths > 0.0)
    return points * ratio[..., None]


def quadrant_tables(bench: OpticalBench) -> TracedTables:
    """Tabulate by both coordinates, for lenses with cylinders, which have two planes of symmetry."""
    across, down = (0.5 * size for size in bench.settings.sensor_mm)
    reach = np.array([across, down]) * 1.1
    xs, ys = (np.linspace(0.0, r, _KNOTS_ACROSS) for r in reach)
    wanted = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    out = _directions_of_points(bench, wanted)
    shape = (_KNOTS_ACROSS, _KNOTS_ACROSS)
    axial = out[:, :2] / -out[:, 2:]
    axial_small = _chief_rays_from_stop(bench, np.array([[_SMALL, 0.0], [0.0, _SMALL]]))
    scale = tuple(float(axial_small[0][n, n] / (axial_small[1][n, n] / -axial_small[1][n, 2])) for n in (0, 1))
    angles = np.arctan(np.linalg.norm(axial, axis=1))
    widest = math.degrees(float(angles.max()))

    def table(ideal: Ideal) -> PointTable:
        lengths = np.linalg.norm(axial, axis=1)
        projected = _ideal_projection(angles, ideal)
        ratio = np.divide(projected, lengths, out=np.ones_like(lengths), where=lengths > 0.0)
        values = axial * ratio[:, None] * np.array(scale)
        return _spline_table((xs, ys), reach, *(values[:, n].reshape(shape) for n in (0, 1)))

    return table, (scale[0], scale[1]), widest


def _directions_of_points(bench: OpticalBench, wanted: FloatArray) -> FloatArray:
    """Find the directions in the scene (n, 3) of points of the film (n, 2), by Newton's method at the stop.

    Raises
    ------
    ValueError : chief rays do not reach all of the points.
    """
    # From the linear directions of the middle.
    start, _ = _chief_rays_from_stop(bench, np.array([[_SMALL, 0.0], [0.0, _SMALL]]))
    slope = np.array([start[0, 0], start[1, 1]]) / _SMALL
    tangents = wanted / slope
    for _ in range(_ROUNDS):
        landed, _ = _chief_rays_from_stop(bench, tangents)
        columns = [(_chief_rays_from_stop(bench, tangents + _SMALL * axis)[0] - landed) / _SMALL for axis in np.eye(2)]
        jacobian = np.stack(columns, axis=-1)
        missed = landed - wanted
        good = np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(missed).all(axis=1)
        step = np.zeros_like(tangents)
        step[good] = np.linalg.solve(jacobian[good], missed[good][..., None])[..., 0]
        tangents = tangents - step
        if np.abs(step).max() < _SETTLED:
            break
    landed, out = _chief_rays_from_stop(bench, tangents)
    if not np.isfinite(landed).all():
        raise ValueError("chief rays of the lens do not reach all of the film: choose a smaller sensor")
    return out


def _spline_table(
    quadrant: tuple[FloatArray, FloatArray], reach: FloatArray, x: FloatArray, y: FloatArray
) -> PointTable:
    """Interpolate values x and y at the knots of a quadrant by splines over all four.

    quadrant : knots of both coordinates (mm), from 0 on.
    reach : of the table (mm), (2,).
    """
    from scipy.interpolate import RectBivariateSpline

    knots = [np.concatenate([-k[:0:-1], k]) for k in quadrant]
    # x is odd in x and even in y.
    wide = [_mirror_quadrant(x, -1.0, 1.0), _mirror_quadrant(y, 1.0, -1.0)]
    splines = [RectBivariateSpline(*knots, part, kx=5, ky=5, s=0.0) for part in wide]

    def forth(points: FloatArray) -> FloatArray:
        ideal = np.stack([spline.ev(points[..., 0], points[..., 1]) for spline in splines], axis=-1)
        outside = (np.abs(points) > reach * (1.0 + _MISSED)).any(axis=-1)
        ideal[outside] = np.nan
        return ideal

    def back(points: FloatArray) -> FloatArray:
        at = np.clip(points, -reach, reach)
        for _ in range(_ROUNDS):
            value = np.stack([spline.ev(at[..., 0], at[..., 1]) for spline in splines], axis=-1)
            rows = [
                np.stack([spline.ev(at[..., 0], at[..., 1], dx, 1 - dx) for dx in (1, 0)], axis=-1)
                for spline in splines
            ]
            step = np.linalg.solve(np.stack(rows, axis=-2), (value - points)[..., None])[..., 0]
            moved = np.clip(at - step, -reach, reach)
            still = np.abs(moved - at).max(initial=0.0) < _SETTLED * reach.max()
            at = moved
            if still:
                break
        missed = np.linalg.norm(forth(at) - points, axis=-1)
        at[~(missed < _MISSED * reach.max())] = np.nan
        return at

    return PointTable(forth, back)


def _mirror_quadrant(values: FloatArray, first: float, second: float) -> FloatArray:
    """Mirror a quadrant's values (k, k) to all four, times a sign where the first or second coordinate is negative."""
    tall = np.concatenate([first * values[:0:-1], values], axis=0)
    return np.concatenate([second * tall[:, :0:-1], tall], axis=1)


def _chief_rays_from_stop(bench: OpticalBench, tangents: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Trace chief rays from the stop: places on the film (n, 2), upright, and directions in the scene (n, 3).

    tangents : x / z and y / z of their directions at the middle of the stop, (n, 2), upright.
    """
    onward = normalize(np.column_stack([-tangents, np.ones(len(tangents))]))
    landed, origin, out = chief_rays.rays_from_stop(bench, bench.primary, onward)
    if not math.isinf(bench.distance):
        out = chief_rays.object_points(bench, origin, out) - np.array([0.0, 0.0, bench.pupil])
    return landed, np.where(np.isfinite(landed[:, :1]), out, np.nan)
