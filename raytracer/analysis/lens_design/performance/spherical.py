"""Spherical aberration over the zones of the pupil, and the offence against the sine condition.

References: Welford 1986, "Aberrations of Optical Systems", ch. 9; Kingslake, Johnson 2010, "Lens Design
Fundamentals", 2nd ed., chs. 6 and 9 (offence against the sine condition).
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.beams import aim_fan, axis_beam, open_stop_fraction
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench, intersect_film
from raytracer.analysis.lens_design.performance.paraxial import chief_ray, crossing, marginal_ray
from raytracer.analysis.lens_design.performance.results import Curve, Spherical
from raytracer.analysis.lens_design.performance.seidel import seidel
from raytracer.optics.lens_system.ray_tracing import trace_rays


def spherical(bench: OpticalBench, meridian: str = "y") -> Spherical:
    """Compute longitudinal and transverse aberration on the axis, by wavelength and zone."""
    wavelengths = np.array(bench.settings.wavelengths_nm)
    pupil = np.linspace(0.0, 1.0, bench.settings.steps)
    shape = (len(wavelengths), len(pupil))
    longitudinal, transverse = np.full(shape, np.nan), np.full(shape, np.nan)
    heights, offence = np.full(len(pupil), np.nan), np.full(len(pupil), np.nan)
    axis = axis_beam(bench, meridian)
    zones = pupil * open_stop_fraction(bench, meridian)
    column = MERIDIANS[meridian]

    marginal = marginal_ray(bench, bench.surfaces(), meridian)
    focus = crossing(bench.surfaces(), marginal)
    if axis is not None:
        ups = aim_fan(bench, axis, zones, up=True)
        origins, directions = axis.rays(ups, np.zeros(len(ups)))
        with np.errstate(divide="ignore", invalid="ignore"):
            heights = origins[:, column] + directions[:, column] / directions[:, 2] * (bench.pupil - origins[:, 2])
        for row, wavelength in enumerate(wavelengths):
            surfaces = bench.surfaces(wavelength)
            weights, points, onward = trace_rays(surfaces, origins, directions)
            with np.errstate(divide="ignore", invalid="ignore"):
                places = points[:, 2] - points[:, column] * onward[:, 2] / onward[:, column]
            # The ray along the axis is the limit of its neighbours.
            places[0] = crossing(surfaces, marginal_ray(bench, surfaces, meridian))
            lost = weights <= 0.0
            longitudinal[row] = np.where(lost, np.nan, places - focus)
            transverse[row] = np.where(
                lost, np.nan, -1e3 * intersect_film(points, onward, weights, bench.film)[:, column]
            )
            if row == 0:
                offence = _sine_condition_error(
                    bench, meridian, heights, directions[:, column], onward[:, column], places, focus
                )
                offence[lost] = np.nan

    third = np.full(len(pupil), np.nan)
    sums = seidel(bench)
    if sums is not None:
        behind = float(bench.surfaces().ior[-1])
        third = -sums.total_spherical / (2.0 * behind * marginal.slopes[-1] ** 2) * zones**2
    return Spherical(meridian, wavelengths, pupil, heights, longitudinal, transverse, third, offence)


def _sine_condition_error(
    bench: OpticalBench, meridian: str, heights: Curve, before: Curve, behind: Curve, places: Curve, focus: float
) -> Curve:
    """Compute the offence against the sine condition, zone by zone, for a near object or one that is infinitely far.

    before, behind : sines of the slopes of the rays on both sides.
    places : at which they cross the axis (mm).
    """
    surfaces = bench.surfaces()
    marginal = marginal_ray(bench, surfaces, meridian)
    exit_ = crossing(surfaces, chief_ray(bench, surfaces, meridian))
    with np.errstate(divide="ignore", invalid="ignore"):
        if math.isinf(bench.distance):
            ratio = heights / behind * marginal.slopes[-1] / marginal.heights[0]
        else:
            ratio = before / behind * marginal.slopes[-1] / marginal.slopes[0]
        shift = (focus - exit_) / (places - exit_) if math.isfinite(exit_) else 1.0
        offence: Curve = ratio * shift - 1.0
    offence[0] = 0.0
    return offence
