"""Charts as plain data, drawn by Matplotlib on pages and on paper."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.report.figure import (
    IN_PAGE,
    POINTS_PER_INCH,
    Curve,
    PageFigure,
    ink,
    new_figure,
    page_figure,
    series_id,
    style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

FloatArray = NDArray[np.float64]
Range = tuple[float, float]

# Dashes of lines (on, off) as multiples of their width, told apart without colours.
SOLID, DASHED, DOTTED, DASH_DOTTED = (), (6.0, 3.0), (1.5, 2.5), (6.0, 2.5, 1.5, 2.5)

# Margin of a range, as a part of it.
_MARGIN = 0.05

# Far below any value that is drawn, in millimetres, micrometres or parts of a whole.
_NOTHING = 1e-9

# Rounding error of a quotient of two lengths, with a margin.
_ROUNDING = 1e-9

# Width and height of a chart on a page without its legend, and side of a bare one (inches); size of letters (pt).
_SIZE, _BARE, _LETTERS = (4.6, 3.2), 2.0, 9.0

# Of a legend's entry (pt): its sample with the gaps, the width of a letter, and its height.
_SAMPLE, _LETTER, _ROW = 34.0, 4.6, 11.5


class LegendEntry(NamedTuple):
    """Entry of a legend; without a colour it has that of text."""

    label: str
    color: str | None = None
    dashes: tuple[float, ...] = SOLID


class Series(NamedTuple):
    """Series of points (x, y): a line, broken where one is not finite, or dots; colour as of `LegendEntry`."""

    label: str
    x: FloatArray
    y: FloatArray
    color: str | None = None
    dashes: tuple[float, ...] = SOLID
    mark: Literal["line", "dots"] = "line"


class ReferenceLine(NamedTuple):
    """Reference line through the whole chart, at a value of x or of y."""

    axis: Literal["x", "y"]
    value: float


@dataclass(frozen=True)
class Chart:
    """Chart; ranges are those of the data where none is given.

    key : name in files and links.
    levels : reference lines.
    entries : of the legend, where one for each series would be too many.
    equal : True for the same scale on both axes.
    bare : True for only a frame, without ticks: one of many.
    note : explanation below the chart.
    """

    key: str
    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    x_range: Range | None = None
    y_range: Range | None = None
    levels: tuple[ReferenceLine, ...] = field(default=())
    entries: tuple[LegendEntry, ...] = ()
    equal: bool = False
    bare: bool = False
    note: str = ""

    def ranges(self) -> tuple[Range, Range]:
        """Return the ranges of x and y that are shown."""
        x = self.x_range or _extent([s.x for s in self.series])
        y = self.y_range or _extent([s.y for s in self.series])
        return x, y

    def legend(self) -> tuple[LegendEntry, ...]:
        """Return the entries of the legend; none if there is but one series."""
        named = [LegendEntry(s.label, s.color, s.dashes) for s in self.series if s.label]
        return self.entries or (tuple(named) if len(named) > 1 and not self.bare else ())


def _extent(arrays: list[FloatArray]) -> Range:
    """Return the range of the finite values, with a margin; never empty."""
    values = np.concatenate([np.ravel(a) for a in arrays]) if arrays else np.empty(0)
    values = values[np.isfinite(values)]
    if values.size == 0:
        return -1.0, 1.0
    low, high = float(values.min()), float(values.max())
    if high - low <= max(_NOTHING, _ROUNDING * max(abs(low), abs(high))):
        # Rounding of constant values must not fill the chart.
        margin = 0.5 * abs(high) if abs(high) > _NOTHING else 1.0
        return low - margin, high + margin
    margin = _MARGIN * (high - low)
    return low - margin, high + margin


def draw(chart: Chart, axes: "Axes") -> None:
    """Draw a chart without title and legend on Matplotlib's axes, in the style that is set."""
    for level in chart.levels:
        line = axes.axvline if level.axis == "x" else axes.axhline
        line(level.value, color=ink(), alpha=0.6, linewidth=0.7)
    for number, series in enumerate(chart.series):
        gid, colour = series_id(number), series.color or ink()
        if series.mark == "dots":
            axes.plot(series.x, series.y, ".", color=colour, markersize=1.6, rasterized=True, gid=gid)
        else:
            axes.plot(series.x, series.y, color=colour, linewidth=1.3, linestyle=_linestyle(series.dashes), gid=gid)
    x, y = chart.ranges()
    axes.set_xlim(x)
    axes.set_ylim(y)
    if chart.equal:
        axes.set_aspect("equal", adjustable="box")
    if chart.bare:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(True)
        return
    axes.set_xlabel(chart.x_label)
    axes.set_ylabel(chart.y_label)
    axes.tick_params(labelsize="small")
    axes.locator_params(axis="x", nbins=6)
    axes.ticklabel_format(useOffset=False, scilimits=(-3, 4))
    axes.grid(linewidth=0.5)


def legend_lines(chart: Chart) -> "list[Line2D]":
    """Make the lines that a legend shows, with their labels."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=entry.color or ink(), linestyle=_linestyle(entry.dashes), linewidth=1.3, label=entry.label)
        for entry in chart.legend()
    ]


def render(chart: Chart, *, legend: bool = True) -> PageFigure:
    """Render a chart for a page; the numbers of a bare one, which are many dots, stay out of its data."""
    curves = [] if chart.bare else [Curve(series.label, series.x, series.y) for series in chart.series]
    labels = chart.x_label, chart.y_label
    with style(IN_PAGE, _LETTERS):
        if chart.bare:
            axes = new_figure(_BARE, _BARE).add_axes((0.005, 0.005, 0.99, 0.99))
            draw(chart, axes)
            return page_figure(axes, chart.key, chart.title, labels, curves)
        lines = legend_lines(chart) if legend else []
        longest = max((len(str(line.get_label())) for line in lines), default=0)
        columns = max(1, int(POINTS_PER_INCH * _SIZE[0] / (_SAMPLE + _LETTER * longest)))
        rows = math.ceil(len(lines) / columns)
        figure = new_figure(_SIZE[0], _SIZE[1] + rows * _ROW / POINTS_PER_INCH, "constrained")
        axes = figure.add_subplot()
        draw(chart, axes)
        if lines:
            figure.legend(handles=lines, loc="outside lower center", ncols=columns, fontsize="small")
        return page_figure(axes, chart.key, chart.title, labels, curves)


def _linestyle(dashes: tuple[float, ...]) -> "Literal['-'] | tuple[float, tuple[float, ...]]":
    """Convert dashes to a line style of Matplotlib's."""
    return (0.0, dashes) if dashes else "-"
