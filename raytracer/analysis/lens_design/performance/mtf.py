"""Contrast of fine lines in the image, by the geometry of the spots; and what diffraction would leave.

The geometric MTF is the modulus of the Fourier transform of the spot.  Diffraction is not simulated: where the spots
are smaller than the Airy disc the curve of the perfect lens, which is given for reference, is the truth.

References: Smith 2008, "Modern Optical Engineering", 4th ed., ch. 15; Goodman 2005, "Introduction to
Fourier Optics", 3rd ed., sec. 6.3.2.
"""

import math

import numpy as np

from raytracer.lens_report.analysis.bench import Bench
from raytracer.lens_report.analysis.fields import fields, points
from raytracer.lens_report.analysis.first_order import working_f_number
from raytracer.lens_report.analysis.results import Curve, DiffractionLimit, Mtf, MtfOverField
from raytracer.lens_report.analysis.spots import light_of, pooled

FREQUENCIES_PER_MM = np.linspace(0.0, 100.0, 51)
_RAYS_OVER_FIELD = 32


def geometric_mtf(places_mm: Curve, weights: Curve, frequencies_per_mm: Curve) -> Curve:
    """Modulus of the mean of exp(2 pi i frequency x place), (k,), of places (n,) in one direction; NaN for no light."""
    total = float(weights.sum())
    if total <= 0.0:
        return np.full(len(frequencies_per_mm), np.nan)
    phases = 2.0 * math.pi * np.outer(frequencies_per_mm, places_mm)
    found: Curve = np.hypot(np.cos(phases) @ weights, np.sin(phases) @ weights) / total
    return found


def mtf(bench: Bench, meridian: str = "y") -> tuple[Mtf, ...]:
    """Over frequency, for each field of the settings."""
    found = []
    for point in fields(bench, meridian):
        places, weights = pooled(light_of(bench, point, bench.settings.rays))
        tangential, sagittal = (geometric_mtf(places[:, way], weights, FREQUENCIES_PER_MM) for way in (0, 1))
        row = (meridian, point.field, point.field_deg, point.height)
        found.append(Mtf(*row, FREQUENCIES_PER_MM, tangential, sagittal))
    return tuple(found)


def mtf_over_field(bench: Bench, meridian: str = "y") -> MtfOverField:
    """Over the field, at the frequencies of the settings."""
    frequencies = np.array(bench.settings.frequencies_per_mm)
    row = points(bench, meridian, np.linspace(0.0, 1.0, bench.settings.steps))
    columns: tuple[list[Curve], list[Curve]] = ([], [])
    for point in row:
        places, weights = pooled(light_of(bench, point, _RAYS_OVER_FIELD))
        for way, column in enumerate(columns):
            column.append(geometric_mtf(places[:, way], weights, frequencies))
    parts, heights = np.array([point.field for point in row]), np.array([point.height for point in row])
    return MtfOverField(meridian, parts, heights, frequencies, *(np.stack(column, axis=1) for column in columns))


def diffraction_limit(bench: Bench) -> DiffractionLimit:
    """Of a perfect lens with a round pupil, on the axis, with this one's working f-number at the primary wavelength."""
    f_number = working_f_number(bench)
    cutoff = 1e6 / (bench.primary * f_number)
    return DiffractionLimit(
        bench.primary, f_number, cutoff, FREQUENCIES_PER_MM, perfect_mtf(FREQUENCIES_PER_MM / cutoff)
    )


def perfect_mtf(part_of_cutoff: Curve) -> Curve:
    """Of a lens that only diffraction limits, at parts of the frequency at which nothing is left."""
    part = np.clip(part_of_cutoff, 0.0, 1.0)
    found: Curve = 2.0 / math.pi * (np.arccos(part) - part * np.sqrt(1.0 - part**2))
    return found
