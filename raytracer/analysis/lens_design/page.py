"""Report on a lens as one self-contained page of HTML."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from raytracer import __version__
from raytracer.analysis.lens_design import text
from raytracer.analysis.lens_design.cross_section.drawing import CrossSection, cross_sections
from raytracer.analysis.lens_design.cross_section.plot import figure_of, names_of
from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.analysis.lens_design.plots import ChartGroup, chart_groups, frame_size_um
from raytracer.optics.lens_system.lens import Lens
from raytracer.report import chart as charts
from raytracer.report import page as html
from raytracer.report.figure import IN_PAGE, PageFigure, inline_svg, style, to_svg
from raytracer.report.table import Table
from raytracer.report.wording import significant

if TYPE_CHECKING:
    from markupsafe import Markup

# Widths (inches) and letters (pt) of the cross-section for wide windows and for narrow ones.
_WIDE, _NARROW = (9.5, 8.5), (3.7, 7.5)


def page(lens: Lens, study: LensStudy) -> bytes:
    """Write the report as HTML (UTF-8)."""
    third = text.seidel(study)
    groups = [_group(group) for group in chart_groups(study)]
    values = {
        "version": __version__,
        "name": study.name,
        "source": study.source,
        "setting": text.setting(study),
        "drawings": [
            {
                "title": one.title,
                "wide": _drawing(one, *_WIDE, f"wide-{number}"),
                "narrow": _drawing(one, *_NARROW, f"narrow-{number}"),
                "caption": caption(one),
            }
            for number, one in enumerate(cross_sections(lens, study), start=1)
        ],
        "before": _with_keys([*text.first_order(study), text.surfaces(lens)]),
        "groups": groups,
        "after": _with_keys([*([third] if third else []), *text.tolerances(study)]),
        "notes": [(text.topic(note), note.reason) for note in text.notes(study)],
    }
    data = {"charts": {chart.key: figure.data for group in groups for chart, figure in group["figures"]}}
    return html.page("lens", f"{study.name}: report", data, parts=("chart",), values=values)


def caption(shown: CrossSection) -> str:
    """Write the caption of a cross-section."""
    words = (
        "Blue glass has an Abbe number above 50, brown below; grey does not disperse. Coloured lines are rays traced "
        "from points of the scene, heavy bars the stop and the film."
    )
    if shown.outside:
        places = ", ".join(f"{mark.name} at {significant(mark.z)} mm" for mark in shown.outside)
        words += f" Outside the picture: {places}."
    return words


def _drawing(shown: CrossSection, width: float, letters: float, key: str) -> "Markup":
    """Draw a cross-section for windows of a width."""
    with style(IN_PAGE):
        drawn = to_svg(figure_of([shown], width, letters), names=names_of([shown]), tight=True)
        return inline_svg(drawn, shown.title, key)


def _with_keys(tables: Sequence[Table]) -> list[tuple[str, Table]]:
    """Give each table the name that links have for it."""
    return [(re.sub(r"[^a-z]+", "-", table.title.lower()).strip("-"), table) for table in tables]


def _group(group: ChartGroup) -> dict[str, Any]:
    """Draw the charts of a group; a legend that all of them have is shown once."""
    legends = {chart.legend() for chart in group.charts}
    shared = legends.pop() if len(legends) == 1 and len(group.charts) > 1 else ()
    figures: list[tuple[charts.Chart, PageFigure]] = [
        (chart, charts.render(chart, legend=not shared)) for chart in group.charts
    ]
    words = f"{group.text} The side of a frame is {frame_size_um(group):g} µm." if group.columns else group.text
    return {**group._asdict(), "text": words, "figures": figures, "legend": shared}
