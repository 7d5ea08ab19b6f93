"""Cross-sections drawn by Matplotlib."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from raytracer.analysis.lens_design.cross_section.drawing import CrossSection, stack_labels
from raytracer.analysis.lens_design.cross_section.outlines import Arc, Cubic, Line, Piece, Point
from raytracer.report.figure import POINTS_PER_INCH, ink, new_figure
from raytracer.report.palette import SERIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Cubics of an arc: they are off by 1e-9 of the radius then.
_ARC_PIECES = 12

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
    rows = [stack_labels(one, *_scale(one, width, letters))[1] + len(one.fields) + 3 for one in drawings]
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


def _scale(drawing: CrossSection, width: float, letters: float) -> tuple[float, float, float]:
    """Return points per millimetre of a drawing of a width (inches), its margin, and the size of letters."""
    return POINTS_PER_INCH * width / (drawing.high[0] - drawing.low[0]), 0.0, letters


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
    placed, rows = stack_labels(drawing, *_scale(drawing, width, letters))
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
    """Convert an outline to the points and codes of Matplotlib: arcs become short cubics."""
    from matplotlib.path import Path

    points, codes = [start], [int(Path.MOVETO)]
    for piece in pieces:
        if isinstance(piece, Line):
            points.append(piece.end)
            codes.append(int(Path.LINETO))
            continue
        cubics = arc_to_cubics(points[-1], piece) if isinstance(piece, Arc) else [piece]
        for cubic in cubics:
            points += [cubic.first, cubic.second, cubic.end]
            codes += 3 * [int(Path.CURVE4)]
    return points, codes


def arc_to_cubics(start: Point, arc: Arc) -> list[Cubic]:
    """Approximate an arc of a circle, scaled along z, by cubics.

    References: Riskus 2006, "Approximation of a Cubic Bezier Curve by Circular Arcs and Vice Versa" (4/3 tan(angle/4)).
    """
    squeeze = arc.half_z / arc.half_height
    (x0, y0), (x1, y1) = (start[0] / squeeze, start[1]), (arc.end[0] / squeeze, arc.end[1])
    # The centre is on the left of the chord of an arc that runs anticlockwise.
    half = 0.5 * math.hypot(x1 - x0, y1 - y0)
    apart = math.sqrt(max(0.0, arc.half_height**2 - half**2)) * (1.0 if arc.anticlockwise else -1.0)
    along = ((x1 - x0) / (2.0 * half), (y1 - y0) / (2.0 * half))
    centre = (0.5 * (x0 + x1) - apart * along[1], 0.5 * (y0 + y1) + apart * along[0])
    first = math.atan2(y0 - centre[1], x0 - centre[0])
    turn = math.remainder(math.atan2(y1 - centre[1], x1 - centre[0]) - first, math.tau)
    angles = first + np.linspace(0.0, turn, _ARC_PIECES + 1)
    lever = 4.0 / 3.0 * math.tan(turn / _ARC_PIECES / 4.0)

    def at(angle: float, ahead: float) -> Point:
        c, s = math.cos(angle), math.sin(angle)
        r = arc.half_height
        return squeeze * (centre[0] + r * (c - ahead * s)), centre[1] + r * (s + ahead * c)

    return [Cubic(at(a, lever), at(b, -lever), at(b, 0.0)) for a, b in pairwise(angles.tolist())]
