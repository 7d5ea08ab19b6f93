"""Spot diagrams: where the light of field points lands.

References: Smith 2008, "Modern Optical Engineering", 4th ed., ch. 15.
"""

import math

import numpy as np

from raytracer.lens_report.analysis.beams import bundle, landed
from raytracer.lens_report.analysis.bench import Bench
from raytracer.lens_report.analysis.fields import FieldPoint, fields, points
from raytracer.lens_report.analysis.results import Curve, Spot, SpotsOfField

Light = tuple[Curve, Curve]
"""Where rays land (n, 2), along the field and across it, from where the primary's chief ray does (mm); weights (n,)."""


def light_of(bench: Bench, point: FieldPoint, rays: int) -> list[Light]:
    """What lands of a field point in each colour of the settings."""
    beam, wavelengths = point.beam, bench.settings.wavelengths_nm
    if beam is None:
        return [(np.empty((0, 2)), np.empty(0)) for _ in wavelengths]

    def make() -> list[Light]:
        ups, acrosses = bundle(bench, beam, rays)
        cell = _cell(ups) * _cell(acrosses)
        if beam.source is not None:
            cell /= float(np.sum((beam.centre - beam.source) ** 2))
        found = []
        for wavelength in wavelengths:
            places, weights = landed(bench, beam, ups, acrosses, wavelength)
            open_ = weights > 0.0
            found.append((places[open_] - (point.height, 0.0), weights[open_] * cell))
        return found

    return bench.kept(("light", beam.meridian, point.height, rays), make)


def _cell(ways: Curve) -> float:
    """The distance between the lines of a grid."""
    lines = np.unique(ways)
    return float((lines[-1] - lines[0]) / (len(lines) - 1)) if len(lines) > 1 else 0.0


def size(places: Curve, weights: Curve) -> tuple[Curve, float, float]:
    """Centroid (2,), root of the mean square of the distances from it, and the greatest of them; NaN for no light."""
    total = float(weights.sum())
    if total <= 0.0:
        return np.full(2, np.nan), math.nan, math.nan
    centre: Curve = (weights[:, None] * places).sum(axis=0) / total
    squares = ((places - centre) ** 2).sum(axis=1)
    return centre, math.sqrt(float((weights * squares).sum()) / total), math.sqrt(float(squares.max()))


def pooled(light: list[Light]) -> Light:
    """All colours together, each with the same light on the whole, if any of it gets through."""
    places = np.concatenate([part for part, _ in light])
    weights = np.concatenate([part / part.sum() if len(part) else part for _, part in light])
    return places, weights


def spots(bench: Bench, meridian: str = "y") -> tuple[SpotsOfField, ...]:
    """For each field of the settings, the spots of all colours."""
    settings = bench.settings
    axis = light_of(bench, axis_point(bench, meridian), settings.rays)
    full = [float(weights.sum()) for _, weights in axis]
    found = []
    for point in fields(bench, meridian):
        light = light_of(bench, point, settings.rays)
        several = []
        for wavelength, (places, weights), most in zip(settings.wavelengths_nm, light, full, strict=True):
            centre, rms, largest = size(places, weights)
            several.append(
                Spot(
                    meridian,
                    point.field,
                    point.field_deg,
                    wavelength,
                    # x across the field, y along it.
                    1e3 * places[:, ::-1],
                    (1e3 * float(centre[1]), 1e3 * float(centre[0])),
                    1e3 * rms,
                    1e3 * largest,
                    float(weights.sum()) / most if most > 0.0 else math.nan,
                )
            )
        _, rms, largest = size(*pooled(light))
        angle, height = point.field_deg, point.height
        found.append(SpotsOfField(meridian, point.field, angle, height, tuple(several), 1e3 * rms, 1e3 * largest))
    return tuple(found)


def axis_point(bench: Bench, meridian: str) -> FieldPoint:
    """The point on the axis."""
    return points(bench, meridian, np.zeros(1))[0]
