"""Spot diagrams, the light of field points on the film; and the MTF, the contrast of fine lines, by their rays.

The geometric MTF is the modulus of the Fourier transform of the spot.  Diffraction is not simulated: where the spots
are smaller than the Airy disc the curve of the perfect lens, which is given for reference, is the truth.

References: Smith 2008, "Modern Optical Engineering", 4th ed., ch. 15; Goodman 2005, "Introduction to Fourier Optics",
3rd ed., sec. 6.3.2.
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.beams import (
    FieldPoint,
    field_points,
    film_points,
    ray_grid,
    settings_field_points,
)
from raytracer.analysis.lens_design.performance.first_order import working_f_number
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.results import (
    Curve,
    DiffractionLimit,
    Mtf,
    MtfOverField,
    Spot,
    SpotsOfField,
)

Light = tuple[Curve, Curve]
"""Places of rays (n, 2), along the field and across it, from that of the primary's chief ray (mm); weights (n,)."""


def trace_field_point(bench: OpticalBench, point: FieldPoint, rays: int) -> list[Light]:
    """Trace the light of a field point to the film, in each colour of the settings."""
    beam, wavelengths = point.beam, bench.settings.wavelengths_nm
    if beam is None:
        return [(np.empty((0, 2)), np.empty(0)) for _ in wavelengths]

    def make() -> list[Light]:
        ups, acrosses = ray_grid(bench, beam, rays)
        cell = _cell(ups) * _cell(acrosses)
        if beam.source is not None:
            cell /= float(np.sum((beam.centre - beam.source) ** 2))
        light = []
        for wavelength in wavelengths:
            places, weights = film_points(bench, beam, ups, acrosses, wavelength)
            open_ = weights > 0.0
            light.append((places[open_] - (point.height, 0.0), weights[open_] * cell))
        return light

    return bench.memoize(("light", beam.meridian, point.height, rays), make)


def _cell(ways: Curve) -> float:
    """Return the distance between the lines of a grid."""
    lines = np.unique(ways)
    return float((lines[-1] - lines[0]) / (len(lines) - 1)) if len(lines) > 1 else 0.0


def spot_size(places: Curve, weights: Curve) -> tuple[Curve, float, float]:
    """Compute the centroid (2,), and the RMS and the greatest distance from it; NaN without light."""
    total = float(weights.sum())
    if total <= 0.0:
        return np.full(2, np.nan), math.nan, math.nan
    centre: Curve = (weights[:, None] * places).sum(axis=0) / total
    squares = ((places - centre) ** 2).sum(axis=1)
    return centre, math.sqrt(float((weights * squares).sum()) / total), math.sqrt(float(squares.max()))


def pool_colors(light: list[Light]) -> Light:
    """Pool all colours, each with the same total light, if any of it gets through."""
    places = np.concatenate([part for part, _ in light])
    weights = np.concatenate([part / part.sum() if len(part) else part for _, part in light])
    return places, weights


def spots(bench: OpticalBench, meridian: str = "y") -> tuple[SpotsOfField, ...]:
    """Compute the spots of all colours, for each field of the settings."""
    settings = bench.settings
    axis = trace_field_point(bench, axis_point(bench, meridian), settings.rays)
    full = [float(weights.sum()) for _, weights in axis]
    spots_of_fields = []
    for point in settings_field_points(bench, meridian):
        light = trace_field_point(bench, point, settings.rays)
        several = []
        for wavelength, (places, weights), most in zip(settings.wavelengths_nm, light, full, strict=True):
            centre, rms, largest = spot_size(places, weights)
            # x across the field, y along it.
            points, centroid = 1e3 * places[:, ::-1], (1e3 * float(centre[1]), 1e3 * float(centre[0]))
            part = float(weights.sum()) / most if most > 0.0 else math.nan
            row = (meridian, point.field, point.field_deg, wavelength)
            several.append(Spot(*row, points, centroid, 1e3 * rms, 1e3 * largest, part))
        _, rms, largest = spot_size(*pool_colors(light))
        place = (meridian, point.field, point.field_deg, point.height)
        spots_of_fields.append(SpotsOfField(*place, tuple(several), 1e3 * rms, 1e3 * largest))
    return tuple(spots_of_fields)


def axis_point(bench: OpticalBench, meridian: str) -> FieldPoint:
    """Return the field point on the axis."""
    return field_points(bench, meridian, np.zeros(1))[0]


# ---- MTF

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
