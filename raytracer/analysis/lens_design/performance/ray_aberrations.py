"""Aberrations over the pupil: Seidel sums, spherical aberration, the offence against the sine condition, and ray fans.

With A = n (h c + u) of the marginal ray and B = n (k c + v) of the chief ray, heights h and k, and H = A k - B h, the
Seidel sums are S1 = -A^2 h D(u/n), S2 = -A B h D(u/n), S3 = -B^2 h D(u/n), S4 = -H^2 c D(1/n), S5 = B (S3 + S4) / A,
C1 = A h D(dn/n) and C2 = B h D(dn/n), where D is the value behind the surface minus that before it.  S5 is written such
that nothing is divided by A.  A departure of a_4 r^4 from the sphere adds 8 a_4 D(n) h^4 to S1, and times k/h, its
square and its cube to S2, S3 and S5.

References: Welford 1986, "Aberrations of Optical Systems", chs. 8 to 10; Kidger 2001, "Fundamental Optical Design",
ch. 6; Kingslake, Johnson 2010, "Lens Design Fundamentals", 2nd ed., chs. 6 and 9 (offence against the sine condition);
Smith 2008, "Modern Optical Engineering", 4th ed., sec. 5.8 (ray intercept curves).
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
from raytracer.analysis.lens_design.performance.illumination import largest_height
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench, crossing, intersect_film
from raytracer.analysis.lens_design.performance.results import Curve, Fan, Seidel, Spherical
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces


def seidel(bench: OpticalBench) -> Seidel | None:
    """Compute the Seidel sums of the primary colour, and of colour between the second and the third wavelength.

    None for lenses with cylinders.
    """
    if not bench.lens.is_round():
        return None
    surfaces = bench.surfaces()
    marginal, chief = bench.marginal_ray(surfaces), bench.chief_ray(surfaces)
    focus = crossing(surfaces, marginal)
    largest = largest_height(bench, "y")
    lands = chief.heights[-1] + chief.slopes[-1] * (focus - surfaces.vertex[-1])
    chief = chief.times(-largest / lands)
    # Differences of the indices between the ends of the spectrum.
    colours = bench.settings.wavelengths_nm[1:3]
    if len(colours) == 2:
        spread = bench.surfaces(colours[0]).ior - bench.surfaces(colours[1]).ior
    else:
        spread = np.full_like(surfaces.ior, np.nan)

    c, n = surfaces.curvature, surfaces.ior
    h, u, k, v = marginal.heights, marginal.slopes, chief.heights, chief.slopes
    a, b = n[:-1] * (h * c + u[:-1]), n[:-1] * (k * c + v[:-1])
    invariant = float(a[0] * k[0] - b[0] * h[0])
    steps, squares = np.diff(1.0 / n), np.diff(1.0 / n**2)
    bent = np.diff(u / n)
    glass = np.diff(spread / n)

    departure = _departure(surfaces) * 8.0 * np.diff(n)
    asphere = departure * h**4
    spherical = -(a**2) * h * bent + asphere
    coma = -a * b * h * bent + departure * h**3 * k
    astigmatism = -(b**2) * h * bent + departure * h**2 * k**2
    petzval = -(invariant**2) * c * steps
    distortion = -(b**3) * h * squares + b * c * steps * k * (2.0 * b * h - a * k) + departure * h * k**3
    axial, lateral = a * h * glass, b * h * glass
    rows = (spherical, coma, astigmatism, petzval, distortion, axial, lateral)
    return Seidel(bench.primary, largest, invariant, *rows, asphere, *(float(row.sum()) for row in rows))


def _departure(surfaces: LensSurfaces) -> Curve:
    """Compute the fourth-order departure of each surface from its osculating sphere: the factor of r^4 (1/mm^3)."""
    if surfaces.shapes is None:
        return np.zeros_like(surfaces.curvature)
    c, across = surfaces.curvature, surfaces.shapes.quadric[:, 2]
    departure: Curve = c**2 * (across - c) / 8.0
    coefficients = surfaces.shapes.coefficients
    return departure + coefficients[:, 0] if coefficients.shape[1] else departure


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
