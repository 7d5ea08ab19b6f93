"""Clear objects without a priority that overlap what has one.

Light keeps an account of what it is in only of what has a priority.  So the surface of one without is a boundary to its
own `outside_ior` wherever it is, and what is around it goes on absorbing within.

Clear things without a priority that are nested deep, each a boundary to its own `outside_ior`, act as if the innermost
had the product of all their indices; light in it comes out again only if it is that much nearer to the normal.
"""

import math
from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.plugins.materials.base.clear import ClearSpec
from raytracer.plugins.materials.base.interface import BLACK, MaterialSpec
from raytracer.scene.pack.materials import collect_components
from raytracer.scene.render_settings import Render
from raytracer.scene.warnings.flat_faces import extremes
from raytracer.scene.warnings.primitive_points import Points, outline, without_motion
from raytracer.scene.warnings.record import WarningRecord, object_label, warning_at
from raytracer.scene.warnings.survey import SceneSurvey

_KIND = "clear objects without a priority in what has one"

_NESTED = "clear objects nested too deep"

MAX_INDEX_PRODUCT = 1e13
"""Product of the indices of nested objects up to which light comes out again: float64 has 4.5e15 steps from 0 to 1.

Measured in a furnace: at 1.6e13 and 2.4e13 a five-thousandth is lost at most, at 1e14 five times that, at 1e15 2 %.
"""

_FEWEST_NESTED = math.ceil(math.log(MAX_INDEX_PRODUCT) / math.log(5.0))
"""Objects whose product may be larger: no index is above 5."""

_USUAL_DEPTH = int(Render.model_fields["max_depth"].default)
"""Scenes with fewer path segments than this cut paths off on purpose."""

_MOST_NESTED = 2048
"""Most clear objects that are compared with each other: the largest ones, which others are in."""

_MOST_TRIED = 32
"""Most objects that are examined as the innermost."""

_MOST_ROWS = 64
"""Most faces of an object that are examined."""

_MOST_COPIES = 64

_BLOCK = 1 << 16

_MOST_TESTS, _FEWEST_POINTS = 1 << 18, 4
"""Most products of triangles and points of another object that are examined, and the least number of points."""

_RINGS = np.linspace(0.25, 1.0, 4)
"""Positions of points of a face, from its centre to its rim, so that long thin faces have some where they cross."""

_ALONG = np.array([0.577, 0.587, 0.568]) / np.linalg.norm([0.577, 0.587, 0.568])
"""A direction along no axis, and in no plane that is common in scenes."""


class _Copy(NamedTuple):
    """A piece as placed by an instance (-1 for none).

    points : (n, 3), of its surface, in the scene.
    low, high : (3,), the box round them.
    pose : (4, 4), from its own space.
    """

    piece: int
    instance: int
    points: Points
    low: Points
    high: Points
    pose: Points


def nesting_warnings(survey: SceneSurvey) -> Iterator[WarningRecord]:
    """Find clear objects without a priority that overlap one with a priority, and nesting that is too deep."""
    bare, filled, hollows = _sorted(survey)

    @cache
    def copies(piece: int) -> list[_Copy]:
        return _copies(survey, piece)

    yield from _deep(survey, bare, copies)
    if not bare or not filled:
        return
    low, high = survey.boxes
    holders = np.array(filled)
    inside_out = [copy for piece in hollows for copy in copies(piece)]
    for piece in bare:
        near = (low[piece] < high[holders]).all(axis=1) & (high[piece] > low[holders]).all(axis=1)
        for other in holders[near].tolist():
            warning = _overlap_warning(survey, copies(piece), copies(other), inside_out)
            if warning is not None:
                yield warning
                break


def _sorted(survey: SceneSurvey) -> tuple[list[int], list[int], list[int]]:
    """Sort clear pieces into those without a priority, those with one, and spheres that are inside out."""
    if not any(look.is_transmissive() for look in survey.packed.resolved_materials.values()):
        return [], [], []
    bare: list[int] = []
    filled: list[int] = []
    hollows: list[int] = []
    for piece in range(len(survey.pieces.item)):
        look = survey.material_of(piece)
        if look is None or not look.is_transmissive():
            continue
        if look.interior_medium() is not None:
            filled.append(piece)
        elif _boundaries(look):
            bare.append(piece)
        if _is_inside_out(survey, piece):
            hollows.append(piece)
    return bare, filled, hollows


# ---- Deep nesting


def _deep(survey: SceneSurvey, bare: list[int], copies: Callable[[int], list[_Copy]]) -> Iterator[WarningRecord]:
    """Warn of the innermost of clear objects without a priority, if light hardly comes out of it again."""
    if len(bare) < _FEWEST_NESTED:
        return
    bare = np.array(bare)[np.argsort(-survey.pieces.half[bare], kind="stable")[:_MOST_NESTED]].tolist()
    index = np.array([_relative_index(survey, piece) for piece in bare])
    around = _enclosing(np.column_stack([survey.boxes[0][bare], -survey.boxes[1][bare]]))
    most = survey.spec.render.max_depth
    # Boxes give an upper bound of the nesting of what is in them.
    by_boxes = around @ np.log(index)
    doubtful = (by_boxes > math.log(MAX_INDEX_PRODUCT)) | (2 * around.sum(axis=1) + 1 > max(most, _USUAL_DEPTH))
    for k in sorted(np.flatnonzero(doubtful).tolist(), key=lambda k: -float(by_boxes[k]))[:_MOST_TRIED]:
        own = copies(bare[k])[0]
        holders = [j for j in np.flatnonzero(around[k]).tolist() if j == k or _holds(survey, copies(bare[j]), own)]
        product, surfaces = float(np.log(index[holders]).sum()), 2 * len(holders)
        if product > math.log(MAX_INDEX_PRODUCT):
            yield survey.warning(
                _NESTED,
                bare[k],
                f"lies within {len(holders) - 1} clear objects whose materials have no `priority`, each a boundary to "
                f"its own `outside_ior`: so it acts as if its index were 1e{product / math.log(10.0):.0f}, and beyond "
                f"{MAX_INDEX_PRODUCT:.0e} rounding keeps light from coming out of it; give the materials a "
                f"`priority`, or the "
                "`outside_ior` of what they are in",
            )
            return
        if surfaces + 1 > max(most, _USUAL_DEPTH):
            yield survey.warning(
                _NESTED,
                bare[k],
                f"lies within {len(holders) - 1} clear objects, so light goes straight through {surfaces} surfaces, "
                f"and paths end after {most} segments: raise `render.max_depth`",
            )
            return


def _enclosing(ends: Points) -> NDArray[np.bool_]:
    """Find which box holds which, of boxes with the ends (n, 6), those above negated: (n, n), by the one held."""
    result = np.ones((len(ends), len(ends)), bool)
    for column in ends.T:
        result &= column[None, :] <= column[:, None]
    return result


def _holds(survey: SceneSurvey, holders: list[_Copy], own: _Copy) -> bool:
    return any(bool(_within(survey, own.points, holder).all()) for holder in holders)


def _relative_index(survey: SceneSurvey, piece: int) -> float:
    """Divide the index within a piece by that around it; the largest of what its material selects from."""
    look = survey.material_of(piece)
    assert look is not None
    ratio = max(part.eta() for part in _boundaries(look))
    return 1.0 / ratio if _is_inside_out(survey, piece) else ratio


def _boundaries(look: MaterialSpec) -> list[ClearSpec]:
    """List the boundaries of clear media that a material is, or selects from."""
    return [part for part in collect_components([look]) if isinstance(part, ClearSpec) and not part.is_index_matched()]


def _is_inside_out(survey: SceneSurvey, piece: int) -> bool:
    base = without_motion(survey.tables[survey.pieces.table[piece]])
    return isinstance(base, Spheres) and float(base.radius[survey.pieces.start[piece]]) < 0.0


def _overlap_warning(
    survey: SceneSurvey, ones: list[_Copy], others: list[_Copy], hollows: list[_Copy]
) -> WarningRecord | None:
    """Make the warning of an object without a priority and one with it, if copies of them overlap."""
    for one in ones:
        for other in others:
            if not ((one.low < other.high) & (one.high > other.low)).all():
                continue
            inside = _inside(survey, one, other, hollows)
            if inside.all():
                if not _is_made_for_index(survey, one.piece, other.piece):
                    return _warning(survey, one, other, "lies within")
            elif inside.any() or _inside(survey, other, one, hollows).any():
                return _warning(survey, one, other, "overlaps")
    return None


def _is_made_for_index(survey: SceneSurvey, piece: int, holder: int) -> bool:
    """Return True if an object within another needs no priority: it is made for that index, and nothing absorbs."""
    look, around = survey.material_of(piece), survey.material_of(holder)
    filling = None if around is None else around.interior_medium()
    assert look is not None
    assert filling is not None
    turned = _is_inside_out(survey, piece)
    facing = {part.ior if turned else part.outside_ior for part in _boundaries(look)}
    return filling.absorption == BLACK and facing == {filling.ior}


def _warning(survey: SceneSurvey, one: _Copy, other: _Copy, how: str) -> WarningRecord:
    keys, holder = survey.owners((one.piece, one.instance), (other.piece, other.instance))
    return warning_at(
        survey.spec,
        _KIND,
        keys,
        f"is clear, and {how} {object_label(survey.spec, holder)}, whose material has a `priority`, as its own has "
        f"not: its "
        "surface is one to its own `outside_ior` there, and the other goes on absorbing in it; give its material a "
        "`priority` too, a higher one if it takes the place of the other",
    )


# ---- Tests of points


def _inside(survey: SceneSurvey, one: _Copy, other: _Copy, hollows: list[_Copy]) -> NDArray[np.bool_]:
    """Find the points of one copy that are inside of another by more than the ray offset, and in no hollow (n,).

    Fewer points are tested, the more triangles the other has.
    """
    rows = int(survey.pieces.stop[other.piece] - survey.pieces.start[other.piece])
    points = one.points[:: math.ceil(len(one.points) / max(_FEWEST_POINTS, _MOST_TESTS // rows))]
    if _is_inside_out(survey, other.piece):
        return np.zeros(len(points), bool)
    result = _within(survey, points, other)
    for hollow in hollows:
        if result.any() and (hollow.piece, hollow.instance) != (one.piece, one.instance):
            result[result] = ~_within(survey, points[result], hollow)
    return result


def _within(survey: SceneSurvey, points: Points, holder: _Copy) -> NDArray[np.bool_]:
    """Find the points (n, 3) of the scene that are inside of a copy by more than its ray offset (n,).

    From inside of a closed mesh, rays to either side cross it an odd number of times; of an open mesh, one does not.
    """
    piece = holder.piece
    reach = max(np.abs(holder.low).max(), np.abs(holder.high).max(), np.abs(points).max())
    result = np.ones(len(points), bool)
    for way in (_ALONG, -_ALONG):
        moved = points[result] + 4.0 * OFFSET_ULPS * reach * way
        own = np.linalg.solve(holder.pose[:3, :3], (moved - holder.pose[:3, 3]).T).T
        boxed = ((own > survey.pieces.low[piece]) & (own < survey.pieces.high[piece])).all(axis=1)
        if survey.is_solid(piece) and survey.spec_of(piece).faces is None:
            direction = np.linalg.solve(holder.pose[:3, :3], way)
            boxed[boxed] = _is_enclosed(survey, piece, own[boxed], direction)
        else:
            boxed[boxed] = survey.contains(piece, own[boxed])
        result[result] = boxed
    return result


def _is_enclosed(survey: SceneSurvey, piece: int, points: Points, direction: Points) -> NDArray[np.bool_]:
    """Find the points (n, 3) from which a ray crosses a mesh an odd number of times (n,).

    References: Moeller, Trumbore 1997, "Fast, Minimum Storage Ray-Triangle Intersection", JGT 2(1).
    """
    table = survey.tables[survey.pieces.table[piece]]
    start, stop = int(survey.pieces.start[piece]), int(survey.pieces.stop[piece])
    odd = np.zeros(len(points), bool)
    frame = np.linalg.svd(direction[None])[2][1:].T
    places = points @ frame
    for begin in range(start, stop if len(points) else start, _BLOCK):
        corners = outline(table, begin, min(begin + _BLOCK, stop))
        # As seen along the rays, most triangles are elsewhere.
        least, most = extremes((corners.reshape(-1, 3) @ frame).reshape(len(corners), -1, 2))
        for number, (point, place) in enumerate(zip(points, places, strict=True)):
            near = (least[:, 0] <= place[0]) & (most[:, 0] >= place[0])
            near &= (least[:, 1] <= place[1]) & (most[:, 1] >= place[1])
            corner, second, third = np.moveaxis(corners[near], 1, 0)
            u, v, to = second - corner, third - corner, point - corner
            across, beside = np.cross(direction, v), np.cross(to, u)
            volume = np.einsum("ni,ni->n", u, across)
            with np.errstate(divide="ignore", invalid="ignore"):
                a = np.einsum("ni,ni->n", to, across) / volume
                b = beside @ direction / volume
                distance = np.einsum("ni,ni->n", v, beside) / volume
            hits = np.count_nonzero((a >= 0.0) & (b >= 0.0) & (a + b < 1.0) & (distance > 0.0))
            odd[number] ^= bool(hits % 2)
    return odd


# ---- Copies


def _copies(survey: SceneSurvey, piece: int) -> list[_Copy]:
    """List a piece's copies, of many the first."""
    own = _surface(survey, piece)
    if survey.pieces.group[piece] < 0:
        placed = [(-1, np.eye(4))]
    else:
        placed = [(number, survey.poses[number]) for number in survey.placed(piece)[:_MOST_COPIES].tolist()]
    copies = []
    for instance, pose in placed:
        points = own @ pose[:3, :3].T + pose[:3, 3]
        copies.append(_Copy(piece, instance, points, points.min(axis=0), points.max(axis=0), pose))
    return copies


def _surface(survey: SceneSurvey, piece: int) -> Points:
    """Sample points (n, 3) of a piece's surface, in its own space."""
    table = survey.tables[survey.pieces.table[piece]]
    start, stop = int(survey.pieces.start[piece]), int(survey.pieces.stop[piece])
    base = without_motion(table)
    if isinstance(base, Spheres):
        return np.asarray(base.center[start] + abs(float(base.radius[start])) * _SPHERE)
    rows = np.unique(np.linspace(start, stop - 1, min(stop - start, _MOST_ROWS)).astype(np.int64))
    faces = np.concatenate([outline(table, row, row + 1) for row in rows.tolist()])
    rim = np.concatenate([faces, 0.5 * (faces + np.roll(faces, -1, axis=1))], axis=1)
    middle = faces.mean(axis=1, keepdims=True)
    rings = middle[:, None] + _RINGS[:, None, None] * (rim - middle)[:, None]
    return np.concatenate([middle.reshape(-1, 3), rings.reshape(-1, 3)])


def _fibonacci_sphere(count: int) -> Points:
    """Sample points (count + 6, 3) all over the unit sphere, the ends of its axes among them."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height * height)
    turning = np.column_stack([radius * np.cos(angle), height, radius * np.sin(angle)])
    return np.concatenate([np.eye(3), -np.eye(3), turning])


_SPHERE = _fibonacci_sphere(250)
