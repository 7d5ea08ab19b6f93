"""Chief rays: those through the centre of the stop, by their field angle or by their height on the film.

They are traced from the centre of the stop both ways, so that none has to be aimed, and fields beyond 90 degrees
are no exception; only the angle at the stop that belongs to a field is searched for.
"""

import math
from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.performance.optical_bench import (
    MERIDIANS,
    OpticalBench,
    intersect_film,
    meridian_vector,
)
from raytracer.analysis.lens_design.performance.results import Curve
from raytracer.optics.lens_system.ray_tracing import trace_paths, trace_rays
from raytracer.optics.lens_system.surfaces import slice_surfaces

_STEPS = 361
_STEEPEST = math.radians(89.5)
_ROUNDS = 12

# Relative error at which a search ends: some roundings.
_CLOSE = 8.0 * float(np.finfo(np.float64).eps)

# Half field (degrees) from which on an object at a distance is a sphere.
_CURVED_FROM = 80.0


class ChiefRays(NamedTuple):
    """Chief rays of one meridian and colour, float64; NaN where there is none.

    angle (k,) : at the stop (radians).
    field_deg (k,) : angle of the light from the axis; of an object at a distance, from the entrance pupil.
    height (k,) : place on the film (mm), along the field, with the sign turned.
    origin (k, 3) : point of the ray on the first surface (mm).
    toward (k, 3) : direction before the first surface.
    """

    angle: Curve
    field_deg: Curve
    height: Curve
    origin: Curve
    toward: Curve


def rays_from_stop(bench: OpticalBench, wavelength_nm: float, onward: Curve) -> tuple[Curve, Curve, Curve]:
    """Trace the rays from the centre of the stop with directions (k, 3), both ways.

    Returns
    -------
    Places on the film (k, 2), with the sign turned, NaN if lost; points on the first surface and directions before it,
    towards the scene (k, 3).
    """
    surfaces, stop = bench.without_rims(wavelength_nm), bench.stop
    centre = np.broadcast_to((0.0, 0.0, float(surfaces.vertex[stop])), onward.shape)
    entered, origin, out = np.ones(len(onward)), centre, -onward
    if stop > 0:
        entered, origin, out = trace_rays(slice_surfaces(surfaces, 0, stop), centre, -onward, towards_film=False)
    left, points, directions = trace_rays(slice_surfaces(surfaces, stop, len(surfaces.curvature)), centre, onward)
    landed: Curve = -intersect_film(points, directions, left, bench.film)
    landed[entered <= 0.0] = np.nan
    return landed, origin, out


def _from_stop(bench: OpticalBench, meridian: str, wavelength_nm: float, angle: Curve) -> ChiefRays:
    """Trace the rays through the centre of the stop at angles (radians)."""
    onward = meridian_vector(meridian, 0.0, -np.sin(angle), np.cos(angle))
    landed, origin, out = rays_from_stop(bench, wavelength_nm, onward)
    column = MERIDIANS[meridian]
    field = np.degrees(np.arctan2(out[:, column], -out[:, 2]))
    if not math.isinf(bench.distance):
        # From the entrance pupil to the object's points that the rays come from.
        points = object_points(bench, origin, out)
        field = np.degrees(np.arctan2(points[:, column], bench.pupil - points[:, 2]))
    height = landed[:, column]
    return ChiefRays(angle, np.where(np.isfinite(height), field, np.nan), height, origin, -out)


def _has_curved_object(bench: OpticalBench) -> bool:
    """Tell if an object at a distance is a sphere around the entrance pupil: so for chief rays beyond 80 degrees."""

    def make() -> bool:
        far, half = bench.at_infinity(), math.hypot(*bench.settings.sensor_mm) / 2.0
        tables = [chief_ray_table(far, meridian, far.primary) for meridian in bench.meridians]
        return any(bool((rays.field_deg[rays.height <= half] > _CURVED_FROM).any()) for rays in tables)

    return bench.memoize("curved", make)


def object_points(bench: OpticalBench, origin: Curve, out: Curve) -> Curve:
    """Intersect rays that leave the lens towards the scene with the object, which is not infinitely far: (k, 3)."""
    if _has_curved_object(bench):
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


def chief_ray_table(bench: OpticalBench, meridian: str, wavelength_nm: float) -> ChiefRays:
    """Tabulate chief rays from the axis outwards, as far as there are any, with growing field and height."""

    def make() -> ChiefRays:
        rays = _ascending(_from_stop(bench, meridian, wavelength_nm, np.linspace(0.0, _STEEPEST, _STEPS)))
        if len(rays.angle) == _STEPS:
            return rays
        # The outermost is between two rows: sample more finely there.
        reached, step = rays.angle[-1], _STEEPEST / (_STEPS - 1)
        closer = np.concatenate([rays.angle[:-1], np.linspace(reached, reached + step, 64)])
        return _ascending(_from_stop(bench, meridian, wavelength_nm, closer))

    return bench.memoize(("chief", meridian, wavelength_nm), make)


def _ascending(rays: ChiefRays) -> ChiefRays:
    """Cut off the rows from which on field and height no longer grow."""
    with np.errstate(invalid="ignore"):
        grows = (np.diff(rays.field_deg) > 0.0) & (np.diff(rays.height) > 0.0)
    count = 1 + (int(np.argmin(grows)) if not grows.all() else len(grows))
    return ChiefRays(*(column[:count] for column in rays))


def chief_rays_at_fields(bench: OpticalBench, meridian: str, wavelength_nm: float, field_deg: Curve) -> ChiefRays:
    """Find the chief rays of fields (degrees, (k,))."""
    return _interpolate_rays(bench, meridian, wavelength_nm, "field_deg", field_deg)


def chief_rays_at_heights(bench: OpticalBench, meridian: str, wavelength_nm: float, height_mm: Curve) -> ChiefRays:
    """Find the chief rays that land at heights on the film (mm, (k,))."""
    return _interpolate_rays(bench, meridian, wavelength_nm, "height", height_mm)


def _interpolate_rays(
    bench: OpticalBench, meridian: str, wavelength_nm: float, column: str, wanted: Curve
) -> ChiefRays:
    """Find the chief rays with wanted values in a column of the table."""
    rows = chief_ray_table(bench, meridian, wavelength_nm)
    known = getattr(rows, column)
    target = np.asarray(wanted, np.float64)
    if len(known) < 3:
        return _from_stop(bench, meridian, wavelength_nm, np.where(target == 0.0, 0.0, np.nan))
    # Start from linear interpolation in the table, and refine by Newton's method with the table's slopes.
    angle = np.interp(target, known, rows.angle, left=np.nan, right=np.nan)
    slopes = np.gradient(known, rows.angle)
    for _ in range(_ROUNDS):
        rays = _from_stop(bench, meridian, wavelength_nm, angle)
        missed = target - getattr(rays, column)
        if np.nanmax(np.abs(missed), initial=0.0) <= _CLOSE * known[-1]:
            return rays
        angle = angle + np.where(np.isfinite(missed), missed / np.interp(angle, rows.angle, slopes), 0.0)
    return _from_stop(bench, meridian, wavelength_nm, angle)


def chief_paths(bench: OpticalBench, rays: ChiefRays, wavelength_nm: float) -> tuple[Curve, Curve]:
    """Trace chief rays through the lens: points at and directions behind each surface, (k, n, 3); NaN if missing."""
    weights, points, directions = trace_paths(bench.without_rims(wavelength_nm), rays.origin, rays.toward)
    lost = (weights <= 0.0) | ~np.isfinite(rays.field_deg)
    points[lost], directions[lost] = np.nan, np.nan
    return points, directions
