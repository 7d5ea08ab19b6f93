"""A study as a self-contained HTML page, and as a folder with the page, its pictures and its data.

The page needs no network, and follows light and dark mode.  Whatever comes from a scene (its name, those of materials)
is escaped.
"""

import io
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytracer.analysis.cost import export, formatting, plots
from raytracer.analysis.cost.results import Study, VariantResult
from raytracer.report import page as html
from raytracer.report import wording
from raytracer.util.atomic_write import check_file, write_bytes
from raytracer.util.errors import InputError, one_line

PAGE = "cost.html"
_NAMES = (PAGE, "cost.csv", "cost.json", "convergence.csv", "convergence.svg", "error_map.png", "error_map.npy")


class Cell(NamedTuple):
    """A cell of the table of variants.

    main : its text.
    ends : its interval as text.
    sort : the number that it is sorted by, as text; "" sorts last.
    number : True for a number, False for words.
    """

    main: str
    ends: str
    sort: str
    number: bool


class Column(NamedTuple):
    """A column of the table of variants.

    number : True if its cells are numbers.
    meaning : what it says and does not say.
    cell : makes the cell of a variant that was measured.
    """

    title: str
    number: bool
    meaning: str
    cell: Callable[[VariantResult], Cell]


_SAME_TIME, _SAME_NOISE = formatting.SAME_TIME.capitalize(), formatting.SAME_NOISE.capitalize()

_MEANINGS = {
    "time_per_spp": (
        "Seconds for one sample in every pixel of the whole picture, over all threads. It does not say how good "
        "the sample is: dearer samples may be the better ones."
    ),
    "time_per_ray": (
        "The same for one ray, be it from the camera, a bounce, or towards a light. An effect may make rays "
        "dearer (more to compute at each hit) or take more of them; this tells which."
    ),
    "rays_per_sample": (
        "How many rays a sample takes on average. It counts rays and not their length or what they meet."
    ),
    "time_ratio": (
        f'Time per sample over that of the scene in the same round: 0.84 is 16 % faster without it. "{_SAME_TIME}" '
        "means that two runs of the very same scene differ as much; it does not mean that the difference is 0."
    ),
    "noise": (
        f'Relative error by chance alone, at equal samples, not equal time. "{_SAME_NOISE}" means as noisy as the '
        "scene, as far as could be told. A quiet picture of something else is no better picture: see the bias."
    ),
    "noise_ratio": (
        "How many times the samples it takes to be as free of noise as the scene, roughly. Times the ratio of "
        "times, it is the ratio of the work."
    ),
    "bias": (
        "How far the picture is from that of the scene when all noise is gone (RMS, relative), where its square "
        "exceeds three standard deviations of what is measured of variants without any. It stays however many "
        'samples are taken. "Not resolved" means that it is smaller than what these rounds could see, given in '
        "brackets; not that there is none. It is against the scene as it is, which may itself be an "
        "approximation."
    ),
    "brightness": (
        "How much brighter the picture as a whole is than that of the scene. A bias may leave it as it is: light "
        "that is lost here may turn up there."
    ),
}
"""Notes on the columns of the table of variants."""


def _columns(study: Study) -> list[Column]:
    """Make the columns of the table of variants, without that of their names."""
    spp = formatting.common_spp(study.variants)
    target = wording.format_given_percent(study.prediction.target)
    reached = (
        f"Predicted time until noise and bias together are {target}, compiling apart; as the scene's where neither "
        "time nor noise nor bias differs. It is blank where the bias exceeds the target, since no number of samples "
        "mends a bias."
    )

    def noise(variant: VariantResult) -> Cell:
        at = f" at {variant.spp:,} spp" if spp is None and variant.spp else ""
        return _cell(formatting.format_noise(variant) + at, variant.noise.value)

    def per_sample(variant: VariantResult) -> Cell:
        return _cell(wording.format_duration_interval(variant.per_sample), variant.per_sample.value, number=True)

    def per_ray(variant: VariantResult) -> Cell:
        return _cell(formatting.format_per_ray(variant.per_ray.value), variant.per_ray.value, number=True)

    def rays(variant: VariantResult) -> Cell:
        return _cell(wording.format_number(variant.rays_per_sample), variant.rays_per_sample, number=True)

    return [
        Column("time against the scene", False, _MEANINGS["time_ratio"], _time_ratio),
        Column(f"noise at {spp:,} spp" if spp else "noise", False, _MEANINGS["noise"], noise),
        Column("bias against the scene", False, _MEANINGS["bias"], _bias),
        Column(f"time to {target}", True, reached, _target),
        Column("time per spp", True, _MEANINGS["time_per_spp"], per_sample),
        Column("time per ray", True, _MEANINGS["time_per_ray"], per_ray),
        Column("rays per sample", True, _MEANINGS["rays_per_sample"], rays),
        Column("squared noise against the scene", False, _MEANINGS["noise_ratio"], _noise_ratio),
        Column("brightness", False, _MEANINGS["brightness"], _brightness),
    ]


def _key(value: float | None) -> str:
    """Format a number to sort by: infinity after all others; "" if it is unknown."""
    if value is None or math.isnan(value):
        return ""
    return repr(float(value)) if math.isfinite(value) else "1e308"


def _cell(words: str, value: float | None, number: bool = False) -> Cell:
    main, bracket, ends = words.partition(" (")
    return Cell(main, bracket.strip() + ends, _key(value), number)


def _cells(variant: VariantResult, columns: Sequence[Column]) -> list[Cell]:
    if not variant.failed:
        return [column.cell(variant) for column in columns]
    said = ["not measured", one_line(variant.failed), *[""] * len(columns)]
    return [Cell(words, "", "", False) for words in said[: len(columns)]]


def _time_ratio(variant: VariantResult) -> Cell:
    return _cell(formatting.format_time_ratio(variant), variant.time.value)


def _bias(variant: VariantResult) -> Cell:
    return _cell(formatting.format_bias(variant), None if variant.bias is None else variant.bias.value)


def _target(variant: VariantResult) -> Cell:
    doubt, seconds = one_line(variant.why_blank), variant.target_seconds
    return Cell(formatting.format_target_time(variant), doubt, _key(seconds), number=seconds is not None)


def _noise_ratio(variant: VariantResult) -> Cell:
    if variant.group == "scene":
        return _cell("", variant.noise_ratio.value)
    ratio = wording.format_interval(variant.noise_ratio)
    is_same = not variant.noise_differs and not math.isnan(variant.noise_ratio.value)
    return _cell(formatting.SAME_NOISE if is_same else ratio, variant.noise_ratio.value)


def _brightness(variant: VariantResult) -> Cell:
    if variant.brightness is None:
        return _cell("" if variant.group == "scene" else wording.UNKNOWN, None)
    return _cell(wording.format_percent_interval(variant.brightness), variant.brightness.value)


class _File(NamedTuple):
    name: str
    type: str
    what: str
    content: bytes

    @property
    def address(self) -> str:
        return html.data_uri(self.content, self.type)


def _data(study: Study) -> list[_File]:
    as_json = json.dumps(export.to_json(study), indent=2, allow_nan=False) + "\n"
    return [
        _File("cost.csv", "text/csv", "the table of costs, with all intervals", export.to_csv(study).encode()),
        _File(
            "convergence.csv",
            "text/csv",
            "samples, seconds and errors of the plot",
            export.convergence_csv(study).encode(),
        ),
        _File("cost.json", "application/json", "all that is on this page but its pictures", as_json.encode()),
    ]


def page(study: Study) -> bytes:
    """Render the page as HTML (UTF-8)."""
    convergence, error_map, picture = (
        plots.convergence_for_page(study),
        plots.error_map_for_page(study),
        plots.picture_png(study),
    )
    machine, columns = formatting.machine_rows(study), _columns(study)
    if study.seconds:
        machine.append(("time spent", formatting.format_phases(study)))
    rounds = formatting.format_rounds(study)
    concentration = formatting.format_concentration(study) if math.isfinite(study.top_share) else ""
    values: dict[str, Any] = {
        "scene": one_line(study.scene),
        "extent": formatting.format_extent(study),
        "headline": formatting.headline(study),
        "warnings": [one_line(warning) for warning in study.warnings],
        "convergence": convergence and convergence.picture,
        "map": error_map and error_map.picture,
        "picture": picture and html.data_uri(picture, "image/png"),
        "sampled": study.tiles_measured < study.tiles,
        "points": [
            {
                "spp": f"{point.spp:,}",
                "time": wording.format_duration(point.seconds),
                "error": wording.format_percent_interval(point.error),
            }
            for point in study.prediction.points
        ],
        "prediction": formatting.prediction_rows(study.prediction),
        "concentration": f"{concentration[:1].upper()}{concentration[1:]}." if concentration else "",
        "rounds": rounds and f"{rounds[:1].upper()}{rounds[1:]}.",
        "columns": columns,
        "variants": [
            {
                "name": formatting.display_name(variant),
                "what": "" if variant.group == "scene" else one_line(variant.what),
                "cells": _cells(variant, columns),
            }
            for section in formatting.group_variants(study.variants)
            for variant in section.variants
        ],
        "plan": formatting.plan_sections(study),
        "machine": machine,
        "files": _data(study),
    }
    charts = {key: figure.data for key, figure in (("convergence", convergence), ("map", error_map)) if figure}
    title = f"{study.scene}: what accuracy costs in time"
    return html.page("cost", title, {"charts": charts}, parts=("chart",), values=values)


def check_report(folder: str | Path) -> None:
    """Make sure, before anything is measured, that a report can be written into `folder`.

    Raises
    ------
    InputError : a file of the report could not be written there.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, and not a folder for a report")
    for name in _NAMES:
        check_file(folder / name)


def write_report(study: Study, folder: str | Path) -> tuple[Path, ...]:
    """Write the page, its pictures and its data into `folder`, which is made if need be.

    `error_map.npy` holds the map's numbers, float32 (height, width), nan where not measured.  A picture that would show
    nothing is left out.

    Returns
    -------
    The files, the page first.

    Raises
    ------
    OutputError : a file cannot be written.
    """
    contents: dict[str, bytes | None] = {PAGE: page(study)}
    contents |= {file.name: file.content for file in _data(study)}
    contents["convergence.svg"] = plots.convergence_svg(study)
    contents["error_map.png"] = plots.error_map_png(study)
    if plots.has_error_map(study):
        numbers = io.BytesIO()
        np.save(numbers, study.error_map.astype(np.float32), allow_pickle=False)
        contents["error_map.npy"] = numbers.getvalue()

    written = []
    for name, data in contents.items():
        if data is not None:
            path = Path(folder) / name
            write_bytes(path, data)
            written.append(path)
    return tuple(written)
