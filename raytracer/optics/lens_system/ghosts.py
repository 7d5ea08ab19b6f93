"""Ghosts: paths of light that is reflected twice inside a lens, and their strengths.

Every surface reflects a part of the light.  Light that is reflected twice goes on towards the film, out of focus and
upside down or not: a ghost of its source; all ghosts together veil the picture as flare.  A lens of n reflecting
surfaces has n (n - 1) / 2 ghosts, one of each pair.  More reflections, and those at the film, are left out: each costs
another factor of a hundredth.

Rays are traced from the film, as all light is here.  Each ray takes one path, sampled from all of them; its weight is
the product of the transmittances and reflectances of its surfaces, over the probability of the path.

References: Hullin, Eisemann, Seidel, Lee 2011, "Physically-Based Real-Time Lens Flare Rendering", TOG 30(4); Steinert,
Dammertz, Hanika, Lensch 2011, "General Spectral Camera Lens Simulation", CGF 30(6).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry, kernel
from raytracer.core.sampling.warp import sample_bin, sample_disc
from raytracer.core.vec import madd, normalize, sub
from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.coatings import reflectance
from raytracer.optics.lens_system.ray_tracing import (
    index_at_row,
    index_row,
    intersect_surface,
    refract,
    rim_transmission,
)
from raytracer.optics.lens_system.surfaces import LensSurfaces, aperture_extent

# Probability of the direct path, and the part of the rest that is uniform over all pairs, so that a pair whose light
# was not found is not left out.
_DIRECT = 0.5
_UNIFORM = 0.5

# Part of the rays of a pair that is aimed at the whole last surface, so that no place is left out.
_ANYWHERE = 0.2

# Radii of the film, and points across the last surface, that are tested for a pair's light.
_RADII = 17
_ACROSS = 24

# Rays by which the strength of a pair is estimated, at most and at least, and about how many for all pairs.
_MAX_TRIALS, _MIN_TRIALS, _ALL_TRIALS = 1024, 64, 200_000

# Pairs, those of 32 surfaces, up to which the places are found where their light passes: for more that takes too long.
_MAX_AIMED_PAIRS = 500


class GhostPaths(NamedTuple):
    """Packed paths through a lens, and their probabilities.

    first, last : int32 (m,), the surfaces that reflect, from the front; the ray from the film meets `last` on its way,
        turns at `first`, turns again at `last`, and leaves at the front.
    cumulative : float64 (m + 1,), cumulative probabilities of the direct path and, after it, the pairs.
    ellipses (mm) : float64 (m, k, 3), bounds of a pair's light in the plane of the last vertex, for k radii on the
        film: distance from the axis on the side of the place, and half axes along that direction and across it; 0 if
        not known.
    per_mm (1/mm) : radii of the table per distance.
    reach (mm) : greatest distance from the axis at which any light crosses that plane.
    """

    first: NDArray[np.int32]
    last: NDArray[np.int32]
    cumulative: NDArray[np.float64]
    ellipses: NDArray[np.float64]
    per_mm: float
    reach: float


@kernel
def sample_ghost_path(flare, u):
    """Sample a path by a number in [0, 1).

    Returns
    -------
    (number of the pair, first, last, probability), with the surfaces that reflect; all three -1 for the direct path.
    """
    way, _ = sample_bin(flare.cumulative, 0, len(flare.cumulative), u)
    if way == 0:
        return -1, -1, -1, flare.cumulative[0]
    pair = way - 1
    return pair, flare.first[pair], flare.last[pair], flare.cumulative[way] - flare.cumulative[pair]


@kernel
def aim_ghost_ray(flare, pair, x, y, u, v, mix):
    """Sample a point of the plane of the last vertex for a place (x, y) of the film (mm).

    Parameters
    ----------
    pair : number of the pair of surfaces that reflect.
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

    # Multiple importance sampling: the density is that of both techniques, whichever was used.
    density = 0.0
    if wide or a * a + b * b <= flare.reach * flare.reach:
        density += anywhere / (math.pi * flare.reach * flare.reach)
    if along > 0.0 and (not wide or ((a - middle) / along) ** 2 + (b / across) ** 2 <= 1.0):
        density += (1.0 - anywhere) / (math.pi * along * across)
    return cosine * a - sine * b, sine * a + cosine * b, 1.0 / density


@kernel
def wavelength_or_d_line(wavelength):
    """Return the wavelength (nm) of a ray; the d line for a ray without one."""
    return LINE_D if wavelength is None else wavelength


@kernel
def trace_ghost_path(lens, origin, direction, first, last, wavelength):
    """Trace a ray from the film to the scene on one path through a lens.

    Parameters
    ----------
    lens : LensSurfaces.
    origin, direction : a point of the ray behind the lens (mm), and a unit vector.
    first, last : the surfaces that reflect, first < last; -1, -1 for the direct path.
    wavelength (nm) : of the ray, None if rays have none.

    Returns
    -------
    (weight, point on the front surface, direction before it); the weight is the part of the light that takes this path,
    0 if the ray does not get through.
    """
    count = len(lens.curvature)
    row, part = index_row(lens.indices, wavelength)
    surface, side, turns, weight = count - 1, -1, 0, 1.0
    while surface >= 0:
        distance, normal, cosine = intersect_surface(lens, surface, origin, direction, float(side))
        # A reflected ray may go away from the surface that should be next.
        if cosine == 0.0 or (turns > 0 and distance < 0.0):
            return 0.0, origin, direction
        origin = madd(origin, distance, direction)
        weight *= rim_transmission(lens, surface, origin)

        # Reflect at the surfaces of the path, and refract at the others.
        near = index_at_row(lens.indices, lens.ior, surface if side > 0 else surface + 1, row, part)
        far = index_at_row(lens.indices, lens.ior, surface + 1 if side > 0 else surface, row, part)
        reflected, _ = reflectance(
            lens.coatings, surface, min(1.0, abs(cosine)), near, far, wavelength_or_d_line(wavelength)
        )
        if (turns == 0 and surface == first) or (turns == 1 and surface == last):
            weight *= reflected
            direction = madd(direction, -2.0 * cosine, normal)
            side = -side
            turns += 1
        else:
            weight *= 1.0 - reflected
            _, direction = refract(direction, normal, cosine, near / far)
        if weight == 0.0:
            return 0.0, origin, direction
        surface += side
    return weight, origin, direction


# ---- Probabilities of the paths


@kernel
def radical_inverse(base, index):
    """Compute the radical inverse of an integer to a base: in [0, 1)."""
    inverse, digit = 0.0, 1.0
    while index > 0:
        digit /= base
        inverse += digit * (index % base)
        index //= base
    return inverse


@entry
def _count_passing(lens, radii, points, behind, first, last, out):
    rear = lens.vertex[len(lens.vertex) - 1]
    for way in range(len(first)):
        for row in range(len(radii)):
            start = (radii[row], 0.0, rear + behind)
            for point in range(len(points)):
                direction = normalize(sub((points[point, 0], points[point, 1], rear), start))
                weight, _, _ = trace_ghost_path(lens, start, direction, first[way], last[way], None)
                out[way, row, point] = weight > 0.0


@entry
def _path_strengths(lens, flare, radius, behind, trials, out):
    rear = lens.vertex[len(lens.vertex) - 1]
    for pair in range(len(flare.first)):
        total = 0.0
        for trial in range(1, trials + 1):
            x, y = sample_disc(radical_inverse(2, trial), radical_inverse(3, trial))
            start = (radius * x, radius * y, rear + behind)
            u, v = sample_disc(radical_inverse(5, trial), radical_inverse(7, trial))
            right, up, area = aim_ghost_ray(flare, pair, start[0], start[1], u, v, radical_inverse(11, trial))
            direction = normalize(sub((right, up, rear), start))
            weight, _, _ = trace_ghost_path(lens, start, direction, flare.first[pair], flare.last[pair], None)
            weight *= area * direction[2] ** 4
            total += weight * weight
        out[pair] = math.sqrt(total / trials)


def _ellipses(
    lens: LensSurfaces, radius: float, behind: float, reach: float, first: NDArray[np.int32], last: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Find `GhostPaths.ellipses` of a lens that is symmetric about its axis."""
    # Light is symmetric about the plane through the axis and the place, so that half of the surface is enough.
    line = reach * ((2.0 * np.arange(_ACROSS) + 1.0) / _ACROSS - 1.0)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line[line > 0.0]))
    points = np.ascontiguousarray(np.stack([x, y], axis=1)[np.hypot(x, y) <= reach])
    cell = 2.0 * reach / _ACROSS
    radii = np.linspace(0.0, radius, 2 * _RADII - 1)
    passing = np.zeros((len(first), len(radii), len(points)), np.bool_)
    _count_passing(lens, radii, points, float(behind), first, last, passing)

    # For each radius the smallest ellipse of its box's form that holds the light there, and half way to its neighbours.
    ellipses = np.zeros((len(first), _RADII, 3))
    for pair, row in np.ndindex(len(first), _RADII):
        lit = points[passing[pair, max(0, 2 * row - 1) : 2 * row + 2].any(axis=0)]
        if len(lit):
            low, high = lit[:, 0].min() - cell, lit[:, 0].max() + cell
            middle, along, across = 0.5 * (low + high), 0.5 * (high - low), lit[:, 1].max() + cell
            farthest = np.hypot((lit[:, 0] - middle) / along, lit[:, 1] / across).max()
            ellipses[pair, row] = middle, along * max(1.0, farthest), across * max(1.0, farthest)
    return ellipses


def build_ghost_paths(
    lens: LensSurfaces, radius: float, behind: float, *, reach: float | None = None, is_round: bool = True
) -> GhostPaths:
    """Build the paths through a lens, with probabilities by their strengths on a film.

    The direct path has a half; of the rest one half is uniform over all pairs, and the other in proportion to the root
    mean square of their light, which is optimal in uniform light.

    Parameters
    ----------
    radius (mm) : greatest distance of the film from the axis.
    behind (mm) : distance of the film behind the last vertex.
    reach (mm) : greatest distance from the axis of light in the plane of the last vertex; its rim by default.
    is_round : whether the lens is symmetric about its axis.
    """
    media = lens.ior[None] if lens.indices is None else lens.indices.ior
    reflecting = np.flatnonzero((media[:, 1:] != media[:, :-1]).any(axis=0))
    pairs = [(i, j) for i in reflecting for j in reflecting if i < j]
    first, last = (np.array([pair[end] for pair in pairs], np.int32) for end in (0, 1))
    reach = float(lens.radius[-1] if reach is None else reach)
    flare = GhostPaths(first, last, np.ones(1), np.zeros((len(pairs), _RADII, 3)), (_RADII - 1) / float(radius), reach)
    if not pairs:
        return flare

    # A circular stop that contains the diaphragm's shape.
    rims = lens.radius.copy()
    if lens.stop >= 0:
        rims[lens.stop] *= aperture_extent(lens.diaphragm)
    plain = lens._replace(indices=None, diaphragm=None, radius=rims)
    if is_round and len(pairs) <= _MAX_AIMED_PAIRS:
        flare = flare._replace(ellipses=_ellipses(plain, radius, behind, reach, first, last))
    strengths = np.zeros(len(pairs))
    trials = max(_MIN_TRIALS, min(_MAX_TRIALS, _ALL_TRIALS // len(pairs)))
    _path_strengths(plain, flare, float(radius), float(behind), trials, strengths)
    uniform = np.full(len(pairs), 1.0 / len(pairs))
    shares = _UNIFORM * uniform + (1.0 - _UNIFORM) * strengths / strengths.sum() if strengths.any() else uniform
    cumulative = np.cumsum([_DIRECT, *((1.0 - _DIRECT) * shares)])
    cumulative[-1] = 1.0
    return flare._replace(cumulative=cumulative)
