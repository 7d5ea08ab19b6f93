"""Charts of a study: spots, ray fans, field curvature, distortion, illumination and MTF."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.lens_design.performance import results
from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.optics.glass import LINE_C, LINE_D, LINE_F
from raytracer.report.chart import DASH_DOTTED, DASHED, DOTTED, SOLID, Chart, LegendEntry, ReferenceLine, Series
from raytracer.report.palette import BLUE, GREEN, OCHRE, PURPLE, SERIES, VERMILLION

_LINES = {LINE_F: "F", LINE_D: "d", LINE_C: "C"}

# Colours of wavelengths (nm) below these.
_OF_WAVELENGTH = ((450.0, PURPLE), (500.0, BLUE), (600.0, GREEN), (620.0, OCHRE))
_DASHES = (SOLID, DASHED, DASH_DOTTED, DOTTED)

# Dashes of tangential and sagittal lines, in charts whose colours say something else.
_PLANES = (LegendEntry("T"), LegendEntry("S", dashes=DASHED))

_ZERO_X, _ZERO_Y = (ReferenceLine("x", 0.0),), (ReferenceLine("y", 0.0),)

# Dots of a spot diagram: few enough that a page of many stays small.  They are a random sample of the rays.
_MOST_DOTS = 400

FloatArray = NDArray[np.float64]


class ChartGroup(NamedTuple):
    """Group of charts with an explanation; `columns` of a table of bare ones, else 0."""

    key: str
    title: str
    text: str
    charts: tuple[Chart, ...]
    columns: int = 0


def wavelength_name(nm: float) -> str:
    """Write a wavelength: `587.6 nm (d)`."""
    letter = _LINES.get(nm)
    return f"{nm:.1f} nm ({letter})" if letter else f"{nm:g} nm"


def wavelength_color(nm: float) -> str:
    """Choose a colour of the palette for a wavelength."""
    return next((hue for end, hue in _OF_WAVELENGTH if nm < end), VERMILLION)


def projection_text(name: str) -> str:
    """Write an ideal projection with its symbols."""
    return name.replace("theta", "θ") if "theta" in name else f"{name} θ"


def chart_groups(study: LensStudy) -> tuple[ChartGroup, ...]:
    """Make all charts, in groups; a group without charts is left out."""
    all_groups = (
        ChartGroup(
            "spots",
            "Spot diagrams",
            "Places at which the rays of one point of the scene reach the film. A row for each place in the picture, a "
            "column for each wavelength, and one for all of them; upwards is away from the middle of the picture. All "
            "frames have the same size. Below each: the RMS and the largest distance from the middle of the spot.",
            *_spots(study),
        ),
        ChartGroup(
            "spherical",
            "Spherical aberration",
            "Places at which rays of a point on the axis cross the axis again, by their height in the pupil. Without "
            "spherical aberration the lines are vertical, without chromatic aberration the same for all wavelengths.",
            tuple(chart for result in study.spherical for chart in _spherical(result)),
        ),
        ChartGroup(
            "fans",
            "Ray fans",
            "Distance of rays from the chief ray on the film, over the pupil, for each place in "
            "the picture: tangential in the plane of the axis, sagittal across it. A slope is defocus, a parabola "
            "coma, an S spherical aberration.",
            tuple(_fans(study)),
        ),
        ChartGroup(
            "curvature",
            "Field curvature and astigmatism",
            "Foci of narrow beams, from the film: the difference between tangential and sagittal is astigmatism.",
            tuple(_curvature(result) for result in study.field_curvature),
        ),
        ChartGroup(
            "distortion",
            "Distortion",
            "Image height against that of the ideal projection: below 0 is barrel distortion, above 0 pincushion.",
            tuple(_distortion(result) for result in study.distortion),
        ),
        ChartGroup(
            "colour",
            "Chromatic aberration",
            "Lateral: distance of each wavelength from the middle one on the film, which gives coloured fringes. "
            "Longitudinal: focus of each wavelength on the axis.",
            tuple(chart for result in study.colour for chart in _chromatic_aberration(result)),
        ),
        ChartGroup(
            "illumination",
            "Relative illumination",
            "Light on the film of an evenly bright scene, against the middle of the picture.",
            tuple(_illumination(result) for result in study.illumination),
        ),
        ChartGroup(
            "mtf",
            "Geometric MTF",
            "The contrast of fine lines, by the spots' rays. Diffraction is not simulated: the dotted line is the "
            "limit that it sets to a perfect lens of this f-number, and no real lens is above it.",
            tuple(_mtf_charts(study)),
        ),
    )
    several = len(study.first_order) > 1
    return tuple(_title_meridians(group) if several else group for group in all_groups if group.charts)


def _title_meridians(group: ChartGroup) -> ChartGroup:
    """Add the plane to the titles of charts of a lens with cylinders: the last letter of their keys."""
    charts = (replace(chart, title=f"{chart.title}, in the plane of {chart.key[-1]}") for chart in group.charts)
    return group._replace(charts=tuple(charts))


def _by_wavelength(
    wavelengths: Iterable[float], values: FloatArray, along: FloatArray, *, upright: bool
) -> list[Series]:
    """Make a line for each wavelength: its values over `along`, or with exchanged axes if the chart is `upright`."""
    lines = []
    for number, (nm, row) in enumerate(zip(wavelengths, values, strict=True)):
        x, y = (row, along) if upright else (along, row)
        lines.append(
            Series(wavelength_name(float(nm)), x, y, wavelength_color(float(nm)), _DASHES[number % len(_DASHES)])
        )
    return lines


# ---- Spots


def _spots(study: LensStudy) -> tuple[tuple[Chart, ...], int]:
    """Make a row of spot diagrams for each field; returns the number of charts in a row, too."""
    fields = [field for field in study.spots if any(len(_passing_points(spot)) for spot in field.spots)]
    if not fields:
        return (), 0
    half = _half_width(fields)
    charts = []
    for field in fields:
        place = f"{field.image_height_mm:.3g} mm ({field.field_deg:.3g}°)"
        key = f"spot-{field.field:g}-{{}}-{field.meridian}"
        dots = tuple(_dots(spot) for spot in field.spots)
        for number, (spot, dot) in enumerate(zip(field.spots, dots, strict=True)):
            title = f"{place}, {dot.label}"
            charts.append(_frame(key.format(number), title, (dot,), half, spot.rms_um, spot.largest_um))
        charts.append(_frame(key.format("all"), f"{place}, all", dots, half, field.rms_um, field.largest_um))
    return tuple(charts), len(fields[0].spots) + 1


def _passing_points(spot: results.Spot) -> FloatArray:
    """Select the points of rays that get through."""
    return spot.points_um[np.isfinite(spot.points_um).all(axis=1)]


def _half_width(fields: Sequence[results.SpotsOfField]) -> float:
    """Choose half the side of all frames (um): a round number that holds nearly all rays of the largest spot."""
    landed = [points for field in fields for spot in field.spots if len(points := _passing_points(spot))]
    wanted = 1.1 * max([0.5, *(float(np.quantile(np.abs(points), 0.98)) for points in landed)])
    power: float = 10.0 ** math.floor(math.log10(wanted))
    return next(power * m for m in (1.0, 2.0, 3.0, 5.0, 10.0) if power * m >= wanted)


def _dots(spot: results.Spot) -> Series:
    """Choose the dots of a spot diagram."""
    points = _passing_points(spot)
    # A stride would pick columns of the pupil's grid.
    chosen = np.random.default_rng(0).permutation(len(points))[:_MOST_DOTS]
    nm = spot.wavelength_nm
    return Series(wavelength_name(nm), points[chosen, 0], points[chosen, 1], wavelength_color(nm), mark="dots")


def _frame(key: str, title: str, series: tuple[Series, ...], half: float, rms: float, largest: float) -> Chart:
    """Make the bare chart of a spot diagram."""
    note = f"RMS {rms:.3g} µm, largest {largest:.3g} µm" if np.isfinite(rms) else "no light"
    ends = (-half, half)
    return Chart(key, title, "x (µm)", "y (µm)", series, ends, ends, equal=True, bare=True, note=note)


def frame_size_um(group: ChartGroup) -> float:
    """Return the side of the frames of spot diagrams (um)."""
    low, high = group.charts[0].ranges()[0]
    return high - low


# ---- Over the pupil


def _spherical(result: results.Spherical) -> Iterator[Chart]:
    """Chart spherical aberration, and the offence against the sine condition."""
    lines = _by_wavelength(result.wavelengths_nm, result.longitudinal_mm, result.pupil, upright=True)
    if np.isfinite(result.third_order_mm).any():
        lines.append(Series("third order (Seidel)", result.third_order_mm, result.pupil, dashes=DOTTED))
    axes = "from the paraxial image (mm)", "height in the pupil"
    title = "Longitudinal spherical aberration"
    yield Chart(f"lsa-{result.meridian}", title, *axes, tuple(lines), y_range=(0.0, 1.0), levels=_ZERO_X)
    if np.isfinite(result.sine_condition).any():
        names = f"osc-{result.meridian}", "Offence against the sine condition", "offence", "height in the pupil"
        line = Series("", result.sine_condition, result.pupil, BLUE)
        note = "Where it is 0 there is no coma close to the axis."
        yield Chart(*names, (line,), y_range=(0.0, 1.0), levels=_ZERO_X, note=note)


def _fans(study: LensStudy) -> Iterator[Chart]:
    """Chart the tangential and the sagittal fan of each field, all on one scale."""
    lit = [fan for fan in study.fans if np.isfinite(fan.tangential_um).any()]
    # One scale, so that fields can be compared; the few worst rays would flatten all others.
    values = [np.abs(values[np.isfinite(values)]) for fan in lit for values in (fan.tangential_um, fan.sagittal_um)]
    most = 1.1 * max((float(np.quantile(v, 0.97)) for v in values if v.size), default=1.0) or 1.0
    axes = "height in the pupil", "from the chief ray (µm)"
    for fan in lit:
        for name, aberration in (("tangential", fan.tangential_um), ("sagittal", fan.sagittal_um)):
            key, title = (
                f"fan-{name}-{fan.field:g}-{fan.meridian}",
                f"{name.capitalize()}, {fan.field_deg:.3g}° off the axis",
            )
            lines = _by_wavelength(fan.wavelengths_nm, aberration, fan.pupil, upright=False)
            yield Chart(key, title, *axes, tuple(lines), (-1.0, 1.0), (-most, most), levels=_ZERO_X + _ZERO_Y)


# ---- Over the field


def _curvature(result: results.FieldCurvature) -> Chart:
    """Chart field curvature and the Petzval surface."""
    lines, entries = [], []
    # Colours by wavelength, dashes by plane.
    for nm, tangential, sagittal in zip(result.wavelengths_nm, result.tangential_mm, result.sagittal_mm, strict=True):
        name, hue = wavelength_name(float(nm)), wavelength_color(float(nm))
        lines.append(Series(f"T, {name}", tangential, result.image_height_mm, hue, SOLID))
        lines.append(Series(f"S, {name}", sagittal, result.image_height_mm, hue, DASHED))
        entries.append(LegendEntry(name, hue))
    entries += _PLANES
    if np.isfinite(result.petzval_mm).any():
        lines.append(Series("Petzval surface", result.petzval_mm, result.image_height_mm, dashes=DOTTED))
        entries.append(LegendEntry("Petzval surface", dashes=DOTTED))
    names = f"curvature-{result.meridian}", "Field curvature", "focus from the film (mm)", "image height (mm)"
    note = "T: tangential, in the plane of the axis. S: sagittal, across it."
    return Chart(*names, tuple(lines), levels=_ZERO_X, entries=tuple(entries), note=note)


def _distortion(result: results.DistortionCurve) -> Chart:
    """Chart distortion against ideal projections."""
    lines = [Series("against f tan θ", result.percent, result.image_height_mm, BLUE, SOLID)]
    best = projection_text(result.projection)
    if result.projection != "f tan":
        lines.append(Series(f"against {best}", result.projection_percent, result.image_height_mm, VERMILLION, DASHED))
    worst = np.nanmax(np.abs(result.percent)) if np.isfinite(result.percent).any() else 0.0
    # Tiny distortion must not fill the chart.
    ends = (-1.0, 1.0) if worst < 0.9 else None
    names = f"distortion-{result.meridian}", "Distortion", "distortion (%)", "image height (mm)"
    return Chart(*names, tuple(lines), ends, levels=_ZERO_X, note=f"The projection that fits best is {best}.")


def _chromatic_aberration(result: results.ChromaticAberration) -> Iterator[Chart]:
    """Chart lateral and longitudinal colour."""
    lateral = _by_wavelength(result.edge_wavelengths_nm, result.lateral_um, result.image_height_mm, upright=True)
    names = f"lateral-{result.meridian}", "Lateral colour", "from the middle colour (µm)", "image height (mm)"
    yield Chart(*names, tuple(lateral), levels=_ZERO_X)
    names = f"axial-{result.meridian}", "Longitudinal colour", "wavelength (nm)", "focus on the axis (mm)"
    axial = Series("", result.wavelengths_nm, result.axial_mm, BLUE)
    note = f"Between the ends of the wavelengths asked for: {result.axial_between_ends_mm:.4g} mm."
    yield Chart(*names, (axial,), levels=_ZERO_Y, note=note)


def _illumination(result: results.Illumination) -> Chart:
    """Chart relative illumination."""
    height = result.image_height_mm
    lines = (
        Series("light on the film", height, 100.0 * result.relative, BLUE, SOLID),
        Series("solid angle of the pupil", height, 100.0 * result.pupil, GREEN, DASHED),
        Series("cos⁴ law", height, 100.0 * result.cos4, dashes=DOTTED),
    )
    names = f"illumination-{result.meridian}", "Relative illumination", "image height (mm)", "of the middle's (%)"
    top = max(105.0, 105.0 * float(np.nanmax([1.0, *result.relative, *result.pupil])))
    return Chart(*names, lines, y_range=(0.0, top))


# ---- MTF


def _mtf_charts(study: LensStudy) -> Iterator[Chart]:
    """Chart the MTF by frequency, and over the field, in each meridian."""
    lit = [field for field in study.mtf if np.isfinite(field.tangential).any()]
    for meridian in dict.fromkeys(field.meridian for field in lit):
        fields = [field for field in lit if field.meridian == meridian]
        tangential, sagittal = [field.tangential for field in fields], [field.sagittal for field in fields]
        yield _mtf_by_frequency("tangential", "across the direction to", fields, tangential, study.diffraction_limit)
        yield _mtf_by_frequency("sagittal", "along the direction to", fields, sagittal, study.diffraction_limit)
    yield from (_mtf_over_field(one) for one in study.mtf_over_field if np.isfinite(one.tangential).any())


def _mtf_by_frequency(
    name: str, way: str, fields: Sequence[results.Mtf], contrasts: Sequence[FloatArray], limit: results.DiffractionLimit
) -> Chart:
    """Chart the tangential or the sagittal MTF of fields in one meridian by frequency."""
    lines = [
        Series(
            f"{field.image_height_mm:.3g} mm",
            field.frequencies_per_mm,
            contrast,
            SERIES[number % len(SERIES)],
            # Dotted is the limit.
            _DASHES[number % (len(_DASHES) - 1)],
        )
        for number, (field, contrast) in enumerate(zip(fields, contrasts, strict=True))
    ]
    last = max(float(line.x[-1]) for line in lines)
    lines.append(Series("diffraction limit", limit.frequencies_per_mm, limit.mtf, dashes=DOTTED))
    key, title = f"mtf-{name}-{fields[0].meridian}", f"MTF by frequency, {name}"
    note = f"By image height, of lines {way} the middle."
    return Chart(key, title, "line pairs a millimetre", "contrast", tuple(lines), (0.0, last), (0.0, 1.02), note=note)


def _mtf_over_field(result: results.MtfOverField) -> Chart:
    """Chart the MTF over image height at a few frequencies."""
    lines, entries = [], []
    for number, frequency in enumerate(result.frequencies_per_mm):
        hue = SERIES[number % len(SERIES)]
        lines.append(Series(f"{frequency:g}/mm T", result.image_height_mm, result.tangential[number], hue, SOLID))
        lines.append(Series(f"{frequency:g}/mm S", result.image_height_mm, result.sagittal[number], hue, DASHED))
        entries.append(LegendEntry(f"{frequency:g}/mm", hue))
    names = f"mtf-field-{result.meridian}", "MTF over the field", "image height (mm)", "contrast"
    return Chart(*names, tuple(lines), y_range=(0.0, 1.02), entries=(*entries, *_PLANES))
