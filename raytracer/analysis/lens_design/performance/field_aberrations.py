"""Aberrations over the field: field curvature and astigmatism, distortion, and chromatic aberration.

Foci of narrow pencils along chief rays are by Coddington's equations, for the reciprocal distances t and s to the foci
in the plane of the ray and the axis and across it: n' cos^2 i' t' = n cos^2 i t + p T and n' s' = n s + p S, with
p = n' cos i' - n cos i and the surface's curvatures T and S there.

References: Coddington 1829, "A Treatise on the Reflexion and Refraction of Light"; Kingslake, Johnson 2010, "Lens
Design Fundamentals", 2nd ed., sec. 11.1; Welford 1986, "Aberrations of Optical Systems", chs. 7 (distortion) and 10
(colour); Kannala, Brandt 2006, "A Generic Camera Model and Calibration Method", PAMI 28(8), eqs. 1 to 5 (projections);
Smith 2008, "Modern Optical Engineering", 4th ed., sec. 5.3 (colour).
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from raytracer.analysis.lens_design.performance.beams import field_samples
from raytracer.analysis.lens_design.performance.chief_rays import chief_paths, chief_rays_at_fields, object_points
from raytracer.analysis.lens_design.performance.first_order import petzval_curvature
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench, crossing
from raytracer.analysis.lens_design.performance.results import (
    ChromaticAberration,
    Curve,
    DistortionCurve,
    FieldCurvature,
)
from raytracer.optics.lens_system.surfaces import LensSurfaces


def surface_profile(surfaces: LensSurfaces, surface: int, meridian: str, height: Curve) -> tuple[Curve, Curve, Curve]:
    """Compute a surface's slope at heights (k,) in a meridian, and its curvatures (1/mm) along and across it."""
    column = MERIDIANS[meridian]
    square = height**2
    if surfaces.shapes is None:
        c = across = closing = surfaces.curvature[surface]
        coefficients = np.empty(0)
    else:
        quadric = surfaces.shapes.quadric[surface]
        c, across, closing = quadric[column], quadric[1 - column], quadric[2]
        coefficients = surfaces.shapes.coefficients[surface]
    # Of c r^2 + w z^2 = 2 z, where 1 - w z is the root.
    root = np.sqrt(1.0 - closing * c * square)
    first, second, sideways = c / root, c / root**3, across / root
    for order, coefficient in enumerate(coefficients, start=2):
        term = 2 * order * coefficient * square ** (order - 1)
        first, sideways, second = first + term, sideways + term, second + (2 * order - 1) * term
    slope = first * height
    length = np.sqrt(1.0 + slope**2)
    return slope, second / length**3, sideways / length


def coddington(
    surfaces: LensSurfaces, meridian: str, points: Curve, directions: Curve, toward: Curve, start: Curve
) -> tuple[Curve, Curve]:
    """Trace pencils along chief rays by Coddington's equations.

    Returns
    -------
    Reciprocal distances (k,) along the rays, from the last surface to the tangential and sagittal foci (1/mm).

    Parameters
    ----------
    points, directions (k, n, 3) : of the chief rays, at and behind the surfaces.
    toward (k, 3) : directions before the first surface.
    start (k,) : reciprocal distance from the first surface to the object, 0 if it is infinitely far, else negative.
    """
    column = MERIDIANS[meridian]
    tangential, sagittal = start.copy(), start.copy()
    before = toward
    for surface in range(points.shape[1]):
        near, far = surfaces.ior[surface], surfaces.ior[surface + 1]
        slope, along, across = surface_profile(surfaces, surface, meridian, points[:, surface, column])
        behind = directions[:, surface]
        length = np.sqrt(1.0 + slope**2)
        cos_in, cos_out = ((way[:, 2] - slope * way[:, column]) / length for way in (before, behind))
        power = far * cos_out - near * cos_in
        tangential = (near * cos_in**2 * tangential + power * along) / (far * cos_out**2)
        sagittal = (near * sagittal + power * across) / far
        if surface + 1 < points.shape[1]:
            way = ((points[:, surface + 1] - points[:, surface]) * behind).sum(axis=1)
            tangential, sagittal = tangential / (1.0 - way * tangential), sagittal / (1.0 - way * sagittal)
        before = behind
    return tangential, sagittal


def field_curvature(bench: OpticalBench, meridian: str = "y") -> FieldCurvature:
    """Compute tangential and sagittal foci over the field, by wavelength."""
    parts, angles, heights = field_samples(bench, meridian)
    wavelengths = np.array(bench.settings.wavelengths_nm)
    foci = np.full((2, len(wavelengths), len(parts)), np.nan)
    for number, wavelength in enumerate(wavelengths):
        surfaces = bench.surfaces(wavelength)
        rays = chief_rays_at_fields(bench, meridian, wavelength, angles)
        points, directions = chief_paths(bench, rays, wavelength)
        start = np.zeros(len(parts))
        if not math.isinf(bench.distance):
            start = -1.0 / np.linalg.norm(object_points(bench, rays.origin, -rays.toward) - points[:, 0], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            reciprocals = coddington(surfaces, meridian, points, directions, rays.toward, start)
            for kind, reciprocal in enumerate(reciprocals):
                foci[kind, number] = points[:, -1, 2] + directions[:, -1, 2] / reciprocal - bench.film
    surfaces = bench.surfaces()
    paraxial = crossing(surfaces, bench.marginal_ray(surfaces, meridian)) - bench.film
    petzval = paraxial + 0.5 * petzval_curvature(surfaces, meridian) * heights**2
    foci[~np.isfinite(foci)] = np.nan
    return FieldCurvature(meridian, wavelengths, parts, angles, heights, foci[0], foci[1], petzval)


# ---- Distortion: image heights of chief rays against ideal projections

PROJECTIONS: Mapping[str, Callable[[Curve], Curve]] = {
    "f tan": np.tan,
    "2f tan(theta/2)": lambda angle: 2.0 * np.tan(0.5 * angle),
    "f theta": lambda angle: angle,
    "2f sin(theta/2)": lambda angle: 2.0 * np.sin(0.5 * angle),
    "f sin theta": np.sin,
}
"""Image height over focal length as a function of the angle from the axis (radians), by name."""


def distortion(bench: OpticalBench, meridian: str = "y") -> DistortionCurve:
    """Compute distortion over the field, at the primary wavelength."""
    parts, degrees, heights = field_samples(bench, meridian)
    angles = np.radians(degrees)
    scale = _scale(bench, meridian)
    percent = {name: _percent(heights, scale * ideal(angles)) for name, ideal in PROJECTIONS.items()}
    beyond = angles >= math.pi / 2.0
    for name in ("f tan", "f sin theta"):
        percent[name][beyond] = np.nan
    known = np.isfinite(angles)
    # A projection of which a value is missing is never the best.
    worst = {name: np.abs(values[known]).max(initial=0.0) for name, values in percent.items()}
    best = min(worst, key=lambda name: np.nan_to_num(worst[name], nan=math.inf, posinf=math.inf))
    return DistortionCurve(meridian, parts, degrees, heights, percent["f tan"], percent["f theta"], best, percent[best])


def _scale(bench: OpticalBench, meridian: str) -> float:
    """Return image height over angle near the axis (mm), on the film: the focal length, if that is at the focus."""
    surfaces = bench.surfaces()
    ray = bench.chief_ray(surfaces, meridian)
    scale = -float(ray.heights[-1] + ray.slopes[-1] * (bench.film - surfaces.vertex[-1]))
    if math.isinf(bench.distance):
        return scale
    # Angles are measured from one pupil; lenses with cylinders have another in the other meridian.
    behind = float(surfaces.vertex[0] + ray.heights[0]) - bench.pupil
    return scale * bench.distance / (bench.distance + behind)


def _percent(heights: Curve, ideal: Curve) -> Curve:
    """Compare heights with ideal ones (%); 0 on the axis."""
    with np.errstate(divide="ignore", invalid="ignore"):
        percent: Curve = 100.0 * (heights / ideal - 1.0)
    percent[heights == 0.0] = 0.0
    return percent


# ---- Chromatic aberration: axial (foci by wavelength) and lateral (image heights by wavelength)

VISIBLE_NM = np.linspace(400.0, 700.0, 61)


def axial_shift_mm(bench: OpticalBench, wavelength_nm: float, meridian: str = "y") -> float:
    """Return the distance (mm) of the paraxial image at a wavelength from that of the primary colour."""
    here, there = (
        crossing(surfaces, bench.marginal_ray(surfaces, meridian))
        for surfaces in (bench.surfaces(), bench.surfaces(wavelength_nm))
    )
    return there - here


def chromatic_aberration(bench: OpticalBench, meridian: str = "y") -> ChromaticAberration:
    """Compute axial colour over the visible spectrum, and lateral colour over the field."""
    ends = bench.settings.wavelengths_nm
    axial = np.array([axial_shift_mm(bench, float(wavelength), meridian) for wavelength in VISIBLE_NM])
    between = math.nan
    if len(ends) >= 3:
        between = axial_shift_mm(bench, ends[1], meridian) - axial_shift_mm(bench, ends[2], meridian)
    parts, angles, heights = field_samples(bench, meridian)
    primary = chief_rays_at_fields(bench, meridian, bench.primary, angles).height
    lateral = np.array([1e3 * (chief_rays_at_fields(bench, meridian, end, angles).height - primary) for end in ends])
    return ChromaticAberration(meridian, VISIBLE_NM, axial, between, np.array(ends), parts, angles, heights, lateral)
