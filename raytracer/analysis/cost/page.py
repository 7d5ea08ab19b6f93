"""A study as a self-contained HTML page, and as a folder with the page, its pictures and its data.

The page needs no network, and follows light and dark mode.  Whatever comes from a scene (its name, those of materials)
is escaped.
"""

import io
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raytracer.analysis.cost import export, formatting, plots
from raytracer.analysis.cost.results import Study, VariantResult
from raytracer.core.error_estimate.intervals import Interval
from raytracer.report import page as html
from raytracer.util.atomic_write import check_file, write_bytes
from raytracer.util.errors import InputError, one_line

PAGE = "cost.html"


class _Data(NamedTuple):
    """A file of data: its type, what it holds, and what writes it."""

    media_type: str
    what: str
    write: Callable[[Study], str]


_DATA = {
    "cost.csv": _Data("text/csv", "the table of costs, with all intervals", export.to_csv),
    "convergence.csv": _Data("text/csv", "samples, seconds and errors of the plot", export.convergence_csv),
    "cost.json": _Data("application/json", "all that is on this page but its pictures", export.json_text),
}
_NAMES = (PAGE, *_DATA, "convergence.svg", "error_map.png", "error_map.npy")


def _key(value: float | None) -> str:
    """Format a number to sort by: infinity after all others; "" if it is unknown."""
    if value is None or math.isnan(value):
        return ""
    return repr(float(value)) if math.isfinite(value) else "1e308"


def _cell(main: str, ends: str = "", sort: str = "", *, number: bool = False) -> dict[str, Any]:
    """Make a cell: its text, its interval as text, the number that it is sorted by, "" being last."""
    return {"main": main, "ends": ends, "sort": sort, "number": number}


def _cells(variant: VariantResult, columns: Mapping[str, formatting.Column]) -> list[dict[str, Any]]:
    if variant.failed:
        said = ["not measured", one_line(variant.failed), *[""] * len(columns)]
        return [_cell(words) for words in said[: len(columns)]]
    cells = []
    for key, column in columns.items():
        main, bracket, ends = column.words(variant).partition(" (")
        value = getattr(variant, key)
        value = value.value if isinstance(value, Interval) else value
        if key == "target_seconds":
            cells.append(_cell(main, one_line(variant.why_blank), _key(value), number=value is not None))
        else:
            cells.append(_cell(main, bracket.strip() + ends, _key(value), number=column.is_number))
    return cells


def page(study: Study) -> bytes:
    """Render the page as HTML (UTF-8)."""
    convergence, error_map, picture = (
        plots.convergence_for_page(study),
        plots.error_map_for_page(study),
        plots.picture_png(study),
    )
    columns = formatting.columns(study)
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
        "points": formatting.point_rows(study.prediction),
        "prediction": formatting.prediction_rows(study.prediction),
        "concentration": f"{concentration[:1].upper()}{concentration[1:]}." if concentration else "",
        "rounds": rounds and f"{rounds[:1].upper()}{rounds[1:]}.",
        "columns": columns.values(),
        "variants": [
            {
                "name": formatting.display_name(variant),
                "what": "" if variant.group == "scene" else one_line(variant.what),
                "cells": _cells(variant, columns),
            }
            for _, variants in formatting.group_variants(study.variants)
            for variant in variants
        ],
        "plan": formatting.plan_sections(study),
        "machine": formatting.machine_rows(study),
        "files": [
            {"name": name, "what": data.what, "address": html.data_uri(data.write(study).encode(), data.media_type)}
            for name, data in _DATA.items()
        ],
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
    contents |= {name: data.write(study).encode() for name, data in _DATA.items()}
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
