"""Charts as plain data, drawn as SVG and on Matplotlib's axes."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.report import svg
from raytracer.report.svg import INK, Node, element

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
Range = tuple[float, float]

# Dashes of lines (on, off) as multiples of their width, told apart without colours.
SOLID, DASHED, DOTTED, DASH_DOTTED = (), (6.0, 3.0), (1.5, 2.5), (6.0, 2.5, 1.5, 2.5)

_LINE, _DOT = 1.8, 1.1
_FONT = 12.0
# Average width of a letter in ems, with a margin so that labels do not overlap.
_LETTER = 0.56
# Margin of a range, as a part of it.
_MARGIN = 0.05

# Far below any value that is drawn, in millimetres, micrometres or parts of a whole.
_NOTHING = 1e-9

# Rounding error of a quotient of two lengths, with a margin: places of ticks, in steps.
_ROUNDING = 1e-9

# Beyond these powers of ten, and for steps below their inverse, numbers are written with an exponent.
_MOST_DIGITS = 5


class Series(NamedTuple):
    """Series of points (x, y): a line, broken where one is not finite, or dots."""

    label: str
    x: FloatArray
    y: FloatArray
    color: str = INK
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
    equal: bool = False
    bare: bool = False
    note: str = ""

    def ranges(self) -> tuple[Range, Range]:
        """Return the ranges of x and y that are shown."""
        x = self.x_range or _extent([s.x for s in self.series])
        y = self.y_range or _extent([s.y for s in self.series])
        return x, y


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


def ticks(low: float, high: float, most: int) -> list[float]:
    """Choose round numbers from `low` to `high`, at most `most`: multiples of 1, 2 or 5 times a power of ten."""
    raw = (high - low) / max(1, most - 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0, 20.0) if power * m >= raw * (1.0 - _ROUNDING))
    first, last = math.ceil(low / step - _ROUNDING), math.floor(high / step + _ROUNDING)
    return [n * step for n in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """Write a tick's number, with as many decimals as its neighbours need to differ from it."""
    if value != 0.0 and (abs(value) >= 10.0**_MOST_DIGITS or step < 10.0**-_MOST_DIGITS):
        return f"{value:.3g}"
    decimals = max(0, math.ceil(-math.log10(step) - _ROUNDING))
    return f"{value:.{decimals}f}".replace("-", "−")


# ---- SVG


class _Plot(NamedTuple):
    """Frame of a chart in the picture.

    left, top, width, height : of the frame (pixels).
    x, y : ranges of values.
    """

    left: float
    top: float
    width: float
    height: float
    x: Range
    y: Range

    def at_x(self, value: FloatArray | float) -> FloatArray:
        """Convert values of x to pixels."""
        low, high = self.x
        return np.asarray(self.left + self.width * (np.asarray(value) - low) / (high - low))

    def at_y(self, value: FloatArray | float) -> FloatArray:
        """Convert values of y to pixels."""
        low, high = self.y
        return np.asarray(self.top + self.height * (high - np.asarray(value)) / (high - low))


def render_svg(chart: Chart, width: float = 400.0, height: float = 300.0) -> Node:
    """Render a chart as an `svg`, of a size in pixels."""
    if chart.bare:
        return _render_bare(chart, width)
    x, y = chart.ranges()
    legend, legend_height = _legend(chart, width)
    labels = [tick_text(t, _step(v)) for v in (ticks(*y, 6),) for t in v]
    left = 26.0 + 0.9 * _LETTER * _FONT * max(map(len, labels), default=1)
    plot = _Plot(left, 10.0, width - left - 14.0, height - 54.0 - legend_height, x, y)
    if chart.equal:
        plot = _equal_scales(plot)
    children = [
        *_grid(plot, chart),
        *_levels(plot, chart),
        *_curves(plot, chart),
        *_labels(plot, chart, height, legend_height),
    ]
    lowered = element("g", {"transform": f"translate(0 {svg.number(height - legend_height)})"}, *legend)
    return svg.render_svg(width, height, chart.title, *children, lowered)


def _render_bare(chart: Chart, width: float) -> Node:
    """Render only the frame and the series of a chart."""
    x, y = chart.ranges()
    plot = _Plot(1.0, 1.0, width - 2.0, width - 2.0, x, y)
    frame = element(
        "rect",
        {
            "x": plot.left,
            "y": plot.top,
            "width": plot.width,
            "height": plot.height,
            "fill": "none",
            "stroke": INK,
            "stroke-opacity": 0.4,
        },
    )
    return svg.render_svg(width, width, chart.title, frame, *_levels(plot, chart), *_curves(plot, chart))


def _equal_scales(plot: _Plot) -> _Plot:
    """Widen the ranges so that both axes have one scale."""
    scale = max((plot.x[1] - plot.x[0]) / plot.width, (plot.y[1] - plot.y[0]) / plot.height)

    def widened(values: Range, pixels: float) -> Range:
        middle, half = 0.5 * (values[0] + values[1]), 0.5 * scale * pixels
        return middle - half, middle + half

    return plot._replace(x=widened(plot.x, plot.width), y=widened(plot.y, plot.height))


def _step(values: list[float]) -> float:
    """Return the distance between ticks."""
    return values[1] - values[0] if len(values) > 1 else abs(values[0]) or 1.0 if values else 1.0


def _grid(plot: _Plot, chart: Chart) -> list[Node]:
    """Draw the frame, ticks with their numbers, and faint lines through them."""
    nodes = []
    xs, ys = ticks(*plot.x, max(3, round(plot.width / 62.0))), ticks(*plot.y, 6)
    bottom, right = plot.top + plot.height, plot.left + plot.width
    lines = [f"M{svg.number(float(plot.at_x(x)))} {svg.number(plot.top)}V{svg.number(bottom)}" for x in xs]
    lines += [f"M{svg.number(plot.left)} {svg.number(float(plot.at_y(y)))}H{svg.number(right)}" for y in ys]
    nodes.append(element("path", {"d": "".join(lines), "stroke": INK, "stroke_opacity": 0.15, "fill": "none"}))
    frame = {"x": plot.left, "y": plot.top, "width": plot.width, "height": plot.height}
    nodes.append(element("rect", {**frame, "fill": "none", "stroke": INK, "stroke_opacity": 0.5}))
    numbers = {"font_size": _FONT - 1.0, "fill": INK}
    for x in xs:
        place = {"x": float(plot.at_x(x)), "y": bottom + 15.0, "text_anchor": "middle"}
        nodes.append(element("text", {**numbers, **place}, tick_text(x, _step(xs))))
    for y in ys:
        place = {"x": plot.left - 5.0, "y": float(plot.at_y(y)) + 4.0, "text_anchor": "end"}
        nodes.append(element("text", {**numbers, **place}, tick_text(y, _step(ys))))
    return nodes


def _levels(plot: _Plot, chart: Chart) -> list[Node]:
    """Draw the reference lines."""
    nodes = []
    for level in chart.levels:
        low, high = plot.x if level.axis == "x" else plot.y
        if not low <= level.value <= high:
            continue
        if level.axis == "x":
            d = f"M{svg.number(float(plot.at_x(level.value)))} {svg.number(plot.top)}v{svg.number(plot.height)}"
        else:
            d = f"M{svg.number(plot.left)} {svg.number(float(plot.at_y(level.value)))}h{svg.number(plot.width)}"
        nodes.append(element("path", {"d": d, "stroke": INK, "stroke_opacity": 0.6, "fill": "none"}))
    return nodes


def _curves(plot: _Plot, chart: Chart) -> list[Node]:
    """Draw the series, within the frame."""
    nodes = []
    for series in chart.series:
        # Points outside would be drawn over the labels.
        x, y = plot.at_x(series.x), plot.at_y(series.y)
        inside = np.isfinite(x) & np.isfinite(y)
        inside &= (x >= plot.left - 0.5) & (x <= plot.left + plot.width + 0.5)
        inside &= (y >= plot.top - 0.5) & (y <= plot.top + plot.height + 0.5)
        look: dict[str, Any] = {
            "stroke": series.color,
            "fill": "none",
            "stroke_linecap": "round",
            "stroke_linejoin": "round",
        }
        if series.mark == "dots":
            d = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x[inside], y[inside], strict=True))
            look |= {"stroke_width": 2.0 * _DOT, "stroke_opacity": 0.75}
        else:
            d = _line(x, y, inside)
            dashes = " ".join(svg.number(part * _LINE) for part in series.dashes) or None
            look |= {"stroke_width": _LINE, "stroke_dasharray": dashes, "stroke_linecap": "butt" if dashes else "round"}
        if d:
            nodes.append(element("path", {"d": d, **look}, element("title", {}, series.label)))
    return nodes


def _line(x: FloatArray, y: FloatArray, inside: NDArray[np.bool_]) -> str:
    """Write a path through points, interrupted by those outside."""
    parts, was = [], False
    for a, b, here in zip(x, y, inside, strict=True):
        if here:
            parts.append(f"{'L' if was else 'M'}{a:.1f} {b:.1f}")
        was = bool(here)
    return "".join(parts)


def _labels(plot: _Plot, chart: Chart, height: float, below: float) -> list[Node]:
    """Draw the labels of the axes."""
    look = {"font_size": _FONT, "fill": INK, "text_anchor": "middle"}
    x = {"x": plot.left + 0.5 * plot.width, "y": height - below - 8.0}
    middle = plot.top + 0.5 * plot.height
    turned = {"transform": f"translate(13 {svg.number(middle)}) rotate(-90)"}
    return [element("text", {**look, **x}, chart.x_label), element("text", {**look, **turned}, chart.y_label)]


def _legend(chart: Chart, width: float) -> tuple[list[Node], float]:
    """Draw the legend, in as many rows as it needs; returns its height, too."""
    named = [s for s in chart.series if s.label]
    if len(named) < 2:
        return [], 0.0
    nodes: list[Node] = []
    x, y, row = 10.0, 12.0, 18.0
    for series in named:
        wide = 34.0 + _LETTER * _FONT * len(series.label)
        if x + wide > width and x > 10.0:
            x, y = 10.0, y + row
        dashes = " ".join(svg.number(part * _LINE) for part in series.dashes) or None
        sample = {"stroke": series.color, "stroke_width": _LINE, "stroke_dasharray": dashes, "fill": "none"}
        shape = f"M{svg.number(x)} {svg.number(y - 4.0)}h22"
        if series.mark == "dots":
            sample |= {"stroke_width": 5.0, "stroke_linecap": "round"}
            shape = f"M{svg.number(x + 11.0)} {svg.number(y - 4.0)}h0"
        nodes.append(element("path", {"d": shape, **sample}))
        nodes.append(element("text", {"x": x + 27.0, "y": y, "font_size": _FONT - 1.0, "fill": INK}, series.label))
        x += wide + 6.0
    return nodes, y + 8.0


# ---- Matplotlib


def plot_on_axes(chart: Chart, axes: "Axes") -> None:
    """Draw a chart on Matplotlib's axes."""
    for level in chart.levels:
        line = axes.axvline if level.axis == "x" else axes.axhline
        line(level.value, color="0.4", linewidth=0.7)
    for series in chart.series:
        colour = "#222222" if series.color == INK else series.color
        if series.mark == "dots":
            axes.plot(
                series.x, series.y, ".", color=colour, markersize=1.6, label=series.label or None, rasterized=True
            )
        else:
            style = (0, series.dashes) if series.dashes else "-"
            axes.plot(series.x, series.y, color=colour, linewidth=1.2, linestyle=style, label=series.label or None)
    x, y = chart.ranges()
    axes.set_xlim(x)
    axes.set_ylim(y)
    if chart.equal:
        axes.set_aspect("equal", adjustable="box")
    if chart.bare:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(chart.title, fontsize=6)
        return
    axes.set_title(chart.title, fontsize=10)
    axes.set_xlabel(chart.x_label, fontsize=8)
    axes.set_ylabel(chart.y_label, fontsize=8)
    axes.tick_params(labelsize=7)
    axes.locator_params(axis="x", nbins=6)
    axes.ticklabel_format(useOffset=False, scilimits=(-3, 4))
    axes.grid(alpha=0.25, linewidth=0.5)
    if sum(bool(s.label) for s in chart.series) > 1:
        axes.legend(fontsize=5.5, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=4)
