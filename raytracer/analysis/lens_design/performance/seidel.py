"""Seidel sums: third-order aberrations, surface by surface.

With A = n (h c + u) of the marginal ray and B = n (k c + v) of the chief ray, heights h and k, and H = A k - B h:
S1 = -A^2 h D(u/n), S2 = -A B h D(u/n), S3 = -B^2 h D(u/n), S4 = -H^2 c D(1/n), S5 = B (S3 + S4) / A, C1 = A h D(dn/n)
and C2 = B h D(dn/n), where D is the value behind the surface minus that before it.  S5 is written such that nothing is
divided by A.  A departure of a_4 r^4 from the sphere adds 8 a_4 D(n) h^4 to S1, and times k/h, its square and its cube
to S2, S3 and S5.

References: Welford 1986, "Aberrations of Optical Systems", chs. 8 and 10; Kidger 2001, "Fundamental
Optical Design", ch. 6.
"""

import numpy as np

from raytracer.analysis.lens_design.performance.illumination import largest_height
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, crossing
from raytracer.analysis.lens_design.performance.results import Curve, Seidel
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
