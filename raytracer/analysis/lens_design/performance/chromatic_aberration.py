"""Chromatic aberration: axial (foci by wavelength) and lateral (image heights by wavelength).

References: Welford 1986, "Aberrations of Optical Systems", ch. 10; Smith 2008, "Modern Optical Engineering", 4th ed.,
sec. 5.3.
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_fields
from raytracer.analysis.lens_design.performance.field_points import field_samples
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.paraxial import crossing, marginal_ray
from raytracer.analysis.lens_design.performance.results import ChromaticAberration

VISIBLE_NM = np.linspace(400.0, 700.0, 61)


def axial_shift_mm(bench: OpticalBench, wavelength_nm: float, meridian: str = "y") -> float:
    """Return the distance (mm) of the paraxial image at a wavelength from that of the primary colour."""
    here, there = (
        crossing(surfaces, marginal_ray(bench, surfaces, meridian))
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
