"""Polygonal aperture: the opening that the blades of a diaphragm leave.

In a scene:

    camera: {type: thin_lens, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 30, aperture: 40 mm,
             aperture_shape: {type: polygon, blades: 7, rotation: 10, curvature: 0.3}}
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from raytracer.apertures.interface import ApertureSpec, Assets, sample_aperture
from raytracer.jit import generic, kernel
from raytracer.lenses.diaphragm import covers, reach
from raytracer.sampling.warp import sample_disc
from raytracer.spec import Angle, Count, Fraction

_SERIES = 8
_NEWTON = 3


class PolygonAperture(ApertureSpec):
    """A regular polygon with a corner at the top, whose edges may bulge.

    Each edge is an arc of a circle whose curvature is `curvature` times that of the circle through the corners: a
    straight line for 0, and for 1 that circle itself, so that the opening is round.
    """

    type: Literal["polygon"] = "polygon"
    blades: Annotated[int, Count(3, 1000)] = Field(default=6, description="blades of the diaphragm, one an edge")
    rotation: Angle = Field(default=0.0, description="turn, anticlockwise as seen from behind the camera")
    curvature: Fraction = Field(
        default=0.0, description="how far the edges bulge: 0 straight, 1 along the circle through the corners"
    )

    def shape(self, assets: Assets) -> "Polygon | None":
        if self.curvature == 1.0:
            return None
        slice_angle = 2.0 * math.pi / self.blades
        turn = math.pi / 2.0 + 0.5 * slice_angle + math.radians(math.fmod(self.rotation, 360.0))
        return Polygon(float(self.blades), turn, self._edge())

    def _edge(self) -> "Straight | Arc":
        """The edge to the right of the centre, of a polygon of area pi."""
        # First with corners on the unit circle.
        corner = math.pi / self.blades
        near, half = math.cos(corner), math.sin(corner)
        angle = math.asin(self.curvature * half)
        apex = near + half * math.tan(0.5 * angle)
        if apex == near:
            size = math.sqrt(math.pi / (self.blades * near * half))
            return Straight(size * near, size * half)
        radius = 1.0 / self.curvature
        swept = apex * angle + (radius - apex) * _minus_sine(angle)
        size = math.sqrt(math.pi / (self.blades * radius * swept))
        return Arc(size * apex, size * radius, angle, size * swept)


class Straight(NamedTuple):
    """Packed edge to the right of the centre: its distance, and half its length."""

    near: float
    half: float


class Arc(NamedTuple):
    """Packed edge to the right of the centre: an arc of radius `radius` about (apex - radius, 0).

    apex, its distance on the axis; angle (rad), half of what it spans about its own centre; swept, the area between the
    centre of the aperture and half the arc, times 2 / radius.
    """

    apex: float
    radius: float
    angle: float
    swept: float


class Polygon(NamedTuple):
    """Packed: number of edges; direction (rad) of the middle of the first one from the centre; and an edge."""

    blades: float
    turn: float
    edge: Any


def _minus_sine(angle: float) -> float:
    """angle - sin(angle) for angles up to 60 degrees, without cancellation: Taylor's series, to the last bit or two."""
    square = angle * angle
    rest = 1.0
    for term in range(_SERIES, 0, -1):
        rest = 1.0 - rest * square / ((2.0 * term + 2.0) * (2.0 * term + 3.0))
    return rest * angle * square / 6.0


minus_sine = kernel(_minus_sine)


@generic
def edge_point(edge, fraction):
    """The point of an edge up to which a line from the centre sweeps a fraction, -1 to 1, of the area of that half."""
    raise NotImplementedError


@edge_point.register(Straight)
def _(edge, fraction):
    return edge.near, edge.half * fraction


@edge_point.register(Arc)
def _(edge, fraction):
    # Of a circle of radius r about a point at the distance d behind the centre, the line from the centre sweeps
    # r (r a - d sin a) / 2 while its end goes through the angle a: Kepler's equation.  The area grows nearly evenly
    # with a, so that Newton's method starts with a few digits and doubles them each time.
    behind = edge.radius - edge.apex
    angle = fraction * edge.angle
    for _step in range(_NEWTON):
        sine = math.sin(0.5 * angle)
        excess = edge.apex * angle + behind * minus_sine(angle) - fraction * edge.swept
        angle -= excess / (edge.apex + 2.0 * behind * sine * sine)
    sine = math.sin(0.5 * angle)
    return edge.apex - 2.0 * edge.radius * sine * sine, edge.radius * math.sin(angle)


@generic
def beyond(edge, along, across):
    """Of a point in the sector of an edge: greater than 0 beyond the edge, at most 0 on its near side."""
    raise NotImplementedError


@beyond.register(Straight)
def _(edge, along, across):
    return along - edge.near


@beyond.register(Arc)
def _(edge, along, across):
    # The distances from the arc's centre, squared, without their common part, which is large for a slight curve.
    past = along - edge.apex
    return past * (past + 2.0 * edge.radius) + across * across


@sample_aperture.register(Polygon)
def _(aperture, u1, u2):
    # The disc, taken to the polygon along its radii, with each sector of the disc as large as what it becomes.
    x, y = sample_disc(u1, u2)
    sector = aperture.blades * math.atan2(y, x) / (2.0 * math.pi)
    number = math.floor(sector + 0.5)
    along, across = edge_point(aperture.edge, 2.0 * (sector - number))
    radius = math.hypot(x, y)
    angle = aperture.turn + 2.0 * math.pi * number / aperture.blades
    cosine, sine = math.cos(angle), math.sin(angle)
    return radius * (cosine * along - sine * across), radius * (sine * along + cosine * across)


@covers.register(Polygon)
def _(diaphragm, x, y):
    slice_angle = 2.0 * math.pi / diaphragm.blades
    number = math.floor((math.atan2(y, x) - diaphragm.turn) / slice_angle + 0.5)
    angle = diaphragm.turn + slice_angle * number
    cosine, sine = math.cos(angle), math.sin(angle)
    return 1.0 if beyond(diaphragm.edge, cosine * x + sine * y, cosine * y - sine * x) <= 0.0 else 0.0


@reach.register
def _(diaphragm: Polygon) -> float:
    # The corners are the ends of the edges.
    return math.hypot(*edge_point(diaphragm.edge, 1.0))
