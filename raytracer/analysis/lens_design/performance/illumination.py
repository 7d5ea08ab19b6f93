"""Relative illumination: the pupil as seen from points of the film, and the largest image height with any light.

The irradiance from a scene of radiance 1 is the projected solid angle of the pupil, that is the integral of
cos^4 / Z^2 over the part of the rear vertex's plane through which rays of the film point get out at the front.  The rim
of that part is found by bisection, and the integral over the polygon is Lambert's formula, so that curves are smooth.

References: Kolb, Mitchell, Hanrahan 1995, sec. 3 (exposure); Lambert 1760, "Photometria"; Baum et al. 1989, "Improving
Radiosity Solutions Through the Use of Analytically Determined Form-Factors", SIGGRAPH (form factor of a polygon).
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.lens_design.performance.chief_rays import chief_paths, chief_ray_table, chief_rays_at_heights
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, crossing, meridian_vector, normalize
from raytracer.analysis.lens_design.performance.results import Curve, Illumination
from raytracer.optics.lens_system.ray_tracing import trace_rays

_COARSE = 32
_WIDENINGS = 5
_SIDES = 256
_HALVINGS = 26
_EDGE_HALVINGS = 12


def projected_solid_angle(bench: OpticalBench, meridian: str, height_mm: float) -> float:
    """Compute the projected solid angle (sr) of the pupil from a height on the film: the irradiance for radiance 1.

    At the primary wavelength.  The pupil's part of the rear plane is taken to be star-shaped about its middle.
    """
    surfaces = bench.surfaces()
    rear = float(surfaces.vertex[-1])
    origin = meridian_vector(meridian, 0.0, -height_mm, bench.film)

    def passes(places: Curve) -> NDArray[np.bool_]:
        directions = normalize(np.insert(places, 2, rear, axis=1) - origin)
        weights, _, _ = trace_rays(surfaces, origin, directions, towards_film=False)
        open_: NDArray[np.bool_] = weights > 0.0
        return open_

    middle, reach = _middle(bench, meridian, height_mm, passes)
    if reach == 0.0:
        return 0.0

    # Find the rim by bisection of the distance in each direction.
    angles = 2.0 * math.pi * np.arange(_SIDES) / _SIDES
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    inside, outside = np.zeros(_SIDES), np.full(_SIDES, reach)
    for _ in range(_HALVINGS):
        between = 0.5 * (inside + outside)
        open_ = passes(middle + between[:, None] * ways)
        inside, outside = np.where(open_, between, inside), np.where(open_, outside, between)
    return _lambert(normalize(np.insert(middle + inside[:, None] * ways, 2, rear, axis=1) - origin))


def _middle(
    bench: OpticalBench, meridian: str, height_mm: float, passes: Callable[[Curve], NDArray[np.bool_]]
) -> tuple[Curve, float]:
    """Find the middle (2,) of the pupil in the rear plane, and a distance that leads out of it; 0 if nothing passes."""
    surfaces = bench.surfaces()
    rim, rear = 1.05 * float(surfaces.radius[-1]), float(surfaces.vertex[-1])
    chief = chief_rays_at_heights(bench, meridian, bench.primary, np.array([height_mm]))
    points, onward = chief_paths(bench, chief, bench.primary)
    way = (rear - points[0, -1, 2]) / onward[0, -1, 2]
    start = points[0, -1, :2] + way * onward[0, -1, :2]

    # Windows around the chief ray that grow until the pupil is within; then the whole element, more finely each time.
    windows = [(np.zeros(2), rim, cells) for cells in (_COARSE, 4 * _COARSE)]
    if np.isfinite(start).all():
        # A bound of the pupil's radius, in the rear plane, as seen from a point of the film.
        slope = abs(float(bench.marginal_ray(surfaces, meridian).slopes[-1]))
        size = 1.5 * slope * abs(bench.film - rear)
        windows = [(start, size * 1.5**step, _COARSE) for step in range(_WIDENINGS)] + windows
    for centre, size, count in windows:
        cells = size * (2.0 * (np.arange(count) + 0.5) / count - 1.0)
        offsets = np.stack(np.meshgrid(cells, cells, indexing="ij"), axis=-1).reshape(-1, 2)
        lit = passes(centre + offsets)
        if not lit.any():
            continue
        passing = offsets[lit]
        if size < rim and np.abs(passing).max() > size * (1.0 - 1.5 / count):
            continue
        middle = passing[np.argmin(np.linalg.norm(passing - passing.mean(axis=0), axis=1))]
        return centre + middle, 4.0 * size
    return np.zeros(2), 0.0


def _lambert(corners: Curve) -> float:
    """Compute the projected solid angle, on a plane at right angles to the axis, of a polygon of directions (n, 3)."""
    following = np.roll(corners, -1, axis=0)
    normals = np.cross(corners, following)
    sines = np.linalg.norm(normals, axis=1)
    angles = np.arctan2(sines, (corners * following).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        parts = np.where(sines > 0.0, angles * normals[:, 2] / sines, 0.0)
    return abs(0.5 * float(parts.sum()))


def sensor_reach(bench: OpticalBench, meridian: str) -> float:
    """Return the distance (mm) of the sensor's corner; where the lens has cylinders, of the middle of a side."""
    width, height = bench.settings.sensor_mm
    return 0.5 * (math.hypot(width, height) if bench.lens.is_round() else {"y": height, "x": width}[meridian])


def largest_height(bench: OpticalBench, meridian: str) -> float:
    """Return the largest image height (mm): the sensor's corner, unless the image circle or the glass ends it.

    Where the lens has cylinders it is the middle of the sensor's side, in either meridian.
    """

    def make() -> float:
        most = sensor_reach(bench, meridian)
        if bench.lens.image_circle is not None:
            most = min(most, 0.5 * bench.lens.image_circle)
        most = min(most, float(chief_ray_table(bench, meridian, bench.primary).height[-1]))
        if projected_solid_angle(bench, meridian, most) > 0.0:
            return most
        dark, bright = most, 0.0
        for _ in range(_EDGE_HALVINGS):
            between = 0.5 * (dark + bright)
            lit = projected_solid_angle(bench, meridian, between) > 0.0
            dark, bright = (dark, between) if lit else (between, bright)
        return bright

    return bench.memoize(("largest", meridian), make)


def illumination(bench: OpticalBench, meridian: str = "y") -> Illumination:
    """Compute relative illumination over the picture."""
    field = np.linspace(0.0, 1.0, bench.settings.steps)
    heights = field * largest_height(bench, meridian)
    irradiance = np.array([projected_solid_angle(bench, meridian, height) for height in heights])
    away = bench.film - crossing(bench.surfaces(), bench.chief_ray(bench.surfaces(), meridian))
    cos4 = (1.0 + (heights / away) ** 2) ** -2
    if irradiance[0] <= 0.0:
        nothing = np.full_like(field, np.nan)
        return Illumination(meridian, field, heights, nothing, nothing, cos4, 0.0)
    relative = irradiance / irradiance[0]
    return Illumination(meridian, field, heights, relative, relative / cos4, cos4, float(irradiance[0] / math.pi))
