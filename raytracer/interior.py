"""Solids and liquids that overlap: which of them a path is in, by their priorities.

All that is here, called on None, compiles to nothing.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.jit import generic, kernel
from raytracer.materials.interface import PASS, WHITE
from raytracer.media.interface import Media
from raytracer.paths import cross, cross_shadow, fill_shadow, stay_shadow
from raytracer.vec import Vec3, dot


class Interior(NamedTuple):
    """Solids and liquids that have priorities, by rank: where several overlap, that of the highest rank is there.

    rank (references,) int32, by the reference of an object's material, -1 for one without a priority; against
    (references, solids + 1) int32, by the reference of a surface's material, after selectors, what it is as a boundary
    to nothing, and to each rank: a reference, or PASS; absorption (solids, 3) float64 (1/m), or None where nothing
    absorbs; surface (solids,) int32, a reference of that rank; camera, Submerged if it may stand in any of them, or
    None.

    A path counts the objects of each rank that it is in.  Where it meets one, `around` is the highest rank there
    besides that object: a higher one hides the surface, which lets the path pass, and a lower one is what it is a
    boundary to.

    References: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2); with counts in place of
    a list, so that it has no order, and no end.
    """

    rank: NDArray[np.int32]
    against: NDArray[np.int32]
    absorption: NDArray[np.float64] | None
    surface: NDArray[np.int32]
    camera: Any


def ranks_of(interior: Interior | None) -> int:
    """Count the ranks, for each of which a path counts the objects that it is in."""
    return 0 if interior is None else len(interior.surface)


class Submerged(NamedTuple):
    """The camera may be in something: from where a ray begins, a look along `up`, a unit vector, tells in what."""

    up: Vec3


@kernel
def _highest(within, lane, solids, besides):
    """The highest rank that a ray is in, without one object of rank `besides`; -1 if it is in none."""
    for rank in range(solids - 1, -1, -1):
        if within[lane, rank] > (rank == besides):
            return rank
    return -1


@generic
def boundary_of(interior, within, lane, material, reference, front):
    """What a surface is to a ray that is `within` solids: the reference of a boundary, or PASS where it is hidden.

    material is the reference of the object's material, and reference what its selectors show.
    """
    raise NotImplementedError


@boundary_of.register(type(None))
def _(interior, within, lane, material, reference, front):
    return reference


@boundary_of.register(Interior)
def _(interior, within, lane, material, reference, front):
    rank = interior.rank[material]
    if rank < 0 or reference == PASS:
        return reference
    around = _highest(within, lane, len(interior.surface), -1 if front else rank)
    return PASS if around >= rank else np.int64(interior.against[reference, around + 1])


@kernel
def _go_through(interior, within, lane, rank, enters):
    """Count a surface that a ray goes through; returns the highest ranks before and behind it."""
    solids = len(interior.surface)
    before = _highest(within, lane, solids, -1)
    # What a ray leaves that it never entered has no outside.
    within[lane, rank] = within[lane, rank] + 1 if enters else max(0, within[lane, rank] - 1)
    return before, _highest(within, lane, solids, -1)


@kernel
def _filling(media, interior, material, rank):
    """The medium within solids of which `rank` is the highest, behind a surface of this material."""
    return np.int64(media.outside[material] if rank < 0 else media.inside[interior.surface[rank]])


@generic
def _settle(media, interior, work, sample, material, before, behind):
    """Change the path's medium where the highest rank that it is in has changed."""
    raise NotImplementedError


@_settle.register(type(None))
def _(media, interior, work, sample, material, before, behind):
    return


@_settle.register(Media)
def _(media, interior, work, sample, material, before, behind):
    if behind != before:
        work.medium[sample] = _filling(media, interior, material, behind)


@generic
def _settle_shadow(media, interior, work, slot, material, before, behind):
    """As `_settle`, for a shadow ray."""
    raise NotImplementedError


@_settle_shadow.register(type(None))
def _(media, interior, work, slot, material, before, behind):
    return


@_settle_shadow.register(Media)
def _(media, interior, work, slot, material, before, behind):
    if behind != before:
        work.shadow_space[slot, 0] = _filling(media, interior, material, behind)


@generic
def go_through(interior, scene, work, sample, hit, direction, outgoing):
    """Change what a path is in where it goes through a surface."""
    raise NotImplementedError


@go_through.register(type(None))
def _(interior, scene, work, sample, hit, direction, outgoing):
    cross(scene.media, work, sample, hit.material, hit, direction, outgoing)


@go_through.register(Interior)
def _(interior, scene, work, sample, hit, direction, outgoing):
    rank, enters = interior.rank[hit.material], dot(outgoing, hit.normal) < 0.0
    if rank < 0:
        cross(scene.media, work, sample, hit.material, hit, direction, outgoing)
    elif (dot(direction, hit.normal) < 0.0) == enters:
        before, behind = _go_through(interior, work.within, sample, rank, enters)
        _settle(scene.media, interior, work, sample, hit.material, before, behind)


@generic
def start_shadow(interior, scene, work, slot, sample, hit, direction, outgoing):
    """Start a shadow ray in what is on its side of a surface that the path met on its way."""
    raise NotImplementedError


@start_shadow.register(type(None))
def _(interior, scene, work, slot, sample, hit, direction, outgoing):
    fill_shadow(scene.media, work, slot, sample, hit.material, hit, direction, outgoing)


@start_shadow.register(Interior)
def _(interior, scene, work, slot, sample, hit, direction, outgoing):
    keep_within(interior, work, slot, sample)
    rank, enters = interior.rank[hit.material], dot(outgoing, hit.normal) < 0.0
    if rank < 0:
        fill_shadow(scene.media, work, slot, sample, hit.material, hit, direction, outgoing)
        return
    stay_shadow(scene.media, work, slot, sample)
    if (dot(direction, hit.normal) < 0.0) == enters:
        before, behind = _go_through(interior, work.shadow_within, slot, rank, enters)
        _settle_shadow(scene.media, interior, work, slot, hit.material, before, behind)


@generic
def keep_within(interior, work, slot, sample):
    """Start a shadow ray within what its path is in."""
    raise NotImplementedError


@keep_within.register(type(None))
def _(interior, work, slot, sample):
    return


@keep_within.register(Interior)
def _(interior, work, slot, sample):
    for rank in range(len(interior.surface)):
        work.shadow_within[slot, rank] = work.within[sample, rank]


@generic
def shadow_goes_through(interior, scene, work, slot, material, enters):
    """Change what a shadow ray is in where it goes straight through a surface of this material."""
    raise NotImplementedError


@shadow_goes_through.register(type(None))
def _(interior, scene, work, slot, material, enters):
    cross_shadow(scene.media, work, slot, material, enters)


@shadow_goes_through.register(Interior)
def _(interior, scene, work, slot, material, enters):
    rank = interior.rank[material]
    if rank < 0:
        cross_shadow(scene.media, work, slot, material, enters)
        return
    before, behind = _go_through(interior, work.shadow_within, slot, rank, enters)
    _settle_shadow(scene.media, interior, work, slot, material, before, behind)


@generic
def move_within(interior, work, slot, to):
    """Take what a shadow ray is in along, to the slot in which the ray goes on."""
    raise NotImplementedError


@move_within.register(type(None))
def _(interior, work, slot, to):
    return


@move_within.register(Interior)
def _(interior, work, slot, to):
    for rank in range(len(interior.surface)):
        work.shadow_within[to, rank] = work.shadow_within[slot, rank]


@generic
def clear_within(interior, work, sample):
    """Let a path be in nothing."""
    raise NotImplementedError


@clear_within.register(type(None))
def _(interior, work, sample):
    return


@clear_within.register(Interior)
def _(interior, work, sample):
    for rank in range(len(interior.surface)):
        work.within[sample, rank] = 0


@kernel
def look_past(interior, within, lane, material, front):
    """Count a surface on the way from where a ray begins to where nothing is: what it leaves there, it was in."""
    rank = interior.rank[material]
    if rank >= 0:
        within[lane, rank] += -1 if front else 1


@kernel
def settle_within(interior, media, work, sample):
    """Start a path within what was counted on the way out."""
    solids = len(interior.surface)
    for rank in range(solids):
        work.within[sample, rank] = max(0, work.within[sample, rank])
    highest = _highest(work.within, sample, solids, -1)
    if highest >= 0:
        _settle(media, interior, work, sample, 0, -1, highest)


@kernel
def _kept(absorption, within, lane, solids, distance):
    if absorption is None:
        return WHITE
    rank = _highest(within, lane, solids, -1)
    if rank < 0:
        return WHITE
    return (
        _transmitted(absorption[rank, 0], distance),
        _transmitted(absorption[rank, 1], distance),
        _transmitted(absorption[rank, 2], distance),
    )


@kernel
def _transmitted(sigma, distance):
    """exp(-sigma distance), of which one factor may be 0 and the other infinite."""
    return math.exp(-sigma * distance) if sigma > 0.0 else 1.0


@generic
def kept(interior, within, lane, distance):
    """What solids leave of light on a straight way (m) of a ray that is `within` them, by channel.

    References: Beer 1852, "Bestimmung der Absorption des rothen Lichts in farbigen Fluessigkeiten".
    """
    raise NotImplementedError


@kept.register(type(None))
def _(interior, within, lane, distance):
    return WHITE


@kept.register(Interior)
def _(interior, within, lane, distance):
    return _kept(interior.absorption, within, lane, len(interior.surface), distance)
