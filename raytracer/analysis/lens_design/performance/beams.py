"""Beams: rays from one point of the scene around its chief ray, aimed at the stop; and the points of the field."""

import math
from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.performance.chief_rays import (
    ChiefRays,
    chief_rays_at_fields,
    chief_rays_at_heights,
    object_points,
)
from raytracer.analysis.lens_design.performance.illumination import largest_height
from raytracer.analysis.lens_design.performance.optical_bench import (
    MERIDIANS,
    OpticalBench,
    intersect_film,
    meridian_vector,
    normalize,
)
from raytracer.analysis.lens_design.performance.results import Curve
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import slice_surfaces

INSIDE = 1e-9
"""Distance of the marginal ray inside the stop's rim, in units of its radius: on the rim rounding decides."""

_STEPS = 65
_WIDENINGS = 6
_ROUNDS = 6
_NARROWINGS = 5
_CLOSE = 8.0 * float(np.finfo(np.float64).eps)
_COARSE = 41


class Beam(NamedTuple):
    """Beam: rays through a plane at right angles to the chief ray, where it enters the lens.

    meridian : of the field point.
    centre : of the plane (mm), (3,).
    axis : direction of the chief ray, (3,).
    up, across : directions in the plane, away from the lens's axis and at right angles to that, (3,).
    source : point of the object (mm), (3,); None if it is infinitely far.
    """

    meridian: str
    centre: Curve
    axis: Curve
    up: Curve
    across: Curve
    source: Curve | None

    def rays(self, up_mm: Curve, across_mm: Curve) -> tuple[Curve, Curve]:
        """Make the rays through points of the plane: origins and directions (n, 3)."""
        origins = self.centre + np.asarray(up_mm)[:, None] * self.up + np.asarray(across_mm)[:, None] * self.across
        if self.source is None:
            return origins, np.broadcast_to(self.axis, origins.shape)
        return origins, normalize(origins - self.source)


def beams(bench: OpticalBench, meridian: str, rays: ChiefRays) -> list[Beam | None]:
    """Make the beams around chief rays; None where there is no chief ray."""
    made: list[Beam | None] = []
    sources = None
    if not math.isinf(bench.distance):
        sources = object_points(bench, rays.origin, -rays.toward)
    for row, field in enumerate(rays.field_deg):
        if not math.isfinite(field):
            made.append(None)
            continue
        axis = rays.toward[row]
        column = MERIDIANS[meridian]
        up = meridian_vector(meridian, 0.0, axis[2], -axis[column])
        source = None if sources is None else sources[row]
        made.append(Beam(meridian, rays.origin[row], axis, up, meridian_vector(meridian, 1.0, 0.0, 0.0), source))
    return made


def aim_fan(bench: OpticalBench, beam: Beam, targets: Curve, *, up: bool) -> Curve:
    """Aim the rays of a fan at targets in the stop, in units of its radius.

    up : True for a fan along the field, False for one across it.

    Returns
    -------
    Distances of the rays from the chief ray (mm), where they enter the lens; NaN where none reaches the target.
    """
    surfaces = bench.without_rims()
    radius = surfaces.radius.copy()
    radius[bench.stop] = np.inf
    front = slice_surfaces(surfaces._replace(radius=radius), 0, bench.stop + 1)
    column = MERIDIANS[beam.meridian] if up else 1 - MERIDIANS[beam.meridian]

    def reached(way: Curve) -> Curve:
        """Trace rays to the stop: places there, NaN if lost."""
        still = np.zeros_like(way)
        weights, points, _ = trace_rays(front, *beam.rays(*((way, still) if up else (still, way))))
        met: Curve = points[:, column] / bench.stop_radius
        met[weights <= 0.0] = np.nan
        return met

    # Widen the fan until it covers the stop, or no more of it gets there.
    across = "x" if beam.meridian == "y" else "y"
    meridian = beam.meridian if up or len(bench.meridians) == 1 else across
    size = 1.5 * abs(float(bench.marginal_ray(bench.surfaces(), meridian, math.inf).heights[0]))
    for _ in range(_WIDENINGS):
        ways = np.linspace(-size, size, _STEPS)
        ways, met = _ascending(ways, reached(ways))
        if len(ways) > 2 and met[0] <= -1.0 and met[-1] >= 1.0:
            break
        size *= 0.6 if len(ways) < _STEPS // 4 else 1.5
    if len(ways) < 3:
        return np.full(len(targets), np.nan)

    aims = np.interp(targets, met, ways, left=np.nan, right=np.nan)
    slopes = np.gradient(met, ways)
    for _ in range(_ROUNDS):
        missed = targets - reached(aims)
        if np.nanmax(np.abs(missed), initial=0.0) <= _CLOSE:
            break
        aims = aims + np.where(np.isfinite(missed), missed / np.interp(aims, ways, slopes), 0.0)
    return aims


def _ascending(ways: Curve, met: Curve) -> tuple[Curve, Curve]:
    """Cut out the rows around the chief ray in which places in the stop grow."""
    middle = len(ways) // 2
    if not math.isfinite(met[middle]):
        return ways[:0], met[:0]
    with np.errstate(invalid="ignore"):
        grows = np.diff(met) > 0.0
    ends = np.flatnonzero(~grows)
    first = int(ends[ends < middle].max(initial=-1)) + 1
    last = int(ends[ends >= middle].min(initial=len(grows)))
    return ways[first : last + 1], met[first : last + 1]


def open_stop_fraction(bench: OpticalBench, meridian: str = "y") -> float:
    """Find the part of the stop's radius up to which light of the axis gets through: 1 if no other rim is narrower."""

    def make() -> float:
        axis = axis_beam(bench, meridian)
        if axis is None:
            return 0.0
        low, high = 0.0, 1.0 - INSIDE
        for _ in range(_NARROWINGS):
            parts = np.linspace(low, high, _STEPS)
            ups = aim_fan(bench, axis, parts, up=True)
            weights, _, _ = trace_rays(bench.surfaces(), *axis.rays(np.nan_to_num(ups), np.zeros(_STEPS)))
            blocked = np.flatnonzero((weights <= 0.0) | np.isnan(ups))
            if not len(blocked):
                return float(high)
            if blocked[0] == 0:
                return 0.0
            low, high = parts[blocked[0] - 1], parts[blocked[0]]
        return float(low)

    return bench.memoize(("opening", meridian), make)


def axis_beam(bench: OpticalBench, meridian: str = "y") -> Beam | None:
    """Make the beam of the point on the axis; None if there is no chief ray."""
    return beams(bench, meridian, chief_rays_at_fields(bench, meridian, bench.primary, np.zeros(1)))[0]


def ray_grid(bench: OpticalBench, beam: Beam, across: int) -> tuple[Curve, Curve]:
    """Make a square grid of rays that covers what the lens lets through: distances up and across (n,), in mm.

    Rays are at the centres of cells, so that each stands for the same part of the light.  Empty if nothing passes.
    """
    ends = np.array([-1.0, 1.0])
    bounds = []
    for up in (True, False):
        low, high = aim_fan(bench, beam, ends, up=up)
        if not math.isfinite(low - high):
            reach = 1.2 * float(bench.surfaces().radius[0]) + float(np.abs(beam.centre[:2]).max())
            low, high = -reach, reach
        margin = 0.15 * (high - low)
        bounds.append((low - margin, high + margin))
    (low, high), (left, right) = bounds
    ups, acrosses = cell_centers(low, high, left, right, _COARSE)
    weights, _, _ = trace_rays(bench.surfaces(), *beam.rays(ups, acrosses))
    passed = weights > 0.0
    if not passed.any():
        return np.empty(0), np.empty(0)
    step_up, step_across = (high - low) / _COARSE, (right - left) / _COARSE
    return cell_centers(
        ups[passed].min() - step_up,
        ups[passed].max() + step_up,
        acrosses[passed].min() - step_across,
        acrosses[passed].max() + step_across,
        across,
    )


def cell_centers(low: float, high: float, left: float, right: float, count: int) -> tuple[Curve, Curve]:
    """Return the centres of count x count cells, with as many rows below the middle as above it."""
    cells = (np.arange(count) + 0.5) / count
    ups, acrosses = np.meshgrid(low + (high - low) * cells, left + (right - left) * cells, indexing="ij")
    return ups.ravel(), acrosses.ravel()


def film_points(
    bench: OpticalBench, beam: Beam, ups: Curve, acrosses: Curve, wavelength_nm: float
) -> tuple[Curve, Curve]:
    """Trace rays to the film: places along the field and across it, upright, (n, 2) in mm, and weights.

    Lost rays are NaN with the weight 0.  A ray's weight is the light that it stands for: that of a cell of the plane,
    or the solid angle of the cell from a near point.
    """
    origins, directions = beam.rays(ups, acrosses)
    weights, points, onward = trace_rays(bench.surfaces(wavelength_nm), origins, directions)
    on_film = intersect_film(points, onward, weights, bench.film)
    if beam.source is not None:
        weights = weights * (directions @ beam.axis) ** 3
    column = MERIDIANS[beam.meridian]
    places: Curve = -on_film[:, [column, 1 - column]]
    return places, np.where(np.isfinite(places[:, 0]), weights, 0.0)


# ---- Points of the field at which a lens is studied


class FieldPoint(NamedTuple):
    """Field point.

    field : part of the largest image height.
    field_deg : angle from the axis (degrees).
    height : place of the primary colour's chief ray on the film (mm).
    beam : of the point; None if no light gets through.
    """

    field: float
    field_deg: float
    height: float
    beam: Beam | None


def field_points(bench: OpticalBench, meridian: str, parts: Curve) -> tuple[FieldPoint, ...]:
    """Find the field points at parts (k,) of the largest image height."""
    heights = parts * largest_height(bench, meridian)
    rays = chief_rays_at_heights(bench, meridian, bench.primary, heights)
    rows = zip(parts, rays.field_deg, heights, beams(bench, meridian, rays), strict=True)
    return tuple(FieldPoint(float(part), float(angle), float(height), beam) for part, angle, height, beam in rows)


def settings_field_points(bench: OpticalBench, meridian: str) -> tuple[FieldPoint, ...]:
    """Find the field points of the settings."""
    parts = np.array(bench.settings.fields)
    return bench.memoize(("fields", meridian), lambda: field_points(bench, meridian, parts))


def field_samples(bench: OpticalBench, meridian: str) -> tuple[Curve, Curve, Curve]:
    """Sample the field for curves: parts (k,), angles (degrees) and heights on the film (mm), of the primary colour."""
    parts = np.linspace(0.0, 1.0, bench.settings.steps)
    heights = parts * largest_height(bench, meridian)
    return parts, chief_rays_at_heights(bench, meridian, bench.primary, heights).field_deg, heights
