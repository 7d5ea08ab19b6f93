"""Aberrations of rays over the pupil: spherical aberration, the offence against the sine condition, and ray fans.

References: Welford 1986, "Aberrations of Optical Systems", ch. 9; Kingslake, Johnson 2010, "Lens Design
Fundamentals", 2nd ed., chs. 6 and 9 (offence against the sine condition); Smith 2008, "Modern Optical Engineering",
4th ed., sec. 5.8 (ray intercept curves).
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.beams import (
    aim_fan,
    axis_beam,
    film_points,
    open_stop_fraction,
    settings_field_points,
)
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench, crossing, intersect_film
from raytracer.analysis.lens_design.performance.results import Curve, Fan, Spherical
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

    marginal = bench.marginal_ray(bench.surfaces(), meridian)
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
            places[0] = crossing(surfaces, bench.marginal_ray(surfaces, meridian))
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
    marginal = bench.marginal_ray(surfaces, meridian)
    exit_ = crossing(surfaces, bench.chief_ray(surfaces, meridian))
    with np.errstate(divide="ignore", invalid="ignore"):
        if math.isinf(bench.distance):
            ratio = heights / behind * marginal.slopes[-1] / marginal.heights[0]
        else:
            ratio = before / behind * marginal.slopes[-1] / marginal.slopes[0]
        shift = (focus - exit_) / (places - exit_) if math.isfinite(exit_) else 1.0
        offence: Curve = ratio * shift - 1.0
    offence[0] = 0.0
    return offence


def fans(bench: OpticalBench, meridian: str = "y") -> tuple[Fan, ...]:
    """Trace a fan along the field and one across it, for each field of the settings and in each colour."""
    wavelengths = np.array(bench.settings.wavelengths_nm)
    pupil = np.linspace(-1.0, 1.0, bench.settings.steps)
    zones = pupil * open_stop_fraction(bench, meridian)
    traced = []
    for point in settings_field_points(bench, meridian):
        tangential, sagittal = (np.full((len(wavelengths), len(pupil)), np.nan) for _ in range(2))
        if point.beam is not None:
            still = np.zeros(len(pupil))
            ups, acrosses = (aim_fan(bench, point.beam, zones, up=up) for up in (True, False))
            for row, wavelength in enumerate(wavelengths):
                along, _ = film_points(bench, point.beam, ups, still, wavelength)
                across, _ = film_points(bench, point.beam, still, acrosses, wavelength)
                tangential[row], sagittal[row] = 1e3 * (along[:, 0] - point.height), 1e3 * across[:, 1]
        traced.append(Fan(meridian, point.field, point.field_deg, wavelengths, pupil, tangential, sagittal))
    return tuple(traced)
