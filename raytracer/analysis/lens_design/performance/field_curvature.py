"""Field curvature and astigmatism: the foci of narrow pencils along chief rays.

Coddington's equations along a chief ray, for the reciprocal distances t and s to the foci in the plane of the ray and
the axis and across it: n' cos^2 i' t' = n cos^2 i t + p T and n' s' = n s + p S, with p = n' cos i' - n cos i and the
surface's curvatures T and S there.

References: Coddington 1829, "A Treatise on the Reflexion and Refraction of Light"; Kingslake, Johnson 2010, "Lens
Design Fundamentals", 2nd ed., sec. 11.1.
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.chief_rays import chief_paths, chief_rays_at_fields, object_points
from raytracer.analysis.lens_design.performance.field_points import field_samples
from raytracer.analysis.lens_design.performance.first_order import petzval_curvature
from raytracer.analysis.lens_design.performance.optical_bench import MERIDIANS, OpticalBench
from raytracer.analysis.lens_design.performance.paraxial import crossing, marginal_ray
from raytracer.analysis.lens_design.performance.results import Curve, FieldCurvature
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
    paraxial = crossing(surfaces, marginal_ray(bench, surfaces, meridian)) - bench.film
    petzval = paraxial + 0.5 * petzval_curvature(surfaces, meridian) * heights**2
    foci[~np.isfinite(foci)] = np.nan
    return FieldCurvature(meridian, wavelengths, parts, angles, heights, foci[0], foci[1], petzval)
