"""How far the film may be off, and what small errors in making the lens do.

References: Smith 2008, "Modern Optical Engineering", 4th ed., chs. 9 (depth of focus) and 18 (tolerances).
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from raytracer.lens_report.analysis.beams import bundle
from raytracer.lens_report.analysis.bench import Bench, landing
from raytracer.lens_report.analysis.first_order import working_f_number
from raytracer.lens_report.analysis.illumination import largest_height
from raytracer.lens_report.analysis.paraxial import chief_ray, crossing, marginal_ray, paraxial_ray
from raytracer.lens_report.analysis.results import Curve, Sensitivity, Tolerances
from raytracer.lens_report.analysis.spots import axis_point
from raytracer.lenses.surfaces import LensSurfaces, trace_rays

_RAYS = 24
_CIRCLE = 1.0 / 1500.0

# About what a good workshop keeps: Smith 2008, ch. 18.
RADIUS_STEP_PERCENT = 0.1
THICKNESS_STEP_MM = 0.05
INDEX_STEP = 0.001

# Of the number itself, for its derivative: the cube root of the rounding error is best for central differences.
_DERIVATIVE_STEP = float(np.finfo(np.float64).eps ** (1.0 / 3.0))


class Error(NamedTuple):
    """Something of a lens that can be off: surface from 0; parameter; unit and step as of `Sensitivity`; value."""

    surface: int
    parameter: str
    unit: str
    step: float
    value: float


def errors(surfaces: LensSurfaces) -> Iterator[Error]:
    """All radii, thicknesses and indices of a lens."""
    count = len(surfaces.curvature)
    for surface in range(count):
        if surfaces.curvature[surface] != 0.0:
            radius = 1.0 / float(surfaces.curvature[surface])
            yield Error(surface, "radius", "%", RADIUS_STEP_PERCENT, radius)
        if surface + 1 < count:
            yield Error(surface, "thickness", "mm", THICKNESS_STEP_MM, float(np.diff(surfaces.vertex)[surface]))
            if surfaces.ior[surface + 1] != 1.0:
                yield Error(surface, "index", "", INDEX_STEP, float(surfaces.ior[surface + 1]))


def changed(surfaces: LensSurfaces, error: Error, by: float) -> LensSurfaces:
    """The lens with one of its numbers greater (mm, or of the index)."""
    surface = error.surface
    if error.parameter == "radius":
        factor = error.value / (error.value + by)
        curvature = surfaces.curvature.copy()
        curvature[surface] *= factor
        shapes = surfaces.shapes
        if shapes is not None:
            quadric = shapes.quadric.copy()
            quadric[surface] *= factor
            # Rays are looked for between the ends of its sag, which move less than it does at the rim.
            margin = abs(factor - 1.0) * (shapes.highest - shapes.lowest)
            shapes = shapes._replace(quadric=quadric, lowest=shapes.lowest - margin, highest=shapes.highest + margin)
        return surfaces._replace(curvature=curvature, shapes=shapes)
    if error.parameter == "thickness":
        vertex = surfaces.vertex.copy()
        vertex[surface + 1 :] += by
        return surfaces._replace(vertex=vertex)
    ior = surfaces.ior.copy()
    ior[surface + 1] += by
    return surfaces._replace(ior=ior)


def back_focus(bench: Bench, surfaces: LensSurfaces, meridian: str) -> float:
    """From the last vertex to the paraxial image of what is focused on (mm)."""
    return crossing(surfaces, marginal_ray(bench, surfaces, meridian)) - float(surfaces.vertex[-1])


class _Axis(NamedTuple):
    """Rays from the point on the axis, all colours: origins, directions (n, 3)."""

    origins: Curve
    directions: Curve


def _rms(bench: Bench, axis: _Axis, error: Error | None = None) -> tuple[float, float, float]:
    """RMS distance from the axis (mm) of the light of all colours on the film, the same at the best place, and that.

    The film keeps its distance behind the last vertex.
    """
    places, slopes = [], []
    for wavelength in bench.settings.wavelengths_nm:
        surfaces = bench.surfaces(wavelength)
        film = bench.film
        if error is not None:
            by = error.step * (1e-2 * error.value if error.unit == "%" else 1.0)
            film -= float(surfaces.vertex[-1])
            surfaces = changed(surfaces, error, by)
            film += float(surfaces.vertex[-1])
        weights, points, onward = trace_rays(surfaces, axis.origins, axis.directions)
        landed = landing(points, onward, weights, film)
        through = np.isfinite(landed[:, 0])
        places.append(landed[through])
        slopes.append(onward[through, :2] / onward[through, 2:])
    return best_focus(np.concatenate(places), np.concatenate(slopes))


def best_focus(places: Curve, slopes: Curve) -> tuple[float, float, float]:
    """RMS of places (n, 2), the least that moving the film can make of it, and how far it is moved for that.

    The mean square is a quadratic in the way that the film moves.
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


def sensitivity(bench: Bench, meridian: str, axis: _Axis, error: Error) -> Sensitivity:
    """What one error does."""
    surfaces = bench.surfaces()
    step = error.step * (1e-2 * error.value if error.unit == "%" else 1.0)
    small = _DERIVATIVE_STEP * max(abs(error.value), 1.0)
    here = back_focus(bench, surfaces, meridian)
    moved = back_focus(bench, changed(surfaces, error, step), meridian) - here
    more, less = (back_focus(bench, changed(surfaces, error, by), meridian) for by in (small, -small))
    rms, least, _ = _rms(bench, axis)
    rms_off, least_off, _ = _rms(bench, axis, error)
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


def depth_of_field(bench: Bench, meridian: str, circle_mm: float) -> tuple[float, float]:
    """Nearest and farthest planes, from the entrance pupil (mm), whose points blur to a circle, by first order."""
    surfaces = bench.surfaces()
    marginal = marginal_ray(bench, surfaces, meridian)
    image, exit_ = crossing(surfaces, marginal), crossing(surfaces, chief_ray(bench, surfaces, meridian))
    slope = abs(float(marginal.slopes[-1]))
    found = []
    for circle in (circle_mm, -circle_mm):
        # The image at such a place has a cone from the exit pupil's rim that is as wide as the circle on the film.
        if math.isinf(exit_):
            place = image + 0.5 * circle / slope
        else:
            away = image - exit_
            place = image + circle * away / (2.0 * slope * abs(away) - circle)
        found.append(_object_distance(bench, surfaces, meridian, place))
    return found[0], found[1]


def _object_distance(bench: Bench, surfaces: LensSurfaces, meridian: str, image: float) -> float:
    """From the entrance pupil (mm) to the point whose paraxial image is at a place on the axis; inf beyond infinity."""
    parallel, tilted = (paraxial_ray(surfaces, *start, meridian) for start in ((1.0, 0.0), (0.0, 1.0)))
    way = image - float(surfaces.vertex[-1])
    # A ray of height h and slope 1 at the front reaches height 0 at the image.
    reach = [float(ray.heights[-1] + way * ray.slopes[-1]) for ray in (parallel, tilted)]
    if reach[0] == 0.0:
        return math.inf
    height = -reach[1] / reach[0]
    distance = bench.pupil - float(surfaces.vertex[0]) + height
    return distance if distance > 0.0 else math.inf


def tolerances(bench: Bench, meridian: str = "y") -> Tolerances:
    """Depth of focus and field, best focus, and sensitivities."""
    settings = bench.settings
    circle = settings.circle_of_confusion_mm
    if circle is None:
        halves = [largest_height(bench, row) for row in bench.meridians]
        circle = _CIRCLE * 2.0 * math.hypot(*halves)
    beam = axis_point(bench, meridian).beam
    axis = _Axis(np.empty((0, 3)), np.empty((0, 3)))
    if beam is not None:
        axis = _Axis(*beam.rays(*bundle(bench, beam, _RAYS)))
    rms, least, way = _rms(bench, axis)
    near, far = depth_of_field(bench, meridian, circle)
    found = tuple(sensitivity(bench, meridian, axis, error) for error in errors(bench.surfaces()))
    return Tolerances(
        meridian=meridian,
        circle_of_confusion_mm=circle,
        depth_of_focus_mm=circle * working_f_number(bench, meridian),
        best_focus_mm=way,
        rms_on_axis_um=1e3 * rms,
        rms_on_axis_best_um=1e3 * least,
        near_limit_mm=near,
        far_limit_mm=far,
        sensitivities=found,
        rss_back_focus_mm=math.sqrt(sum(row.back_focus_mm**2 for row in found)),
    )
