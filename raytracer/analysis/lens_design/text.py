"""Text and tables of a study: for a terminal, and for pages."""

import math
import textwrap
from collections.abc import Sequence

import numpy as np

from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.analysis.lens_design.performance.results import Curve, FirstOrder, Note
from raytracer.analysis.lens_design.plots import projection_text, wavelength_name
from raytracer.optics.lens_system.lens import Lens
from raytracer.report.table import Row, Table, align_columns
from raytracer.report.wording import degrees, metres, micrometres, millimetres, relative, significant

_WIDTH = 100


# ---- Tables


def setting(study: LensStudy) -> str:
    """Describe the set-up of the lens: aperture, focus, film, field, wavelengths."""
    first, chosen = study.first_order[0], study.settings
    width, height = chosen.sensor_mm
    colours = ", ".join(wavelength_name(nm) for nm in chosen.wavelengths_nm)
    # The working f-number, as the pupil near the axis may be wider than what rays of the rim make of it.
    open_to = f"wide open, working f/{first.working_f_number:.4g}"
    number = open_to if chosen.f_number is None else f"f/{chosen.f_number:g}"
    return (
        f"{number}, focused on {metres(chosen.focus_distance_mm)}, film {width:.4g} x {height:.4g} mm, "
        f"largest field {first.half_field_deg:.4g}° ({first.half_field_image_height_mm:.4g} mm); {colours}"
    )


def first_order(study: LensStudy) -> tuple[Table, ...]:
    """Make the tables of first-order data, one for each meridian: by matrices, and by traced rays."""
    several = len(study.first_order) > 1
    return tuple(_first_order(first, several) for first in study.first_order)


def _first_order(first: FirstOrder, several: bool) -> Table:
    def place(name: str, z: float) -> Row:
        return Row(name, (millimetres(z), "", ""))

    def both(name: str, by_matrices: float, traced: float, difference: float, meaning: str = "") -> Row:
        return Row(name, (millimetres(by_matrices), millimetres(traced), relative(difference)), meaning)

    length = first.focal_length_mm, first.focal_length_traced_mm, first.focal_length_difference
    behind = first.back_focus_mm, first.back_focus_traced_mm, first.back_focus_difference
    rows = [
        both("focal length", *length),
        both("back focus", *behind, "from the last vertex to the rear focal point"),
        place("front focal point F", first.front_focus_z_mm),
        place("rear focal point F′", first.rear_focus_z_mm),
        place("front principal plane H", first.front_principal_z_mm),
        place("rear principal plane H′", first.rear_principal_z_mm),
        place("front nodal point N", first.front_nodal_z_mm),
        place("rear nodal point N′", first.rear_nodal_z_mm),
        place("stop", first.stop_z_mm),
        place("stop's diameter", first.stop_diameter_mm),
        place("entrance pupil", first.entrance_pupil_z_mm),
        place("entrance pupil's diameter", first.entrance_pupil_diameter_mm),
        place("exit pupil", first.exit_pupil_z_mm),
        place("exit pupil's diameter", first.exit_pupil_diameter_mm),
        Row("f-number", (significant(first.f_number), "", ""), "focal length over the entrance pupil's diameter"),
        Row("working f-number", ("", significant(first.working_f_number), ""), "1 / (2 sin u′) of the marginal ray"),
        Row("magnification", (significant(first.magnification), "", "")),
        place("film", first.film_z_mm),
        place("front vertex to film", first.total_track_mm),
        Row("field of view, width", ("", degrees(first.field_of_view_width_deg), "")),
        Row("field of view, height", ("", degrees(first.field_of_view_height_deg), "")),
        Row("field of view, diagonal", ("", degrees(first.field_of_view_diagonal_deg), "")),
        Row("radius of the Petzval surface", (millimetres(first.petzval_radius_mm, 5), "", "")),
    ]
    # The published value is of the lens focused at infinity; focusing groups and cylinders change it.
    if math.isfinite(first.published_focal_length_mm) and first.magnification == 0.0 and first.meridian == "y":
        off = first.focal_length_mm / first.published_focal_length_mm - 1.0
        difference = f"{round(100.0 * off, 2) + 0.0:+.2f} %".replace("-", "−")
        rows.insert(1, Row("focal length, published", (f"{first.published_focal_length_mm:g} mm", "", difference)))
    title = f"First order, in the plane of {first.meridian}" if several else "First order"
    text = (
        f"At {wavelength_name(first.wavelength_nm)}. By ray transfer matrices, and beside them by rays traced near the "
        "axis; the difference is relative. Places are from the front vertex, positive towards the film."
    )
    return Table(title, ("", "matrices", "traced", "difference"), tuple(rows), text)


def surfaces(lens: Lens) -> Table:
    """Make the table of the surfaces: the prescription."""
    rows = []
    for number, one in enumerate(lens.elements, start=1):
        radius = "flat" if one.curvature == 0.0 else f"{1.0 / one.curvature:.6g}".replace("-", "−")
        name = one.glass.name
        glass = "" if float(one.glass.ior()) == 1.0 else name
        more: list[str] = [one.kind] if one.kind not in ("spherical", "flat") else []
        more += ["stop"] if one.is_stop and one.kind != "stop" else []
        more += [f"k = {one.conic:g}"] if one.conic else []
        more += [f"along {one.axis}"] if one.axis else []
        more += ["coated"] if one.coating is not None else []
        cells = (radius, f"{one.thickness:g}", glass, f"{2.0 * one.radius:g}", ", ".join(more))
        rows.append(Row(str(number), cells))
    head = ("surface", "radius (mm)", "to the next (mm)", "material", "clear diameter (mm)", "")
    return Table("Surfaces", head, tuple(rows))


def seidel(study: LensStudy) -> Table | None:
    """Make the table of Seidel sums by surface; None for lenses with cylinders."""
    sums = study.seidel
    if sums is None:
        return None
    columns = (
        ("spherical", sums.spherical, sums.total_spherical),
        ("coma", sums.coma, sums.total_coma),
        ("astigmatism", sums.astigmatism, sums.total_astigmatism),
        ("Petzval", sums.petzval, sums.total_petzval),
        ("distortion", sums.distortion, sums.total_distortion),
        ("axial colour", sums.axial_colour, sums.total_axial_colour),
        ("lateral colour", sums.lateral_colour, sums.total_lateral_colour),
    )
    rows = [
        Row(str(number + 1), tuple(_micrometres(column[number]) for _, column, _ in columns))
        for number in range(len(sums.spherical))
    ]
    rows.append(Row("sum", tuple(_micrometres(total) for _, _, total in columns)))
    text = (
        f"In micrometres, at {wavelength_name(sums.wavelength_nm)}, for the marginal ray and the chief ray that lands "
        f"{sums.image_height_mm:.4g} mm out: S_I to S_V, C_I and C_II. Large numbers of both signs that cancel "
        "each other make a lens hard to build."
    )
    return Table("Seidel sums", ("surface", *(name for name, _, _ in columns)), tuple(rows), text)


def _micrometres(millimetre: float) -> str:
    return f"{1000.0 * float(millimetre):.2f}".replace("-", "−")


def tolerances(study: LensStudy) -> tuple[Table, ...]:
    """Make the tables of tolerances: on focus, and in manufacturing."""
    several = len(study.tolerances) > 1
    tables = []
    for result in study.tolerances:
        plane = f", in the plane of {result.meridian}" if several else ""
        rows = (
            Row("circle of confusion", (millimetres(result.circle_of_confusion_mm, 3),)),
            Row("depth of focus", (f"± {millimetres(result.depth_of_focus_mm, 3)}",), "tolerance of the film's place"),
            Row("nearest plane that is sharp", (_scene(result.near_limit_mm),), "from the entrance pupil"),
            Row("farthest plane that is sharp", (_scene(result.far_limit_mm),), "from the entrance pupil"),
            Row("best focus, from the film", (millimetres(result.best_focus_mm, 3),), "least RMS spot on the axis"),
            Row("RMS spot on the axis", (micrometres(result.rms_on_axis_um),)),
            Row("the same at best focus", (micrometres(result.rms_on_axis_best_um),)),
            Row("all errors below, together", (millimetres(result.rss_back_focus_mm, 3),), "RSS, on the back focus"),
        )
        tables.append(Table(f"Tolerance on focus{plane}", ("", ""), rows))
        errors = tuple(
            Row(
                f"{one.surface}: {one.parameter}",
                (
                    f"{one.step:g} {one.unit}".strip(),
                    f"{1000.0 * one.back_focus_mm:.3g}".replace("-", "−"),
                    significant(one.back_focus_per_unit),
                    f"{one.spot_um:+.3g}".replace("-", "−"),
                    f"{one.spot_refocused_um:+.3g}".replace("-", "−"),
                ),
            )
            for one in result.sensitivities
        )
        if errors:
            head = ("surface", "error", "back focus (µm)", "by the number", "spot (µm)", "refocused (µm)")
            text = "Effect of a small error of each number on the back focus, and on the RMS spot on the axis."
            tables.append(Table(f"Manufacturing tolerances{plane}", head, errors, text))
    return tuple(tables)


def _scene(value: float) -> str:
    return "none" if math.isnan(value) else metres(value)


def notes(study: LensStudy) -> tuple[Note, ...]:
    """Select the notes for readers of a report: not those on keys of the JSON."""
    return tuple(note for note in study.notes if "null" not in note.reason and "`" not in note.reason)


def topic(note: Note) -> str:
    """Write the topic of a note in words."""
    return "Seidel sums" if note.topic == "seidel" else note.topic.replace("_", " ")


# ---- A terminal


def summary(study: LensStudy) -> str:
    """Write a study for a terminal."""
    lines = textwrap.wrap(study.name, _WIDTH)
    lines += textwrap.wrap(study.source, _WIDTH)
    lines += textwrap.wrap(setting(study), _WIDTH)
    for table in first_order(study):
        lines += ["", table.title, *_columns([table.head, *((row.name, *row.cells) for row in table.rows)])]
    for title, make in (("Aberrations", aberrations), ("Spots, of all wavelengths together", spots)):
        for first in study.first_order:
            plane = f", in the plane of {first.meridian}" if len(study.first_order) > 1 else ""
            lines += ["", f"{title}{plane}", *_columns(make(study, first.meridian))]
    for note in notes(study):
        lines += ["", *textwrap.wrap(f"{topic(note)}: {note.reason}", _WIDTH)]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def aberrations(study: LensStudy, meridian: str = "y") -> list[tuple[str, ...]]:
    """List the aberrations in one meridian, in a number each: name, value, place."""
    number = [first.meridian for first in study.first_order].index(meridian)
    spherical, colour, curvature = study.spherical[number], study.colour[number], study.field_curvature[number]
    distortion, light = study.distortion[number], study.illumination[number]
    rows: list[tuple[str, ...]] = []
    zones = np.flatnonzero(np.isfinite(spherical.longitudinal_mm[0]))
    if zones.size:
        value, zone = spherical.longitudinal_mm[0, zones[-1]], spherical.pupil[zones[-1]]
        where = "at the pupil's rim" if zone == 1.0 else f"at {zone:.2g} of the pupil's height"
        rows.append(("spherical aberration", millimetres(float(value), 3), where))
    wavelengths = study.settings.wavelengths_nm
    ends = f"{wavelengths[1]:.4g} nm from {wavelengths[2]:.4g} nm" if len(wavelengths) > 2 else ""
    rows.append(("longitudinal colour", millimetres(colour.axial_between_ends_mm, 3), ends))
    height = curvature.image_height_mm
    rows += _outermost("focus, tangential", curvature.tangential_mm[0], height, "mm")
    rows += _outermost("focus, sagittal", curvature.sagittal_mm[0], height, "mm")
    rows += _outermost("distortion", distortion.percent, height, "%")
    if distortion.projection != "f tan":
        name = f"distortion against {projection_text(distortion.projection)}"
        rows += _outermost(name, distortion.projection_percent, height, "%")
    for nm, values in zip(colour.edge_wavelengths_nm[1:], colour.lateral_um[1:], strict=True):
        rows += _outermost(f"lateral colour, {wavelength_name(float(nm))}", values, height, "µm")
    rows += _outermost("relative illumination", 100.0 * light.relative, height, "%")
    return rows


def _outermost(name: str, values: Curve, heights: Curve, unit: str) -> list[tuple[str, ...]]:
    """Make the row of the outermost value of a curve, and its place; no row if there is none."""
    there = np.flatnonzero(np.isfinite(values))
    if not there.size:
        return []
    last = there[-1]
    return [(name, f"{significant(float(values[last]), 3)} {unit}", f"{float(heights[last]):.4g} mm out")]


def spots(study: LensStudy, meridian: str = "y") -> list[tuple[str, ...]]:
    """List spots and contrast over the field in one meridian, with the head of the table first."""
    frequencies = study.settings.frequencies_per_mm
    head = ("image height", "field", "RMS", "largest", *(f"T {f:g}/mm" for f in frequencies))
    rows = [(*head, *(f"S {f:g}/mm" for f in frequencies))]
    for spot, mtf in zip(study.spots, study.mtf, strict=True):
        if spot.meridian != meridian:
            continue
        contrasts = [
            significant(float(np.interp(frequency, mtf.frequencies_per_mm, values)), 2)
            for values in (mtf.tangential, mtf.sagittal)
            for frequency in frequencies
        ]
        sizes = (micrometres(spot.rms_um), micrometres(spot.largest_um))
        rows.append((millimetres(spot.image_height_mm, 4), degrees(spot.field_deg), *sizes, *contrasts))
    return rows


def _columns(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Align rows in columns, indented by two."""
    return [f"  {row}" for row in align_columns(rows)]
