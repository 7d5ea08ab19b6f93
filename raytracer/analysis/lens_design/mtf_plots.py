"""Charts of the MTF of a study: by frequency, and over the field."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.analysis.lens_design.performance.results import DiffractionLimit, Mtf, MtfOverField
from raytracer.report.chart import DASH_DOTTED, DASHED, DOTTED, SOLID, Chart, LegendEntry, Series
from raytracer.report.palette import SERIES

PLANES = (LegendEntry("T"), LegendEntry("S", dashes=DASHED))
"""Dashes of tangential and sagittal lines, in charts whose colours say something else."""

# Of fields; dotted is the limit.
_DASHES = (SOLID, DASHED, DASH_DOTTED)


def mtf_charts(study: LensStudy) -> list[Chart]:
    """Chart the MTF by frequency, and over the field, in each meridian."""
    lit = [field for field in study.mtf if np.isfinite(field.tangential).any()]
    charts = []
    for meridian in dict.fromkeys(field.meridian for field in lit):
        fields = [field for field in lit if field.meridian == meridian]
        charts += [
            _mtf_by_frequency("tangential", "across the direction to", fields, study.diffraction_limit),
            _mtf_by_frequency("sagittal", "along the direction to", fields, study.diffraction_limit),
        ]
    return [*charts, *(_mtf_over_field(one) for one in study.mtf_over_field if np.isfinite(one.tangential).any())]


def _mtf_by_frequency(
    name: Literal["tangential", "sagittal"], way: str, fields: Sequence[Mtf], limit: DiffractionLimit
) -> Chart:
    """Chart the tangential or the sagittal MTF of fields in one meridian by frequency."""
    lines = [
        Series(
            f"{field.image_height_mm:.3g} mm",
            field.frequencies_per_mm,
            getattr(field, name),
            SERIES[number % len(SERIES)],
            _DASHES[number % len(_DASHES)],
        )
        for number, field in enumerate(fields)
    ]
    last = max(float(line.x[-1]) for line in lines)
    return Chart(
        f"mtf-{name}-{fields[0].meridian}",
        f"MTF by frequency, {name}",
        "line pairs a millimetre",
        "contrast",
        (*lines, Series("diffraction limit", limit.frequencies_per_mm, limit.mtf, dashes=DOTTED)),
        (0.0, last),
        (0.0, 1.02),
        note=f"By image height, of lines {way} the middle.",
    )


def _mtf_over_field(result: MtfOverField) -> Chart:
    """Chart the MTF over image height at a few frequencies."""
    lines, entries = [], []
    for number, frequency in enumerate(result.frequencies_per_mm):
        hue = SERIES[number % len(SERIES)]
        lines.append(Series(f"{frequency:g}/mm T", result.image_height_mm, result.tangential[number], hue, SOLID))
        lines.append(Series(f"{frequency:g}/mm S", result.image_height_mm, result.sagittal[number], hue, DASHED))
        entries.append(LegendEntry(f"{frequency:g}/mm", hue))
    return Chart(
        f"mtf-field-{result.meridian}",
        "MTF over the field",
        "image height (mm)",
        "contrast",
        tuple(lines),
        y_range=(0.0, 1.02),
        entries=(*entries, *PLANES),
    )
