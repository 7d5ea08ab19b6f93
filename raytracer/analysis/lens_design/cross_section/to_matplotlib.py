"""Cross-sections on Matplotlib's axes."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from raytracer.analysis.lens_design.cross_section.drawing import CrossSection, stack_labels
from raytracer.analysis.lens_design.cross_section.outlines import Arc, Cubic, Line, Piece, Point
from raytracer.report.palette import SERIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Cubics of an arc: they are off by 1e-9 of the radius then.
_ARC_PIECES = 12


def plot_on_axes(drawing: CrossSection, axes: "Axes") -> None:
    """Draw a cross-section on Matplotlib's axes."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path
    from matplotlib.transforms import ScaledTranslation

    ink = "#222222"
    for outline in drawing.outlines:
        points, codes = _polybezier(outline.start, outline.pieces)
        path = Path([*points, points[0]], [*codes, int(Path.CLOSEPOLY)])
        axes.add_patch(PathPatch(path, facecolor=outline.fill, alpha=outline.opacity, edgecolor="none"))
        axes.add_patch(PathPatch(path, facecolor="none", edgecolor=ink, linewidth=0.7))
    for start, pieces in drawing.bare:
        points, codes = _polybezier(start, pieces)
        axes.add_patch(PathPatch(Path(points, codes), facecolor="none", edgecolor=ink, linewidth=0.7))
    axes.plot([drawing.low[0], drawing.high[0]], [0.0, 0.0], color=ink, linewidth=0.5, linestyle=(0, (10, 3, 2, 3)))
    used = sorted({ray.field for ray in drawing.rays})
    labels = dict(zip(used, drawing.fields, strict=True))
    for ray in drawing.rays:
        axes.plot(
            *ray.points.T, color=SERIES[ray.field % len(SERIES)], linewidth=0.6, label=labels.pop(ray.field, None)
        )
    for z, low, high in drawing.stops:
        for side in (1.0, -1.0):
            axes.plot([z, z], [side * low, side * high], color=ink, linewidth=2.2)
    film, half = drawing.film
    axes.plot([film, film], [-half, half], color=ink, linewidth=2.0)
    placed, rows = stack_labels(drawing, 700.0 / (drawing.high[0] - drawing.low[0]), 0.0)
    for mark, _, row in placed:
        axes.plot([mark.z], [0.0], "o", color=ink, markersize=2.5)
        axes.annotate(
            mark.name,
            (mark.z, drawing.low[1]),
            (0.0, -9.0 * (row + 1)),
            textcoords="offset points",
            ha="center",
            fontsize=6.5,
            annotation_clip=False,
        )
        axes.plot([mark.z, mark.z], [0.0, drawing.low[1]], color=ink, linewidth=0.4, linestyle=(0, (2, 3)), alpha=0.5)
    axes.set_xlim(drawing.low[0], drawing.high[0])
    axes.set_ylim(drawing.low[1], drawing.high[1])
    axes.set_aspect("equal")
    axes.axis("off")
    if used:
        # Below the names, which are placed in points: an axis's height has another number of them for each lens.
        below = axes.transAxes + ScaledTranslation(0.0, -(9.0 * rows + 4.0) / 72.0, axes.figure.dpi_scale_trans)
        axes.legend(
            fontsize=6.5,
            frameon=False,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=below,
            borderaxespad=0.0,
            ncols=3,
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
