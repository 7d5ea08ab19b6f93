"""Cross-sections as SVG."""

from collections.abc import Iterable, Sequence

from raytracer.analysis.lens_design.cross_section.drawing import LABEL_FONT, AxisMark, CrossSection, stack_labels
from raytracer.analysis.lens_design.cross_section.outlines import Arc, Cubic, FloatArray, Piece, Point
from raytracer.report import svg
from raytracer.report.palette import SERIES
from raytracer.report.svg import INK, Node, element

_FONT = LABEL_FONT
_ROW = 16.0


def render_svg(drawing: CrossSection, width: float = 900.0) -> Node:
    """Render a drawing as an `svg` that is `width` pixels wide."""
    margin = 14.0
    scale = (width - 2.0 * margin) / (drawing.high[0] - drawing.low[0])
    tall = scale * (drawing.high[1] - drawing.low[1])
    marks, rows = stack_labels(drawing, scale, margin)
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
        element("path", {"d": _polyline(ray.points), "fill": "none", **_pen(SERIES[ray.field % len(SERIES)], 1.0)})
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
    names = [node for mark, x, row in marks for node in _draw_mark(mark, x, row, axis, bottom)]
    lowered = element("g", {"transform": f"translate(0 {svg.number(bottom + _ROW * rows + 6.0)})"}, *legend)
    return svg.render_svg(width, height, drawing.title, body, *names, lowered)


def document(drawings: Sequence[CrossSection]) -> bytes:
    """Write drawings below each other as a file (UTF-8)."""
    rendered = [render_svg(one) for one in drawings]
    sizes = [[float(number) for number in node[1]["viewBox"].split()[2:]] for node in rendered]
    parts, top = [], 0.0
    for (name, attributes, *children), (width, height) in zip(rendered, sizes, strict=True):
        parts.append(
            [
                name,
                attributes | {"y": svg.number(top), "width": svg.number(width), "height": svg.number(height)},
                *children,
            ]
        )
        top += height
    if len(rendered) == 1:
        return svg.document(rendered[0])
    label = "; ".join(one.title for one in drawings)
    return svg.document(svg.render_svg(sizes[0][0], top, label, *parts))


def _mm(value: float) -> str:
    """Write a number of the drawing (mm), to 10 nm."""
    text = f"{value:.5f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _pair(point: Iterable[float]) -> str:
    """Write a point."""
    return " ".join(_mm(float(value)) for value in point)


def _segment(start: Point, end: Point) -> str:
    """Write a straight line as a path."""
    return f"M{_pair(start)}L{_pair(end)}"


def _polyline(points: FloatArray) -> str:
    """Write straight lines through points as a path."""
    return "M" + "L".join(_pair(point) for point in points)


def _path(start: Point, pieces: Sequence[Piece]) -> str:
    """Write the pieces of a curve as a path."""
    parts = [f"M{_pair(start)}"]
    for piece in pieces:
        if isinstance(piece, Arc):
            # In the drawing's own frame, in which heights grow upwards, the positive sense is anticlockwise.
            sense = int(piece.anticlockwise)
            parts.append(f"A{_mm(piece.half_z)} {_mm(piece.half_height)} 0 0 {sense} {_pair(piece.end)}")
        elif isinstance(piece, Cubic):
            parts.append("C" + " ".join(_pair(point) for point in piece))
        else:
            parts.append(f"L{_pair(piece.end)}")
    return "".join(parts)


def _pen(color: str, width: float) -> dict[str, object]:
    """Style a line of a width in pixels, whatever the scale."""
    return {"stroke": color, "stroke_width": width, "vector_effect": "non-scaling-stroke"}


def _draw_mark(mark: AxisMark, x: float, row: int, axis: float, bottom: float) -> list[Node]:
    """Draw a mark on the axis, and its name below the drawing."""
    y = bottom + _ROW * (row + 0.75)
    lead = f"M{svg.number(x)} {svg.number(axis)}V{svg.number(y - 11.0)}"
    look = {"stroke": INK, "stroke_width": 0.8, "stroke_dasharray": "2 3", "stroke_opacity": 0.5, "fill": "none"}
    title = element("title", {}, f"{mark.title}: {mark.z:.4g} mm")
    return [
        element("path", {"d": lead, **look}),
        element("circle", {"cx": x, "cy": axis, "r": 2.6, "fill": INK}, title),
        element("text", {"x": x, "y": y, "text_anchor": "middle", "font_size": _FONT, "fill": INK}, mark.name, title),
    ]


def _legend(drawing: CrossSection, width: float) -> tuple[list[Node], float]:
    """Draw the legend of the fields' colours; returns its height too."""
    used = sorted({ray.field for ray in drawing.rays})
    entries = [(SERIES[field % len(SERIES)], text) for field, text in zip(used, drawing.fields, strict=True)]
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
