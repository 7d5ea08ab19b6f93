"""The field points at which a lens is looked at."""

from typing import NamedTuple

import numpy as np

from raytracer.lens_report.analysis.beams import Beam, beams
from raytracer.lens_report.analysis.bench import Bench
from raytracer.lens_report.analysis.chief import of_heights
from raytracer.lens_report.analysis.illumination import largest_height
from raytracer.lens_report.analysis.results import Curve


class FieldPoint(NamedTuple):
    """field : part of the largest image height; field_deg; height, where the primary's chief ray lands (mm); beam."""

    field: float
    field_deg: float
    height: float
    beam: Beam | None


def points(bench: Bench, meridian: str, parts: Curve) -> tuple[FieldPoint, ...]:
    """Field points at parts (k,) of the largest image height."""
    heights = parts * largest_height(bench, meridian)
    rays = of_heights(bench, meridian, bench.primary, heights)
    rows = zip(parts, rays.field_deg, heights, beams(bench, meridian, rays), strict=True)
    return tuple(FieldPoint(float(part), float(angle), float(height), beam) for part, angle, height, beam in rows)


def fields(bench: Bench, meridian: str) -> tuple[FieldPoint, ...]:
    """Those of the settings."""
    parts = np.array(bench.settings.fields)
    return bench.kept(("fields", meridian), lambda: points(bench, meridian, parts))


def row(bench: Bench, meridian: str) -> tuple[Curve, Curve, Curve]:
    """For curves over the field: its parts (k,), angles (degrees) and heights on the film (mm), of the primary."""
    parts = np.linspace(0.0, 1.0, bench.settings.steps)
    heights = parts * largest_height(bench, meridian)
    return parts, of_heights(bench, meridian, bench.primary, heights).field_deg, heights
