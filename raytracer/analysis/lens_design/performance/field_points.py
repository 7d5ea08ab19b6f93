"""Field points at which a lens is studied."""

from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.performance.beams import Beam, beams
from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_heights
from raytracer.analysis.lens_design.performance.illumination import largest_height
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.results import Curve


class FieldPoint(NamedTuple):
    """Field point.

    field : part of the largest image height.
    field_deg : angle from the axis (degrees).
    height : place of the primary colour's chief ray on the film (mm).
    beam : of the point; None if no light gets through.
    """

    field: float
    field_deg: float
    height: float
    beam: Beam | None


def field_points(bench: OpticalBench, meridian: str, parts: Curve) -> tuple[FieldPoint, ...]:
    """Find the field points at parts (k,) of the largest image height."""
    heights = parts * largest_height(bench, meridian)
    rays = chief_rays_at_heights(bench, meridian, bench.primary, heights)
    rows = zip(parts, rays.field_deg, heights, beams(bench, meridian, rays), strict=True)
    return tuple(FieldPoint(float(part), float(angle), float(height), beam) for part, angle, height, beam in rows)


def settings_field_points(bench: OpticalBench, meridian: str) -> tuple[FieldPoint, ...]:
    """Find the field points of the settings."""
    parts = np.array(bench.settings.fields)
    return bench.memoize(("fields", meridian), lambda: field_points(bench, meridian, parts))


def field_samples(bench: OpticalBench, meridian: str) -> tuple[Curve, Curve, Curve]:
    """Sample the field for curves: parts (k,), angles (degrees) and heights on the film (mm), of the primary colour."""
    parts = np.linspace(0.0, 1.0, bench.settings.steps)
    heights = parts * largest_height(bench, meridian)
    return parts, chief_rays_at_heights(bench, meridian, bench.primary, heights).field_deg, heights
