"""Report on a lens as PDF, and its cross-section as PNG and SVG."""

import io
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from raytracer.analysis.lens_design import text
from raytracer.analysis.lens_design.cross_section.drawing import cross_sections
from raytracer.analysis.lens_design.cross_section.plot import figure_of, names_of, plot_on_axes
from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.analysis.lens_design.plots import ChartGroup, chart_groups, frame_size_um
from raytracer.optics.lens_system.lens import Lens
from raytracer.report import chart
from raytracer.report.chart import Chart
from raytracer.report.figure import ON_PAPER, new_figure, style, to_png, to_svg
from raytracer.report.table import Table

if TYPE_CHECKING:
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

# A4 upright (inches); of a drawing by itself width (inches), letters (pt) and resolution.
_PAGE = (8.27, 11.69)
_WIDTH, _LETTERS, _DPI = 10.0, 9.0, 200

_PER_ROW, _PER_PAGE = 2, 6
_ROWS_OF_SPOTS = 6

# Height of a table's title, text and head, in lines.
_LINES_OF_HEAD = 7


def png(lens: Lens, study: LensStudy) -> bytes:
    """Draw the cross-sections as PNG, below each other if there are two."""
    with style(ON_PAPER):
        figure = figure_of(cross_sections(lens, study), _WIDTH, _LETTERS, study.name)
        return to_png(figure, _DPI, tight=True)


def svg(lens: Lens, study: LensStudy) -> bytes:
    """Draw the cross-sections as SVG, below each other if there are two."""
    shown = cross_sections(lens, study)
    with style(ON_PAPER):
        title = "; ".join(one.title for one in shown)
        return to_svg(figure_of(shown, _WIDTH, _LETTERS), title=title, names=names_of(shown), tight=True)


def pdf(lens: Lens, study: LensStudy) -> bytes:
    """Write the report as PDF."""
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = io.BytesIO()
    # Without a date the same lens gives the same file.
    facts = {"Title": study.name, "CreationDate": None}
    with style(ON_PAPER, 8.0), PdfPages(buffer, metadata=facts) as book:
        _front(book, lens, study)
        all_groups = chart_groups(study)
        for group in all_groups:
            if group.columns:
                _frames(book, group)
        _charts(book, [group for group in all_groups if not group.columns])
        third = text.seidel(study)
        _tables(book, [text.surfaces(lens), *([third] if third else []), *text.tolerances(study)])
        if text.notes(study):
            _notes(book, study)
    return buffer.getvalue()


def _save(book: "PdfPages", figure: "Figure") -> None:
    """Add a page."""
    book.savefig(figure)  # type: ignore[no-untyped-call]


def _wrapped(words: str, width: int = 105) -> str:
    """Wrap a text."""
    return "\n".join(textwrap.wrap(words, width))


def _front(book: "PdfPages", lens: Lens, study: LensStudy) -> None:
    """Add the first page: cross-section and first order."""
    shown = cross_sections(lens, study)
    figure = new_figure(*_PAGE)
    figure.text(0.07, 0.965, _wrapped(study.name, 60), fontsize=15, va="top")
    figure.text(
        0.07, 0.94, f"{_wrapped(study.source)}\n{_wrapped(text.setting(study))}", fontsize=7.5, va="top", color="0.3"
    )
    each = 0.36 / len(shown)
    for number, one in enumerate(shown):
        axes = figure.add_axes((0.06, 0.90 - each * (number + 1) + 0.02, 0.88, each - 0.035))
        plot_on_axes(one, axes, 0.65 * _PAGE[0], 6.5)
    tables = text.first_order(study)
    for number, table in enumerate(tables):
        _draw_table(figure, table, 0.07 + 0.46 * number, 0.50, 0.86 / len(tables), 5.5 if len(tables) > 1 else 7.5)
    _save(book, figure)


def _draw_table(figure: "Figure", table: Table, left: float, top: float, width: float, size: float) -> float:
    """Draw a table, its columns as wide as their text; returns its lower end on the page."""
    step = _step(size)
    figure.text(left, top, table.title, fontsize=size + 3.0, va="top")
    top -= 1.6 * step
    if table.text:
        words = _wrapped(table.text, round(115.0 * width))
        figure.text(left, top, words, fontsize=size, va="top", color="0.3")
        top -= step * (words.count("\n") + 1)
    top -= 0.4 * step
    lines = [table.head, *((row.name, *row.cells) for row in table.rows)]
    share = np.array([max(len(line[column]) for line in lines) + 2.0 for column in range(len(table.head))])
    ends = left + width * np.cumsum(share) / share.sum()
    for number, line in enumerate(lines):
        weight = "bold" if number == 0 or line[0] == "sum" else "normal"
        for column, cell in enumerate(line):
            x, side = (left, "left") if column == 0 else (ends[column], "right")
            figure.text(x, top - step * number, cell, fontsize=size, ha=side, va="top", fontweight=weight)
    return top - step * len(lines)


def _step(size: float) -> float:
    """Return the distance from line to line, as a part of the page's height."""
    return 0.0017 * size + 0.0035


def _tables(book: "PdfPages", tables: Sequence[Table]) -> None:
    """Add tables below each other, on as many pages as they need."""
    size, top, bottom = 7.0, 0.955, 0.05
    figure, y = new_figure(*_PAGE), top
    for table in tables:
        rows = table.rows
        while rows:
            fit = int((y - bottom) / _step(size)) - _LINES_OF_HEAD
            if fit < min(len(rows), 8):
                _save(book, figure)
                figure, y = new_figure(*_PAGE), top
                continue
            y = _draw_table(figure, table._replace(rows=rows[:fit]), 0.07, y, 0.86, size) - 2.5 * _step(size)
            rows = rows[fit:]
    _save(book, figure)


def _charts(book: "PdfPages", all_groups: Sequence[ChartGroup]) -> None:
    """Add the charts of all groups in turn, a page at a time, with the explanations of their groups."""
    flat = [(group, chart) for group in all_groups for chart in group.charts]
    for start in range(0, len(flat), _PER_PAGE):
        part = flat[start : start + _PER_PAGE]
        of_page = list({group.key: group for group, _ in part}.values())
        figure = new_figure(*_PAGE)
        title = of_page[0].title if len(of_page) == 1 else "Aberrations"
        words = "\n".join(_wrapped(f"{group.title}. {group.text}") for group in of_page)
        bottom = _heading(figure, title, words)
        place = {"left": 0.09, "right": 0.96, "top": bottom - 0.035, "bottom": 0.09, "hspace": 0.55, "wspace": 0.28}
        _fill(book, figure, [chart for _, chart in part], (_PER_PAGE // _PER_ROW, _PER_ROW), place)


def _frames(book: "PdfPages", group: ChartGroup) -> None:
    """Add spot diagrams, a row for each field."""
    per_page = _ROWS_OF_SPOTS * group.columns
    place = {"left": 0.05, "right": 0.95, "top": 0.85, "bottom": 0.05, "hspace": 0.4, "wspace": 0.12}
    for start in range(0, len(group.charts), per_page):
        figure = new_figure(*_PAGE)
        _heading(figure, group.title, _wrapped(f"{group.text} The side of a frame is {frame_size_um(group):g} µm."))
        _fill(book, figure, group.charts[start : start + per_page], (_ROWS_OF_SPOTS, group.columns), place)


def _fill(
    book: "PdfPages", figure: "Figure", shown: Sequence[Chart], shape: tuple[int, int], place: Mapping[str, float]
) -> None:
    """Draw charts on a page, in rows and columns, and add it."""
    grid = figure.subplots(*shape, squeeze=False, gridspec_kw=dict(place))
    for axes in grid.ravel()[len(shown) :]:
        axes.axis("off")
    for one, axes in zip(shown, grid.ravel(), strict=False):
        chart.draw(one, axes)
        axes.set_title(one.title, fontsize=6.0 if one.bare else 10.0)
        if one.bare:
            axes.set_xlabel(one.note, fontsize=5.5)
        elif lines := chart.legend_lines(one):
            axes.legend(handles=lines, fontsize=5.5, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=4)
    _save(book, figure)


def _heading(figure: "Figure", title: str, words: str) -> float:
    """Draw a title and lines below it; returns their lower end on the page."""
    figure.text(0.06, 0.965, title, fontsize=13, va="top")
    figure.text(0.06, 0.942, words, fontsize=7.5, va="top", color="0.3")
    return 0.942 - _step(7.5) * 0.75 * (words.count("\n") + 1)


def _notes(book: "PdfPages", study: LensStudy) -> None:
    """Add a page of notes."""
    figure = new_figure(*_PAGE)
    words = "\n".join(_wrapped(f"{text.topic(note)}: {note.reason}") for note in text.notes(study))
    figure.text(0.06, 0.965, "Notes", fontsize=13, va="top")
    figure.text(0.06, 0.935, words, fontsize=8.0, va="top")
    _save(book, figure)
