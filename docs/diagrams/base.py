"""A sheet to draw rays, lenses and lengths on, in units of the thing that is drawn."""

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from raytracer.report.figure import new_figure
from raytracer.report.palette import BLUE, FAINT, GREEN, INK, OCHRE, PURPLE, VERMILLION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GLASS, SENSOR = "#cfe4f2", "#3c4048"

__all__ = ["BLUE", "FAINT", "GLASS", "GREEN", "INK", "OCHRE", "PURPLE", "SENSOR", "VERMILLION", "Point", "Sheet"]

Point = tuple[float, float]

_MARGIN = 0.12
"""Margin around a sheet (inches)."""


class Sheet:
    """A drawing in a box of given ranges, with the same scale in x and y.

    Parameters
    ----------
    x, y : ranges that are shown, in any unit.
    width : of the drawing (inches).
    sheets : drawings one below the other that share the width; `self.axes` is one of them, by `use`.
    """

    def __init__(self, x: Point, y: Point, width: float = 8.0, *, stretch: float = 1.0, rows: int = 1) -> None:
        height = rows * (width - 2 * _MARGIN) * stretch * (y[1] - y[0]) / (x[1] - x[0]) + 2 * _MARGIN
        self.figure: Figure = new_figure(width, height)
        self._all = [
            self.figure.add_axes(
                (
                    _MARGIN / width,
                    (_MARGIN + (rows - 1 - row) * (height - 2 * _MARGIN) / rows) / height,
                    1.0 - 2 * _MARGIN / width,
                    (height - 2 * _MARGIN) / rows / height,
                )
            )
            for row in range(rows)
        ]
        for axes in self._all:
            axes.set(xlim=x, ylim=y, aspect=stretch if stretch != 1.0 else "equal")
            axes.set_axis_off()
        self.axes = self._all[0]

    def use(self, row: int) -> None:
        """Draw on another row from now on."""
        self.axes = self._all[row]

    def line(self, *points: Point, color: str = INK, width: float = 1.2, dashed: bool = False, **more: Any) -> None:
        """Draw a line through points."""
        style = {"linestyle": (0, (4, 3))} if dashed else {}
        x, y = zip(*points, strict=True)
        self.axes.plot(x, y, color=color, linewidth=width, solid_capstyle="round", clip_on=False, **style, **more)

    def ray(self, *points: Point, color: str = VERMILLION, width: float = 1.3, dashed: bool = False) -> None:
        """Draw a ray through points, with an arrow in the middle of its longest part."""
        self.line(*points, color=color, width=width, dashed=dashed)
        lengths = [np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(points)]
        longest = int(np.argmax(lengths))
        start, end = np.array(points[longest]), np.array(points[longest + 1])
        self._arrow(start + 0.5 * (end - start), start + 0.55 * (end - start), color, 11.0, width)

    def arrow(self, start: Point, end: Point, color: str = INK, width: float = 1.6) -> None:
        """Draw an arrow, such as an object that is seen."""
        self._arrow(np.array(start), np.array(end), color, 13.0, width)

    def _arrow(self, start: Any, end: Any, color: str, size: float, width: float) -> None:
        from matplotlib.patches import FancyArrowPatch

        kind = {"arrowstyle": "-|>", "mutation_scale": size, "shrinkA": 0.0, "shrinkB": 0.0}
        self.axes.add_patch(
            FancyArrowPatch(tuple(start), tuple(end), color=color, linewidth=width, clip_on=False, zorder=4, **kind)
        )

    def dot(self, point: Point, color: str = INK, size: float = 5.0) -> None:
        """Draw a point."""
        self.axes.plot(*point, "o", color=color, markersize=size, clip_on=False, zorder=5)

    def text(self, point: Point, text: str, color: str = INK, size: float = 10.0, **more: Any) -> None:
        """Write text, centred on a point unless `ha` and `va` say otherwise; formulas stand between dollar signs."""
        more = {"ha": "center", "va": "center", "parse_math": True, **more}
        self.axes.text(*point, text, color=color, fontsize=size, clip_on=False, zorder=6, **more)

    def lens(self, x: float, radius: float, y: float = 0.0, thickness: float = 0.16) -> None:
        """Draw a thin lens that stands upright."""
        from matplotlib.patches import Polygon

        t = np.linspace(-1.0, 1.0, 41)
        bulge = thickness * radius * (1.0 - t * t)
        outline = np.concatenate([np.c_[x + bulge, y + radius * t], np.c_[x - bulge, y + radius * t][::-1]])
        self.axes.add_patch(Polygon(outline, facecolor=GLASS, edgecolor=BLUE, linewidth=1.2, clip_on=False, zorder=3))

    def box(self, corner: Point, size: Point, color: str = SENSOR, edge: str = "none", **more: Any) -> None:
        """Draw a filled rectangle."""
        from matplotlib.patches import Rectangle

        self.axes.add_patch(Rectangle(corner, *size, facecolor=color, edgecolor=edge, clip_on=False, **more))

    def area(self, points: Sequence[Point], color: str, alpha: float = 0.2) -> None:
        """Fill a polygon."""
        from matplotlib.patches import Polygon

        self.axes.add_patch(Polygon(np.array(points), facecolor=color, edgecolor="none", alpha=alpha, clip_on=False))

    def axis(self, start: float, end: float, y: float = 0.0) -> None:
        """Draw the optical axis."""
        self.line((start, y), (end, y), color=FAINT, width=0.8, dashed=True, zorder=1)

    def length(self, start: Point, end: Point, text: str, offset: Point = (0.0, 0.0), color: str = FAINT) -> None:
        """Draw a dimension line between two points, with its name beside the middle."""
        from matplotlib.patches import FancyArrowPatch

        kind = {"arrowstyle": "<->", "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0}
        self.axes.add_patch(FancyArrowPatch(start, end, color=color, linewidth=0.9, clip_on=False, **kind))
        middle = (0.5 * (start[0] + end[0]) + offset[0], 0.5 * (start[1] + end[1]) + offset[1])
        self.text(middle, text, color=INK)
