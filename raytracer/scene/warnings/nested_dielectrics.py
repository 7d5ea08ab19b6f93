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

from raytracer.geometry import OFFSET_ULPS
from raytracer.materials.interface import BLACK, ClearSpec, MaterialSpec
from raytracer.primitives.spheres import Spheres
from raytracer.scene.concerns.faces import extremes
from raytracer.scene.concerns.interface import Concern, concern, named
from raytracer.scene.concerns.outlines import Points, outline, resting
from raytracer.scene.concerns.survey import Survey
from raytracer.scene.materials import parts
from raytracer.scene.spec import Render

_KIND = "clear objects without a priority in what has one"

_NESTED = "clear objects nested too deep"

MOST_INDEX = 1e13
"""Product of the indices of nested objects up to which light comes out again: float64 has 4.5e15 steps from 0 to 1.

Measured in a furnace: at 1.6e13 and 2.4e13 a five-thousandth is lost at most, at 1e14 five times that, at 1e15 2 %.
"""

_FEWEST_NESTED = math.ceil(math.log(MOST_INDEX) / math.log(5.0))
"""Objects whose product may be larger: no index is above 5."""

_USUAL_DEPTH = int(Render.model_fields["max_depth"].default)
"""Who asks for paths of fewer segments than this knows that something is cut off."""

_MOST_NESTED = 2048
"""Clear objects that are held against each other: the largest, since what others are in is."""

_MOST_TRIED = 32
"""Objects that are looked at as the innermost."""

_MOST_ROWS = 64
"""Faces of an object that are looked at."""

_MOST_COPIES = 64

_BLOCK = 1 << 16

_MOST_TESTS, _FEWEST_POINTS = 1 << 18, 4
"""Triangles times points of another object that are looked at, and points at least."""

_RINGS = np.linspace(0.25, 1.0, 4)
"""Where points of a face are, from its middle to its rim: what is long and thin has some where it goes through."""

_ALONG = np.array([0.577, 0.587, 0.568]) / np.linalg.norm([0.577, 0.587, 0.568])
"""A direction along no axis, and in no plane that anyone builds by."""


class _Copy(NamedTuple):
    """A piece where an instance (-1: none) puts it.

    points (n, 3), of its surface, in the scene; low, high (3,), the box round them; pose (4, 4), from its own space.
    """

    piece: int
    instance: int
    points: Points
    low: Points
    high: Points
    pose: Points


def nesting(survey: Survey) -> Iterator[Concern]:
    """Concerns about clear objects without a priority, one for each that overlaps an object that has one."""
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
            found = _met(survey, copies(piece), copies(other), inside_out)
            if found is not None:
                yield found
                break


def _sorted(survey: Survey) -> tuple[list[int], list[int], list[int]]:
    """Pieces that are clear and have no priority, those that have one, and clear spheres that are inside out."""
    if not any(look.transmits() for look in survey.packed.looks.values()):
        return [], [], []
    bare: list[int] = []
    filled: list[int] = []
    hollows: list[int] = []
    for piece in range(len(survey.pieces.item)):
        look = survey.look_of(piece)
        if look is None or not look.transmits():
            continue
        if look.filling() is not None:
            filled.append(piece)
        elif _boundaries(look):
            bare.append(piece)
        if _is_inside_out(survey, piece):
            hollows.append(piece)
    return bare, filled, hollows


# ---- Deep nesting


def _deep(survey: Survey, bare: list[int], copies: Callable[[int], list[_Copy]]) -> Iterator[Concern]:
    """Find a concern about the innermost of clear objects without a priority, if light hardly comes out of it again."""
    if len(bare) < _FEWEST_NESTED:
        return
    bare = np.array(bare)[np.argsort(-survey.pieces.half[bare], kind="stable")[:_MOST_NESTED]].tolist()
    index = np.array([_relative_index(survey, piece) for piece in bare])
    around = _enclosing(np.column_stack([survey.boxes[0][bare], -survey.boxes[1][bare]]))
    most = survey.spec.render.max_depth
    # What a box holds is in what is in the box at most.
    by_boxes = around @ np.log(index)
    doubtful = (by_boxes > math.log(MOST_INDEX)) | (2 * around.sum(axis=1) + 1 > max(most, _USUAL_DEPTH))
    for k in sorted(np.flatnonzero(doubtful).tolist(), key=lambda k: -float(by_boxes[k]))[:_MOST_TRIED]:
        own = copies(bare[k])[0]
        holders = [j for j in np.flatnonzero(around[k]).tolist() if j == k or _holds(survey, copies(bare[j]), own)]
        product, surfaces = float(np.log(index[holders]).sum()), 2 * len(holders)
        if product > math.log(MOST_INDEX):
            yield survey.concern(
                _NESTED,
                bare[k],
                f"lies within {len(holders) - 1} clear objects whose materials have no `priority`, each a boundary to "
                f"its own `outside_ior`: so it acts as if its index were 1e{product / math.log(10.0):.0f}, and beyond "
                f"{MOST_INDEX:.0e} rounding keeps light from coming out of it; give the materials a `priority`, or the "
                "`outside_ior` of what they are in",
            )
            return
        if surfaces + 1 > max(most, _USUAL_DEPTH):
            yield survey.concern(
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


def _holds(survey: Survey, holders: list[_Copy], own: _Copy) -> bool:
    return any(bool(_within(survey, own.points, holder).all()) for holder in holders)


def _relative_index(survey: Survey, piece: int) -> float:
    """Divide the index within a piece by that around it; the largest of what its material selects from."""
    look = survey.look_of(piece)
    assert look is not None
    ratio = max(part.eta() for part in _boundaries(look))
    return 1.0 / ratio if _is_inside_out(survey, piece) else ratio


def _boundaries(look: MaterialSpec) -> list[ClearSpec]:
    """What a material is, or selects from, that is the boundary of something clear."""
    return [part for part in parts([look]) if isinstance(part, ClearSpec) and not part.is_nothing()]


def _is_inside_out(survey: Survey, piece: int) -> bool:
    base = resting(survey.tables[survey.pieces.table[piece]])
    return isinstance(base, Spheres) and float(base.radius[survey.pieces.start[piece]]) < 0.0


def _met(survey: Survey, ones: list[_Copy], others: list[_Copy], hollows: list[_Copy]) -> Concern | None:
    """What is to be said of an object without a priority and one with it, if copies of them overlap."""
    for one in ones:
        for other in others:
            if not ((one.low < other.high) & (one.high > other.low)).all():
                continue
            inside = _inside(survey, one, other, hollows)
            if inside.all():
                if not _fits(survey, one.piece, other.piece):
                    return _told(survey, one, other, "lies within")
            elif inside.any() or _inside(survey, other, one, hollows).any():
                return _told(survey, one, other, "overlaps")
    return None


def _fits(survey: Survey, piece: int, holder: int) -> bool:
    """Whether what lies within another may do without a priority: made for its index, where nothing is absorbed."""
    look, around = survey.look_of(piece), survey.look_of(holder)
    filling = None if around is None else around.filling()
    assert look is not None
    assert filling is not None
    turned = _is_inside_out(survey, piece)
    facing = {part.ior if turned else part.outside_ior for part in _boundaries(look)}
    return filling.absorption == BLACK and facing == {filling.ior}


def _told(survey: Survey, one: _Copy, other: _Copy, how: str) -> Concern:
    keys, holder = survey.owners((one.piece, one.instance), (other.piece, other.instance))
    return concern(
        survey.spec,
        _KIND,
        keys,
        f"is clear, and {how} {named(survey.spec, holder)}, whose material has a `priority`, as its own has not: its "
        "surface is one to its own `outside_ior` there, and the other goes on absorbing in it; give its material a "
        "`priority` too, a higher one if it takes the place of the other",
    )


# ---- What is inside of what


def _inside(survey: Survey, one: _Copy, other: _Copy, hollows: list[_Copy]) -> NDArray[np.bool_]:
    """Of points of one, which are inside of another by more than the offset of rays, and in none of the hollows (n,).

    Fewer points are looked at, the more triangles the other has.
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


def _within(survey: Survey, points: Points, holder: _Copy) -> NDArray[np.bool_]:
    """Which points (n, 3) of the scene are inside of a copy, by more than the offset of rays that leave it.

    A mesh is left an odd number of times on the way out, to either side; what is open is not, to one of them.
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


def _is_enclosed(survey: Survey, piece: int, points: Points, direction: Points) -> NDArray[np.bool_]:
    """From which points (n, 3) a ray meets a mesh an odd number of times.

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


def _copies(survey: Survey, piece: int) -> list[_Copy]:
    """A piece wherever it is placed, of many places the first."""
    own = _surface(survey, piece)
    if survey.pieces.group[piece] < 0:
        placed = [(-1, np.eye(4))]
    else:
        placed = [(number, survey.poses[number]) for number in survey.placed(piece)[:_MOST_COPIES].tolist()]
    found = []
    for instance, pose in placed:
        points = own @ pose[:3, :3].T + pose[:3, 3]
        found.append(_Copy(piece, instance, points, points.min(axis=0), points.max(axis=0), pose))
    return found


def _surface(survey: Survey, piece: int) -> Points:
    """Points (n, 3) of a piece's surface, in its own space."""
    table = survey.tables[survey.pieces.table[piece]]
    start, stop = int(survey.pieces.start[piece]), int(survey.pieces.stop[piece])
    base = resting(table)
    if isinstance(base, Spheres):
        return np.asarray(base.center[start] + abs(float(base.radius[start])) * _SPHERE)
    rows = np.unique(np.linspace(start, stop - 1, min(stop - start, _MOST_ROWS)).astype(np.int64))
    faces = np.concatenate([outline(table, row, row + 1) for row in rows.tolist()])
    rim = np.concatenate([faces, 0.5 * (faces + np.roll(faces, -1, axis=1))], axis=1)
    middle = faces.mean(axis=1, keepdims=True)
    rings = middle[:, None] + _RINGS[:, None, None] * (rim - middle)[:, None]
    return np.concatenate([middle.reshape(-1, 3), rings.reshape(-1, 3)])


def _spiral(count: int) -> Points:
    """Points (count + 6, 3) all over the unit sphere, the ends of its axes among them."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height * height)
    turning = np.column_stack([radius * np.cos(angle), height, radius * np.sin(angle)])
    return np.concatenate([np.eye(3), -np.eye(3), turning])


_SPHERE = _spiral(250)
