"""Nested dielectrics: overlapping solids and liquids, of which the one of the highest priority is at a point.

References: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2); with counts in place of
a list, so that it has no order, and no end.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.vec import Vec3
from raytracer.plugins.materials.base.interface import PASSTHROUGH, WHITE


class NestedDielectrics(NamedTuple):
    """Solids and liquids that have priorities, by rank: where several overlap, the highest rank fills the space.

    A path counts the objects of each rank that it is in.  Where it meets one, `around` is the highest rank there
    besides that object: a higher one hides the surface, which lets the path pass, and a lower one is what the surface
    is a boundary to.

    Attributes
    ----------
    rank : int32 (references,), by the reference of an object's material, -1 for one without a priority.
    boundaries : int32 (references, solids + 1), by the reference of a surface's material, after selectors: the material
        of its boundary to nothing, and to each rank; a reference, or PASSTHROUGH.
    absorption : float64 (solids, 3) (1/m), or None where nothing absorbs.
    surface : int32 (solids,), a material reference of each rank.
    camera : SubmergedCamera if the camera may stand in any of them, or None.
    """

    rank: NDArray[np.int32]
    boundaries: NDArray[np.int32]
    absorption: NDArray[np.float64] | None
    surface: NDArray[np.int32]
    camera: Any


class SubmergedCamera(NamedTuple):
    """A camera that may be in solids: a ray from its position along the unit vector `up` counts them."""

    up: Vec3


class Crossing(NamedTuple):
    """The crossing of a surface: the object's rank, -1 without a priority, and the highest ranks before and behind."""

    rank: np.int64
    before: int
    behind: int


@kernel
def highest_rank(inside_counts, row, solids, besides):
    """Return the highest rank that a ray is in, without one object of rank `besides`; -1 if it is in none."""
    for rank in range(solids - 1, -1, -1):
        if inside_counts[row, rank] > (rank == besides):
            return rank
    return -1


@optional
def resolve_boundary(nested, inside_counts, row, object_material, material, front):
    """Resolve the material of a surface for a ray inside these solids: a reference, or PASSTHROUGH where it is hidden.

    object_material : reference of the object's material.
    material : reference of the material that its selectors choose.
    """
    return material


@resolve_boundary.register(NestedDielectrics)
def resolve_boundary_nested_dielectrics(nested, inside_counts, row, object_material, material, front):
    rank = nested.rank[object_material]
    if rank < 0 or material == PASSTHROUGH:
        return material
    around = highest_rank(inside_counts, row, len(nested.surface), -1 if front else rank)
    return PASSTHROUGH if around >= rank else np.int64(nested.boundaries[material, around + 1])


@optional
def count_crossing(nested, inside_counts, row, material, enters):
    """Count the crossing of a surface of an object of this material; returns a Crossing, or None."""


@count_crossing.register(NestedDielectrics)
def count_crossing_nested_dielectrics(nested, inside_counts, row, material, enters):
    rank, solids = np.int64(nested.rank[material]), len(nested.surface)
    if rank < 0:
        return Crossing(rank, -1, -1)
    before = highest_rank(inside_counts, row, solids, -1)
    # A ray that leaves a solid which it never entered was not counted in it.
    inside_counts[row, rank] = inside_counts[row, rank] + 1 if enters else max(0, inside_counts[row, rank] - 1)
    return Crossing(rank, before, highest_rank(inside_counts, row, solids, -1))


@optional
def clear_inside_counts(nested, inside_counts, row):
    """Start a path outside of all solids."""


@clear_inside_counts.register(NestedDielectrics)
def clear_inside_counts_nested_dielectrics(nested, inside_counts, row):
    for rank in range(len(nested.surface)):
        inside_counts[row, rank] = 0


@optional
def copy_inside_counts(nested, inside_counts, row, target_counts, target):
    """Copy the solids that a ray is in to another ray."""


@copy_inside_counts.register(NestedDielectrics)
def copy_inside_counts_nested_dielectrics(nested, inside_counts, row, target_counts, target):
    for rank in range(len(nested.surface)):
        target_counts[target, rank] = inside_counts[row, rank]


@optional
def beer_transmittance(nested, inside_counts, row, distance):
    """Compute the transmittance of absorbing solids over a distance (m), for a ray inside these, by channel.

    References: Beer 1852, "Bestimmung der Absorption des rothen Lichts in farbigen Fluessigkeiten".
    """
    return WHITE


@beer_transmittance.register(NestedDielectrics)
def beer_transmittance_nested_dielectrics(nested, inside_counts, row, distance):
    return _beer_transmittance(nested.absorption, inside_counts, row, len(nested.surface), distance)


@kernel
def _beer_transmittance(absorption, inside_counts, row, solids, distance):
    if absorption is None:
        return WHITE
    rank = highest_rank(inside_counts, row, solids, -1)
    if rank < 0:
        return WHITE
    return (
        _attenuation(absorption[rank, 0], distance),
        _attenuation(absorption[rank, 1], distance),
        _attenuation(absorption[rank, 2], distance),
    )


@kernel
def _attenuation(sigma, distance):
    """Compute exp(-sigma distance), where one factor may be 0 and the other infinite."""
    return math.exp(-sigma * distance) if sigma > 0.0 else 1.0
