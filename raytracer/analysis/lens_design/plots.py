"""The charts of a study."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.glass import LINE_C, LINE_D, LINE_F
from raytracer.lens_report.analysis.results import (
    Colour,
    Distortion,
    Fan,
    FieldCurvature,
    Illumination,
    MtfOverField,
    Spherical,
    Spot,
    SpotsOfField,
)
from raytracer.lens_report.analysis.study import Study
from raytracer.lens_report.charts import DASH_DOTTED, DASHED, DOTTED, SOLID, Chart, Level, Range, Series
from raytracer.lens_report.svg import BLUE, GREEN, HUES, INK, OCHRE, PURPLE, VERMILLION

_LINES = {LINE_F: "F", LINE_D: "d", LINE_C: "C"}

# The shortest wavelength (nm) of each of these colours is that before it.
_OF_WAVELENGTH = ((450.0, PURPLE), (500.0, BLUE), (600.0, GREEN), (620.0, OCHRE))
_DASHES = (SOLID, DASHED, DASH_DOTTED, DOTTED)

# Few enough dots that a page of many spots stays small; they are a fair part of the rays, in the order of the pupil.
_MOST_DOTS = 400

Array = NDArray[np.float64]


class Group(NamedTuple):
    """Charts that belong together, with what is to be said of them; `columns` of a table of bare ones, else 0."""

    key: str
    title: str
    text: str
    charts: tuple[Chart, ...]
    columns: int = 0


def wavelength_name(nm: float) -> str:
    """`587.6 nm (d)`."""
    letter = _LINES.get(nm)
    return f"{nm:.1f} nm ({letter})" if letter else f"{nm:g} nm"


def wavelength_hue(nm: float) -> str:
    """A colour of the palette for a wavelength."""
    return next((hue for end, hue in _OF_WAVELENGTH if nm < end), VERMILLION)


def projection(name: str) -> str:
    """An ideal projection as it is written."""
    return name.replace("theta", "θ") if "theta" in name else f"{name} θ"


def groups(study: Study) -> tuple[Group, ...]:
    """All charts, by what they are about; a group that the study has nothing for is left out."""
    found = (
        Group(
            "spots",
            "Spot diagrams",
            "Where the rays of one point of the scene land on the film. A row for each place in the picture, a column "
            "for each wavelength, and one for all of them; upwards is away from the middle of the picture. All frames "
            "have the same size. Below each: the RMS and the largest distance from the middle of the spot.",
            *_spots(study),
        ),
        Group(
            "spherical",
            "Spherical aberration",
            "Where rays of a point on the axis meet the axis again, by their height in the pupil. A lens without "
            "spherical aberration draws vertical lines, one without colour errors the same for all wavelengths.",
            tuple(chart for result in study.spherical for chart in _spherical(result)),
        ),
        Group(
            "fans",
            "Ray fans",
            "How far from the chief ray's place on the film the other rays land, over the pupil, for each place in "
            "the picture: tangential in the plane of the axis, sagittal across it. A slope is defocus, a parabola "
            "coma, an S spherical aberration.",
            tuple(_fans(study)),
        ),
        Group(
            "curvature",
            "Field curvature and astigmatism",
            "Where narrow beams are sharp, from the film: what differs between tangential and sagittal is astigmatism.",
            tuple(_curvature(result) for result in study.field_curvature),
        ),
        Group(
            "distortion",
            "Distortion",
            "How much farther out a point lands than the ideal projection says: below 0 is a barrel, above a cushion.",
            tuple(_distortion(result) for result in study.distortion),
        ),
        Group(
            "colour",
            "Colour errors",
            "Lateral: how far off the middle colour's place the others land, which gives coloured fringes. "
            "Longitudinal: where each wavelength is sharp on the axis.",
            tuple(chart for result in study.colour for chart in _colours(result)),
        ),
        Group(
            "illumination",
            "Relative illumination",
            "Light on the film of an evenly bright scene, against the middle of the picture.",
            tuple(_illumination(result) for result in study.illumination),
        ),
        Group(
            "mtf",
            "Geometric MTF",
            "The contrast of fine lines, by the spots' rays. Diffraction is not simulated: the dotted line is the "
            "limit that it sets to a perfect lens of this f-number, and no real lens is above it.",
            tuple(_mtf(study)),
        ),
    )
    several = len(study.first_order) > 1
    return tuple(_told_apart(group) if several else group for group in found if group.charts)


def _told_apart(group: Group) -> Group:
    """The titles of a lens with cylinders say the plane that they are of, which is the last letter of their keys."""
    charts = (replace(chart, title=f"{chart.title}, in the plane of {chart.key[-1]}") for chart in group.charts)
    return group._replace(charts=tuple(charts))


def _by_wavelength(wavelengths: Iterable[float], values: Array, along: Array, *, upright: bool) -> list[Series]:
    """A line for each wavelength: its values over `along`, or beside it where the chart is `upright`."""
    found = []
    for number, (nm, row) in enumerate(zip(wavelengths, values, strict=True)):
        x, y = (row, along) if upright else (along, row)
        found.append(
            Series(wavelength_name(float(nm)), x, y, wavelength_hue(float(nm)), _DASHES[number % len(_DASHES)])
        )
    return found


# ---- Spots


def _spots(study: Study) -> tuple[tuple[Chart, ...], int]:
    """A row for each field, and how many charts there are in it."""
    fields = [field for field in study.spots if any(len(_landed(spot)) for spot in field.spots)]
    if not fields:
        return (), 0
    half = _half_width(fields)
    charts = []
    for field in fields:
        place = f"{field.image_height_mm:.3g} mm ({field.field_deg:.3g}°)"
        key = f"spot-{field.field:g}"
        for number, spot in enumerate(field.spots):
            title = f"{place}, {wavelength_name(spot.wavelength_nm)}"
            charts.append(
                _frame(f"{key}-{number}-{field.meridian}", title, (_dots(spot),), half, spot.rms_um, spot.largest_um)
            )
        together = tuple(_dots(spot) for spot in field.spots)
        title = f"{place}, all"
        charts.append(_frame(f"{key}-all-{field.meridian}", title, together, half, field.rms_um, field.largest_um))
    return tuple(charts), len(fields[0].spots) + 1


def _landed(spot: Spot) -> Array:
    """The points of rays that get through."""
    return spot.points_um[np.isfinite(spot.points_um).all(axis=1)]


def _half_width(fields: Sequence[SpotsOfField]) -> float:
    """Half the side of all frames (um): a round number that holds nearly all rays of the largest spot."""
    landed = [points for field in fields for spot in field.spots if len(points := _landed(spot))]
    wanted = 1.1 * max([0.5, *(float(np.quantile(np.abs(points), 0.98)) for points in landed)])
    power: float = 10.0 ** math.floor(math.log10(wanted))
    return next(power * m for m in (1.0, 2.0, 3.0, 5.0, 10.0) if power * m >= wanted)


def _dots(spot: Spot) -> Series:
    points = _landed(spot)
    # A stride would pick columns of the pupil's grid.
    chosen = np.random.default_rng(0).permutation(len(points))[:_MOST_DOTS]
    nm = spot.wavelength_nm
    return Series(wavelength_name(nm), points[chosen, 0], points[chosen, 1], wavelength_hue(nm), mark="dots")


def _frame(key: str, title: str, series: tuple[Series, ...], half: float, rms: float, largest: float) -> Chart:
    note = f"RMS {rms:.3g} µm, largest {largest:.3g} µm" if np.isfinite(rms) else "no light"
    ends = (-half, half)
    return Chart(key, title, "x (µm)", "y (µm)", series, ends, ends, equal=True, bare=True, note=note)


def frame_size_um(group: Group) -> float:
    """The side of the frames of spot diagrams (um)."""
    low, high = group.charts[0].ranges()[0]
    return high - low


# ---- Over the pupil


def _spherical(result: Spherical) -> list[Chart]:
    lines = _by_wavelength(result.wavelengths_nm, result.longitudinal_mm, result.pupil, upright=True)
    if np.isfinite(result.third_order_mm).any():
        lines.append(Series("third order (Seidel)", result.third_order_mm, result.pupil, INK, DOTTED))
    charts = [
        Chart(
            f"lsa-{result.meridian}",
            "Longitudinal spherical aberration",
            "from the paraxial image (mm)",
            "height in the pupil",
            tuple(lines),
            y_range=(0.0, 1.0),
            levels=(Level("x", 0.0),),
        )
    ]
    if np.isfinite(result.sine_condition).any():
        charts.append(
            Chart(
                f"osc-{result.meridian}",
                "Offence against the sine condition",
                "offence",
                "height in the pupil",
                (Series("", result.sine_condition, result.pupil, BLUE),),
                y_range=(0.0, 1.0),
                levels=(Level("x", 0.0),),
                note="Where it is 0 there is no coma close to the axis.",
            )
        )
    return charts


def _fans(study: Study) -> list[Chart]:
    lit = [fan for fan in study.fans if np.isfinite(fan.tangential_um).any()]
    # One scale, so that fields can be compared; the few worst rays would flatten all others.
    values = [np.abs(values[np.isfinite(values)]) for fan in lit for values in (fan.tangential_um, fan.sagittal_um)]
    most = 1.1 * max((float(np.quantile(v, 0.97)) for v in values if v.size), default=1.0) or 1.0
    return [chart for fan in lit for chart in _fan(fan, (-most, most))]


def _fan(fan: Fan, ends: Range) -> list[Chart]:
    found = []
    for name, values in (("tangential", fan.tangential_um), ("sagittal", fan.sagittal_um)):
        found.append(
            Chart(
                f"fan-{name}-{fan.field:g}-{fan.meridian}",
                f"{name.capitalize()}, {fan.field_deg:.3g}° off the axis",
                "height in the pupil",
                "from the chief ray (µm)",
                tuple(_by_wavelength(fan.wavelengths_nm, values, fan.pupil, upright=False)),
                (-1.0, 1.0),
                ends,
                levels=(Level("x", 0.0), Level("y", 0.0)),
            )
        )
    return found


# ---- Over the field


def _curvature(result: FieldCurvature) -> Chart:
    lines = []
    # Colours by wavelength, dashes by plane.
    for nm, tangential, sagittal in zip(result.wavelengths_nm, result.tangential_mm, result.sagittal_mm, strict=True):
        name, hue = wavelength_name(float(nm)), wavelength_hue(float(nm))
        lines.append(Series(f"T, {name}", tangential, result.image_height_mm, hue, SOLID))
        lines.append(Series(f"S, {name}", sagittal, result.image_height_mm, hue, DASHED))
    if np.isfinite(result.petzval_mm).any():
        lines.append(Series("Petzval surface", result.petzval_mm, result.image_height_mm, INK, DOTTED))
    return Chart(
        f"curvature-{result.meridian}",
        "Field curvature",
        "focus from the film (mm)",
        "image height (mm)",
        tuple(lines),
        levels=(Level("x", 0.0),),
        note="T: tangential, in the plane of the axis. S: sagittal, across it.",
    )


def _distortion(result: Distortion) -> Chart:
    lines = [Series("against f tan θ", result.percent, result.image_height_mm, BLUE, SOLID)]
    best = projection(result.projection)
    if result.projection != "f tan":
        lines.append(Series(f"against {best}", result.projection_percent, result.image_height_mm, VERMILLION, DASHED))
    worst = np.nanmax(np.abs(result.percent)) if np.isfinite(result.percent).any() else 0.0
    # What is nearly nothing is not to look like something.
    ends = (-1.0, 1.0) if worst < 0.9 else None
    return Chart(
        f"distortion-{result.meridian}",
        "Distortion",
        "distortion (%)",
        "image height (mm)",
        tuple(lines),
        ends,
        levels=(Level("x", 0.0),),
        note=f"The projection that fits best is {best}.",
    )


def _colours(result: Colour) -> list[Chart]:
    lateral = _by_wavelength(result.edge_wavelengths_nm, result.lateral_um, result.image_height_mm, upright=True)
    return [
        Chart(
            f"lateral-{result.meridian}",
            "Lateral colour",
            "from the middle colour (µm)",
            "image height (mm)",
            tuple(lateral),
            levels=(Level("x", 0.0),),
        ),
        Chart(
            f"axial-{result.meridian}",
            "Longitudinal colour",
            "wavelength (nm)",
            "focus on the axis (mm)",
            (Series("", result.wavelengths_nm, result.axial_mm, BLUE),),
            levels=(Level("y", 0.0),),
            note=f"Between the ends of the wavelengths asked for: {result.axial_between_ends_mm:.4g} mm.",
        ),
    ]


def _illumination(result: Illumination) -> Chart:
    height = result.image_height_mm
    return Chart(
        f"illumination-{result.meridian}",
        "Relative illumination",
        "image height (mm)",
        "of the middle's (%)",
        (
            Series("light on the film", height, 100.0 * result.relative, BLUE, SOLID),
            Series("solid angle of the pupil", height, 100.0 * result.pupil, GREEN, DASHED),
            Series("cos⁴ law", height, 100.0 * result.cos4, INK, DOTTED),
        ),
        y_range=(0.0, max(105.0, 105.0 * float(np.nanmax([1.0, *result.relative, *result.pupil])))),
    )


def _mtf(study: Study) -> list[Chart]:
    limit = study.diffraction_limit
    lines = []
    for number, field in enumerate(m for m in study.mtf if np.isfinite(m.tangential).any()):
        hue, name = HUES[number % len(HUES)], f"{field.image_height_mm:.3g} mm"
        if len(study.first_order) > 1:
            name = f"{field.meridian} {name}"
        lines.append(Series(f"{name} T", field.frequencies_per_mm, field.tangential, hue, SOLID))
        lines.append(Series(f"{name} S", field.frequencies_per_mm, field.sagittal, hue, DASHED))
    if not lines:
        return []
    lines.append(Series("diffraction limit", limit.frequencies_per_mm, limit.mtf, INK, DOTTED))
    last = max(float(line.x[-1]) for line in lines[:-1])
    over = [_mtf_over_field(result) for result in study.mtf_over_field if np.isfinite(result.tangential).any()]
    return [
        Chart(
            "mtf",
            "MTF by frequency",
            "line pairs a millimetre",
            "contrast",
            tuple(lines),
            (0.0, last),
            (0.0, 1.02),
            note="By image height. T: lines across the direction to the middle. S: lines along it.",
        ),
        *over,
    ]


def _mtf_over_field(result: MtfOverField) -> Chart:
    lines = []
    for number, frequency in enumerate(result.frequencies_per_mm):
        hue = HUES[number % len(HUES)]
        lines.append(Series(f"{frequency:g}/mm T", result.image_height_mm, result.tangential[number], hue, SOLID))
        lines.append(Series(f"{frequency:g}/mm S", result.image_height_mm, result.sagittal[number], hue, DASHED))
    return Chart(
        f"mtf-field-{result.meridian}",
        "MTF over the field",
        "image height (mm)",
        "contrast",
        tuple(lines),
        y_range=(0.0, 1.02),
    )
