"""Sizes of objects relative to their distances, and to the ray offset of what they lie on, which float32 limits.

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
from raytracer.plugins.cameras.base.interface import project
from raytracer.plugins.lights.base.interface import Lights
from raytracer.scene.warnings.base.primitive_points import Points, coordinate_extents, normals, outline, without_motion
from raytracer.scene.warnings.base.survey import SceneSurvey

MAX_DISTANCE_IN_RADII = 1e5
"""Largest distance of an object in its radii: at 1e6, Embree misses 15 % of the rays at 0.99 of a sphere's radius."""


class RelativeSizes(NamedTuple):
    """Largest coordinates and camera distances of pieces, or of their worst instances, relative to their radii.

    reach, distance : (n,), in radii.
    extent (m) : its own radius in the scene.
    flat : factor by which its instance makes it thinner in one direction than in another.
    """

    reach: Points
    distance: Points
    extent: Points
    flat: Points

    def scale(self, survey: SceneSurvey) -> Points:
        """Find the largest numbers (n,) at play where rays meet each piece, in its own space (m)."""
        return np.asarray(np.maximum(self.reach, self.distance) * survey.pieces.half)


def relative_sizes(survey: SceneSurvey) -> RelativeSizes:
    """Compare the coordinates and camera distances of all pieces with their radii."""
    pieces, camera = survey.pieces, survey.camera
    half = np.maximum(pieces.half, np.finfo(float).tiny)
    away = np.maximum(0.0, np.linalg.norm(pieces.middle - camera, axis=1) - half)
    result = RelativeSizes(pieces.reach / half, away / half, pieces.half.copy(), np.ones(len(half)))
    instances = survey.packed.scene.instances
    for group in np.unique(pieces.group[pieces.group >= 0]).tolist():
        assert instances is not None
        shown, of = np.flatnonzero(instances.group == group), np.flatnonzero(pieces.group == group)
        if not len(shown):
            continue
        pose, scale = survey.poses[shown], survey.scales[shown]
        low, high = pieces.low[of].min(axis=0), pieces.high[of].max(axis=0)
        middle = pose[:, :3, :3] @ (low + 0.5 * (high - low)) + pose[:, :3, 3]
        radius = scale * 0.5 * float(np.linalg.norm(high - low))
        # Rays are intersected in the group's space, where flattening by a factor moves the camera away by that factor.
        own = np.linalg.solve(pose[:, :3, :3], (camera - middle)[:, :, None])[:, :, 0]
        away = np.maximum(0.0, np.linalg.norm(own, axis=1) - radius / scale)
        # The nearest copy is seen best; the one farthest out has the worst coordinates.
        nearest = int(np.argmin(away))
        result.distance[of] = away[nearest] / half[of]
        result.flat[of] = np.linalg.cond(pose[nearest, :3, :3])
        out = (np.abs(middle).max(axis=1) / scale).max() / half[of]
        result.reach[of] = np.maximum(result.reach[of], out)
        result.extent[of] = pieces.half[of] * scale.max()
    return result


# ---- Objects on what is large


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
    if survey.pieces.group[piece] < 0:
        return np.asarray(middle[None]), np.asarray(half[None])
    shown = survey.placed(piece)
    pose = survey.poses[shown]
    return pose[:, :3, :3] @ middle + pose[:, :3, 3], survey.scales[shown] * half


def _reach_below(survey: SceneSurvey, ground: int, middle: Points, radius: Points) -> Points:
    """Compute a ground's largest coordinate (n,) (m) where balls lie on it, of several faces the least; 0 beside."""
    pieces = survey.pieces
    table, start, stop = survey.rows_of(ground)
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


# ---- Lights to which this does not matter


_MOST_COPIES = 256
"""Most instances of a light that are examined; one with more counts as seen."""

_TIMES = (0.0, 0.5, 1.0)
"""Fractions of the exposure at which a camera that moves is asked what it sees."""


class UnseenLightFinder:
    """Finder of lights that only next-event estimation reaches: neither camera rays nor mirrors show them.

    Other rays that hit them weigh next to nothing in MIS: next-event estimation samples a light that is small in the
    sky with a far higher density than any rough surface scatters with.

    References: Veach 1997, thesis, eq. 9.8 (the balance heuristic).
    """

    def __init__(self, survey: SceneSurvey) -> None:
        self._survey = survey
        lights = survey.packed.scene.lights
        self._is_all = isinstance(lights, Lights) and not any(
            look.has_delta_bsdf() for look in survey.packed.resolved_materials.values()
        )

    def is_only_light_sampled(self, piece: int) -> bool:
        """Tell if a piece is a light that next-event estimation samples, and that is seen in no other way."""
        survey = self._survey
        if not self._is_all:
            return False
        look, table = survey.material_of(piece), survey.tables[survey.pieces.table[piece]]
        if look is None or not look.is_emissive() or look.has_non_delta_bsdf() or without_motion(table) is not table:
            return False
        places, _ = _copies(survey, piece)
        return len(places) <= _MOST_COPIES and not any(self._is_seen(place) for place in places)

    def _is_seen(self, place: Points) -> bool:
        """Tell if the camera may see what is at a place (3,): it stands before it, and not far beside the picture."""
        film = self._survey.spec.film
        for time in _TIMES:
            x, y, depth = project(self._survey.packed.scene.camera, tuple(map(float, place)), time)
            if math.isnan(x + y):
                if depth > 0.0:
                    return True
            elif abs(x / film.width - 0.5) < 1.0 and abs(y / film.height - 0.5) < 1.0:
                # What is out of focus shows half a picture beside its place, at most.
                return True
        return False
