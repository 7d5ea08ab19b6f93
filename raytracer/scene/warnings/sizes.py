"""Warn of objects whose sizes float32 cannot hold side by side, or not at their positions.

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
from raytracer.report.wording import plural
from raytracer.scene.warnings.primitive_points import (
    Points,
    coordinate_extents,
    is_flat,
    normals,
    outline,
    without_motion,
)
from raytracer.scene.warnings.record import WarningRecord, warning_at
from raytracer.scene.warnings.slivers import sliver_warnings
from raytracer.scene.warnings.survey import SceneSurvey
from raytracer.scene.warnings.unseen_lights import UnseenLightFinder

MAX_DISTANCE_IN_RADII = 1e5
"""Largest distance of an object in its radii: at 1e6, Embree misses 15 % of the rays at 0.99 of a sphere's radius."""

MAX_SIZE_RATIO = 1e6
"""Largest ratio of the sizes of two objects: float32 has 2^24 = 1.7e7 steps."""

_HULL = math.sqrt(3.0)
"""Extent of an object's box relative to the object's own along an axis."""

# Flattening from which on a message mentions it.
_FLAT = 10.0

# How many times the largest coordinate the offset of a quad may count: its corner once, either edge twice.
_MOST_REACH = 5.0

# Most primitives of an object that others are compared with one by one; of one with more, its box is.
_MOST_FACES = 4096

# Most objects that are examined as grounds, whose ray offset may exceed the size of others.
_MOST_GROUNDS = 256


def size_warnings(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find degenerate triangles, objects too far or too small, and objects within the ray offset of others."""
    yield from _degenerate(survey)
    unseen_lights = UnseenLightFinder(survey)
    seen = _relative_sizes(survey)
    yield from _far(survey, seen, unseen_lights)
    yield from sliver_warnings(survey, seen.scale(survey), unseen_lights)
    yield from _thin(survey)
    drowned = list(_within_ray_offset(survey))
    yield from drowned
    if not drowned:
        yield from _extents(survey, seen.extent, unseen_lights)


def _degenerate(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find triangles without an area, in files or once they are rounded to float32."""
    packed, pieces = survey.packed, survey.pieces
    for item, (count, first) in packed.empty.items():
        keys = packed.items[item].keys
        yield warning_at(
            survey.spec,
            "triangles without an area",
            keys,
            f"its file has {count:,} {plural(count, 'triangle')} without an area (the first is number {first}, "
            "counted from 0), which no ray can hit and which are left out",
        )
    for piece in np.flatnonzero(pieces.empty).tolist():
        count, total = int(pieces.empty[piece]), int(pieces.stop[piece] - pieces.start[piece])
        what = f"{count:,} of its {total:,} faces have" if total > 1 else "it has"
        yield survey.warning(
            "faces that float32 cannot hold",
            piece,
            f"{what} no area once its coordinates are rounded to float32, in which rays are cast, so no ray can hit "
            f"{'them' if total > 1 else 'it'}: make the object larger, or place it nearer to {survey.origin_text()}",
        )


# ---- Far away


class _RelativeSizes(NamedTuple):
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


def _relative_sizes(survey: SceneSurvey) -> _RelativeSizes:
    pieces, camera = survey.pieces, survey.camera
    half = np.maximum(pieces.half, np.finfo(float).tiny)
    away = np.maximum(0.0, np.linalg.norm(pieces.middle - camera, axis=1) - half)
    result = _RelativeSizes(pieces.reach / half, away / half, pieces.half.copy(), np.ones(len(half)))
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


def _far(survey: SceneSurvey, seen: _RelativeSizes, unseen_lights: UnseenLightFinder) -> Iterator[WarningRecord]:
    """Find objects too far away for their size, from the origin or from the camera."""
    for piece in np.flatnonzero(
        (seen.reach > MAX_DISTANCE_IN_RADII) | (seen.distance > MAX_DISTANCE_IN_RADII)
    ).tolist():
        if unseen_lights.is_only_light_sampled(piece):
            continue
        radius = float(seen.extent[piece])
        if seen.distance[piece] > MAX_DISTANCE_IN_RADII:
            where, times = "the camera", float(seen.distance[piece])
            if seen.flat[piece] > _FLAT:
                where += f", as seen where its transform has not made it {seen.flat[piece]:.2g} times thinner"
        else:
            where, times = survey.origin_text(), float(seen.reach[piece])
        yield survey.warning(
            "objects too far away for their size",
            piece,
            f"is {times:.2g} of its radii ({radius:.3g} m) away from {where}, and beyond "
            f"{MAX_DISTANCE_IN_RADII:.0e} float32 is "
            "too coarse to hit it well: make it larger, bring it nearer, or leave it out",
        )


def _thin(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find transmissive boxes thinner than the ray offset, behind which rays from their surfaces begin."""
    pieces = survey.pieces
    # The sides of thin boxes are narrow.
    for piece in np.flatnonzero(pieces.width < 4.0 * OFFSET_ULPS * _MOST_REACH * pieces.reach).tolist():
        look, start, stop = survey.material_of(piece), int(pieces.start[piece]), int(pieces.stop[piece])
        table = survey.tables[pieces.table[piece]]
        if look is None or not (look.is_transmissive() or look.has_passthrough()) or stop - start > _MOST_FACES:
            continue
        # A single face has no inside; round objects are as thick as they are wide.
        if not survey.is_solid(piece) or survey.spec_of(piece).faces is None or not is_flat(table):
            continue
        faces = outline(table, start, stop)
        thickness = float(np.ptp(faces.reshape(-1, 3) @ normals(faces).T, axis=0).min())
        offset = OFFSET_ULPS * float(coordinate_extents(table, start, stop).max())
        if thickness < 2.0 * offset:
            yield survey.warning(
                "clear things thinner than the offset of rays",
                piece,
                f"is {thickness:.2g} m thick, light goes into it, and rays leave its faces {offset:.2g} m off them "
                "because its coordinates reach so far: they begin behind it, and so do not know what they are in; make "
                "it thicker or smaller, or use a quad of a `thin_dielectric`",
            )


# ---- Objects within the ray offset of a ground


def _within_ray_offset(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find objects on grounds so large that the offset of rays from the ground is a good part of the objects' size."""
    pieces = survey.pieces
    half = pieces.half
    grounds = np.flatnonzero(
        (pieces.group < 0) & (3.0 * pieces.reach > MAX_DISTANCE_IN_RADII * half.min(initial=np.inf))
    )
    reported = np.zeros(len(half), bool)
    for ground in grounds[np.argsort(-pieces.reach[grounds], kind="stable")][:_MOST_GROUNDS].tolist():
        small = np.flatnonzero(~reported & (MAX_DISTANCE_IN_RADII * half < 3.0 * pieces.reach[ground]))
        for piece, radius, reach in _objects_within_offset(survey, ground, small[small != ground]):
            reported[piece] = True
            yield survey.warning(
                "objects that drown in what they lie on",
                piece,
                f"is {2.0 * radius:.3g} m large and lies on {survey.name_of(ground)}, which rays leave "
                f"{OFFSET_ULPS * reach:.2g} m off its surface because its coordinates reach {reach:.3g} m there: "
                "nothing that is lower casts a shadow on it; make that one smaller, or split it",
            )


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
    if stop - start > _MOST_FACES:
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


# ---- The whole scene


def _extents(survey: SceneSurvey, extent: Points, unseen_lights: UnseenLightFinder) -> Iterator[WarningRecord]:
    """Find a ratio of largest to smallest object that is too large; subdivided objects do not count as large."""
    whole = np.array([0.0 if survey.is_cut(piece) else size for piece, size in enumerate(extent.tolist())])
    small, large = int(np.argmin(extent)), int(np.argmax(whole))
    if whole[large] > MAX_SIZE_RATIO * extent[small]:
        # Lights are examined only if the ratio is too large.
        aimed = np.array([unseen_lights.is_only_light_sampled(piece) for piece in range(len(extent))])
        small, large = int(np.argmin(np.where(aimed, np.inf, extent))), int(np.argmax(np.where(aimed, 0.0, whole)))
    ratio = float(whole[large] / max(extent[small], np.finfo(float).tiny))
    if ratio > MAX_SIZE_RATIO:
        yield survey.warning(
            "sizes that are too far apart",
            small,
            f"is {2.0 * extent[small]:.3g} m large, and {survey.name_of(large)} {2.0 * extent[large]:.3g} m, "
            f"{ratio:.2g} times as much: beyond {MAX_SIZE_RATIO:.0e} float32 cannot hold both, and rays from far away "
            "miss what is small; make skies of an `environment` or a `sun`, and grounds no larger than is seen",
        )
