"""Study of a lens: all analyses in one."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from raytracer.analysis.lens_design.performance import results
from raytracer.analysis.lens_design.performance.field_aberrations import (
    chromatic_aberration,
    distortion,
    field_curvature,
)
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.analysis.lens_design.performance.illumination import illumination, sensor_reach
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, set_up_bench
from raytracer.analysis.lens_design.performance.ray_aberrations import fans, seidel, spherical
from raytracer.analysis.lens_design.performance.results import Note, Settings
from raytracer.analysis.lens_design.performance.spots import diffraction_limit, mtf, mtf_over_field, spots
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
    first_order: tuple[results.FirstOrder, ...]
    spherical: tuple[results.Spherical, ...]
    fans: tuple[results.Fan, ...]
    field_curvature: tuple[results.FieldCurvature, ...]
    distortion: tuple[results.DistortionCurve, ...]
    colour: tuple[results.ChromaticAberration, ...]
    illumination: tuple[results.Illumination, ...]
    spots: tuple[results.SpotsOfField, ...]
    mtf: tuple[results.Mtf, ...]
    mtf_over_field: tuple[results.MtfOverField, ...]
    diffraction_limit: results.DiffractionLimit
    seidel: results.Seidel | None
    tolerances: tuple[results.Tolerances, ...]
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
    settings, is_round = bench.settings, study.seidel is not None
    is_marked, disperses = any(element.is_stop for element in lens.elements), lens.disperses()
    few_colours = len(settings.wavelengths_nm) < 3
    stop = f"no surface is marked as the stop: surface {bench.stop + 1} acts as one"
    perfect = "geometric: diffraction is not simulated; `diffraction_limit` is a perfect lens's, for reference"
    grey = "no glass in the lens has an index that depends on the wavelength: no chromatic aberration"
    diagonal = "field_of_view_diagonal_deg is null: a lens with cylinders is seen in two meridians"
    yield from (Note("first_order", warning) for warning in lens_warnings(lens))
    yield from _noted(
        ("mtf", True, perfect),
        ("settings", math.isinf(bench.distance), "focus_distance_mm is null: focused at infinity"),
        ("settings", settings.f_number is None, "f_number is null: the stop is as wide open as it goes"),
        (
            "settings",
            settings.circle_of_confusion_mm is None,
            "circle_of_confusion_mm is null: a 1500th of the picture's diagonal",
        ),
        ("first_order", not is_marked, stop),
        ("first_order", lens.focal_length is None, "published_focal_length_mm is null: none is published"),
        ("colour", not disperses, grey),
        ("colour", few_colours, "axial_between_ends_mm is null: it needs three wavelengths"),
        ("seidel", few_colours, "axial_colour and lateral_colour are null: they need three wavelengths"),
        ("seidel", not is_round, "not defined for lenses with cylinders, whose meridians differ"),
        ("spherical", not is_round, "third_order_mm is null: not defined for lenses with cylinders"),
        ("first_order", not is_round, diagonal),
    )
    for first in study.first_order:
        yield from _limits(bench, first)
    yield from _gaps(study)


def _noted(*rows: tuple[str, bool, str]) -> Iterator[Note]:
    """Make the notes, of topic and reason, that hold."""
    return (Note(topic, reason) for topic, holds, reason in rows if holds)


def _limits(bench: OpticalBench, first: results.FirstOrder) -> Iterator[Note]:
    """Write notes on quantities that are at infinity or out of reach in one meridian."""
    reach = sensor_reach(bench, first.meridian)
    largest, circle = first.half_field_image_height_mm, bench.lens.image_circle
    ends = "that is the lens's image circle" if circle is not None and largest == 0.5 * circle else "it is dark there"
    is_dark, dark = not math.isfinite(first.working_f_number), "null: no light of the axis gets through"
    yield from _noted(
        ("settings", largest < reach, f"fields reach to {largest:.4g} mm from the axis, not to {reach:.4g} mm: {ends}"),
        ("first_order", math.isinf(first.exit_pupil_z_mm), "exit_pupil is null: at infinity (telecentric)"),
        ("first_order", math.isinf(first.entrance_pupil_z_mm), "entrance_pupil is null: at infinity (telecentric)"),
        ("first_order", is_dark, f"working_f_number is {dark}"),
        *((topic, is_dark, dark) for topic in ("diffraction_limit", "tolerances", "illumination")),
        ("first_order", math.isinf(first.petzval_radius_mm), "petzval_radius_mm is null: the Petzval surface is flat"),
    )


def _gaps(study: LensStudy) -> Iterator[Note]:
    """Write notes on curves with missing values."""
    far, near = ([getattr(row, name) for row in study.tolerances] for name in ("far_limit_mm", "near_limit_mm"))
    blocked = any(np.isnan(fan.tangential_um).any() or np.isnan(fan.sagittal_um).any() for fan in study.fans)
    zones = any(np.isnan(curve.longitudinal_mm).any() for curve in study.spherical)
    dark = any(not len(spot.points_um) for row in study.spots for spot in row.spots)
    beyond = any(np.isnan(curve.percent).any() for curve in study.distortion)
    lost = any(np.isnan(curve.tangential_mm).any() for curve in study.field_curvature)
    no_light = "null for fields of which no light gets through"
    return _noted(
        ("tolerances", not np.isfinite(far).all(), "far_limit_mm is null: sharp enough as far as infinity"),
        ("tolerances", not np.isfinite(near).all(), "near_limit_mm is null: it is beyond infinity"),
        ("fans", blocked, "null where rims block the rays"),
        ("spots", dark, f"sizes are {no_light}"),
        ("mtf", dark, no_light),
        ("mtf_over_field", dark, no_light),
        ("spherical", zones, "null for zones that rims block"),
        ("distortion", beyond, "percent is null from 90 degrees on, where f tan has no value"),
        ("field_curvature", lost, "null where no chief ray gets through, or the pencil leaves parallel"),
    )


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
