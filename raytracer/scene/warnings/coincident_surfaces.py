"""Warn of faces of different objects that overlap in one plane, and of spheres that coincide.

Which of the two a ray hits is then left to float32.  Two surfaces are one to it if they are nearer than the offset of
the rays that leave them.

References: Gottschalk, Lin, Manocha 1996, "OBBTree", SIGGRAPH (overlap by separating axes).
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.scene.warnings.base.flat_faces import Faces, extremes, flat_faces
from raytracer.scene.warnings.base.kind import COINCIDENCE, SceneWarningKind
from raytracer.scene.warnings.base.primitive_points import Points, is_flat, without_motion
from raytracer.scene.warnings.base.survey import SceneSurvey, object_label
from raytracer.schema.transform import TRANSFORM_ROUNDING
from raytracer.schema.warning_kind import Sentence, Warned
from raytracer.schema.yaml_nodes import KeyPath

Indices = NDArray[np.int64]

_SLOPES = 64
"""Cells from 0 to 1 into which the slopes of planes are sorted: each more than twice `MOST_SLOPE` wide."""

_ROUNDING = 64.0 * np.finfo(np.float64).eps
"""Difference of equal planes in float64, after some transforms."""

_MOST_LAGS = 64
"""Most neighbours in its cell that a face is compared with; the largest faces of a cell are compared with all."""

_LARGEST, _MOST_CELLS = 8, 1000

_MOST_PAIRS = 1 << 21
"""Rough limit of all pairs of neighbours that are examined."""

_PAIRS_AT_ONCE = 1 << 14

_MOST_TRIES = 32
"""Most places where two objects, or copies of them, coincide that are examined for one that matters."""

_MOST_SIDES = 256
"""Most pairs of bodies that are skipped once two of their faces coincide."""

_SLANTED = np.sqrt([2.0, 3.0, 5.0, 7.0]) / np.sqrt(17.0)
"""A unit vector, no part of which is a rational multiple of another."""


class _Pair(NamedTuple):
    """Two coincident surfaces.

    keys : paths of their objects.
    materials : references.
    solid : each is seen from outside alone.
    normals : (2, 3).
    point : one that both have.
    offset (m) : of rays that leave them.
    """

    keys: tuple[KeyPath, KeyPath]
    materials: tuple[int, int]
    solid: tuple[bool, bool]
    normals: Points
    point: Points
    offset: float


class CoincidentSurfaces(SceneWarningKind):
    """Coincident surfaces, one warning for each two objects."""

    name = "surfaces that coincide"
    section = COINCIDENCE
    rank = 80
    opaque = Sentence(
        "a surface of it coincides with {other}, to within {offset:.2g} m, where they overlap: which of the two is "
        "seen is left to rounding; {remedy}",
        when="two opaque surfaces with different materials overlap in one plane that the camera may see: a poster "
        "in a wall, a lamp in a ceiling, flush boxes",
        remedy="move one of them by more than that",
        advice="a millimetre is enough",
    )
    clear = Sentence(
        "a surface of it coincides with {other}, to within {offset:.2g} m, and light goes into one of them: which of "
        "the two it meets first is left to rounding, so some goes astray; {remedy}",
        when="glass, a cutout or a medium stands exactly on a surface, or touches another",
        remedy="let them overlap by more than that and give what is clear a `priority`, or leave a gap",
    )

    def find(self, survey: SceneSurvey) -> Warned:
        tried: dict[tuple[KeyPath, KeyPath], int] = {}
        for pair in (*_flat_pairs(survey), *_round_pairs(survey)):
            one, other = sorted(pair.keys, key=survey.order)
            tries = tried.get((one, other), 0)
            sentence = self._sentence(survey, pair, is_same=one == other) if tries < _MOST_TRIES else None
            tried[one, other] = tries + 1 if sentence is None else _MOST_TRIES
            if sentence is not None:
                whose = "another of its own" if one == other else f"one of {object_label(survey.spec, one)}"
                yield self.of_keys(survey, other, sentence.fill(other=whose, offset=pair.offset))

    def _sentence(self, survey: SceneSurvey, pair: _Pair, *, is_same: bool) -> Sentence | None:
        """Choose what to say of a pair, if it matters: many surfaces that touch are never seen there."""
        looks = [survey.packed.resolved_materials.get(material) for material in pair.materials]
        alike = pair.materials[0] == pair.materials[1]
        if any(look is not None and look.admits_light() for look in looks):
            return None if alike and is_same else self.clear
        return None if alike or not _is_seen(survey, pair) else self.opaque


def _is_seen(survey: SceneSurvey, pair: _Pair) -> bool:
    """Return True if two opaque surfaces are visible where they coincide: not between two solids, nor inside one.

    A pair that lies within another solid is not seen either.
    """
    toward = (survey.camera - pair.point) @ pair.normals.T
    if np.any((toward <= 0.0) & pair.solid):
        return False
    return not survey.is_buried(pair.point + 2.0 * pair.offset * np.sign(toward[0]) * pair.normals[0])


# ---- Flat faces that overlap


def _flat_pairs(survey: SceneSurvey) -> Iterator[_Pair]:
    faces = flat_faces(survey)
    if faces is None:
        return
    body = _bodies(faces)
    first, second = _neighbours(faces, body)
    # One pair of faces stands for all that two bodies have on the same sides of the camera.
    seen = np.einsum("ij,ij->i", survey.camera - faces.points[:, 0], faces.normal) > 0.0
    side = 2 * body + seen
    matters = _matter(survey, faces, seen)
    sides = int(side.max()) + 1
    reported: set[int] = set()
    for begin in range(0, len(first), _PAIRS_AT_ONCE):
        a, b = first[begin : begin + _PAIRS_AT_ONCE], second[begin : begin + _PAIRS_AT_ONCE]
        fresh = ~np.isin(side[a] * sides + side[b], list(reported))
        a, b = a[fresh], b[fresh]
        overlapping = _overlap(faces, a, b)
        overlapping[overlapping] = matters(a[overlapping], b[overlapping])
        a, b = a[overlapping], b[overlapping]
        _, chosen = np.unique(side[a] * sides + side[b], return_index=True)
        for i, j in zip(a[chosen].tolist(), b[chosen].tolist(), strict=True):
            if len(reported) < _MOST_SIDES:
                reported.add(int(side[i]) * sides + int(side[j]))
            both = [(int(faces.piece[face]), int(faces.instance[face])) for face in (i, j)]
            yield _Pair(
                survey.owners(*both),
                (int(faces.material[i]), int(faces.material[j])),
                (survey.is_solid(both[0][0]), survey.is_solid(both[1][0])),
                faces.normal[[i, j]],
                _middle(faces.points[i].astype(np.float64), faces.points[j].astype(np.float64), faces.normal[j]),
                float(max(faces.offset[i], faces.offset[j])),
            )


def _matter(
    survey: SceneSurvey, faces: Faces, seen: NDArray[np.bool_]
) -> Callable[[Indices, Indices], NDArray[np.bool_]]:
    """Make a fast test of whether pairs of faces in one plane matter, which runs on thousands at once.

    seen : (n,), the camera is on the outer side of the face.
    """
    looks = survey.packed.resolved_materials
    clear = np.zeros(int(faces.material.max()) + 1, bool)
    clear[[reference for reference, look in looks.items() if reference < len(clear) and look.admits_light()]] = True
    closed = np.array([survey.is_solid(piece) for piece in range(len(survey.pieces.item))])

    def matters(a: Indices, b: Indices) -> NDArray[np.bool_]:
        lets_in = clear[faces.material[a]] | clear[faces.material[b]]
        solid = closed[faces.piece[a]], closed[faces.piece[b]]
        opposite = np.einsum("ij,ij->i", faces.normal[a], faces.normal[b]) < 0.0
        hidden = (solid[0] & ~seen[a]) | (solid[1] & ~seen[b]) | (solid[0] & solid[1] & opposite)
        return np.asarray(lets_in | ((faces.material[a] != faces.material[b]) & ~hidden))

    return matters


def _middle(points: Points, other: Points, normal: Points) -> Points:
    """Find a point (3,) in the intersection of two convex polygons (k, 3), in the plane of the second, by its normal.

    References: Sutherland, Hodgman 1974, "Reentrant Polygon Clipping", Communications of the ACM 17(1).
    """
    left = list(points)
    for start, end in zip(other, np.roll(other, -1, axis=0), strict=True):
        inwards = np.cross(normal, end - start)
        heights = [float((corner - start) @ inwards) for corner in left]
        clipped = []
        for k, (corner, height) in enumerate(zip(left, heights, strict=True)):
            before = heights[k - 1]
            if (height > 0.0) != (before > 0.0):
                clipped.append(left[k - 1] + before / (before - height) * (corner - left[k - 1]))
            if height > 0.0:
                clipped.append(corner)
        # Edges without a length cut nothing off.
        left = clipped or left
    return np.asarray(np.mean(left, axis=0))


def _bodies(faces: Faces) -> Indices:
    """Number the bodies of faces (n,): faces of one object and one material share a number."""
    copies, kinds = int(faces.instance.max()) + 2, int(faces.material.max()) + 1
    number = (faces.piece * copies + faces.instance + 1) * kinds + faces.material
    # Pairs of these are numbered too.
    return number if number.max() < 2**30 else np.unique(number, return_inverse=True)[1].ravel()


def _overlap(faces: Faces, first: Indices, second: Indices) -> NDArray[np.bool_]:
    """Find the pairs of faces that overlap in one plane, to within the precision of float32."""
    result = np.zeros(len(first), bool)
    offset = np.maximum(faces.offset[first], faces.offset[second])
    corners = [faces.points[face].astype(np.float64) for face in (first, second)]
    (low, high), (other_low, other_high) = (extremes(points) for points in corners)
    near = np.all(np.minimum(high, other_high) - np.maximum(low, other_low) >= -offset[:, None], axis=1)
    swapped = (high - low).max(axis=1) > (other_high - other_low).max(axis=1)
    rows = np.flatnonzero(near)
    if not len(rows):
        return result
    swapped, offset = swapped[rows], offset[rows]
    inner, outer = (np.where(swapped[:, None, None], corners[1 - side][rows], corners[side][rows]) for side in (0, 1))
    normal = faces.normal[np.where(swapped, first[rows], second[rows])]
    origin = outer[:, :1]
    in_plane = (np.abs(np.einsum("nki,ni->nk", inner - origin, normal)) <= offset[:, None]).all(axis=1)
    rows, inner, outer, normal, origin, offset = (
        column[in_plane] for column in (rows, inner, outer, normal, origin, offset)
    )
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frame = np.stack([across, np.cross(normal, across)], axis=2)
    flat = [(points - origin) @ frame for points in (inner, outer)]

    # Convex polygons are apart if they are separate along the normal of an edge of one of them.
    edges = np.concatenate([np.roll(points, -1, axis=1) - points for points in flat], axis=1)
    length = np.linalg.norm(edges, axis=2)
    axes = np.stack([-edges[:, :, 1], edges[:, :, 0]], axis=2)
    shadows = [np.einsum("nac,nkc->nak", axes, points) for points in flat]
    depth = np.minimum(shadows[0].max(axis=2), shadows[1].max(axis=2)) - np.maximum(
        shadows[0].min(axis=2), shadows[1].min(axis=2)
    )
    apart = (length > 0.0) & (depth <= 2.0 * offset[:, None] * length)
    result[rows[~apart.any(axis=1)]] = True
    return result


# ---- Candidates for one plane


def _neighbours(faces: Faces, body: Indices) -> tuple[Indices, Indices]:
    """List pairs of faces of different bodies in a cell of slopes and heights of planes."""
    cell, face = _cells(faces)
    order = np.argsort(cell, kind="stable")
    cell, face = cell[order], face[order]
    start = np.flatnonzero(np.diff(cell, prepend=cell[0] - 1))
    owner = body[face]
    mixed = np.minimum.reduceat(owner, start) != np.maximum.reduceat(owner, start)
    kept = np.repeat(mixed, np.diff(start, append=len(cell)))
    cell, face = cell[kept], face[kept]
    if not len(cell):
        return face, face
    order = np.lexsort((faces.points[face, 0, 0], cell))
    cell, face = cell[order], face[order]
    owner = body[face]
    pairs = []
    for lag in range(1, min(_MOST_LAGS, 1 + _MOST_PAIRS // len(cell)) + 1):
        same = cell[lag:] == cell[:-lag]
        if not same.any():
            break
        same = np.flatnonzero(same & (owner[lag:] != owner[:-lag]))
        pairs.append(np.stack([face[same], face[same + lag]]))

    # In a crowded cell, the largest faces are compared with all.
    start = np.flatnonzero(np.diff(cell, prepend=cell[0] - 1))
    count = np.diff(start, append=len(cell))
    crowded = np.flatnonzero(count > len(pairs) + 1)
    for begin, size in zip(start[crowded][:_MOST_CELLS].tolist(), count[crowded].tolist(), strict=False):
        members = face[begin : begin + size]
        least, most = extremes(faces.points[members])
        span = (most - least).max(axis=1)
        number = min(_LARGEST, size, 1 + _MOST_PAIRS // (4 * size))
        largest = members[np.argpartition(-span, number - 1)[:number]]
        for one in largest.tolist():
            others = members[body[members] != body[one]]
            pairs.append(np.stack([np.full(len(others), one), others]))
    first, second = np.sort(np.concatenate(pairs, axis=1), axis=0)
    _, chosen = np.unique(first * len(body) + second, return_index=True)
    return first[chosen], second[chosen]


def _cells(faces: Faces) -> tuple[Indices, Indices]:
    """Sort faces into cells of planes: into all cells that a plane may be in within its uncertainty.

    Over the axis along which its normal is largest, a plane is its two slopes, within -1 and 1, and its height.
    """
    point = faces.points[:, 0].astype(np.float64)
    out = point - np.median(point, axis=0)
    doubt = faces.slope + _ROUNDING
    steep = np.abs(faces.normal)
    steepest = np.maximum(np.maximum(steep[:, 0], steep[:, 1]), steep[:, 2])
    room = 2.0 * (faces.offset / steepest + doubt * np.abs(out).max(axis=1))
    # A cell is twice as large as the uncertainty of most, so two cells hold each; others are cut to that.
    step = max(4.0 * float(np.quantile(room, 0.99)), np.finfo(float).tiny)
    room = np.minimum(room, 0.49 * step)
    wide = 4 * _SLOPES
    cells, members = [], []
    for axis in range(3):
        face = np.flatnonzero(steep[:, axis] >= steepest - doubt)
        normal, along = faces.normal[face], faces.normal[face, axis]
        slopes = [_SLOPES * normal[:, other] / along for other in range(3) if other != axis]
        values = [(slope, 2.0 * _SLOPES * doubt[face]) for slope in slopes]
        values.append((np.einsum("ij,ij->i", normal, out[face]) / along / step, room[face] / step))
        key = np.full(len(face), axis, np.int64)
        for part, size in enumerate((wide, wide, 2**40)):
            value, around = values[part]
            first, last = (np.round(value + end * around).astype(np.int64) for end in (-1.0, 1.0))
            # What reaches across an edge is in both cells.
            both = np.flatnonzero(first != last)
            number = np.concatenate([first, last[both]]) + size // 2
            spread = np.concatenate([np.arange(len(face)), both])
            face, key = face[spread], key[spread] * size + np.clip(number, 0, size - 1)
            values = [(column[spread], width[spread]) for column, width in values]
        cells.append(key)
        members.append(face)
    return np.concatenate(cells), np.concatenate(members)


# ---- Spheres that coincide


def _round_pairs(survey: SceneSurvey) -> Iterator[_Pair]:
    """Find spheres with one centre and radius, to within the offset of rays that leave them."""
    found = [_balls(survey, number) for number in range(len(survey.tables)) if not is_flat(survey.tables[number])]
    if not found:
        return
    place, piece, instance, material = (np.concatenate(column) for column in zip(*found, strict=True))
    if len(place) < 2:
        return
    offset = OFFSET_ULPS * (np.abs(place[:, :3]).max(axis=1) + place[:, 3])
    # Along a direction that no one builds by, what is near in four dimensions are neighbours, and few others.
    along = place @ _SLANTED
    order = np.argsort(along)
    for lag in range(1, min(_MOST_LAGS, len(order) - 1) + 1):
        first, second = order[:-lag], order[lag:]
        near = along[second] - along[first] <= 2.0 * np.maximum(offset[first], offset[second])
        if not near.any():
            break
        first, second = first[near], second[near]
        apart = np.abs(place[first] - place[second]).max(axis=1)
        same = apart <= np.maximum(offset[first], offset[second])
        for i, j in zip(first[same].tolist(), second[same].tolist(), strict=True):
            out = _unit(survey.camera - place[i, :3])
            yield _Pair(
                survey.owners((int(piece[i]), int(instance[i])), (int(piece[j]), int(instance[j]))),
                (int(material[i]), int(material[j])),
                (False, False),
                np.stack([out, out]),
                place[i, :3] + place[i, 3] * out,
                float(max(offset[i], offset[j])),
            )


def _unit(vector: Points) -> Points:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.eye(3)[0]


def _balls(survey: SceneSurvey, number: int) -> tuple[Points, Indices, Indices, Indices]:
    """List centres and radii (n, 4) of a table's spheres in the scene, their pieces, instances, and materials (n,)."""
    pieces, base = survey.pieces, without_motion(survey.tables[number])
    of = np.flatnonzero(pieces.table == number)
    owner = np.repeat(of, (pieces.stop - pieces.start)[of])
    rows, own = np.column_stack([base.center, np.abs(base.radius)]), base.material.astype(np.int64)
    single = pieces.group[owner] < 0
    found = [(rows[single], owner[single], np.full(np.count_nonzero(single), -1), own[single])]
    instances = survey.packed.scene.instances
    for row in np.flatnonzero(~single).tolist():
        shown = survey.placed(int(owner[row]))
        pose, scale = survey.poses[shown], survey.scales[shown]
        # What is stretched is no sphere.
        gram = pose[:, :3, :3].transpose(0, 2, 1) @ pose[:, :3, :3]
        stretched = np.abs(gram - scale[:, None, None] ** 2 * np.eye(3)).max(axis=(1, 2))
        kept = stretched <= TRANSFORM_ROUNDING * scale**2
        shown, pose, scale = shown[kept], pose[kept], scale[kept]
        center = pose[:, :3, :3] @ rows[row, :3] + pose[:, :3, 3]
        material = np.full(len(shown), own[row])
        if instances is not None and instances.material is not None:
            given = instances.material[shown]
            material = np.where(given >= 0, given, material)
        place = np.column_stack([center, scale * rows[row, 3]])
        found.append((place, np.full(len(shown), owner[row]), shown, material))
    place, piece, instance, material = (np.concatenate(column) for column in zip(*found, strict=True))
    return place, piece, instance, material
