"""Objects within the offset of the rays that leave what they lie on.

A ray leaves a primitive by `OFFSET_ULPS` of how far its coordinates reach, which is what float32 hits are good to.  At
`MAX_DISTANCE_IN_RADII` of its own radii that is a twentieth of an object's radius.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.scene.warnings.base.primitive_points import (
    Points,
    coordinate_extents,
    normals,
    outline,
    without_motion,
)
from raytracer.scene.warnings.base.relative_sizes import MAX_DISTANCE_IN_RADII
from raytracer.scene.warnings.base.survey import SceneSurvey

MOST_REACH = 5.0
"""Offset of a quad at most, over that of its largest coordinate: its corner counts once, either edge twice."""

MOST_FACES = 4096
"""Most faces of an object that are examined one by one; of one with more, its box is."""

_HULL = math.sqrt(3.0)
"""Extent of an object's box relative to the object's own along an axis."""

# Most objects that are examined as grounds, whose ray offset may exceed the size of others.
_MOST_GROUNDS = 256


class SunkObject(NamedTuple):
    """Object so small that the ray offset of what it lies on is a good part of its size.

    radius, reach (m) : its own, and the largest coordinate of the ground there.
    """

    piece: int
    ground: int
    radius: float
    reach: float


def sunk_objects(survey: SceneSurvey) -> list[SunkObject]:
    """Find the objects on grounds so large that the offset of rays from these is a good part of the objects' size."""
    pieces = survey.pieces
    half = pieces.half
    grounds = np.flatnonzero(
        (pieces.group < 0) & (3.0 * pieces.reach > MAX_DISTANCE_IN_RADII * half.min(initial=np.inf))
    )
    reported = np.zeros(len(half), bool)
    found = []
    for ground in grounds[np.argsort(-pieces.reach[grounds], kind="stable")][:_MOST_GROUNDS].tolist():
        small = np.flatnonzero(~reported & (MAX_DISTANCE_IN_RADII * half < 3.0 * pieces.reach[ground]))
        for piece, radius, reach in _objects_within_offset(survey, ground, small[small != ground]):
            reported[piece] = True
            found.append(SunkObject(piece, ground, radius, reach))
    return found


def _objects_within_offset(
    survey: SceneSurvey, ground: int, small: NDArray[np.int64]
) -> Iterator[tuple[int, float, float]]:
    """Find small objects within the ray offset of a ground, their radii and the ground's largest coordinate (m)."""
    pieces = survey.pieces
    single = small[pieces.group[small] < 0]
    radius = pieces.half[single]
    reach = _reach_below(survey, ground, pieces.middle[single], radius)
    lost = MAX_DISTANCE_IN_RADII * radius < reach
    yield from zip(single[lost].tolist(), radius[lost].tolist(), reach[lost].tolist(), strict=True)
    for piece in small[pieces.group[small] >= 0].tolist():
        middle, radius = _copies(survey, piece)
        reach = _reach_below(survey, ground, middle, radius)
        worst = int(np.argmax(reach / radius))
        if MAX_DISTANCE_IN_RADII * radius[worst] < reach[worst]:
            yield piece, float(radius[worst]), float(reach[worst])


def _copies(survey: SceneSurvey, piece: int) -> tuple[Points, Points]:
    """Compute centres (n, 3) and radii (n,) of a piece wherever it is placed."""
    middle, half = survey.pieces.middle[piece], survey.pieces.half[piece]
    shown = survey.placed(piece)
    pose = survey.poses[shown]
    return pose[:, :3, :3] @ middle + pose[:, :3, 3], survey.scales[shown] * half


def _reach_below(survey: SceneSurvey, ground: int, middle: Points, radius: Points) -> Points:
    """Compute a ground's largest coordinate (n,) (m) where balls lie on it, of several faces the least; 0 beside."""
    pieces = survey.pieces
    table = survey.tables[pieces.table[ground]]
    start, stop = int(pieces.start[ground]), int(pieces.stop[ground])
    reach = coordinate_extents(table, start, stop)
    base = without_motion(table)
    if isinstance(base, Spheres):
        away = np.linalg.norm(middle - base.center[start], axis=1)
        on = np.abs(away - abs(base.radius[start])) <= _HULL * radius + OFFSET_ULPS * reach
        return np.asarray(np.where(on, reach, 0.0))
    near = _HULL * radius + OFFSET_ULPS * float(reach.max())
    low, high = pieces.low[ground] - near[:, None], pieces.high[ground] + near[:, None]
    within = ((middle >= low) & (middle <= high)).all(axis=1)
    if stop - start > MOST_FACES:
        return np.asarray(np.where(within, float(reach.min()), 0.0))
    result = np.where(within, np.inf, 0.0)
    faces = outline(table, start, stop)
    normal = normals(faces)
    for place in np.flatnonzero(within).tolist():
        slack = _HULL * radius[place] + OFFSET_ULPS * reach
        height = np.abs(np.einsum("ni,ni->n", middle[place] - faces[:, 0], normal))
        beside = np.maximum(faces.min(axis=1) - middle[place], middle[place] - faces.max(axis=1)).max(axis=1)
        on = (height <= slack) & (beside <= slack)
        result[place] = reach[on].min() if on.any() else 0.0
    return np.asarray(result)
