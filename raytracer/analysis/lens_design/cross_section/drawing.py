"""A lens in section: glass, stop, film, fans of traced rays, and where its cardinal points are.

What is drawn is geometry in millimetres, (z, height) with the scene on the left; spheres and ellipses are exact arcs,
and other surfaces cubic curves through exact points and slopes.  SVG and Matplotlib draw the same.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.glass import Glass
from raytracer.lens_report import svg
from raytracer.lens_report.analysis.bench import Bench, bench_of
from raytracer.lens_report.analysis.results import FirstOrder
from raytracer.lens_report.analysis.study import Study
from raytracer.lens_report.svg import HUES, INK, Node, element
from raytracer.lenses.lens import Element, Lens
from raytracer.lenses.surfaces import LensSurfaces, trace_paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]
Section: TypeAlias = Literal["x", "y"]

CROWN, FLINT, OTHER = "#56a0d3", "#c08a3e", "#7f8c8d"
"""Fills: glasses with an Abbe number above 50, with one below, and such as do not disperse."""

# Pieces of a curve that is no arc; and of arcs for Matplotlib, whose cubics are off by 1e-9 of the radius then.
_PIECES = 48
_ARC_PIECES = 12

# Rays that are followed to find those that get through, and those of them that are drawn.
_TRIED = 801
_DRAWN = 7

# Where in the picture the points are whose light is drawn, as parts of the largest field.
_FIELDS = (0.0, 0.7, 1.0)

# And where else if there is none, as parts of that.
_LIT = (1.0, 0.98, 0.95, 0.9)

# How high rays behind the lens are drawn, as a part of all else.
_ASTRAY = 1.3

# The way of a ray before the lens, as a part of the lens's length.
_BEFORE = 0.35


class Arc(NamedTuple):
    """An arc of an ellipse with its axes along z and up, from where the pen is, less than half of it."""

    half_z: float
    half_height: float
    anticlockwise: bool
    end: Point


class Line(NamedTuple):
    """A straight line from where the pen is."""

    end: Point


class Cubic(NamedTuple):
    """A cubic Bezier curve from where the pen is."""

    first: Point
    second: Point
    end: Point


Piece: TypeAlias = Arc | Line | Cubic


class Outline(NamedTuple):
    """A closed piece of glass: where it starts, its pieces, and what it is."""

    start: Point
    pieces: tuple[Piece, ...]
    fill: str
    opacity: float
    title: str


class Ray(NamedTuple):
    """A ray's points (n, 2): (z, height); which field it belongs to, from 0."""

    points: Array
    field: int


class Mark(NamedTuple):
    """A point of the axis with a name."""

    z: float
    name: str
    title: str


@dataclass(frozen=True)
class Drawing:
    """All that is seen.

    bare : surfaces without glass.
    stops : z, radius of the opening, outer radius.
    film : z, half its height.
    fields : what each fan's colour stands for.
    outside : marks too far off to be in the picture.
    """

    title: str
    outlines: tuple[Outline, ...]
    bare: tuple[tuple[Point, tuple[Piece, ...]], ...]
    stops: tuple[tuple[float, float, float], ...]
    rays: tuple[Ray, ...]
    fields: tuple[str, ...]
    marks: tuple[Mark, ...]
    outside: tuple[Mark, ...]
    film: tuple[float, float]
    low: Point
    high: Point


# ---- Glass


def profile(surface: Element, vertex: float, reach: float, section: Section = "y") -> tuple[Point, tuple[Piece, ...]]:
    """A surface from `-reach` up to `reach` (mm): its lower end, and its pieces."""
    across, along = surface.quadric()[0 if section == "x" else 1], surface.quadric()[2]
    bottom, top = ((vertex + _sag(surface, height, section), height) for height in (-reach, reach))
    if not any(surface.coefficients):
        if across == 0.0:
            return bottom, (Line(top),)
        # An ellipse, across y^2 + along z^2 = 2 z.
        if across * along > 0.0:
            half_z, half_height = abs(1.0 / along), 1.0 / math.sqrt(across * along)
            return bottom, (Arc(half_z, half_height, across < 0.0, top),)
    heights = np.linspace(-reach, reach, _PIECES + 1)
    zs = [vertex + _sag(surface, float(height), section) for height in heights]
    slopes = [_slope(surface, float(height), section) for height in heights]
    pieces = []
    for (low, high), (z_low, z_high), (s_low, s_high) in zip(
        pairwise(heights.tolist()), pairwise(zs), pairwise(slopes), strict=True
    ):
        third = (high - low) / 3.0
        pieces.append(
            Cubic((z_low + third * s_low, low + third), (z_high - third * s_high, high - third), (z_high, high))
        )
    return bottom, tuple(pieces)


def _sag(surface: Element, height: float, section: Section) -> float:
    """How far a surface is behind its vertex; at the farthest point of one that does not reach so far."""
    u, w = surface.quadric()[0 if section == "x" else 1], surface.quadric()[2]
    root = math.sqrt(max(0.0, 1.0 - u * w * height * height))
    terms = (a * height ** (2 * power) for power, a in enumerate(surface.coefficients, start=2))
    return u * height * height / (1.0 + root) + math.fsum(terms)


def _slope(surface: Element, height: float, section: Section) -> float:
    """dz/dheight, of u h^2 + w z^2 = 2 z by implicit differentiation and of the polynomial."""
    u, w = surface.quadric()[0 if section == "x" else 1], surface.quadric()[2]
    root = math.sqrt(max(0.0, 1.0 - u * w * height * height))
    slope = u * height / root if root > 0.0 else 0.0
    for power, coefficient in enumerate(surface.coefficients, start=2):
        slope += 2 * power * coefficient * height ** (2 * power - 1)
    return slope


def reversed_pieces(start: Point, pieces: Sequence[Piece]) -> tuple[Point, tuple[Piece, ...]]:
    """The same curve from its other end."""
    ends = [start, *(piece.end for piece in pieces)]
    turned: list[Piece] = []
    for piece, end in zip(reversed(pieces), reversed(ends[:-1]), strict=True):
        if isinstance(piece, Arc):
            turned.append(piece._replace(anticlockwise=not piece.anticlockwise, end=end))
        elif isinstance(piece, Cubic):
            turned.append(Cubic(piece.second, piece.first, end))
        else:
            turned.append(Line(end))
    return ends[-1], tuple(turned)


def _body(front: Element, back: Element, places: Point, section: Section) -> Outline:
    """The glass between two surfaces."""
    start, pieces = profile(front, places[0], front.radius, section)
    foot, rear = profile(back, places[1], back.radius, section)
    top, down = reversed_pieces(foot, rear)
    reach = max(front.radius, back.radius)
    before, behind = pieces[-1].end[0], top[0]
    # A flat rim brings the smaller surface to the other's height, where there is glass for it; else a bevel.
    above: list[Piece] = []
    below: list[Piece] = []
    if before <= behind:
        above = [Line((before, reach)), Line((behind, reach))]
        below = [Line((behind, -reach)), Line((before, -reach))]
    outline = (*pieces, *above, Line(top), *down, *below, Line(start))
    fill, title = _look(front.glass)
    opacity = 0.3 + 0.25 * min(1.0, max(0.0, float(front.glass.ior()) - 1.4) / 0.5)
    return Outline(start, outline, fill, opacity, title)


def _look(glass: Glass) -> tuple[str, str]:
    index = float(glass.ior())
    if not glass.disperses():
        return OTHER, f"n = {index:.4f}"
    abbe = glass.abbe()
    name = f"{glass.name}: " if any(c.isalpha() for c in glass.name) else ""
    return (CROWN if abbe > 50.0 else FLINT), f"{name}n = {index:.4f}, V = {abbe:.1f}"


# ---- Rays


def fan(
    surfaces: LensSurfaces,
    film: float,
    height: float,
    *,
    plane: float = -math.inf,
    section: Section = "y",
    wavelength: float | None = None,
    count: int = _DRAWN,
) -> tuple[Array, float] | None:
    """Rays of one point of the scene, that which is seen at a height of the film (mm; upwards in the drawing).

    The ray from the film through the middle of the stop says where that point is; rays from it are then tried, and of
    those that get through `count` are chosen at equal distances.

    Parameters
    ----------
    film : its place (mm).
    plane : place of the point (mm, before the lens); its light is parallel if it is infinite.

    Returns
    -------
    Points (rays, surfaces + 2, 2), (z, height), from before the lens to the film; the point's angle from the axis
    (degrees, above 0 if it is below it).  None if no light gets there.
    """
    axis = 0 if section == "x" else 1
    last = float(surfaces.vertex[-1])

    def spread(values: tuple[Array | float, Array | float]) -> Array:
        """(height, z) as points of space."""
        rows = np.zeros((max(np.size(values[0]), np.size(values[1])), 3))
        rows[:, axis], rows[:, 2] = values
        return rows

    # Find the chief ray, from the film to the scene.
    tried = np.linspace(-1.0, 1.0, _TRIED) * float(surfaces.radius[-1])
    ways = spread((tried - height, last - film))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    weights, points, onward = trace_paths(surfaces, spread((height, film)).repeat(_TRIED, 0), ways, False, wavelength)
    through = weights > 0.0
    if through.sum() < 2:
        return None
    points, onward = points[through], onward[through]
    stop = max(surfaces.stop, 0)
    chief = int(np.argmin(np.abs(points[:, stop, axis])))
    towards = onward[chief, 0][[2, axis]]
    at = points[chief, 0][[2, axis]]
    angle = math.degrees(math.atan2(towards[1], -towards[0]))

    # Send light from there through all of the front that it may fill.
    normal = np.array([-towards[1], towards[0]])
    offsets = (points[:, 0][:, [2, axis]] - at) @ normal
    room = 0.6 * (offsets.max() - offsets.min()) + 1e-3 * float(surfaces.radius[0])
    offsets = np.linspace(offsets.min() - room, offsets.max() + room, _TRIED)
    aims = at + offsets[:, None] * normal
    length = float(surfaces.vertex[-1] - surfaces.vertex[0]) + abs(film - last)
    if math.isinf(plane):
        starts = aims + _BEFORE * length * towards
        directions = np.broadcast_to(-towards, starts.shape)
    else:
        place = at + (plane - at[0]) / towards[0] * towards
        directions = aims - place
        directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        away = min(_BEFORE * length, float(np.linalg.norm(place - at)))
        starts = aims - away * directions
    weights, points, onward = trace_paths(
        surfaces, spread((starts[:, 1], starts[:, 0])), spread((directions[:, 1], directions[:, 0])), True, wavelength
    )
    chosen = np.flatnonzero(weights > 0.0)
    if chosen.size == 0:
        return None
    chosen = chosen[np.unique(np.linspace(0, chosen.size - 1, count).round().astype(int))]
    met, leaving = points[chosen][:, :, [2, axis]], onward[chosen, -1][:, [2, axis]]
    reached = met[:, -1] + ((film - met[:, -1, 0]) / leaving[:, 0])[:, None] * leaving
    return np.concatenate([starts[chosen][:, None], met, reached[:, None]], axis=1), angle


# ---- The whole


def drawing(
    lens: Lens,
    surfaces: LensSurfaces,
    film: float,
    heights: Sequence[float],
    *,
    half_film: float,
    plane: float = -math.inf,
    section: Section = "y",
    marks: Mapping[str, tuple[float, str]] | None = None,
    wavelength: float | None = None,
) -> Drawing:
    """A lens in section.

    Parameters
    ----------
    surfaces : `lens` packed as it is set: stop, focus.
    film : its place (mm from the front vertex).
    heights : in the image (mm, 0 or more) whose light is drawn.
    half_film : half the film's height in this section (mm).
    plane : place of what is photographed (mm, negative), may be infinite.
    marks : places on the axis (mm) and what they are, by the names that are drawn.
    wavelength : of the rays (nm); the d line by default.
    """
    elements, vertex = lens.elements, [float(v) for v in surfaces.vertex]
    outlines, loose, stops = [], [], []
    for number, (one, place) in enumerate(zip(elements, vertex, strict=True)):
        is_glass = float(one.glass.ior()) != 1.0
        before = number > 0 and float(elements[number - 1].glass.ior()) != 1.0
        if is_glass and number + 1 < len(elements):
            outlines.append(_body(one, elements[number + 1], (place, vertex[number + 1]), section))
        if number == surfaces.stop:
            open_to = float(surfaces.radius[number])
            # Of glass that is its own stop it is the rim.
            rim = place + _sag(one, open_to, section)
            stops.append((rim, open_to, max(1.15 * one.radius, open_to + 0.25 * one.radius)))
        elif not is_glass and not before:
            loose.append(profile(one, place, one.radius, section))

    rays, fields = [], []
    for number, height in enumerate(heights):
        # A point above the axis is seen below it.  At the very end of the field no light may be left.
        for part in _LIT:
            found = fan(surfaces, film, -part * height, plane=plane, section=section, wavelength=wavelength)
            if found is not None:
                fields.append(f"{abs(found[1]):.3g}° ({part * height:.3g} mm on the film)")
                rays += [Ray(points, number) for points in found[0]]
                break

    corners = [np.array([[vertex[0], 0.0], [film, half_film], [film, -half_film]])]
    corners += [np.array([[o.start[0], o.start[1]], *(p.end for p in o.pieces)]) for o in outlines]
    corners += [np.array([[z, outer], [z, -outer]]) for z, _, outer in stops]
    # Few rays that go astray behind the lens are not to make all else small.
    limit = _ASTRAY * float(np.abs(np.concatenate(corners)[:, 1]).max())
    rays = [ray._replace(points=_ending(ray.points, limit)) for ray in rays]
    every = np.concatenate([*corners, *(ray.points for ray in rays)])
    low, high = every.min(axis=0), every.max(axis=0)
    room = 0.02 * (high[0] - low[0])
    named = [Mark(z, name, title) for name, (z, title) in (marks or {}).items() if math.isfinite(z)]
    inside = [mark for mark in named if low[0] - room <= mark.z <= high[0] + room]
    return Drawing(
        title=f"{lens.name}, in section" if lens.is_round() else f"{lens.name}, in the plane of {section}",
        outlines=tuple(outlines),
        bare=tuple(loose),
        stops=tuple(stops),
        rays=tuple(rays),
        fields=tuple(fields),
        marks=tuple(inside),
        outside=tuple(mark for mark in named if mark not in inside),
        film=(film, half_film),
        low=(float(low[0] - room), float(low[1] - room)),
        high=(float(high[0] + room), float(high[1] + room)),
    )


def _ending(points: Array, limit: float) -> Array:
    """A ray whose last straight piece ends at a height, if it goes beyond."""
    (z, height), (last_z, last) = points[-2:]
    if abs(last) <= limit or abs(height) >= limit:
        return points
    part = (math.copysign(limit, last) - height) / (last - height)
    ended = points.copy()
    ended[-1] = z + part * (last_z - z), height + part * (last - height)
    return ended


def sections(lens: Lens, study: Study) -> tuple[Drawing, ...]:
    """A lens in section, set up as it was for a study: once, or in both planes if it has cylinders."""
    bench = bench_of(lens, study.settings)
    return tuple(_section(bench, first) for first in study.first_order)


def _section(bench: Bench, first: FirstOrder) -> Drawing:
    at: Section = "x" if first.meridian == "x" else "y"
    marks = {
        "F": (first.front_focus_z_mm, "front focal point"),
        "F′": (first.rear_focus_z_mm, "rear focal point"),
        "H": (first.front_principal_z_mm, "front principal point, and nodal point"),
        "H′": (first.rear_principal_z_mm, "rear principal point, and nodal point"),
        "entrance pupil": (first.entrance_pupil_z_mm, "entrance pupil"),
        "exit pupil": (first.exit_pupil_z_mm, "exit pupil"),
    }
    largest = first.half_field_image_height_mm
    heights = [part * largest for part in _FIELDS] if math.isfinite(largest) else [0.0]
    return drawing(
        bench.lens,
        bench.surfaces(),
        bench.film,
        heights,
        half_film=max(heights),
        plane=bench.pupil - bench.distance,
        section=at,
        marks=marks,
        wavelength=bench.primary,
    )


# ---- SVG

_FONT = 12.0
_ROW = 16.0


def picture(drawing: Drawing, width: float = 900.0) -> Node:
    """A drawing as an `svg` that is `width` pixels wide."""
    margin = 14.0
    scale = (width - 2.0 * margin) / (drawing.high[0] - drawing.low[0])
    tall = scale * (drawing.high[1] - drawing.low[1])
    marks, rows = _rows(drawing, scale, margin)
    axis = margin + scale * drawing.high[1]
    bottom = margin + tall
    legend, legend_height = _legend(drawing, width)
    height = bottom + _ROW * rows + legend_height + 8.0

    # Millimetres, z to the right and heights upwards.
    move = f"translate({_mm(margin - scale * drawing.low[0])} {_mm(axis)}) scale({_mm(scale)} {_mm(-scale)})"
    glass = [
        element(
            "path",
            {"d": _path(o.start, o.pieces) + "Z", "fill": o.fill, "fill_opacity": o.opacity, **_pen(INK, 1.1)},
            element("title", {}, o.title),
        )
        for o in drawing.outlines
    ]
    loose = [element("path", {"d": _path(*one), "fill": "none", **_pen(INK, 1.1)}) for one in drawing.bare]
    lines = [
        element("path", {"d": _polyline(ray.points), "fill": "none", **_pen(HUES[ray.field % len(HUES)], 1.0)})
        for ray in drawing.rays
    ]
    stops = [
        element(
            "path",
            {"d": "".join(_segment((z, s * low), (z, s * high)) for s in (1.0, -1.0)), **_pen(INK, 3.5)},
            element("title", {}, "stop"),
        )
        for z, low, high in drawing.stops
    ]
    film, half = drawing.film
    end = _segment((film, -half), (film, half))
    optical = _segment((drawing.low[0], 0.0), (drawing.high[0], 0.0))
    body = element(
        "g",
        {"transform": move},
        *glass,
        *loose,
        element("path", {"d": optical, "stroke_dasharray": "10 3 2 3", "stroke_opacity": 0.6, **_pen(INK, 1.0)}),
        *lines,
        *stops,
        element("path", {"d": end, **_pen(INK, 3.0)}, element("title", {}, "film")),
    )
    names = [node for mark, x, row in marks for node in _name(mark, x, row, axis, bottom)]
    lowered = element("g", {"transform": f"translate(0 {svg.number(bottom + _ROW * rows + 6.0)})"}, *legend)
    return svg.picture(width, height, drawing.title, body, *names, lowered)


def document(drawings: Sequence[Drawing]) -> bytes:
    """Drawings below each other as a file (UTF-8)."""
    made = [picture(one) for one in drawings]
    sizes = [[float(number) for number in node[1]["viewBox"].split()[2:]] for node in made]
    parts, top = [], 0.0
    for (name, attributes, *children), (width, height) in zip(made, sizes, strict=True):
        parts.append(
            [
                name,
                attributes | {"y": svg.number(top), "width": svg.number(width), "height": svg.number(height)},
                *children,
            ]
        )
        top += height
    if len(made) == 1:
        return svg.document(made[0])
    label = "; ".join(one.title for one in drawings)
    return svg.document(svg.picture(sizes[0][0], top, label, *parts))


def _mm(value: float) -> str:
    """A number of the drawing, to 10 nm."""
    text = f"{value:.5f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _pair(point: Iterable[float]) -> str:
    return " ".join(_mm(float(value)) for value in point)


def _segment(start: Point, end: Point) -> str:
    return f"M{_pair(start)}L{_pair(end)}"


def _polyline(points: Array) -> str:
    return "M" + "L".join(_pair(point) for point in points)


def _path(start: Point, pieces: Sequence[Piece]) -> str:
    parts = [f"M{_pair(start)}"]
    for piece in pieces:
        if isinstance(piece, Arc):
            # In the drawing's own frame, of which the heights grow upwards, the positive sense is anticlockwise.
            sense = int(piece.anticlockwise)
            parts.append(f"A{_mm(piece.half_z)} {_mm(piece.half_height)} 0 0 {sense} {_pair(piece.end)}")
        elif isinstance(piece, Cubic):
            parts.append("C" + " ".join(_pair(point) for point in piece))
        else:
            parts.append(f"L{_pair(piece.end)}")
    return "".join(parts)


def _pen(hue: str, wide: float) -> dict[str, object]:
    """A line as wide in pixels whatever the scale."""
    return {"stroke": hue, "stroke_width": wide, "vector_effect": "non-scaling-stroke"}


def _rows(drawing: Drawing, scale: float, margin: float) -> tuple[list[tuple[Mark, float, int]], int]:
    """Names of points under the drawing: where across, and in which row, so that none covers another."""
    placed: list[tuple[Mark, float, int]] = []
    ends: list[float] = []
    for mark in sorted(drawing.marks):
        x = margin + scale * (mark.z - drawing.low[0])
        half = 0.5 * 0.6 * _FONT * len(mark.name) + 3.0
        row = next((n for n, end in enumerate(ends) if x - half > end), len(ends))
        ends[row : row + 1] = [x + half]
        placed.append((mark, x, row))
    return placed, len(ends)


def _name(mark: Mark, x: float, row: int, axis: float, bottom: float) -> list[Node]:
    y = bottom + _ROW * (row + 0.75)
    lead = f"M{svg.number(x)} {svg.number(axis)}V{svg.number(y - 11.0)}"
    look = {"stroke": INK, "stroke_width": 0.8, "stroke_dasharray": "2 3", "stroke_opacity": 0.5, "fill": "none"}
    title = element("title", {}, f"{mark.title}: {mark.z:.4g} mm")
    return [
        element("path", {"d": lead, **look}),
        element("circle", {"cx": x, "cy": axis, "r": 2.6, "fill": INK}, title),
        element("text", {"x": x, "y": y, "text_anchor": "middle", "font_size": _FONT, "fill": INK}, mark.name, title),
    ]


def _legend(drawing: Drawing, width: float) -> tuple[list[Node], float]:
    """The fields' colours."""
    used = sorted({ray.field for ray in drawing.rays})
    entries = [(HUES[field % len(HUES)], text) for field, text in zip(used, drawing.fields, strict=True)]
    nodes: list[Node] = []
    x, y = 14.0, 14.0
    for hue, text in entries:
        wide = 36.0 + 0.56 * _FONT * len(text)
        if x + wide > width and x > 14.0:
            x, y = 14.0, y + 18.0
        nodes.append(element("path", {"d": f"M{svg.number(x)} {svg.number(y - 4.0)}h22", **_pen(hue, 2.0)}))
        nodes.append(element("text", {"x": x + 28.0, "y": y, "font_size": _FONT, "fill": INK}, text))
        x += wide + 10.0
    return nodes, y + 6.0 if nodes else 0.0


# ---- Matplotlib


def draw(drawing: Drawing, axes: "Axes") -> None:
    """A drawing on Matplotlib's axes."""
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
        axes.plot(*ray.points.T, color=HUES[ray.field % len(HUES)], linewidth=0.6, label=labels.pop(ray.field, None))
    for z, low, high in drawing.stops:
        for side in (1.0, -1.0):
            axes.plot([z, z], [side * low, side * high], color=ink, linewidth=2.2)
    film, half = drawing.film
    axes.plot([film, film], [-half, half], color=ink, linewidth=2.0)
    placed, rows = _rows(drawing, 700.0 / (drawing.high[0] - drawing.low[0]), 0.0)
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
    """An outline as Matplotlib takes it: arcs in short cubics."""
    from matplotlib.path import Path

    points, codes = [start], [int(Path.MOVETO)]
    for piece in pieces:
        if isinstance(piece, Line):
            points.append(piece.end)
            codes.append(int(Path.LINETO))
            continue
        cubics = _cubics(points[-1], piece) if isinstance(piece, Arc) else [piece]
        for cubic in cubics:
            points += [cubic.first, cubic.second, cubic.end]
            codes += 3 * [int(Path.CURVE4)]
    return points, codes


def _cubics(start: Point, arc: Arc) -> list[Cubic]:
    """An arc of a circle, squeezed along z, in cubics.

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
