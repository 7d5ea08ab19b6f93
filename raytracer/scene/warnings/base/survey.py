"""Survey of a packed scene, object by object: sizes, positions, and primitives that vanish in float32."""

from collections.abc import Callable
from functools import cached_property, reduce
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from raytracer.core.motion.trajectory import compose
from raytracer.core.primitives.spheres import Spheres
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.shapes.base.interface import ShapeSpec
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.spec import SceneSpec
from raytracer.scene.warnings.base.primitive_points import Points, has_edges, normals, outline, squared, without_motion
from raytracer.schema.yaml_nodes import KeyPath, path_text

Derived = TypeVar("Derived")

# Rows per block: intermediate results stay in the processor's cache, and take little memory.
_BLOCK = 1 << 14


def object_label(spec: SceneSpec, keys: KeyPath) -> str:
    """Format an object for messages: its path in the scene, and its name if it has one."""
    within, *rest = keys
    objects = spec.groups.get(str(rest[0]), ()) if within == "groups" and rest else spec.objects
    number = rest[-1] if within in ("objects", "groups") and rest else None
    name = objects[number].name if isinstance(number, int) else None
    return path_text(keys) if name is None else f'{path_text(keys)} "{name}"'


class Pieces(NamedTuple):
    """Ranges of rows of the tables, one for each object in the scene's space or in that of a group (n,).

    table, start, stop : range of rows.
    item : of `PackedScene.items`.
    group : -1 for what is in none.
    low, high (m) : the box (n, 3) round it, in the space of its group or of the packed scene.
    empty : number of rows without an area in float32.
    first : the first of them, or -1.
    width (m) : of the narrowest of its other faces in float32; infinite if round.
    """

    table: NDArray[np.int64]
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    item: NDArray[np.int64]
    group: NDArray[np.int64]
    low: Points
    high: Points
    empty: NDArray[np.int64]
    first: NDArray[np.int64]
    width: Points

    @property
    def half(self) -> Points:
        """Compute half the largest edge of each box (n,) (m): the radius of a sphere."""
        return np.asarray(0.5 * (self.high - self.low).max(axis=1))

    @property
    def middle(self) -> Points:
        """Compute the centre of each box (n, 3)."""
        return np.asarray(self.low + 0.5 * (self.high - self.low))

    @property
    def reach(self) -> Points:
        """Compute the largest coordinate of each piece (n,) (m)."""
        return np.asarray(np.maximum(np.abs(self.low), np.abs(self.high)).max(axis=1))


class SceneSurvey:
    """A packed scene with the sizes and positions of its objects.

    shift (3,) : the origin of the packed scene in the scene as it was written.
    """

    def __init__(self, packed: PackedScene) -> None:
        self.packed, self.spec = packed, packed.spec
        origin = packed.scene.origin
        self.shift = np.zeros(3) if origin is None else np.array(origin.world)
        self.tables = packed.scene.primitives
        self.pieces = _pieces(packed)
        self._looks: dict[int, MaterialSpec | None] = {}
        self._derived: dict[object, object] = {}

    def once(self, derive: Callable[["SceneSurvey"], Derived]) -> Derived:
        """Derive something from the survey, once however many kinds of warnings ask for it."""
        if derive not in self._derived:
            self._derived[derive] = derive(self)
        return cast(Derived, self._derived[derive])

    def forget(self) -> None:
        """Drop what was derived: it refers to the survey, and both would keep the scene in memory for a while."""
        self._derived.clear()

    @cached_property
    def camera(self) -> Points:
        """Position of the camera (3,) in the packed scene when the shutter opens."""
        camera = self.spec.camera
        return np.asarray(camera_at_time(camera, camera.shutter_interval().open).look_from - self.shift)

    @cached_property
    def poses(self) -> Points:
        """Poses (n, 4, 4) of instances, from group space to the packed scene, at the shutter's opening."""
        instances = self.packed.scene.instances
        if instances is None:
            return np.empty((0, 4, 4))
        result = np.zeros((len(instances.group), 4, 4))
        result[:, 3, 3] = 1.0
        still = len(instances.pose)
        result[:still, :3] = instances.pose
        if instances.trajectories is not None:
            rows = instances.trajectories.rows[instances.trajectories.first[:-1]]
            result[still:] = [compose(row) for row in rows]
        return result

    @cached_property
    def scales(self) -> Points:
        """Largest scale of each instance's pose (n,)."""
        return np.asarray(np.linalg.norm(self.poses[:, :3, :3], axis=1).max(axis=1, initial=0.0))

    @cached_property
    def boxes(self) -> tuple[Points, Points]:
        """Boxes (n, 3) round the pieces in the packed scene, and round all copies of those in groups."""
        low, high = self.pieces.low.copy(), self.pieces.high.copy()
        for piece in np.flatnonzero(self.pieces.group >= 0).tolist():
            shown = self.placed(piece)
            pose = self.poses[shown]
            middle = pose[:, :3, :3] @ self.pieces.middle[piece] + pose[:, :3, 3]
            half = np.abs(pose[:, :3, :3]) @ (0.5 * (high[piece] - low[piece]))
            low[piece] = (middle - half).min(axis=0, initial=np.inf)
            high[piece] = (middle + half).max(axis=0, initial=-np.inf)
        return low, high

    def placed(self, piece: int) -> NDArray[np.int64]:
        """List the instances of a piece (n,); none for a piece in no group."""
        instances = self.packed.scene.instances
        if instances is None or self.pieces.group[piece] < 0:
            return np.empty(0, np.int64)
        return np.flatnonzero(instances.group == self.pieces.group[piece])

    def rows_of(self, piece: int) -> tuple[Any, int, int]:
        """Return the table of a piece, its first row, and that after its last."""
        pieces = self.pieces
        return self.tables[pieces.table[piece]], int(pieces.start[piece]), int(pieces.stop[piece])

    def spec_of(self, piece: int) -> ShapeSpec:
        """Return the object that a piece is, or is part of."""
        return self.packed.items[int(self.pieces.item[piece])].spec

    def material_of(self, piece: int) -> MaterialSpec | None:
        """Return a piece's resolved material; None if its faces, or its copies, have several."""
        if piece not in self._looks:
            self._looks[piece] = self._material_of(piece)
        return self._looks[piece]

    def _material_of(self, piece: int) -> MaterialSpec | None:
        pieces, instances = self.pieces, self.packed.scene.instances
        own = self.tables[pieces.table[piece]].material[pieces.start[piece] : pieces.stop[piece]]
        references = np.unique(own) if own[0] != own[-1] else own[:1]
        if instances is not None and instances.material is not None and pieces.group[piece] >= 0:
            given = np.unique(instances.material[self.placed(piece)])
            references = np.concatenate([given[given >= 0], references if (given < 0).any() else references[:0]])
        return self.packed.resolved_materials.get(int(references[0])) if len(references) == 1 else None

    def keys_of(self, piece: int) -> KeyPath:
        """Return the path in the scene of a piece's object."""
        return self.packed.items[int(self.pieces.item[piece])].keys

    def owners(self, one: tuple[int, int], other: tuple[int, int]) -> tuple[KeyPath, KeyPath]:
        """Return the paths of two objects, each given by its piece and instance (-1 for none).

        These objects place the pieces; if the same one places both, the paths are those of the pieces in the group.
        """
        placing = [
            -1 if instance < 0 else int(self.packed.objects.instance_objects[instance]) for _, instance in (one, other)
        ]
        inside = self.keys_of(one[0]), self.keys_of(other[0])
        if placing[0] == placing[1]:
            return inside
        first, second = (
            keys if number < 0 else ("objects", number) for number, keys in zip(placing, inside, strict=True)
        )
        return first, second

    def order(self, keys: KeyPath) -> tuple[bool, str, int]:
        """Make a key that sorts objects as they are written, those of groups first."""
        *path, number = keys
        return path == ["objects"], str(path), int(number)

    def contains(self, piece: int, points: Points) -> NDArray[np.bool_]:
        """Find points (n, 3) of its space that are inside of a piece (n,); none unless it is a sphere or convex."""
        table, start, stop = self.rows_of(piece)
        base = without_motion(table)
        if isinstance(base, Spheres):
            away = np.linalg.norm(points - base.center[start], axis=1)
            return np.asarray(away < abs(float(base.radius[start])))
        if not self.is_solid(piece) or self.spec_of(piece).faces is None:
            return np.zeros(len(points), bool)
        faces = outline(table, start, stop)
        heights = np.einsum("pfi,fi->pf", points[:, None] - faces[None, :, 0], normals(faces))
        return np.asarray((heights < 0.0).all(axis=1))

    def is_buried(self, point: Points) -> bool:
        """Return True if a point (3,) of the packed scene is inside of an opaque sphere or box."""
        low, high = self.boxes
        for piece in np.flatnonzero(((point > low) & (point < high)).all(axis=1)).tolist():
            look = self.material_of(piece)
            if look is None or look.admits_light():
                continue
            shown = self.placed(piece)
            if self.pieces.group[piece] < 0:
                inside = self.contains(piece, point[None])
            else:
                pose = self.poses[shown]
                away = (point - pose[:, :3, 3])[:, :, None]
                within = np.asarray(np.linalg.solve(pose[:, :3, :3], away)[:, :, 0], np.float64)
                inside = self.contains(piece, within)
            if inside.any():
                return True
        return False

    def is_solid(self, piece: int) -> bool:
        """Return True if a piece is closed, and so seen from the side of its normals alone."""
        return self.spec_of(piece).is_closed

    def is_cut(self, piece: int) -> bool:
        """Return True if a piece's faces were cut into parts as large as they are far away (`subdivide_large`)."""
        rows, faces = int(self.pieces.stop[piece] - self.pieces.start[piece]), self.spec_of(piece).faces
        return faces is not None and rows > faces

    def name_of(self, piece: int) -> str:
        """Format a piece's object for messages."""
        return object_label(self.spec, self.keys_of(piece))

    def origin_text(self) -> str:
        """Name the origin of coordinates in messages."""
        return "the middle of the scene" if self.shift.any() else "the origin"


def _pieces(packed: PackedScene) -> Pieces:
    parts: list[Pieces] = []
    for number, (table, owners) in enumerate(zip(packed.scene.primitives, packed.objects.owners, strict=True)):
        stop = np.append(owners.start[1:], len(table.material))
        used = stop > owners.start
        count = np.count_nonzero(used)
        pieces = Pieces(
            np.full(count, number),
            owners.start[used],
            stop[used],
            owners.item[used].astype(np.int64),
            owners.group[used].astype(np.int64),
            np.full((count, 3), np.inf),
            np.full((count, 3), -np.inf),
            np.zeros(count, np.int64),
            -np.ones(count, np.int64),
            np.full(count, np.inf),
        )
        _measure(table, pieces)
        parts.append(pieces)
    return Pieces(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _measure(table: object, measures: Pieces) -> None:
    """Measure pieces whose rows follow each other in a table: their columns from `low` on."""
    start, stop = measures.start, measures.stop
    for begin in range(0, int(stop[-1]) if len(stop) else 0, _BLOCK):
        end = min(begin + _BLOCK, int(stop[-1]))
        points = outline(table, begin, end)
        first = int(np.searchsorted(start, begin, side="right")) - 1
        last = int(np.searchsorted(start, end, side="left"))
        within = np.maximum(start[first:last] - begin, 0)
        corners = [points[:, k] for k in range(points.shape[1])]
        low, high = reduce(np.minimum, corners), reduce(np.maximum, corners)
        measures.low[first:last] = np.minimum(measures.low[first:last], np.minimum.reduceat(low, within))
        measures.high[first:last] = np.maximum(measures.high[first:last], np.maximum.reduceat(high, within))

        width = _widths(table, points)
        rows = np.flatnonzero(width == 0.0)
        width[rows] = np.inf
        measures.width[first:last] = np.minimum(measures.width[first:last], np.minimum.reduceat(width, within))
        piece, earliest, number = np.unique(
            np.searchsorted(within, rows, side="right") - 1 + first, return_index=True, return_counts=True
        )
        fresh = measures.empty[piece] == 0
        measures.first[piece[fresh]] = begin + rows[earliest[fresh]] - start[piece[fresh]]
        measures.empty[piece] += number


def _widths(table: object, points: Points) -> Points:
    """Measure the least heights of faces (n,) as float32 holds them (m); 0 of those without an area, never hit."""
    if not has_edges(table):
        return np.full(len(points), np.inf)
    a, b, c = (points[:, k].astype(np.float32).astype(np.float64) for k in (0, 1, points.shape[1] - 1))
    u, v = b - a, c - a
    area, longest = squared(np.cross(u, v)), np.maximum(squared(u), squared(v))
    if points.shape[1] == 3:
        longest = np.maximum(longest, squared(c - b))
    return np.sqrt(np.divide(area, longest, out=np.zeros(len(points)), where=longest > 0.0))
