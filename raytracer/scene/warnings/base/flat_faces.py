"""Collect the flat faces of a scene that may lie in the plane of another object's."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.scene.warnings.base.primitive_points import Points, edges, is_flat, outline
from raytracer.scene.warnings.base.survey import SceneSurvey

Indices = NDArray[np.int64]

MAX_FACES = 2_000_000
"""Most faces that are examined; objects with so many copies that there would be more are left out."""

_LARGE = 10_000
"""Objects with more faces than this are examined only where they reach into the box of another."""

_MOST_BOXES = 256
"""Most boxes of others that each face is compared with; among more, all faces are taken."""

_BLOCK = 1 << 14

MAX_SLOPE = 1.0 / 256.0
"""Largest tilt that the offset of its corners may give to a face; a narrower face has no useful plane."""


class Faces(NamedTuple):
    """Flat faces in the packed scene's space, of four corners at most.

    points : float32 (n, 4, 3), the corners; triangles have the last one twice.
    normal : (n, 3), unit, to the outside.
    slope : (n,), tilt of the plane by the offset of the corners.
    piece, instance : (n,), that they belong to; no instance is -1.
    material : (n,), references.
    offset (m) : (n,), of rays that leave them.
    """

    points: NDArray[np.float32]
    normal: Points
    slope: Points
    piece: Indices
    instance: Indices
    material: Indices
    offset: Points


def flat_faces(survey: SceneSurvey) -> Faces | None:
    """Collect all flat faces, of large objects those that reach into the box of another; None if fewer than two."""
    pieces = survey.pieces
    parts: list[Faces] = []
    flat = np.array([is_flat(table) for table in survey.tables])[pieces.table]
    rows = pieces.stop - pieces.start
    baked, grouped = flat & (pieces.group < 0), np.flatnonzero(flat & (pieces.group >= 0))
    small = baked & (rows <= _LARGE)
    tables = np.unique(pieces.table[small]).tolist()
    parts += [_of_small(survey, np.flatnonzero(small & (pieces.table == number))) for number in tables]
    for piece in np.flatnonzero(baked & (rows > _LARGE)).tolist():
        parts += _of_large(survey, piece)
    remaining = MAX_FACES - sum(len(part.piece) for part in parts)
    total = np.array([len(survey.placed(piece)) for piece in grouped.tolist()], np.int64) * rows[grouped]
    for piece, count in sorted(zip(grouped.tolist(), total.tolist(), strict=True), key=lambda pair: pair[1]):
        remaining -= count
        if remaining < 0:
            break
        parts.append(_of_copies(survey, piece))
    if sum(len(part.piece) for part in parts) < 2:
        return None
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Faces(*columns)


def _of_small(survey: SceneSurvey, chosen: Indices) -> Faces:
    """Collect the faces of some objects of one table."""
    pieces = survey.pieces
    table = survey.tables[pieces.table[chosen[0]]]
    start, stop = pieces.start[chosen], pieces.stop[chosen]
    row = np.repeat(start - np.cumsum(stop - start) + (stop - start), stop - start) + np.arange((stop - start).sum())
    begin, end = int(row[0]), int(row[-1]) + 1
    if end - begin == len(row):
        points = outline(table, begin, end)
    else:
        points = np.concatenate([outline(table, *span) for span in zip(start.tolist(), stop.tolist(), strict=True)])
    return _made(points, np.repeat(chosen, stop - start), table.material[row])


def _of_large(survey: SceneSurvey, piece: int) -> list[Faces]:
    """Collect the faces of a large object that reach into another's box, or all if it has several materials."""
    pieces = survey.pieces
    table, start, stop = survey.rows_of(piece)
    low, high = survey.boxes
    slack = OFFSET_ULPS * float(pieces.reach[piece])
    near = (low <= pieces.high[piece] + slack).all(axis=1) & (high >= pieces.low[piece] - slack).all(axis=1)
    near[piece] = False
    others = np.flatnonzero(near)
    own = table.material[start:stop]
    takes_all = len(others) > _MOST_BOXES or bool((own != own[0]).any())
    parts: list[Faces] = []
    for begin in range(start, stop, _BLOCK) if takes_all or len(others) else ():
        points = outline(table, begin, min(begin + _BLOCK, stop))
        kept = np.full(len(points), takes_all)
        if not takes_all:
            least, most = extremes(points)
            for other in others.tolist():
                bottom, top = low[other] - slack, high[other] + slack
                inside = [(least[:, axis] <= top[axis]) & (most[:, axis] >= bottom[axis]) for axis in range(3)]
                kept |= inside[0] & inside[1] & inside[2]
        rows = np.flatnonzero(kept)
        if len(rows):
            parts.append(_made(points[rows], np.full(len(rows), piece), table.material[begin + rows]))
    return parts


def extremes(points: Any) -> tuple[Any, Any]:
    """Find the least and greatest coordinates (n, 3) of corners (n, k, 3), faster than NumPy's min and max."""
    least, most = points[:, 0].copy(), points[:, 0].copy()
    for corner in range(1, points.shape[1]):
        np.minimum(least, points[:, corner], out=least)
        np.maximum(most, points[:, corner], out=most)
    return least, most


def _of_copies(survey: SceneSurvey, piece: int) -> Faces:
    """Collect the faces of an object wherever instances place it."""
    instances = survey.packed.scene.instances
    assert instances is not None
    shown = survey.placed(piece)
    table, start, stop = survey.rows_of(piece)
    pose = survey.poses[shown]
    points = np.einsum("nij,rkj->nrki", pose[:, :3, :3], outline(table, start, stop)) + pose[:, None, None, :3, 3]
    material = np.broadcast_to(table.material[start:stop], points.shape[:2])
    if instances.material is not None:
        given = instances.material[shown][:, None]
        material = np.where(given >= 0, given, material)
    instance = np.repeat(shown, stop - start)
    mirrored = np.linalg.det(pose[:, :3, :3]) < 0.0
    points = points.reshape(-1, *points.shape[2:])
    turned = np.repeat(mirrored, stop - start)
    points[turned] = points[turned, ::-1]
    return _made(points, np.full(len(instance), piece), material.reshape(-1), instance)


def _made(points: Points, piece: Indices, material: NDArray[np.int32], instance: Indices | None = None) -> Faces:
    """Make faces of corners (n, k, 3), cut into faces of four if they have more."""
    count, corners, _ = points.shape
    shown = np.full(count, -1) if instance is None else instance
    if corners > 4:
        fan = np.array([(0, corner, corner + 1, min(corner + 2, corners - 1)) for corner in range(1, corners - 1, 2)])
        points = points[:, fan].reshape(-1, 4, 3)
        piece, material, shown = (np.repeat(column, len(fan)) for column in (piece, material, shown))
    u, v, w = edges(points)
    normal = np.cross(u, v)
    area = np.sqrt(np.einsum("ij,ij->i", normal, normal))
    longest = np.sqrt(np.max([np.einsum("ij,ij->i", edge, edge) for edge in (u, v, w)], axis=0))
    least, most = extremes(points)
    offset = OFFSET_ULPS * np.maximum(most.max(axis=1), -least.min(axis=1))
    # The least height of a triangle is twice its area over its longest edge.
    firm = np.flatnonzero(offset * longest < MAX_SLOPE * area)
    held = np.empty((len(firm), 4, 3), np.float32)
    held[:, : points.shape[1]] = points[firm]
    held[:, points.shape[1] :] = points[firm, -1:]
    return Faces(
        held,
        normal[firm] / area[firm, None],
        offset[firm] * longest[firm] / area[firm],
        piece[firm],
        shown[firm],
        material[firm].astype(np.int64),
        offset[firm],
    )
