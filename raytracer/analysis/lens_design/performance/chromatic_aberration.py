"""Where colours come to a focus, and how large their images are.

References: Welford 1986, "Aberrations of Optical Systems", ch. 10; Smith 2008, "Modern Optical Engineering", 4th ed.,
sec. 5.3.
"""

import math

import numpy as np

from raytracer.lens_report.analysis.bench import Bench
from raytracer.lens_report.analysis.chief import of_fields
from raytracer.lens_report.analysis.fields import row
from raytracer.lens_report.analysis.paraxial import crossing, marginal_ray
from raytracer.lens_report.analysis.results import Colour

VISIBLE_NM = np.linspace(400.0, 700.0, 61)


def axial_mm(bench: Bench, wavelength_nm: float, meridian: str = "y") -> float:
    """The paraxial image at a wavelength, from that of the primary colour."""
    here, there = (
        crossing(surfaces, marginal_ray(bench, surfaces, meridian))
        for surfaces in (bench.surfaces(), bench.surfaces(wavelength_nm))
    )
    return there - here


def colour(bench: Bench, meridian: str = "y") -> Colour:
    """Axial colour over the visible, and lateral colour over the field."""
    ends = bench.settings.wavelengths_nm
    axial = np.array([axial_mm(bench, float(wavelength), meridian) for wavelength in VISIBLE_NM])
    between = math.nan
    if len(ends) >= 3:
        between = axial_mm(bench, ends[1], meridian) - axial_mm(bench, ends[2], meridian)
    parts, angles, heights = row(bench, meridian)
    primary = of_fields(bench, meridian, bench.primary, angles).height
    lateral = np.array([1e3 * (of_fields(bench, meridian, end, angles).height - primary) for end in ends])
    return Colour(meridian, VISIBLE_NM, axial, between, np.array(ends), parts, angles, heights, lateral)
