"""The light of one point of the scene: rays around its chief ray, and which of them the stop lets through."""

import math
from typing import NamedTuple

import numpy as np

from raytracer.lens_report.analysis.bench import MERIDIANS, Bench, along, landing, unit
from raytracer.lens_report.analysis.chief import ChiefRays, object_points, of_fields
from raytracer.lens_report.analysis.paraxial import marginal_ray
from raytracer.lens_report.analysis.results import Curve
from raytracer.lenses.surfaces import LensSurfaces, part, trace_rays

INSIDE = 1e-9
"""How far inside the stop's rim, in units of its radius, the marginal ray is: on it rounding decides."""

_STEPS = 65
_WIDENINGS = 6
_ROUNDS = 6
_NARROWINGS = 5
_CLOSE = 8.0 * float(np.finfo(np.float64).eps)
_COARSE = 41


class Beam(NamedTuple):
    """Rays through a plane at right angles to the chief ray, where it enters the lens.

    centre (3,); axis (3,), the chief ray's direction; up (3,), away from the axis, and across (3,), in that plane;
    source (3,), the point of the object, None if it is infinitely far.
    """

    meridian: str
    centre: Curve
    axis: Curve
    up: Curve
    across: Curve
    source: Curve | None

    def rays(self, up_mm: Curve, across_mm: Curve) -> tuple[Curve, Curve]:
        """Origins and directions (n, 3) of the rays through points of the plane."""
        origins = self.centre + np.asarray(up_mm)[:, None] * self.up + np.asarray(across_mm)[:, None] * self.across
        if self.source is None:
            return origins, np.broadcast_to(self.axis, origins.shape)
        return origins, unit(origins - self.source)


def beams(bench: Bench, meridian: str, rays: ChiefRays) -> list[Beam | None]:
    """The beams around chief rays; None where there is no chief ray."""
    found: list[Beam | None] = []
    sources = None
    if not math.isinf(bench.distance):
        sources = object_points(bench, rays.origin, -rays.toward)
    for row, field in enumerate(rays.field_deg):
        if not math.isfinite(field):
            found.append(None)
            continue
        axis = rays.toward[row]
        column = MERIDIANS[meridian]
        up = along(meridian, 0.0, axis[2], -axis[column])
        source = None if sources is None else sources[row]
        found.append(Beam(meridian, rays.origin[row], axis, up, along(meridian, 1.0, 0.0, 0.0), source))
    return found


def _at_stop(bench: Bench, front: LensSurfaces, beam: Beam, up_mm: Curve, across_mm: Curve) -> Curve:
    """Where rays meet the stop, in units of its radius along the field and across it: (n, 2), NaN for those lost."""
    weights, points, _ = trace_rays(front, *beam.rays(up_mm, across_mm))
    column = MERIDIANS[beam.meridian]
    met: Curve = points[:, [column, 1 - column]] / bench.stop_radius
    met[weights <= 0.0] = np.nan
    return met


def aimed(bench: Bench, beam: Beam, targets: Curve, *, up: bool, wavelength_nm: float | None = None) -> Curve:
    """How far from the chief ray (mm) rays of a fan pass that meet the stop at targets, in units of its radius.

    up : whether the fan is along the field; else across it.  NaN for those that cannot be found.
    """
    surfaces = bench.wide(wavelength_nm)
    radius = surfaces.radius.copy()
    radius[bench.stop] = np.inf
    front = part(surfaces._replace(radius=radius), 0, bench.stop + 1)
    which = 0 if up else 1

    def reached(way: Curve) -> Curve:
        still = np.zeros_like(way)
        met: Curve = _at_stop(bench, front, beam, *((way, still) if up else (still, way)))[:, which]
        return met

    # Widen the fan until it covers the stop, or no more of it gets there.
    size = 1.5 * pupil_radius(bench, beam.meridian if up else other(bench, beam.meridian))
    for _ in range(_WIDENINGS):
        ways = np.linspace(-size, size, _STEPS)
        ways, met = _ascending(ways, reached(ways))
        if len(ways) > 2 and met[0] <= -1.0 and met[-1] >= 1.0:
            break
        size *= 0.6 if len(ways) < _STEPS // 4 else 1.5
    if len(ways) < 3:
        return np.full(len(targets), np.nan)

    found = np.interp(targets, met, ways, left=np.nan, right=np.nan)
    slopes = np.gradient(met, ways)
    for _ in range(_ROUNDS):
        missed = targets - reached(found)
        if np.nanmax(np.abs(missed), initial=0.0) <= _CLOSE:
            break
        found = found + np.where(np.isfinite(missed), missed / np.interp(found, ways, slopes), 0.0)
    return found


def _ascending(ways: Curve, met: Curve) -> tuple[Curve, Curve]:
    """The rows around the chief ray in which what is met grows."""
    middle = len(ways) // 2
    if not math.isfinite(met[middle]):
        return ways[:0], met[:0]
    with np.errstate(invalid="ignore"):
        grows = np.diff(met) > 0.0
    ends = np.flatnonzero(~grows)
    first = int(ends[ends < middle].max(initial=-1)) + 1
    last = int(ends[ends >= middle].min(initial=len(grows)))
    return ways[first : last + 1], met[first : last + 1]


def other(bench: Bench, meridian: str) -> str:
    """The meridian across; the same for a lens of revolution."""
    if len(bench.meridians) == 1:
        return meridian
    return "x" if meridian == "y" else "y"


def opening(bench: Bench, meridian: str = "y") -> float:
    """Part of the stop's radius up to which light of the axis gets through: 1, but for rims that are narrower."""

    def make() -> float:
        axis = axis_beam(bench, meridian)
        if axis is None:
            return 0.0
        low, high = 0.0, 1.0 - INSIDE
        for _ in range(_NARROWINGS):
            parts = np.linspace(low, high, _STEPS)
            ups = aimed(bench, axis, parts, up=True)
            weights, _, _ = trace_rays(bench.surfaces(), *axis.rays(np.nan_to_num(ups), np.zeros(_STEPS)))
            blocked = np.flatnonzero((weights <= 0.0) | np.isnan(ups))
            if not len(blocked):
                return float(high)
            if blocked[0] == 0:
                return 0.0
            low, high = parts[blocked[0] - 1], parts[blocked[0]]
        return float(low)

    return bench.kept(("opening", meridian), make)


def axis_beam(bench: Bench, meridian: str = "y") -> Beam | None:
    """That of the point on the axis."""
    return beams(bench, meridian, of_fields(bench, meridian, bench.primary, np.zeros(1)))[0]


def pupil_radius(bench: Bench, meridian: str) -> float:
    """Of the paraxial entrance pupil (mm)."""
    far = marginal_ray(bench, bench.surfaces(), meridian, math.inf)
    return abs(float(far.heights[0]))


def bundle(bench: Bench, beam: Beam, across: int) -> tuple[Curve, Curve]:
    """A square grid of rays that covers what the lens lets through: ways up and across (n,), in mm.

    The centres of its cells, so that each ray stands for the same part of the light.  Empty if nothing passes.
    """
    ends = np.array([-1.0, 1.0])
    bounds = []
    for up in (True, False):
        low, high = aimed(bench, beam, ends, up=up)
        if not math.isfinite(low - high):
            reach = 1.2 * float(bench.surfaces().radius[0]) + float(np.abs(beam.centre[:2]).max())
            low, high = -reach, reach
        margin = 0.15 * (high - low)
        bounds.append((low - margin, high + margin))
    (low, high), (left, right) = bounds
    ups, acrosses = grid(low, high, left, right, _COARSE)
    weights, _, _ = trace_rays(bench.surfaces(), *beam.rays(ups, acrosses))
    passed = weights > 0.0
    if not passed.any():
        return np.empty(0), np.empty(0)
    step_up, step_across = (high - low) / _COARSE, (right - left) / _COARSE
    return grid(
        ups[passed].min() - step_up,
        ups[passed].max() + step_up,
        acrosses[passed].min() - step_across,
        acrosses[passed].max() + step_across,
        across,
    )


def grid(low: float, high: float, left: float, right: float, count: int) -> tuple[Curve, Curve]:
    """Centres of count x count cells, with as many rows below the middle as above it."""
    cells = (np.arange(count) + 0.5) / count
    ups, acrosses = np.meshgrid(low + (high - low) * cells, left + (right - left) * cells, indexing="ij")
    return ups.ravel(), acrosses.ravel()


def landed(bench: Bench, beam: Beam, ups: Curve, acrosses: Curve, wavelength_nm: float) -> tuple[Curve, Curve]:
    """Where rays land on the film, along the field and across it with signs turned, (n, 2) in mm, and their weights.

    NaN with the weight 0 for those that do not get there.  A ray's weight is the light that it stands for: that of a
    cell of the plane, or the solid angle in which a near point sees it.
    """
    origins, directions = beam.rays(ups, acrosses)
    weights, points, onward = trace_rays(bench.surfaces(wavelength_nm), origins, directions)
    on_film = landing(points, onward, weights, bench.film)
    if beam.source is not None:
        weights = weights * (directions @ beam.axis) ** 3
    column = MERIDIANS[beam.meridian]
    places: Curve = -on_film[:, [column, 1 - column]]
    return places, np.where(np.isfinite(places[:, 0]), weights, 0.0)
