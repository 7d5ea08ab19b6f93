"""Polygonal openings: the shape that the blades of a diaphragm leave, and rectangles.

The unit of length is the radius of the round opening of the same area, pi: see `apertures.base.interface`.
"""

import math
from typing import Any, NamedTuple

from raytracer.core.compiler.dispatch import generic, kernel
from raytracer.core.sampling.warp import sample_disc
from raytracer.optics.lens_system.surfaces import aperture_extent, aperture_transmission
from raytracer.plugins.apertures.base.interface import sample_aperture, stretch_aperture

_SERIES_TERMS = 8
_NEWTON_STEPS = 3


class StraightEdge(NamedTuple):
    """Packed straight edge to the right of the centre.

    distance : of the edge from the centre.
    half_length : half the length of the edge.
    """

    distance: float
    half_length: float


class ArcEdge(NamedTuple):
    """Packed curved edge to the right of the centre: an arc about (apex - radius, 0).

    apex : distance of the arc from the centre, along the axis.
    radius : of the arc.
    angle (rad) : half the angle that the arc spans about its own centre.
    swept_area : area between the centre of the aperture and half the arc, times 2 / radius.
    """

    apex: float
    radius: float
    angle: float
    swept_area: float


class Polygon(NamedTuple):
    """Packed regular polygon.

    blades : number of edges.
    turn (rad) : direction of the middle of the first edge from the centre.
    edge : a StraightEdge or an ArcEdge.
    """

    blades: float
    turn: float
    edge: Any


def pack_polygon(blades: int, rotation: float, curvature: float) -> Polygon:
    """Pack a regular polygon of area pi with a corner at the top.

    rotation : anticlockwise as seen from behind the camera (deg).
    curvature : of the edges, over that of the circle through the corners: 0 for straight edges, less than 1.
    """
    slice_angle = 2.0 * math.pi / blades
    turn = math.pi / 2.0 + 0.5 * slice_angle + math.radians(math.fmod(rotation, 360.0))
    return Polygon(float(blades), turn, _pack_edge(blades, curvature))


def pack_rectangle(width: float, height: float) -> Any:
    """Pack a rectangle of area pi with the proportions of these edges, upright."""
    # The square of a disc's area, drawn out to the rectangle's shape.
    return stretch_aperture(pack_polygon(4, 45.0, 0.0), height / width)


def _pack_edge(blades: int, curvature: float) -> StraightEdge | ArcEdge:
    """Pack the edge to the right of the centre, of a polygon of area pi."""
    # First with corners on the unit circle.
    corner = math.pi / blades
    near, half = math.cos(corner), math.sin(corner)
    angle = math.asin(curvature * half)
    apex = near + half * math.tan(0.5 * angle)
    if apex == near:
        size = math.sqrt(math.pi / (blades * near * half))
        return StraightEdge(size * near, size * half)
    radius = 1.0 / curvature
    swept = apex * angle + (radius - apex) * _minus_sine(angle)
    size = math.sqrt(math.pi / (blades * radius * swept))
    return ArcEdge(size * apex, size * radius, angle, size * swept)


def _minus_sine(angle: float) -> float:
    """Compute angle - sin(angle) up to 60 degrees without cancellation, by Taylor's series, to the last bit or two."""
    square = angle * angle
    rest = 1.0
    for term in range(_SERIES_TERMS, 0, -1):
        rest = 1.0 - rest * square / ((2.0 * term + 2.0) * (2.0 * term + 3.0))
    return rest * angle * square / 6.0


minus_sine = kernel(_minus_sine)


@generic
def sample_edge(edge, fraction):
    """Return the point of an edge up to which a line from the centre sweeps a part, -1 to 1, of half the area."""


@sample_edge.register(StraightEdge)
def sample_edge_straight_edge(edge, fraction):
    return edge.distance, edge.half_length * fraction


@sample_edge.register(ArcEdge)
def sample_edge_arc_edge(edge, fraction):
    # Of a circle of radius r about a point at the distance d behind the centre, the line from the centre sweeps
    # r (r a - d sin a) / 2 while its end goes through the angle a: Kepler's equation.  The area grows nearly evenly
    # with a, so that Newton's method starts with a few digits and doubles them each time.
    behind = edge.radius - edge.apex
    angle = fraction * edge.angle
    for _step in range(_NEWTON_STEPS):
        sine = math.sin(0.5 * angle)
        excess = edge.apex * angle + behind * minus_sine(angle) - fraction * edge.swept_area
        angle -= excess / (edge.apex + 2.0 * behind * sine * sine)
    sine = math.sin(0.5 * angle)
    return edge.apex - 2.0 * edge.radius * sine * sine, edge.radius * math.sin(angle)


@generic
def edge_excess(edge, along, across):
    """Tell on which side of its sector's edge a point lies: greater than 0 beyond the edge, at most 0 before it."""


@edge_excess.register(StraightEdge)
def edge_excess_straight_edge(edge, along, across):
    return along - edge.distance


@edge_excess.register(ArcEdge)
def edge_excess_arc_edge(edge, along, across):
    # The distances from the arc's centre, squared, without their common part, which is large for a slight curve.
    past = along - edge.apex
    return past * (past + 2.0 * edge.radius) + across * across


@sample_aperture.register(Polygon)
def sample_aperture_polygon(aperture, u1, u2):
    # The disc, taken to the polygon along its radii, with each sector of the disc as large as what it becomes.
    x, y = sample_disc(u1, u2)
    sector = aperture.blades * math.atan2(y, x) / (2.0 * math.pi)
    number = math.floor(sector + 0.5)
    along, across = sample_edge(aperture.edge, 2.0 * (sector - number))
    radius = math.hypot(x, y)
    angle = aperture.turn + 2.0 * math.pi * number / aperture.blades
    cosine, sine = math.cos(angle), math.sin(angle)
    return radius * (cosine * along - sine * across), radius * (sine * along + cosine * across)


@aperture_transmission.register(Polygon)
def aperture_transmission_polygon(diaphragm, x, y):
    slice_angle = 2.0 * math.pi / diaphragm.blades
    number = math.floor((math.atan2(y, x) - diaphragm.turn) / slice_angle + 0.5)
    angle = diaphragm.turn + slice_angle * number
    cosine, sine = math.cos(angle), math.sin(angle)
    return 1.0 if edge_excess(diaphragm.edge, cosine * x + sine * y, cosine * y - sine * x) <= 0.0 else 0.0


@aperture_extent.register
def aperture_extent_polygon(diaphragm: Polygon) -> float:
    # The corners are the ends of the edges.
    return math.hypot(*sample_edge(diaphragm.edge, 1.0))
