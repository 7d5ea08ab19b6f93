"""Report on a lens as one self-contained page of HTML."""

import re
from typing import Any

from raytracer import __version__
from raytracer.analysis.lens_design import text
from raytracer.analysis.lens_design.cross_section.drawing import CrossSection, cross_sections
from raytracer.analysis.lens_design.cross_section.to_svg import render_svg
from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.analysis.lens_design.plots import ChartGroup, chart_groups, frame_size_um
from raytracer.analysis.lens_design.text import Table
from raytracer.optics.lens_system.lens import Lens
from raytracer.report import chart as charts
from raytracer.report import page as html
from raytracer.report.chart import Chart


def page(lens: Lens, study: LensStudy) -> bytes:
    """Write the report as HTML (UTF-8)."""
    third = text.seidel(study)
    before = [*text.first_order(study), text.surfaces(lens)]
    after = [*([third] if third else []), *text.tolerances(study)]
    data = {
        "version": __version__,
        "name": study.name,
        "source": study.source,
        "setting": text.setting(study),
        "drawings": [_drawing_data(one) for one in cross_sections(lens, study)],
        "tables_before": [_table_data(table) for table in before],
        "groups": [_group_data(group) for group in chart_groups(study)],
        "tables_after": [_table_data(table) for table in after],
        "notes": [{"topic": text.topic(note), "reason": note.reason} for note in text.notes(study)],
    }
    return html.page("lens", f"{study.name}: report", data)


def caption(shown: CrossSection) -> str:
    """Write the caption of a cross-section."""
    words = (
        "Blue glass has an Abbe number above 50, brown below; grey does not disperse. Coloured lines are rays traced "
        "from points of the scene, heavy bars the stop and the film."
    )
    if shown.outside:
        words += f" Outside the picture: {', '.join(f'{mark.name} at {mark.z:.4g} mm' for mark in shown.outside)}."
    return words


def _drawing_data(shown: CrossSection) -> dict[str, Any]:
    """Convert a cross-section to data of the page."""
    return {"title": shown.title, "picture": render_svg(shown), "caption": caption(shown)}


def _table_data(table: Table) -> dict[str, Any]:
    """Convert a table to data of the page."""
    key = re.sub(r"[^a-z]+", "-", table.title.lower()).strip("-")
    rows = [row._asdict() for row in table.rows]
    return {"key": key, "title": table.title, "text": table.text, "head": table.head, "rows": rows}


def _group_data(group: ChartGroup) -> dict[str, Any]:
    """Convert a group of charts to data of the page."""
    words = group.text
    if group.columns:
        words += f" The side of a frame is {frame_size_um(group):g} µm."
    return {
        "key": group.key,
        "title": group.title,
        "text": words,
        "columns": group.columns,
        "charts": [_chart_data(chart) for chart in group.charts],
    }


def _chart_data(chart: Chart) -> dict[str, Any]:
    """Convert a chart to data of the page."""
    values: dict[str, Any] = {
        "key": chart.key,
        "title": chart.title,
        "note": chart.note,
        "picture": charts.render_svg(chart, 150.0 if chart.bare else 400.0),
    }
    # Dots are too many for a table of numbers.
    if not chart.bare:
        values |= {"x_label": chart.x_label, "y_label": chart.y_label}
        values["series"] = [{"label": series.label, "x": series.x, "y": series.y} for series in chart.series]
    return values
