"""Scattering with a shading normal that is not the geometric one, without a loss or gain of energy.

Normals of a mesh's vertices, normal maps and bump maps tilt the normal that a surface is shaded with.  Let g be the
geometric and n the shading normal, both turned to the side that light arrives from, at an angle t.  The material,
shaded with n, draws w with the density p(w) and sends it light with the value V(w) = f |cos|.  It reflects where
n . w > 0 and transmits where n . w < 0; but in two wedges of the angle t the sign of g . w is another one, so that
reflected light would go into the surface, and transmitted light would stay out.  To drop that light darkens surfaces
(a white sphere of 80 faces by 0.5 %, its darkest places by 5 %).  Here such directions are turned to the right side.

Let h be the angle of a direction's projection on the plane of g and n above the horizon of g (below it, for what is
transmitted), on the side that n leans to.  What the material draws has h between -t, the horizon of n, and pi - t; the
wedge is h < 0.  Its directions are turned about g x n, to the heights up to Z:

    h' = -h / s,    s = t / Z.

Solid angle is even in h where the component along g x n is constant, so this multiplies densities by s, and with the
inverse m(w') of it, which lies in the wedge where h' < Z,

    V'(w') = V(w') + s V(m(w')),    p'(w') = p(w') + s p(m(w')),    for w' on the same side by g and by n, else 0.

Both integrals over w' are those over w, so no energy is lost or made, and no direction leaves on the wrong side, as
long as Z is the same for all w and t <= Z <= pi - t.  A sample's weight stays V(w) / p(w): given w', its mean over the
two directions that may have led there, in proportion to their densities, is V'(w') / p'(w').  Where n = g nothing is
turned, and what is on the right side stays as it is: what goes straight through goes straight.

Z = t mirrors the wedge at the surface.  It then is all just above the horizon: of a matte sphere of 80 faces in
parallel light that makes steps in brightness between lit faces up to 0.25 (of a brightness of 1, on the average over
lights and views), and half as much again of the step where faces turn away from the light.  Z = pi - t spreads it
over all heights: 0.03; but a glossy lobe, most of which lies in the wedge as seen near the rim, becomes a streak across
the sky.  So Z is twice the height of the middle of the lobe, the mirror direction or straight on: a lobe that reaches
down to the horizon reaches about as far to its other side.  Where that middle itself lies in the wedge, as do all
directions of a mirror there, Z = t.

**A normal that faces away from the viewer**, as at the rim of a coarse mesh, has no lobe on the viewer's side.  The
nearest normal that does not is taken for it, at a right angle to the viewer: what a round silhouette has at its rim.

References: Veach 1997, thesis, sec. 5.3 (shading normals and their loss of energy); Schuessler et al. 2017,
"Microfacet-based Normal Mapping for Robust Monte Carlo Path Tracing", ACM TOG 36(6) (the same goal by another model
of the surface, which gives a smooth mesh the brightness of its faces where normals lean to the light).
"""

import math
from typing import NamedTuple

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import Vec3, dot, madd, neg, norm, normalize, reflect, scale

# The least cosine between a shading normal and the viewer, and the least sine between the two normals that counts:
# its square is what float64 can tell from 0 beside 1.
_GRAZING = 2.0**-26


class NormalTilt(NamedTuple):
    """Tilt of a shading normal over a surface.

    Attributes
    ----------
    up : the true unit normal on the side to which light scatters.
    toward : the unit vector across it that the shading normal on that side leans to.
    spread : s above, and 0 where the two normals are the same.
    limit : Z (rad).
    """

    up: Vec3
    toward: Vec3
    spread: float
    limit: float


@kernel
def turn_towards_viewer(normal: Vec3, viewer: Vec3, geometric: Vec3) -> Vec3:
    """Turn `normal` until it does not face away from the unit vector `viewer`, and no further."""
    if dot(normal, viewer) >= _GRAZING:
        return normal
    along = madd(normal, -dot(normal, viewer), viewer)
    size = norm(along)
    # A normal that faces exactly away has no nearest one.
    return normalize(madd(scale(1.0 / size, along), _GRAZING, viewer)) if size > 0.0 else geometric


@kernel
def _height(direction: Vec3, up: Vec3, toward: Vec3) -> float:
    """Measure the height h of a direction, as above (rad)."""
    return math.atan2(dot(direction, up), dot(direction, toward))


@kernel
def normal_tilt(geometric: Vec3, shading: Vec3, incoming: Vec3, transmitted: bool) -> NormalTilt:
    """Compare a shading normal with the geometric one, both turned against the direction of incoming light."""
    up = neg(geometric) if transmitted else geometric
    normal = neg(shading) if transmitted else shading
    cosine = dot(normal, up)
    across = madd(normal, -cosine, up)
    sine = norm(across)
    if sine < _GRAZING:
        return NormalTilt(up, up, 0.0, 0.0)
    toward = scale(1.0 / sine, across)
    angle, rest = math.atan2(sine, cosine), math.atan2(sine, -cosine)
    middle = _height(incoming if transmitted else reflect(incoming, shading), up, toward)
    # Of normals at more than a right angle, only the angles up to `rest` are free for the wedge.
    limit = min(max(angle, 2.0 * middle), rest)
    return NormalTilt(up, toward, angle / limit, limit)


@kernel
def _turned(tilt: NormalTilt, direction: Vec3, factor: float) -> Vec3:
    """Turn a direction about the line in which both horizons meet, to a multiple of its height."""
    rise, run = dot(direction, tilt.up), dot(direction, tilt.toward)
    length, height = math.hypot(rise, run), factor * math.atan2(rise, run)
    turned = madd(direction, length * math.sin(height) - rise, tilt.up)
    return madd(turned, length * math.cos(height) - run, tilt.toward)


@kernel
def out_of_wedge(tilt: NormalTilt, direction: Vec3) -> Vec3:
    """Turn a direction of the wedge to the right side of the surface: h to h'."""
    return _turned(tilt, direction, -1.0 / tilt.spread)


@kernel
def into_wedge(tilt: NormalTilt, direction: Vec3) -> tuple[Vec3, float]:
    """Find the direction m that `out_of_wedge` turns to this one, on the right side, and s; that is 0 if none is."""
    if tilt.spread == 0.0 or _height(direction, tilt.up, tilt.toward) >= tilt.limit:
        return direction, 0.0
    return _turned(tilt, direction, -tilt.spread), tilt.spread
