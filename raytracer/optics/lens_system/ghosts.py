"""Reflections inside a lens: the ways on which light from the film reaches the scene, and how strong each is.

Every surface reflects a part of the light.  What is reflected twice goes on towards the film, out of focus and upside
down or not: a ghost of the light's source; all of them together veil the picture as flare.  A lens of n reflecting
surfaces has n (n - 1) / 2 ghosts, one of each pair.  More reflections, and those at the film, are left out: each costs
another factor of a hundredth.

Rays are followed from the film, as all light is here.  Of one ray one way is followed, drawn from all of them; its
weight is the product of what its surfaces transmit and reflect, over the probability with which it is drawn.

References: Hullin, Eisemann, Seidel, Lee 2011, "Physically-Based Real-Time Lens Flare Rendering", TOG 30(4); Steinert,
Dammertz, Hanika, Lensch 2011, "General Spectral Camera Lens Simulation", CGF 30(6).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.glass import LINE_D
from raytracer.jit import entry, kernel
from raytracer.lenses.coatings import reflectance
from raytracer.lenses.diaphragm import reach as reach_of
from raytracer.lenses.surfaces import LensSurfaces, bend, index_in, meet, passed, row_of
from raytracer.sampling.warp import sample_bin, sample_disc
from raytracer.vec import madd, normalize, sub

# How often light takes the direct way, and which part of the rest goes to all pairs alike, lest one whose light was
# not found be left out.
_DIRECT = 0.5
_ALIKE = 0.5

# What part of the rays of a pair is aimed at the whole last surface, lest a place that was not found be left out.
_ANYWHERE = 0.2

# By how many radii of the film, and how many points across the last surface, it is found where a pair's light passes.
_RADII = 17
_ACROSS = 24

# By how many rays it is found how strong a pair is, at most and at least, and about how many they are of all pairs.
_MOST_TRIALS, _FEWEST_TRIALS, _ALL_TRIALS = 1024, 64, 200_000

# Up to how many pairs, those of 32 surfaces, it is found where their light passes: of more that takes too long.
_MOST_FOUND = 500


class Flare(NamedTuple):
    """Packed: the ways through a lens, and how often each is drawn.

    first, last : int32 (m,), the surfaces that reflect, from the front; the ray from the film meets `last` on its way,
    turns at `first`, turns again at `last`, and leaves at the front.
    cumulative : float64 (m + 1,), probabilities of the direct way and, after it, the pairs, each with those before it.
    ellipses : float64 (m, k, 3), where a pair's light crosses the plane of the last vertex, for k radii on the film:
    distance from the axis on the side of the place, and half axes along that direction and across it (mm), 0 if it is
    not known; per_mm, how many radii a millimetre has.
    reach : how far from the axis any light crosses that plane (mm).
    """

    first: NDArray[np.int32]
    last: NDArray[np.int32]
    cumulative: NDArray[np.float64]
    ellipses: NDArray[np.float64]
    per_mm: float
    reach: float


@kernel
def choose(flare, u):
    """Draw a way by a number in [0, 1).

    Returns
    -------
    (number of the pair, first, last, probability), with the surfaces that reflect; all three -1 for the direct way.
    """
    way, _ = sample_bin(flare.cumulative, 0, len(flare.cumulative), u)
    if way == 0:
        return -1, -1, -1, flare.cumulative[0]
    pair = way - 1
    return pair, flare.first[pair], flare.last[pair], flare.cumulative[way] - flare.cumulative[pair]


@kernel
def aim_ghost(flare, pair, x, y, u, v, mix):
    """A point of the plane of the last vertex for a place (x, y) of the film (mm).

    Parameters
    ----------
    pair : that the ray takes.
    u, v : a point of the unit disc.
    mix : a number in [0, 1).

    Returns
    -------
    (x, y, 1 / density by area) of the point (mm, mm2).
    """
    radius = math.hypot(x, y)
    row = min(int(radius * flare.per_mm + 0.5), flare.ellipses.shape[1] - 1)
    middle, along, across = flare.ellipses[pair, row, 0], flare.ellipses[pair, row, 1], flare.ellipses[pair, row, 2]
    anywhere = 1.0 if along == 0.0 else _ANYWHERE
    cosine, sine = (x / radius, y / radius) if radius > 0.0 else (1.0, 0.0)
    wide = mix < anywhere

    # The disc keeps its own directions, in the lens's frame and in that of the place.
    a, b = cosine * u + sine * v, cosine * v - sine * u
    a, b = (flare.reach * a, flare.reach * b) if wide else (middle + along * a, across * b)

    # Both ways to draw a point count, whichever it was.
    density = 0.0
    if wide or a * a + b * b <= flare.reach * flare.reach:
        density += anywhere / (math.pi * flare.reach * flare.reach)
    if along > 0.0 and (not wide or ((a - middle) / along) ** 2 + (b / across) ** 2 <= 1.0):
        density += (1.0 - anywhere) / (math.pi * along * across)
    return cosine * a - sine * b, sine * a + cosine * b, 1.0 / density


@kernel
def nanometres(wavelength):
    """The wavelength (nm) of a ray; the d line for one that has none."""
    return LINE_D if wavelength is None else wavelength


@kernel
def trace_way(lens, origin, direction, first, last, wavelength):
    """Follow a ray from the film to the scene on one way through a lens.

    Parameters
    ----------
    lens : LensSurfaces.
    origin, direction : a point of the ray behind the lens (mm), and a unit vector.
    first, last : the surfaces that reflect, first < last; -1, -1 for the direct way.
    wavelength : of the ray (nm), None if rays have none.

    Returns
    -------
    (weight, point on the front surface, direction before it); the weight is the part of the light that goes this way,
    0 if the ray does not get through.
    """
    count = len(lens.curvature)
    row, part = row_of(lens.indices, wavelength)
    surface, side, turns, weight = count - 1, -1, 0, 1.0
    while surface >= 0:
        distance, normal, cosine = meet(lens, surface, origin, direction, float(side))
        # What is reflected may go away from the surface that should be next.
        if cosine == 0.0 or (turns > 0 and distance < 0.0):
            return 0.0, origin, direction
        origin = madd(origin, distance, direction)
        weight *= passed(lens, surface, origin)

        # Turn where the way says so, and else go on.
        near = index_in(lens.indices, lens.ior, surface if side > 0 else surface + 1, row, part)
        far = index_in(lens.indices, lens.ior, surface + 1 if side > 0 else surface, row, part)
        reflected, _ = reflectance(lens.coatings, surface, min(1.0, abs(cosine)), near, far, nanometres(wavelength))
        if (turns == 0 and surface == first) or (turns == 1 and surface == last):
            weight *= reflected
            direction = madd(direction, -2.0 * cosine, normal)
            side = -side
            turns += 1
        else:
            weight *= 1.0 - reflected
            _, direction = bend(direction, normal, cosine, near / far)
        if weight == 0.0:
            return 0.0, origin, direction
        surface += side
    return weight, origin, direction


# ---- How often each way is drawn


@kernel
def radical_inverse(base, index):
    """The digits of a whole number to a base, mirrored at the point: in [0, 1)."""
    inverse, digit = 0.0, 1.0
    while index > 0:
        digit /= base
        inverse += digit * (index % base)
        index //= base
    return inverse


@entry
def _passing(lens, radii, points, behind, first, last, out):
    rear = lens.vertex[len(lens.vertex) - 1]
    for way in range(len(first)):
        for row in range(len(radii)):
            start = (radii[row], 0.0, rear + behind)
            for point in range(len(points)):
                direction = normalize(sub((points[point, 0], points[point, 1], rear), start))
                weight, _, _ = trace_way(lens, start, direction, first[way], last[way], None)
                out[way, row, point] = weight > 0.0


@entry
def _strengths(lens, flare, radius, behind, trials, out):
    rear = lens.vertex[len(lens.vertex) - 1]
    for pair in range(len(flare.first)):
        total = 0.0
        for trial in range(1, trials + 1):
            x, y = sample_disc(radical_inverse(2, trial), radical_inverse(3, trial))
            start = (radius * x, radius * y, rear + behind)
            u, v = sample_disc(radical_inverse(5, trial), radical_inverse(7, trial))
            right, up, area = aim_ghost(flare, pair, start[0], start[1], u, v, radical_inverse(11, trial))
            direction = normalize(sub((right, up, rear), start))
            weight, _, _ = trace_way(lens, start, direction, flare.first[pair], flare.last[pair], None)
            weight *= area * direction[2] ** 4
            total += weight * weight
        out[pair] = math.sqrt(total / trials)


def _ellipses(
    lens: LensSurfaces, radius: float, behind: float, reach: float, first: NDArray[np.int32], last: NDArray[np.int32]
) -> NDArray[np.float64]:
    """`Flare.ellipses` of a lens that is alike all around its axis."""
    # Light is symmetric about the plane through the axis and the place, so that half of the surface is enough.
    line = reach * ((2.0 * np.arange(_ACROSS) + 1.0) / _ACROSS - 1.0)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line[line > 0.0]))
    points = np.ascontiguousarray(np.stack([x, y], axis=1)[np.hypot(x, y) <= reach])
    cell = 2.0 * reach / _ACROSS
    radii = np.linspace(0.0, radius, 2 * _RADII - 1)
    passing = np.zeros((len(first), len(radii), len(points)), np.bool_)
    _passing(lens, radii, points, float(behind), first, last, passing)

    # Of each radius the least ellipse of its box's form that holds what passes there, and half way to the next radii.
    ellipses = np.zeros((len(first), _RADII, 3))
    for pair, row in np.ndindex(len(first), _RADII):
        found = points[passing[pair, max(0, 2 * row - 1) : 2 * row + 2].any(axis=0)]
        if len(found):
            low, high = found[:, 0].min() - cell, found[:, 0].max() + cell
            middle, along, across = 0.5 * (low + high), 0.5 * (high - low), found[:, 1].max() + cell
            farthest = np.hypot((found[:, 0] - middle) / along, found[:, 1] / across).max()
            ellipses[pair, row] = middle, along * max(1.0, farthest), across * max(1.0, farthest)
    return ellipses


def flare_of(
    lens: LensSurfaces, radius: float, behind: float, *, reach: float | None = None, is_round: bool = True
) -> Flare:
    """The ways through a lens, drawn by how strong they are on a film.

    The direct one is drawn half of the time; of the rest a half goes to all pairs alike, and a half in proportion to
    the root of the mean square of their light, which in an even light is best.

    Parameters
    ----------
    radius : how far from the axis the film reaches (mm).
    behind : how far behind the last vertex it is (mm).
    reach : how far from the axis light crosses the plane of the last vertex (mm); its rim by default.
    is_round : whether the lens is alike all around its axis.
    """
    media = lens.ior[None] if lens.indices is None else lens.indices.ior
    reflecting = np.flatnonzero((media[:, 1:] != media[:, :-1]).any(axis=0))
    pairs = [(i, j) for i in reflecting for j in reflecting if i < j]
    first, last = (np.array([pair[end] for pair in pairs], np.int32) for end in (0, 1))
    reach = float(lens.radius[-1] if reach is None else reach)
    flare = Flare(first, last, np.ones(1), np.zeros((len(pairs), _RADII, 3)), (_RADII - 1) / float(radius), reach)
    if not pairs:
        return flare

    # The stop as a circle that holds its shape.
    rims = lens.radius.copy()
    if lens.stop >= 0:
        rims[lens.stop] *= reach_of(lens.diaphragm)
    plain = lens._replace(indices=None, diaphragm=None, radius=rims)
    if is_round and len(pairs) <= _MOST_FOUND:
        flare = flare._replace(ellipses=_ellipses(plain, radius, behind, reach, first, last))
    strengths = np.zeros(len(pairs))
    trials = max(_FEWEST_TRIALS, min(_MOST_TRIALS, _ALL_TRIALS // len(pairs)))
    _strengths(plain, flare, float(radius), float(behind), trials, strengths)
    alike = np.full(len(pairs), 1.0 / len(pairs))
    shares = _ALIKE * alike + (1.0 - _ALIKE) * strengths / strengths.sum() if strengths.any() else alike
    cumulative = np.cumsum([_DIRECT, *((1.0 - _DIRECT) * shares)])
    cumulative[-1] = 1.0
    return flare._replace(cumulative=cumulative)
