"""Outlines of glass in a cross-section, by straight lines and cubic curves."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.lens import Element
from raytracer.report.palette import CROWN, FLINT, PLAIN_GLASS

FloatArray = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]
SectionAxis: TypeAlias = Literal["x", "y"]

# Pieces of an arc, which is off by 1e-9 of its radius then, and of another curve.
_ARC_PIECES, _PIECES = 12, 48


class Line(NamedTuple):
    """Straight line from the end of the piece before."""

    end: Point


class Cubic(NamedTuple):
    """Cubic Bezier curve from the end of the piece before."""

    first: Point
    second: Point
    end: Point


Piece: TypeAlias = Line | Cubic


class Outline(NamedTuple):
    """Closed outline of a piece of glass.

    start : first point (mm).
    pieces : from there on, back to the start.
    fill, opacity : of the glass.
    title : name and index of the glass.
    """

    start: Point
    pieces: tuple[Piece, ...]
    fill: str
    opacity: float
    title: str


def surface_outline(
    surface: Element, vertex: float, reach: float, plane: SectionAxis = "y"
) -> tuple[Point, tuple[Piece, ...]]:
    """Draw a surface from `-reach` up to `reach` (mm): its lower end, and its pieces."""
    across, along = surface.quadric()[0 if plane == "x" else 1], surface.quadric()[2]
    bottom, top = ((vertex + surface_sag(surface, height, plane), height) for height in (-reach, reach))
    if not any(surface.coefficients):
        if across == 0.0:
            return bottom, (Line(top),)
        if across * along > 0.0:
            return _elliptic_arc(vertex, (1.0 / along, 1.0 / math.sqrt(across * along)), reach)
    heights = np.linspace(-reach, reach, _PIECES + 1)
    zs = [vertex + surface_sag(surface, float(height), plane) for height in heights]
    slopes = [surface_slope(surface, float(height), plane) for height in heights]
    pieces = []
    for (low, high), (z_low, z_high), (s_low, s_high) in zip(
        pairwise(heights.tolist()), pairwise(zs), pairwise(slopes), strict=True
    ):
        third = (high - low) / 3.0
        pieces.append(
            Cubic((z_low + third * s_low, low + third), (z_high - third * s_high, high - third), (z_high, high))
        )
    return bottom, tuple(pieces)


def _elliptic_arc(vertex: float, half_axes: Point, reach: float) -> tuple[Point, tuple[Piece, ...]]:
    """Draw across y^2 + along z^2 = 2 z up to a height; the half axis along z is negative if the centre lies in front.

    References: Riskus 2006, "Approximation of a Cubic Bezier Curve by Circular Arcs and Vice Versa" (4/3 tan(angle/4)).
    """
    half_z, half_height = half_axes
    end = math.asin(min(1.0, reach / half_height))
    lever = 4.0 / 3.0 * math.tan(2.0 * end / _ARC_PIECES / 4.0)

    def at(angle: float, ahead: float) -> Point:
        c, s = math.cos(angle), math.sin(angle)
        return vertex + half_z * (1.0 - c + ahead * s), half_height * (s + ahead * c)

    angles = np.linspace(-end, end, _ARC_PIECES + 1).tolist()
    return at(-end, 0.0), tuple(Cubic(at(a, lever), at(b, -lever), at(b, 0.0)) for a, b in pairwise(angles))


def surface_sag(surface: Element, height: float, plane: SectionAxis) -> float:
    """Compute the sag of a surface at a height (mm); beyond its edge, that of its farthest point."""
    u, w = surface.quadric()[0 if plane == "x" else 1], surface.quadric()[2]
    root = math.sqrt(max(0.0, 1.0 - u * w * height * height))
    terms = (a * height ** (2 * power) for power, a in enumerate(surface.coefficients, start=2))
    return u * height * height / (1.0 + root) + math.fsum(terms)


def surface_slope(surface: Element, height: float, plane: SectionAxis) -> float:
    """Compute dz/dheight, of u h^2 + w z^2 = 2 z by implicit differentiation, and of the polynomial."""
    u, w = surface.quadric()[0 if plane == "x" else 1], surface.quadric()[2]
    root = math.sqrt(max(0.0, 1.0 - u * w * height * height))
    slope = u * height / root if root > 0.0 else 0.0
    for power, coefficient in enumerate(surface.coefficients, start=2):
        slope += 2 * power * coefficient * height ** (2 * power - 1)
    return slope


def reversed_pieces(start: Point, pieces: Sequence[Piece]) -> tuple[Point, tuple[Piece, ...]]:
    """Reverse a curve: its other end, and its pieces from there."""
    ends = [start, *(piece.end for piece in pieces)]
    turned: list[Piece] = []
    for piece, end in zip(reversed(pieces), reversed(ends[:-1]), strict=True):
        turned.append(Cubic(piece.second, piece.first, end) if isinstance(piece, Cubic) else Line(end))
    return ends[-1], tuple(turned)


def glass_outline(front: Element, back: Element, places: Point, plane: SectionAxis) -> Outline:
    """Outline the glass between two surfaces."""
    start, pieces = surface_outline(front, places[0], front.radius, plane)
    foot, rear = surface_outline(back, places[1], back.radius, plane)
    top, down = reversed_pieces(foot, rear)
    reach = max(front.radius, back.radius)
    before, behind = pieces[-1].end[0], top[0]
    # A flat rim extends the smaller surface to the height of the other, where there is glass for it; else a bevel.
    above: list[Piece] = []
    below: list[Piece] = []
    if before <= behind:
        above = [Line((before, reach)), Line((behind, reach))]
        below = [Line((behind, -reach)), Line((before, -reach))]
    outline = (*pieces, *above, Line(top), *down, *below, Line(start))
    glass = front.glass
    index = float(glass.ior())
    fill, title = PLAIN_GLASS, f"n = {index:.4f}"
    if glass.disperses():
        fill = CROWN if glass.abbe() > 50.0 else FLINT
        name = f"{glass.name}: " if any(c.isalpha() for c in glass.name) else ""
        title = f"{name}{title}, V = {glass.abbe():.1f}"
    opacity = 0.3 + 0.25 * min(1.0, max(0.0, index - 1.4) / 0.5)
    return Outline(start, outline, fill, opacity, title)
