"""A report on a lens as one page of HTML that holds all it shows."""

import re
from typing import Any

from raytracer import __version__, pages
from raytracer.lens_report import charts, drawing, text
from raytracer.lens_report.analysis.study import Study
from raytracer.lens_report.charts import Chart
from raytracer.lens_report.drawing import Drawing
from raytracer.lens_report.plots import Group, frame_size_um, groups
from raytracer.lens_report.text import Table
from raytracer.lenses.lens import Lens


def page(lens: Lens, study: Study) -> bytes:
    """The report (UTF-8)."""
    third = text.seidel(study)
    before = [*text.first_order(study), text.surfaces(lens)]
    after = [*([third] if third else []), *text.tolerances(study)]
    data = {
        "version": __version__,
        "name": study.name,
        "source": study.source,
        "setting": text.setting(study),
        "drawings": [_drawing(one) for one in drawing.sections(lens, study)],
        "tables_before": [_table(table) for table in before],
        "groups": [_group(group) for group in groups(study)],
        "tables_after": [_table(table) for table in after],
        "notes": [{"topic": text.topic(note), "reason": note.reason} for note in text.notes(study)],
    }
    return pages.page("lens", f"{study.name}: report", data)


def caption(shown: Drawing) -> str:
    """What is to be said of a drawing."""
    said = (
        "Blue glass has an Abbe number above 50, brown below; grey does not disperse. Coloured lines are rays traced "
        "from points of the scene, heavy bars the stop and the film."
    )
    if shown.outside:
        said += f" Outside the picture: {', '.join(f'{mark.name} at {mark.z:.4g} mm' for mark in shown.outside)}."
    return said


def _drawing(shown: Drawing) -> dict[str, Any]:
    return {"title": shown.title, "picture": drawing.picture(shown), "caption": caption(shown)}


def _table(table: Table) -> dict[str, Any]:
    key = re.sub(r"[^a-z]+", "-", table.title.lower()).strip("-")
    rows = [row._asdict() for row in table.rows]
    return {"key": key, "title": table.title, "text": table.text, "head": table.head, "rows": rows}


def _group(group: Group) -> dict[str, Any]:
    said = group.text
    if group.columns:
        said += f" The side of a frame is {frame_size_um(group):g} µm."
    return {
        "key": group.key,
        "title": group.title,
        "text": said,
        "columns": group.columns,
        "charts": [_chart(chart) for chart in group.charts],
    }


def _chart(chart: Chart) -> dict[str, Any]:
    found: dict[str, Any] = {
        "key": chart.key,
        "title": chart.title,
        "note": chart.note,
        "picture": charts.picture(chart, 150.0 if chart.bare else 400.0),
    }
    # Of dots there are too many to be read.
    if not chart.bare:
        found |= {"x_label": chart.x_label, "y_label": chart.y_label}
        found["series"] = [{"label": series.label, "x": series.x, "y": series.y} for series in chart.series]
    return found
