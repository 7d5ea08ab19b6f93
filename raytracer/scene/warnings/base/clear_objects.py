"""Clear objects of a scene wherever they are placed, and which points are inside of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.geometry import OFFSET_ULPS
from raytracer.core.primitives.spheres import Spheres
from raytracer.plugins.materials.base.clear import ClearSpec
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.scene.pack.materials import collect_components
from raytracer.scene.warnings.base.flat_faces import extremes
from raytracer.scene.warnings.base.primitive_points import Points, outline, without_motion
from raytracer.scene.warnings.base.survey import SceneSurvey

_MOST_ROWS = 64
"""Most faces of an object that are examined."""

_MOST_COPIES = 64

_BLOCK = 1 << 16

_RINGS = np.linspace(0.25, 1.0, 4)
"""Positions of points of a face, from its centre to its rim, so that long thin faces have some where they cross."""

_ALONG = np.array([0.577, 0.587, 0.568]) / np.linalg.norm([0.577, 0.587, 0.568])
"""A direction along no axis, and in no plane that is common in scenes."""


class Copy(NamedTuple):
    """Piece as placed by an instance (-1 for none).

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


class ClearObjects:
    """Clear pieces of a scene, sorted, and their copies.

    bare, filled : those without a priority, and those with one.
    hollows : spheres that are inside out.
    """

    def __init__(self, survey: SceneSurvey) -> None:
        self._survey = survey
        self._copies: dict[int, list[Copy]] = {}
        self.bare: list[int] = []
        self.filled: list[int] = []
        self.hollows: list[int] = []
        if not any(look.is_transmissive() for look in survey.packed.resolved_materials.values()):
            return
        for piece in range(len(survey.pieces.item)):
            look = survey.material_of(piece)
            if look is None or not look.is_transmissive():
                continue
            if look.interior_medium() is not None:
                self.filled.append(piece)
            elif boundaries(look):
                self.bare.append(piece)
            if is_inside_out(survey, piece):
                self.hollows.append(piece)

    def copies(self, piece: int) -> list[Copy]:
        """List a piece's copies, of many the first."""
        if piece not in self._copies:
            self._copies[piece] = _copies(self._survey, piece)
        return self._copies[piece]


def boundaries(look: MaterialSpec) -> list[ClearSpec]:
    """List the boundaries of clear media that a material is, or selects from."""
    return [part for part in collect_components([look]) if isinstance(part, ClearSpec) and not part.is_index_matched()]


def is_inside_out(survey: SceneSurvey, piece: int) -> bool:
    """Tell if a piece is a sphere with a negative radius."""
    base = without_motion(survey.tables[survey.pieces.table[piece]])
    return isinstance(base, Spheres) and float(base.radius[survey.pieces.start[piece]]) < 0.0


# ---- Tests of points


def inside_copy(survey: SceneSurvey, points: Points, holder: Copy) -> NDArray[np.bool_]:
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
    table, start, stop = survey.rows_of(piece)
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


def _copies(survey: SceneSurvey, piece: int) -> list[Copy]:
    own = _surface(survey, piece)
    if survey.pieces.group[piece] < 0:
        placed = [(-1, np.eye(4))]
    else:
        placed = [(number, survey.poses[number]) for number in survey.placed(piece)[:_MOST_COPIES].tolist()]
    copies = []
    for instance, pose in placed:
        points = own @ pose[:3, :3].T + pose[:3, 3]
        copies.append(Copy(piece, instance, points, points.min(axis=0), points.max(axis=0), pose))
    return copies


def _surface(survey: SceneSurvey, piece: int) -> Points:
    """Sample points (n, 3) of a piece's surface, in its own space."""
    table, start, stop = survey.rows_of(piece)
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
