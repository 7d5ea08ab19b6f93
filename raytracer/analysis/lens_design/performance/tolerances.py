"""Depth of focus and of field, and sensitivities to manufacturing tolerances.

References: Smith 2008, "Modern Optical Engineering", 4th ed., chs. 9 (depth of focus) and 18 (tolerances).
"""

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np

from raytracer.analysis.lens_design.performance.beams import ray_grid
from raytracer.analysis.lens_design.performance.first_order import working_f_number
from raytracer.analysis.lens_design.performance.illumination import largest_height
from raytracer.analysis.lens_design.performance.optical_bench import (
    OpticalBench,
    crossing,
    intersect_film,
    paraxial_ray,
)
from raytracer.analysis.lens_design.performance.results import Curve, Sensitivity, Tolerances
from raytracer.analysis.lens_design.performance.spots import axis_point
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces

_RAYS = 24
_CIRCLE = 1.0 / 1500.0

# Tolerances of a good workshop: Smith 2008, ch. 18.
RADIUS_STEP_PERCENT = 0.1
THICKNESS_STEP_MM = 0.05
INDEX_STEP = 0.001

# Relative step of derivatives: the cube root of the rounding error is best for central differences.
_DERIVATIVE_STEP = float(np.finfo(np.float64).eps ** (1.0 / 3.0))


AxialRays: TypeAlias = tuple[Curve, Curve]
"""Rays from the point on the axis, for all colours: origins and directions (n, 3)."""


class Perturbation(NamedTuple):
    """Error of one number of a lens.

    surface : from 0.
    parameter, unit, step : as of `Sensitivity`.
    value : the number without the error.
    """

    surface: int
    parameter: str
    unit: str
    step: float
    value: float

    @property
    def by(self) -> float:
        """The error in the unit of the number."""
        return self.step * (1e-2 * self.value if self.unit == "%" else 1.0)


def list_perturbations(surfaces: LensSurfaces) -> Iterator[Perturbation]:
    """List perturbations of all radii, thicknesses and indices of a lens."""
    count = len(surfaces.curvature)
    for surface in range(count):
        if surfaces.curvature[surface] != 0.0:
            radius = 1.0 / float(surfaces.curvature[surface])
            yield Perturbation(surface, "radius", "%", RADIUS_STEP_PERCENT, radius)
        if surface + 1 < count:
            yield Perturbation(surface, "thickness", "mm", THICKNESS_STEP_MM, float(np.diff(surfaces.vertex)[surface]))
            if surfaces.ior[surface + 1] != 1.0:
                yield Perturbation(surface, "index", "", INDEX_STEP, float(surfaces.ior[surface + 1]))


def perturb_lens(surfaces: LensSurfaces, error: Perturbation, by: float) -> LensSurfaces:
    """Increase one number of a lens (mm, or of the index)."""
    surface = error.surface
    if error.parameter == "radius":
        factor = error.value / (error.value + by)
        curvature = surfaces.curvature.copy()
        curvature[surface] *= factor
        shapes = surfaces.shapes
        if shapes is not None:
            quadric = shapes.quadric.copy()
            quadric[surface] *= factor
            # Intersections are searched between the ends of the sag, which move less than the surface at the rim.
            margin = abs(factor - 1.0) * (shapes.max_sag - shapes.min_sag)
            shapes = shapes._replace(quadric=quadric, min_sag=shapes.min_sag - margin, max_sag=shapes.max_sag + margin)
        return surfaces._replace(curvature=curvature, shapes=shapes)
    if error.parameter == "thickness":
        vertex = surfaces.vertex.copy()
        vertex[surface + 1 :] += by
        return surfaces._replace(vertex=vertex)
    ior = surfaces.ior.copy()
    ior[surface + 1] += by
    return surfaces._replace(ior=ior)


def back_focus(bench: OpticalBench, surfaces: LensSurfaces, meridian: str) -> float:
    """Return the distance (mm) from the last vertex to the paraxial image of the point that is focused on."""
    return crossing(surfaces, bench.marginal_ray(surfaces, meridian)) - float(surfaces.vertex[-1])


def _axial_spot(bench: OpticalBench, axis: AxialRays, error: Perturbation | None = None) -> tuple[float, float, float]:
    """Compute the RMS spot on the axis (mm) of all colours, the same at best focus, and the place of that.

    The film keeps its distance behind the last vertex.
    """
    places, slopes = [], []
    for wavelength in bench.settings.wavelengths_nm:
        surfaces = bench.surfaces(wavelength)
        film = bench.film
        if error is not None:
            film -= float(surfaces.vertex[-1])
            surfaces = perturb_lens(surfaces, error, error.by)
            film += float(surfaces.vertex[-1])
        weights, points, onward = trace_rays(surfaces, *axis)
        landed = intersect_film(points, onward, weights, film)
        through = np.isfinite(landed[:, 0])
        places.append(landed[through])
        slopes.append(onward[through, :2] / onward[through, 2:])
    return best_focus(np.concatenate(places), np.concatenate(slopes))


def best_focus(places: Curve, slopes: Curve) -> tuple[float, float, float]:
    """Compute the RMS of places (n, 2), the least RMS of all places of the film, and the distance to that place.

    The mean square is a quadratic in the film's place.
    """
    if not len(places):
        return math.nan, math.nan, math.nan
    square, product, steepness = (
        float((first * second).sum(axis=1).mean())
        for first, second in ((places, places), (places, slopes), (slopes, slopes))
    )
    if steepness == 0.0:
        return math.sqrt(square), math.sqrt(square), 0.0
    return math.sqrt(square), math.sqrt(max(square - product**2 / steepness, 0.0)), -product / steepness


def sensitivity(bench: OpticalBench, meridian: str, axis: AxialRays, error: Perturbation) -> Sensitivity:
    """Compute the sensitivity to one error."""
    surfaces = bench.surfaces()
    small = _DERIVATIVE_STEP * max(abs(error.value), 1.0)
    here = back_focus(bench, surfaces, meridian)
    moved = back_focus(bench, perturb_lens(surfaces, error, error.by), meridian) - here
    more, less = (back_focus(bench, perturb_lens(surfaces, error, by), meridian) for by in (small, -small))
    rms, least, _ = _axial_spot(bench, axis)
    rms_off, least_off, _ = _axial_spot(bench, axis, error)
    return Sensitivity(
        surface=error.surface + 1,
        parameter=error.parameter,
        unit=error.unit,
        step=error.step,
        back_focus_mm=moved,
        back_focus_per_unit=(more - less) / (2.0 * small),
        spot_um=1e3 * (rms_off - rms),
        spot_refocused_um=1e3 * (least_off - least),
    )


def depth_of_field(bench: OpticalBench, meridian: str, circle_mm: float) -> tuple[float, float]:
    """Find the nearest and farthest planes, from the entrance pupil (mm), that blur to a circle, by first order."""
    surfaces = bench.surfaces()
    marginal = bench.marginal_ray(surfaces, meridian)
    image, exit_ = crossing(surfaces, marginal), crossing(surfaces, bench.chief_ray(surfaces, meridian))
    slope = abs(float(marginal.slopes[-1]))
    limits = []
    for circle in (circle_mm, -circle_mm):
        # The cone from the exit pupil's rim to an image at this place is as wide as the circle on the film.
        if math.isinf(exit_):
            place = image + 0.5 * circle / slope
        else:
            away = image - exit_
            place = image + circle * away / (2.0 * slope * abs(away) - circle)
        limits.append(_object_distance(bench, surfaces, meridian, place))
    return limits[0], limits[1]


def _object_distance(bench: OpticalBench, surfaces: LensSurfaces, meridian: str, image: float) -> float:
    """Find the distance from the entrance pupil (mm) of the point with a paraxial image at z; inf beyond infinity."""
    parallel, tilted = (paraxial_ray(surfaces, *start, meridian) for start in ((1.0, 0.0), (0.0, 1.0)))
    way = image - float(surfaces.vertex[-1])
    # A ray of height h and slope 1 at the front reaches height 0 at the image.
    reach = [float(ray.heights[-1] + way * ray.slopes[-1]) for ray in (parallel, tilted)]
    if reach[0] == 0.0:
        return math.inf
    height = -reach[1] / reach[0]
    distance = bench.pupil - float(surfaces.vertex[0]) + height
    return distance if distance > 0.0 else math.inf


def tolerances(bench: OpticalBench, meridian: str = "y") -> Tolerances:
    """Compute depth of focus and field, best focus, and sensitivities."""
    settings = bench.settings
    circle = settings.circle_of_confusion_mm
    if circle is None:
        halves = [largest_height(bench, row) for row in bench.meridians]
        circle = _CIRCLE * 2.0 * math.hypot(*halves)
    beam = axis_point(bench, meridian).beam
    axis = (np.empty((0, 3)), np.empty((0, 3)))
    if beam is not None:
        axis = beam.rays(*ray_grid(bench, beam, _RAYS))
    rms, least, way = _axial_spot(bench, axis)
    near, far = depth_of_field(bench, meridian, circle)
    sensitivities = tuple(sensitivity(bench, meridian, axis, error) for error in list_perturbations(bench.surfaces()))
    return Tolerances(
        meridian=meridian,
        circle_of_confusion_mm=circle,
        depth_of_focus_mm=circle * working_f_number(bench, meridian),
        best_focus_mm=way,
        rms_on_axis_um=1e3 * rms,
        rms_on_axis_best_um=1e3 * least,
        near_limit_mm=near,
        far_limit_mm=far,
        sensitivities=sensitivities,
        rss_back_focus_mm=math.sqrt(sum(row.back_focus_mm**2 for row in sensitivities)),
    )
