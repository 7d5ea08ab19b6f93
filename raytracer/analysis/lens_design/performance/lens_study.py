"""Study of a lens: all analyses in one."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from raytracer.analysis.lens_design.performance.chromatic_aberration import chromatic_aberration
from raytracer.analysis.lens_design.performance.distortion import distortion
from raytracer.analysis.lens_design.performance.field_curvature import field_curvature
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.analysis.lens_design.performance.illumination import illumination
from raytracer.analysis.lens_design.performance.mtf import diffraction_limit, mtf, mtf_over_field
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, set_up_bench
from raytracer.analysis.lens_design.performance.ray_fans import fans
from raytracer.analysis.lens_design.performance.results import (
    ChromaticAberration,
    DiffractionLimit,
    DistortionCurve,
    Fan,
    FieldCurvature,
    FirstOrder,
    Illumination,
    Mtf,
    MtfOverField,
    Note,
    Seidel,
    Settings,
    Spherical,
    SpotsOfField,
    Tolerances,
)
from raytracer.analysis.lens_design.performance.seidel import seidel
from raytracer.analysis.lens_design.performance.spherical import spherical
from raytracer.analysis.lens_design.performance.spots import spots
from raytracer.analysis.lens_design.performance.tolerances import tolerances
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.warnings import lens_warnings


class LensStudy(NamedTuple):
    """Results of all analyses of a lens; those by meridian are tuples, with one member for lenses of revolution.

    `seidel` is None for lenses with cylinders, for which the sums are not defined.
    """

    name: str
    source: str
    settings: Settings
    film_z_mm: float
    first_order: tuple[FirstOrder, ...]
    spherical: tuple[Spherical, ...]
    fans: tuple[Fan, ...]
    field_curvature: tuple[FieldCurvature, ...]
    distortion: tuple[DistortionCurve, ...]
    colour: tuple[ChromaticAberration, ...]
    illumination: tuple[Illumination, ...]
    spots: tuple[SpotsOfField, ...]
    mtf: tuple[Mtf, ...]
    mtf_over_field: tuple[MtfOverField, ...]
    diffraction_limit: DiffractionLimit
    seidel: Seidel | None
    tolerances: tuple[Tolerances, ...]
    notes: tuple[Note, ...]

    def as_dict(self, *, points: bool = False) -> dict[str, Any]:
        """Convert to plain dicts, lists, numbers and strings, for JSON; numbers that are not finite become None.

        points : True to include the points of the spot diagrams, some megabytes of them.
        """
        values: dict[str, Any] = to_plain(self)
        if not points:
            for row in values["spots"]:
                for spot in row["spots"]:
                    del spot["points_um"]
        return values


def study_lens(lens: Lens, settings: Settings | None = None) -> LensStudy:
    """Run all analyses of a lens.

    Raises
    ------
    ValueError : the lens makes no image, or the f-number or focus distance is not possible.
    """
    bench = set_up_bench(lens, settings)
    rows = bench.meridians
    study = LensStudy(
        name=lens.name,
        source=lens.source,
        settings=bench.settings,
        film_z_mm=bench.film,
        first_order=tuple(first_order(bench, meridian) for meridian in rows),
        spherical=tuple(spherical(bench, meridian) for meridian in rows),
        fans=tuple(fan for meridian in rows for fan in fans(bench, meridian)),
        field_curvature=tuple(field_curvature(bench, meridian) for meridian in rows),
        distortion=tuple(distortion(bench, meridian) for meridian in rows),
        colour=tuple(chromatic_aberration(bench, meridian) for meridian in rows),
        illumination=tuple(illumination(bench, meridian) for meridian in rows),
        spots=tuple(spot for meridian in rows for spot in spots(bench, meridian)),
        mtf=tuple(curve for meridian in rows for curve in mtf(bench, meridian)),
        mtf_over_field=tuple(mtf_over_field(bench, meridian) for meridian in rows),
        diffraction_limit=diffraction_limit(bench),
        seidel=seidel(bench),
        tolerances=tuple(tolerances(bench, meridian) for meridian in rows),
        notes=(),
    )
    return study._replace(notes=tuple(_notes(lens, bench, study)))


def _notes(lens: Lens, bench: OpticalBench, study: LensStudy) -> Iterator[Note]:
    """Write notes on missing results, and on how to read the others."""
    for warning in lens_warnings(lens):
        yield Note("first_order", warning)
    yield Note("mtf", "geometric: diffraction is not simulated; `diffraction_limit` is a perfect lens's, for reference")
    if math.isinf(bench.distance):
        yield Note("settings", "focus_distance_mm is null: focused at infinity")
    if bench.settings.f_number is None:
        yield Note("settings", "f_number is null: the stop is as wide open as it goes")
    if bench.settings.circle_of_confusion_mm is None:
        yield Note("settings", "circle_of_confusion_mm is null: a 1500th of the picture's diagonal")
    if not any(element.is_stop for element in lens.elements):
        yield Note("first_order", f"no surface is marked as the stop: surface {bench.stop + 1} acts as one")
    if lens.focal_length is None:
        yield Note("first_order", "published_focal_length_mm is null: none is published")
    if not lens.disperses():
        yield Note(
            "colour", "no glass in the lens has an index that depends on the wavelength: no chromatic aberration"
        )
    if len(bench.settings.wavelengths_nm) < 3:
        yield Note("colour", "axial_between_ends_mm is null: it needs three wavelengths")
        yield Note("seidel", "axial_colour and lateral_colour are null: they need three wavelengths")
    if study.seidel is None:
        yield Note("seidel", "not defined for lenses with cylinders, whose meridians differ")
        yield Note("spherical", "third_order_mm is null: not defined for lenses with cylinders")
        yield Note("first_order", "field_of_view_diagonal_deg is null: a lens with cylinders is seen in two meridians")
    for first in study.first_order:
        yield from _limits(bench, first)
    yield from _gaps(study)


def _limits(bench: OpticalBench, first: FirstOrder) -> Iterator[Note]:
    """Write notes on quantities that are at infinity or out of reach in one meridian."""
    width, height = bench.settings.sensor_mm
    reach = 0.5 * (math.hypot(width, height) if bench.lens.is_round() else {"y": height, "x": width}[first.meridian])
    largest, circle = first.half_field_image_height_mm, bench.lens.image_circle
    if largest < reach:
        reason = (
            "that is the lens's image circle" if circle is not None and largest == 0.5 * circle else "it is dark there"
        )
        yield Note("settings", f"fields reach to {largest:.4g} mm from the axis, not to {reach:.4g} mm: {reason}")
    if math.isinf(first.exit_pupil_z_mm):
        yield Note("first_order", "exit_pupil is null: at infinity (telecentric)")
    if math.isinf(first.entrance_pupil_z_mm):
        yield Note("first_order", "entrance_pupil is null: at infinity (telecentric)")
    if not math.isfinite(first.working_f_number):
        yield Note("first_order", "working_f_number is null: no light of the axis gets through")
        yield Note("diffraction_limit", "null: no light of the axis gets through")
        yield Note("tolerances", "null: no light of the axis gets through")
        yield Note("illumination", "null: no light of the axis gets through")
    if math.isinf(first.petzval_radius_mm):
        yield Note("first_order", "petzval_radius_mm is null: the Petzval surface is flat")


def _gaps(study: LensStudy) -> Iterator[Note]:
    """Write notes on curves with missing values."""
    if any(not math.isfinite(row.far_limit_mm) for row in study.tolerances):
        yield Note("tolerances", "far_limit_mm is null: sharp enough as far as infinity")
    if any(not math.isfinite(row.near_limit_mm) for row in study.tolerances):
        yield Note("tolerances", "near_limit_mm is null: it is beyond infinity")
    if any(np.isnan(fan.tangential_um).any() or np.isnan(fan.sagittal_um).any() for fan in study.fans):
        yield Note("fans", "null where rims block the rays")
    if any(not len(spot.points_um) for row in study.spots for spot in row.spots):
        yield Note("spots", "sizes are null for fields of which no light gets through")
        yield Note("mtf", "null for fields of which no light gets through")
        yield Note("mtf_over_field", "null for fields of which no light gets through")
    if any(np.isnan(curve.longitudinal_mm).any() for curve in study.spherical):
        yield Note("spherical", "null for zones that rims block")
    if any(np.isnan(curve.percent).any() for curve in study.distortion):
        yield Note("distortion", "percent is null from 90 degrees on, where f tan has no value")
    if any(np.isnan(curve.tangential_mm).any() for curve in study.field_curvature):
        yield Note("field_curvature", "null where no chief ray gets through, or the pencil leaves parallel")


def to_plain(value: Any) -> Any:
    """Convert a result to values of JSON."""
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {key: to_plain(part) for key, part in value._asdict().items()}
    if isinstance(value, Mapping):
        return {key: to_plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(part) for part in value]
    return value
