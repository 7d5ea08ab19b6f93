"""Chief rays: those through the centre of the stop, by where they come from or where they land.

They are followed from the centre of the stop both ways, so that none has to be aimed, and fields beyond 90 degrees
are no exception; only which of them belongs to a field is searched for.
"""

import math
from typing import NamedTuple

import numpy as np

from raytracer.lens_report.analysis.bench import MERIDIANS, Bench, along, landing, out_to_scene
from raytracer.lens_report.analysis.results import Curve
from raytracer.lenses.surfaces import part, trace_paths, trace_rays

_STEPS = 361
_STEEPEST = math.radians(89.5)
_ROUNDS = 12

# Of the largest, what a search may be off by: some roundings.
_CLOSE = 8.0 * float(np.finfo(np.float64).eps)

_CURVED_FROM = 80.0


class ChiefRays(NamedTuple):
    """Chief rays of one meridian and colour, float64; NaN where there is none.

    angle (k,) : at the stop (radians).  field_deg (k,) : where the light comes from; of an object at a distance, the
    angle at which the entrance pupil sees it.  height (k,) : where it lands on the film (mm), along the field, with
    the sign turned.  origin, toward (k, 3) : a point of the ray on the first surface, and its direction before it.
    """

    angle: Curve
    field_deg: Curve
    height: Curve
    origin: Curve
    toward: Curve


def _from_stop(bench: Bench, meridian: str, wavelength_nm: float, angle: Curve) -> ChiefRays:
    """The rays that go through the centre of the stop at angles (radians)."""
    surfaces = bench.wide(wavelength_nm)
    count, stop = len(surfaces.curvature), bench.stop
    onward = along(meridian, 0.0, -np.sin(angle), np.cos(angle))
    centre = np.broadcast_to((0.0, 0.0, surfaces.vertex[stop]), onward.shape)

    # To the scene, and to the film.
    entered, origin, out = out_to_scene(surfaces, stop, centre, -onward)
    left, points, directions = trace_rays(part(surfaces, stop, count), centre, onward)
    column = MERIDIANS[meridian]
    field = np.degrees(np.arctan2(out[:, column], -out[:, 2]))
    if not math.isinf(bench.distance):
        field = _seen(bench, origin, out, column)
    height = -landing(points, directions, left, bench.film)[:, column]
    lost = (entered <= 0.0) | ~np.isfinite(height)
    field, height = np.where(lost, np.nan, field), np.where(lost, np.nan, height)
    return ChiefRays(angle, field, height, origin, -out)


def _seen(bench: Bench, origin: Curve, out: Curve, column: int) -> Curve:
    """Angles (degrees) at which the entrance pupil sees the points of the object that rays come from."""
    points = object_points(bench, origin, out)
    seen: Curve = np.degrees(np.arctan2(points[:, column], bench.pupil - points[:, 2]))
    return seen


def curved(bench: Bench) -> bool:
    """Whether an object at a distance is a sphere around the entrance pupil: that of a lens that sees behind itself."""
    return bench.kept("curved", lambda: _widest(bench) > _CURVED_FROM)


def _widest(bench: Bench) -> float:
    """The greatest angle (degrees) from the axis at which chief rays of the sensor's corner go out."""
    far = bench.at_infinity()
    widest = 0.0
    for meridian in bench.meridians:
        rays = table(far, meridian, far.primary)
        within = rays.height <= math.hypot(*bench.settings.sensor_mm) / 2.0
        widest = max(widest, float(rays.field_deg[within].max()))
    return widest


def object_points(bench: Bench, origin: Curve, out: Curve) -> Curve:
    """Where rays that leave the lens towards the scene meet the object, which is not infinitely far: (k, 3)."""
    if curved(bench):
        centre = np.array([0.0, 0.0, bench.pupil])
        offset = origin - centre
        half = (offset * out).sum(axis=1)
        rest = (offset * offset).sum(axis=1) - bench.distance**2
        way = -half + np.sqrt(half * half - rest)
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (bench.pupil - bench.distance - origin[:, 2]) / out[:, 2]
        way = np.where(way > 0.0, way, np.nan)
    points: Curve = origin + way[:, None] * out
    return points


def table(bench: Bench, meridian: str, wavelength_nm: float) -> ChiefRays:
    """Chief rays from the axis outwards, as far as there are any, with growing field and height."""

    def make() -> ChiefRays:
        rays = _ascending(_from_stop(bench, meridian, wavelength_nm, np.linspace(0.0, _STEEPEST, _STEPS)))
        if len(rays.angle) == _STEPS:
            return rays
        # The last one is between two rows: look closer there.
        reached, step = rays.angle[-1], _STEEPEST / (_STEPS - 1)
        closer = np.concatenate([rays.angle[:-1], np.linspace(reached, reached + step, 64)])
        return _ascending(_from_stop(bench, meridian, wavelength_nm, closer))

    return bench.kept(("chief", meridian, wavelength_nm), make)


def _ascending(rays: ChiefRays) -> ChiefRays:
    """The rows from the first on in which field and height grow."""
    with np.errstate(invalid="ignore"):
        grows = (np.diff(rays.field_deg) > 0.0) & (np.diff(rays.height) > 0.0)
    count = 1 + (int(np.argmin(grows)) if not grows.all() else len(grows))
    return ChiefRays(*(column[:count] for column in rays))


def of_fields(bench: Bench, meridian: str, wavelength_nm: float, field_deg: Curve) -> ChiefRays:
    """The chief rays of fields (degrees, (k,))."""
    return _found(bench, meridian, wavelength_nm, "field_deg", field_deg)


def of_heights(bench: Bench, meridian: str, wavelength_nm: float, height_mm: Curve) -> ChiefRays:
    """The chief rays that land at heights on the film (mm, (k,))."""
    return _found(bench, meridian, wavelength_nm, "height", height_mm)


def _found(bench: Bench, meridian: str, wavelength_nm: float, column: str, wanted: Curve) -> ChiefRays:
    rows = table(bench, meridian, wavelength_nm)
    known = getattr(rows, column)
    target = np.asarray(wanted, np.float64)
    if len(known) < 3:
        return _from_stop(bench, meridian, wavelength_nm, np.where(target == 0.0, 0.0, np.nan))
    # From the table's straight lines on, by Newton's steps with the table's slopes.
    angle = np.interp(target, known, rows.angle, left=np.nan, right=np.nan)
    slopes = np.gradient(known, rows.angle)
    for _ in range(_ROUNDS):
        rays = _from_stop(bench, meridian, wavelength_nm, angle)
        missed = target - getattr(rays, column)
        if np.nanmax(np.abs(missed), initial=0.0) <= _CLOSE * known[-1]:
            return rays
        angle = angle + np.where(np.isfinite(missed), missed / np.interp(angle, rows.angle, slopes), 0.0)
    return _from_stop(bench, meridian, wavelength_nm, angle)


def chief_paths(bench: Bench, rays: ChiefRays, wavelength_nm: float) -> tuple[Curve, Curve]:
    """Points and directions of chief rays at and behind each surface: (k, n, 3), NaN for those that there are not."""
    weights, points, directions = trace_paths(bench.wide(wavelength_nm), rays.origin, rays.toward)
    lost = (weights <= 0.0) | ~np.isfinite(rays.field_deg)
    points[lost], directions[lost] = np.nan, np.nan
    return points, directions
