"""Cross-sections drawn by Matplotlib."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from raytracer.analysis.lens_design.cross_section.drawing import AxisMark, CrossSection, stack_labels
from raytracer.analysis.lens_design.cross_section.outlines import Line, Piece, Point
from raytracer.report.figure import POINTS_PER_INCH, ink, new_figure
from raytracer.report.palette import SERIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Height of a row of labels, as a multiple of their letters; width of a legend's entry of letters of 1 pt (pt).
_ROW, _ENTRY = 1.4, 19.0

# Greatest height of a cross-section, as a part of its width.
_TALLEST = 0.8


def figure_of(drawings: Sequence[CrossSection], width: float, letters: float, title: str | None = None) -> "Figure":
    """Draw cross-sections below each other, so many inches wide with their labels in letters of a size (pt).

    Several have their own titles; a single one has `title`, if there is one.  What is drawn may reach beyond the
    figure: it is meant to be saved cut to that.
    """
    ratios = [min(_TALLEST, (one.high[1] - one.low[1]) / (one.high[0] - one.low[0])) for one in drawings]
    rows = [_stacked(one, width, letters)[1] + len(one.fields) + 3 for one in drawings]
    heights = [width * ratio + _ROW * letters * n / POINTS_PER_INCH for ratio, n in zip(ratios, rows, strict=True)]
    figure = new_figure(width, sum(heights))
    top = 1.0
    for number, (one, ratio, height) in enumerate(zip(drawings, ratios, heights, strict=True)):
        tall = width * ratio / sum(heights)
        axes = figure.add_axes((0.0, top - tall, 1.0, tall))
        plot_on_axes(one, axes, width, letters, number)
        if name := one.title if len(drawings) > 1 else title:
            axes.set_title(name, fontsize=1.3 * letters)
        top -= height / sum(heights)
    return figure


def _stacked(drawing: CrossSection, width: float, letters: float) -> tuple[list[tuple[AxisMark, float, int]], int]:
    """Place the names under a drawing of a width (inches)."""
    return stack_labels(drawing, POINTS_PER_INCH * width / (drawing.high[0] - drawing.low[0]), letters)


def names_of(drawings: Sequence[CrossSection]) -> dict[str, str]:
    """List what is said of the parts of drawings under the pointer, by their `gid`."""
    names: dict[str, str] = {}
    for number, drawing in enumerate(drawings):
        names |= {f"glass-{number}-{index}": one.title for index, one in enumerate(drawing.outlines)}
        names |= {
            f"mark-{number}-{index}": f"{one.title}: {one.z:.4g} mm" for index, one in enumerate(sorted(drawing.marks))
        }
        names |= {f"stop-{number}": "stop", f"film-{number}": "film"}
    return names


def plot_on_axes(drawing: CrossSection, axes: "Axes", width: float, letters: float, number: int = 0) -> None:
    """Draw a cross-section on axes of a width (inches), in the style that is set.

    number : of the drawing in its figure, in the `gid` of its parts.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path
    from matplotlib.transforms import ScaledTranslation

    line = ink()
    for index, outline in enumerate(drawing.outlines):
        points, codes = _polybezier(outline.start, outline.pieces)
        path = Path([*points, points[0]], [*codes, int(Path.CLOSEPOLY)])
        glass = PathPatch(path, facecolor=outline.fill, alpha=outline.opacity, edgecolor="none")
        glass.set_gid(f"glass-{number}-{index}")
        axes.add_patch(glass)
        axes.add_patch(PathPatch(path, facecolor="none", edgecolor=line, linewidth=0.7))
    for start, pieces in drawing.bare:
        points, codes = _polybezier(start, pieces)
        axes.add_patch(PathPatch(Path(points, codes), facecolor="none", edgecolor=line, linewidth=0.7))
    axes.plot([drawing.low[0], drawing.high[0]], [0.0, 0.0], color=line, linewidth=0.5, linestyle=(0, (10, 3, 2, 3)))
    used = sorted({ray.field for ray in drawing.rays})
    labels = dict(zip(used, drawing.fields, strict=True))
    for ray in drawing.rays:
        color = SERIES[ray.field % len(SERIES)]
        axes.plot(*ray.points.T, color=color, linewidth=0.6, label=labels.pop(ray.field, None))
    for z, low, high in drawing.stops:
        blades = [*(-1.0 * np.array([low, high])), np.nan, low, high]
        axes.plot([z] * len(blades), blades, color=line, linewidth=2.2, gid=f"stop-{number}")
    film, half = drawing.film
    axes.plot([film, film], [-half, half], color=line, linewidth=2.0, gid=f"film-{number}")
    row_height = _ROW * letters
    placed, rows = _stacked(drawing, width, letters)
    for index, (mark, _, row) in enumerate(placed):
        axes.plot([mark.z], [0.0], "o", color=line, markersize=2.5, gid=f"mark-{number}-{index}")
        axes.annotate(
            mark.name,
            (mark.z, drawing.low[1]),
            (0.0, -row_height * (row + 1)),
            textcoords="offset points",
            ha="center",
            fontsize=letters,
            annotation_clip=False,
        )
        axes.plot([mark.z, mark.z], [0.0, drawing.low[1]], color=line, linewidth=0.4, linestyle=(0, (2, 3)), alpha=0.5)
    axes.set_xlim(drawing.low[0], drawing.high[0])
    axes.set_ylim(drawing.low[1], drawing.high[1])
    axes.set_aspect("equal")
    axes.axis("off")
    if used:
        # Below the names, which are placed in points: an axis's height has another number of them for each lens.
        down = -(row_height * rows + 4.0) / POINTS_PER_INCH
        figure = axes.get_figure(root=True)
        assert figure is not None
        axes.legend(
            fontsize=letters,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=axes.transAxes + ScaledTranslation(0.0, down, figure.dpi_scale_trans),
            borderaxespad=0.0,
            ncols=max(1, min(3, int(POINTS_PER_INCH * width / (_ENTRY * letters)))),
        )


def _polybezier(start: Point, pieces: Sequence[Piece]) -> tuple[list[Point], list[int]]:
    """Convert an outline to the points and codes of Matplotlib."""
    from matplotlib.path import Path

    points, codes = [start], [int(Path.MOVETO)]
    for piece in pieces:
        points += piece
        codes += len(piece) * [int(Path.LINETO if isinstance(piece, Line) else Path.CURVE4)]
    return points, codes
