"""Geometric MTF, the contrast of fine lines by the spots' rays; and the diffraction limit.

The geometric MTF is the modulus of the Fourier transform of the spot.  Diffraction is not simulated: where the spots
are smaller than the Airy disc the curve of the perfect lens, which is given for reference, is the truth.

References: Smith 2008, "Modern Optical Engineering", 4th ed., ch. 15; Goodman 2005, "Introduction to
Fourier Optics", 3rd ed., sec. 6.3.2.
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.field_points import field_points, settings_field_points
from raytracer.analysis.lens_design.performance.first_order import working_f_number
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.results import Curve, DiffractionLimit, Mtf, MtfOverField
from raytracer.analysis.lens_design.performance.spots import pool_colors, trace_field_point

FREQUENCIES_PER_MM = np.linspace(0.0, 100.0, 51)
_RAYS_OVER_FIELD = 32


def geometric_mtf(places_mm: Curve, weights: Curve, frequencies_per_mm: Curve) -> Curve:
    """Compute the MTF (k,), the modulus of the mean of exp(2 pi i frequency x place), of places (n,) in one direction.

    NaN without light.
    """
    total = float(weights.sum())
    if total <= 0.0:
        return np.full(len(frequencies_per_mm), np.nan)
    phases = 2.0 * math.pi * np.outer(frequencies_per_mm, places_mm)
    contrast: Curve = np.hypot(np.cos(phases) @ weights, np.sin(phases) @ weights) / total
    return contrast


def mtf(bench: OpticalBench, meridian: str = "y") -> tuple[Mtf, ...]:
    """Compute the MTF over frequency, for each field of the settings."""
    curves = []
    for point in settings_field_points(bench, meridian):
        places, weights = pool_colors(trace_field_point(bench, point, bench.settings.rays))
        tangential, sagittal = (geometric_mtf(places[:, way], weights, FREQUENCIES_PER_MM) for way in (0, 1))
        row = (meridian, point.field, point.field_deg, point.height)
        curves.append(Mtf(*row, FREQUENCIES_PER_MM, tangential, sagittal))
    return tuple(curves)


def mtf_over_field(bench: OpticalBench, meridian: str = "y") -> MtfOverField:
    """Compute the MTF over the field, at the frequencies of the settings."""
    frequencies = np.array(bench.settings.frequencies_per_mm)
    row = field_points(bench, meridian, np.linspace(0.0, 1.0, bench.settings.steps))
    columns: tuple[list[Curve], list[Curve]] = ([], [])
    for point in row:
        places, weights = pool_colors(trace_field_point(bench, point, _RAYS_OVER_FIELD))
        for way, column in enumerate(columns):
            column.append(geometric_mtf(places[:, way], weights, frequencies))
    parts, heights = np.array([point.field for point in row]), np.array([point.height for point in row])
    return MtfOverField(meridian, parts, heights, frequencies, *(np.stack(column, axis=1) for column in columns))


def diffraction_limit(bench: OpticalBench) -> DiffractionLimit:
    """Compute the MTF of a perfect lens with a round pupil, on the axis, of the same working f-number."""
    f_number = working_f_number(bench)
    cutoff = 1e6 / (bench.primary * f_number)
    return DiffractionLimit(
        bench.primary, f_number, cutoff, FREQUENCIES_PER_MM, perfect_mtf(FREQUENCIES_PER_MM / cutoff)
    )


def perfect_mtf(part_of_cutoff: Curve) -> Curve:
    """Compute the MTF of a lens that only diffraction limits, at parts of the cut-off frequency."""
    part = np.clip(part_of_cutoff, 0.0, 1.0)
    contrast: Curve = 2.0 / math.pi * (np.arccos(part) - part * np.sqrt(1.0 - part**2))
    return contrast
