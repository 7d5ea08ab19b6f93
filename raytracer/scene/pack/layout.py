"""From a scene's objects to tables of primitives, and to groups of them that are placed by instances.

An object is baked, its transform applied once and for all, into the tables of what it is part of: the scene, or a
group.  It becomes a group of its own, placed by an instance, if it moves otherwise than straight on, if its primitives
cannot take its transform (an ellipsoid), if another object is an instance of it, or if another object names the same
file, so that what is stored is stored once.  Groups in groups are flattened: what is placed are primitives.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.embree import Placements
from raytracer.errors import InputError
from raytracer.geometry import Geometry
from raytracer.instances import Instances, pose_rows
from raytracer.motion import (
    Moving,
    Rows,
    Shift,
    Static,
    compose,
    composed,
    decompose,
    pack_trajectories,
    place,
    trajectory_of,
)
from raytracer.primitives.interface import concatenate, geometry, graded, group_key, section, unmapped
from raytracer.primitives.translated import translated
from raytracer.scene.limits import check_extent, check_poses
from raytracer.scene.spec import SceneSpec
from raytracer.scene.supplies import Anew, Supplies
from raytracer.shapes.interface import PlacingSpec, ShapeSpec
from raytracer.spec import Spec, matrix_of

Keys: TypeAlias = tuple[str | int, ...]
Reference: TypeAlias = int | NDArray[np.int64]
Matrices: TypeAlias = NDArray[np.float64]

_MOST_INSTANCES = 2**24

# Each takes some microseconds and a kilobyte, however many copies it is of.
_MOST_PLACINGS = 2**20

_STILL = np.empty((0, 4, 4))


class Item(NamedTuple):
    """An object whose material counts: spec, its path in the scene, and its number in `objects`, -1 in a group."""

    spec: ShapeSpec
    keys: Keys
    number: int


class Part(NamedTuple):
    """An item with primitives, and where it lies in the space of what it is part of."""

    item: int
    placed: Static | Shift


class Placing(NamedTuple):
    """Instances of a group: poses (n, 4, 4) of those that stand still, or trajectories of those that move.

    material, the item whose material takes the place of all others, or -1; number, that of the object in `objects`.
    """

    group: int
    poses: Matrices
    trajectories: tuple[Rows, ...]
    material: int
    number: int


class Layout(NamedTuple):
    """items; plain, what is in no group; groups, by number; placings, of groups."""

    items: Sequence[Item]
    plain: Sequence[Part]
    groups: Sequence[Sequence[Part]]
    placings: Sequence[Placing]


class Owners(NamedTuple):
    """The rows of a table from start[i] on, up to start[i + 1], are of object number[i]; -1 for none of its own.

    item[i] of the layout is what they are made from, and they are in group[i], -1 for none.
    """

    start: NDArray[np.int64]
    number: NDArray[np.int32]
    item: NDArray[np.int32]
    group: NDArray[np.int32]


class Objects(NamedTuple):
    """Packed objects.

    primitives, one table a kind; bounds int64 (groups + 1, tables, 2), the first row, and that after the last, of what
    is in no group and of each group; owners, one a table; instances, or None; placed int32 (n,), the object in the
    scene that each instance is or belongs to; geometries, of what is in no group, by table, groups, likewise, and
    placements, as Embree takes them.
    """

    primitives: tuple[Any, ...]
    bounds: NDArray[np.int64]
    owners: tuple[Owners, ...]
    instances: Instances | None
    placed: NDArray[np.int32]
    geometries: Mapping[int, Geometry]
    groups: Sequence[Mapping[int, Geometry]]
    placements: Sequence[Placements]

    def moves(self) -> bool:
        """Whether any object moves while the shutter is open."""
        geometries = (item for numbered in (self.geometries, *self.groups) for item in numbered.values())
        placed = any(len(item.poses) > 1 for item in self.placements)
        return placed or any(len(item.vertices) > 1 for item in geometries)


class Assets:
    """Files that a scene names, each read once."""

    def __init__(self, spec: SceneSpec, supplies: Supplies | None = None) -> None:
        self._spec, self._supplies = spec, supplies or Anew()
        self._held: dict[tuple[str, Path], Any] = {}

    def read(self, kind: str, name: str) -> Any:
        """What the file of that name, relative to the scene, holds as a kind of `assets.LOADERS`.

        Raises
        ------
        InputError : it cannot be read.
        """
        known = kind, self._spec.base / name
        if known not in self._held:
            self._held[known] = self._supplies.read(*known)
        return self._held[known]

    def of(self, item: Spec, keys: Keys) -> Mapping[str, Any]:
        """What the files of an object, or of the camera, hold, by the path of the key that names each.

        Raises
        ------
        SceneError : a file cannot be read.
        """
        result = {}
        for path, (name, kind) in item.files().items():
            try:
                result[".".join(map(str, path))] = self.read(kind, name)
            except InputError as error:
                raise self._spec.error(str(error), *keys, *path) from None
        return result

    def is_fresh(self, supplies: Supplies) -> bool:
        """Whether `supplies` has for each file that was read the very same as this."""
        try:
            return all(supplies.read(*known) is held for known, held in self._held.items())
        except InputError:
            return False


# ---- Which object goes where


def lay_out(spec: SceneSpec, assets: Assets) -> Layout:
    """Sort the objects of a scene into what is baked and what is placed by instances.

    Raises
    ------
    SceneError : an object's motion or placements cannot be.
    """
    builder = _Builder(spec, assets)
    plain, placings = builder.gather(builder.entries_of(None))
    return Layout(builder.items, plain, builder.groups, placings)


_Entries: TypeAlias = Iterable[tuple[Keys, ShapeSpec, int]]


class _Builder:
    """What is found while the objects are walked through."""

    def __init__(self, spec: SceneSpec, assets: Assets) -> None:
        self._spec, self._assets = spec, assets
        self._shutter = spec.camera.opening()
        self.items: list[Item] = []
        self.groups: list[list[Part]] = []
        self._numbers: dict[Keys, int] = {}
        self._named: dict[str, list[Placing]] = {}
        self._alike: dict[tuple[ShapeSpec, bool], int] = {}
        self._count = self._placings = 0
        every = [item for name in (None, *spec.groups) for _, item, _ in self.entries_of(name)]
        self._again = {item.of for item in every if isinstance(item, PlacingSpec)}
        filed = [_bare(item) for item in every if item.files() and not isinstance(item, PlacingSpec)]
        self._shared = {item for item, times in Counter(filed).items() if times > 1}

    def entries_of(self, group: str | None) -> _Entries:
        """The objects of the scene, or of one of its groups, with their paths and numbers."""
        if group is None:
            return [(("objects", number), item, number) for number, item in enumerate(self._spec.objects)]
        return [(("groups", group, place), item, -1) for place, item in enumerate(self._spec.groups[group])]

    def _item(self, item: ShapeSpec, keys: Keys, number: int) -> int:
        """The number of an item, a new one where it was not met before."""
        if keys not in self._numbers:
            self._numbers[keys] = len(self.items)
            self.items.append(Item(item, keys, number))
        return self._numbers[keys]

    def gather(self, entries: _Entries) -> tuple[list[Part], list[Placing]]:
        """What is baked of some objects, and what is placed, both in the space that they share."""
        parts: list[Part] = []
        placings: list[Placing] = []
        for keys, item, number in entries:
            if isinstance(item, PlacingSpec):
                placings += self._instances(item, keys, number)
                continue
            placed = self._place(item, matrix_of(item.transform), keys)
            named_again = number >= 0 and item.name in self._again
            if (
                isinstance(placed, Moving)
                or named_again
                or not item.takes(placed.matrix)
                or (self._shared and _bare(item) in self._shared)
            ):
                placings.append(self._alone(item, keys, number, placed))
            else:
                parts.append(Part(self._item(item, keys, number), placed))
        return parts, placings

    def _place(self, item: ShapeSpec, matrix: Matrices, keys: Keys) -> Static | Shift | Moving:
        try:
            return place(item.motion, matrix, self._shutter)
        except ValueError as error:
            raise self._spec.error(str(error), *keys, "motion") from None

    def _alone(self, item: ShapeSpec, keys: Keys, number: int, placed: Static | Shift | Moving) -> Placing:
        """An object as an instance of a group of its own, which it shares with others that differ by material only."""
        own = self._item(item, keys, number)
        bare = _bare(item), self._brings_materials(item, keys)
        if bare not in self._alike:
            self._alike[bare] = len(self.groups)
            self.groups.append([Part(own, Static(np.eye(4)))])
        group = self._alike[bare]
        first = self.items[self.groups[group][0].item].spec
        material = -1 if _matter(first) == _matter(item) else own
        self._count_more(1, keys)
        if isinstance(placed, Static):
            return Placing(group, placed.matrix[None], (), material, number)
        return Placing(group, _STILL, (trajectory_of(placed),), material, number)

    def _brings_materials(self, item: ShapeSpec, keys: Keys) -> bool:
        """Whether what an object is made of is in its file."""
        if item.material is not None:
            return False
        return any(getattr(held, "kinds", None) is not None for held in self._assets.of(item, keys).values())

    def _instances(self, item: PlacingSpec, keys: Keys, number: int) -> list[Placing]:
        """All that an instance places."""
        inner = self._contents(item.of)
        try:
            poses = item.poses(self._assets.of(item, keys))
        except ValueError as error:
            raise self._spec.error(str(error), *keys) from None
        moving: list[Rows] = []
        if item.motion is not None:
            placed = [self._place(item, pose, keys) for pose in poses]
            poses = np.array([one.matrix for one in placed if isinstance(one, Static)]).reshape(-1, 4, 4)
            moving = [trajectory_of(one) for one in placed if not isinstance(one, Static)]
        material = self._item(item, keys, number) if item.material is not None else -1
        result: list[Placing] = []
        for below in inner:
            self._count_more((len(poses) + len(moving)) * (len(below.poses) + len(below.trajectories)), keys)
            still, trajectories = _composed(poses, moving, below)
            result.append(
                Placing(below.group, still, trajectories, below.material if material < 0 else material, number)
            )
        return result

    def _contents(self, name: str) -> list[Placing]:
        """What a name stands for, a group's or an object's, as placings in its own space."""
        if name not in self._named:
            if name in self._spec.groups:
                parts, placings = self.gather(self.entries_of(name))
                if parts:
                    placings.append(Placing(len(self.groups), np.eye(4)[None], (), -1, -1))
                    self.groups.append(parts)
            else:
                entry = next(entry for entry in self.entries_of(None) if entry[1].name == name)
                placings = self.gather([entry])[1]
            self._named[name] = placings
        return self._named[name]

    def _count_more(self, count: int, keys: Keys) -> None:
        """Count instances, which are `count` copies of one group."""
        self._count += count
        self._placings += 1
        if self._placings > _MOST_PLACINGS:
            raise self._spec.error(
                f"places groups in groups more than {_MOST_PLACINGS:,} times by instances that are written one by one",
                *keys,
            )
        if self._count > _MOST_INSTANCES:
            raise self._spec.error(
                f"places groups in groups {self._count:,} times in all, and at most {_MOST_INSTANCES:,} are possible",
                *keys,
            )


def _bare(item: ShapeSpec) -> ShapeSpec:
    """The object without what an instance can add: equal ones have the same primitives."""
    without = ("name", "material", "medium", "outside_medium", "transform", "motion")
    return item.model_copy(update=dict.fromkeys(without))


def _matter(item: ShapeSpec) -> tuple[Any, ...]:
    """What an object is made of."""
    return item.material, item.medium, item.outside_medium


def _composed(poses: Matrices, moving: Sequence[Rows], below: Placing) -> tuple[Matrices, tuple[Rows, ...]]:
    """The poses and trajectories of what is placed by some, and in them by others."""
    still = (poses[:, None] @ below.poses[None]).reshape(-1, 4, 4)
    if not moving and not below.trajectories:
        return still, ()
    outer_still, inner_still = ([decompose(pose)[None] for pose in some] for some in (poses, below.poses))
    pairs = [(outer, inner) for outer in outer_still for inner in below.trajectories]
    pairs += [(outer, inner) for outer in moving for inner in (*inner_still, *below.trajectories)]
    return still, tuple(composed(outer, inner) for outer, inner in pairs)


# ---- Tables


class _Piece(NamedTuple):
    """The rows of one item: group, -1 for none; the number of its object, and its own."""

    group: int
    table: Any
    number: int
    item: int


def pack_objects(
    spec: SceneSpec,
    layout: Layout,
    references: Sequence[Reference],
    assets: Assets,
    *,
    textured: bool,
    eye: NDArray[np.float64],
) -> Objects:
    """Pack laid-out objects, whose items have these material references, one, or one a face.

    Parameters
    ----------
    textured : whether the scene has textures, so that meshes need the parameters that their files give to vertices.
    eye : (3,), where the camera is in the packed scene (m).

    Raises
    ------
    SceneError : an object's file cannot be read, or does not suit it.
    """
    pieces: dict[tuple[Any, ...], list[_Piece]] = {}
    for group, parts in enumerate((layout.plain, *layout.groups), -1):
        for part in parts:
            item = layout.items[part.item]
            table = _pack_item(spec, item, part.placed, references[part.item], assets)
            if not textured:
                table = unmapped(table)
                # Where a group is placed, and what moves, is near the eye in one place or moment and far in another.
                if group < 0 and not isinstance(part.placed, Shift):
                    table = graded(table, eye)
            number = item.number if group < 0 else -1
            pieces.setdefault(group_key(table), []).append(_Piece(group, table, number, part.item))
    _check_placings(spec, layout)
    order = sorted(pieces)
    bounds = np.zeros((len(layout.groups) + 1, len(order), 2), np.int64)
    for number, key in enumerate(order):
        lengths = np.zeros(len(layout.groups) + 1, np.int64)
        for piece in pieces[key]:
            lengths[piece.group + 1] += len(piece.table.material)
        bounds[:, number, 1] = np.cumsum(lengths)
        bounds[:, number, 0] = bounds[:, number, 1] - lengths
    owners = tuple(_owners_of(pieces[key]) for key in order)
    primitives = tuple(_joined(pieces.pop(key)) for key in order)
    instances, placed, placements = _pack_instances(layout, references, bounds, len(order))
    geometries = [
        {
            number: geometry(section(primitives[number], int(start), int(stop)))
            for number, (start, stop) in enumerate(rows)
            if stop > start
        }
        for rows in bounds
    ]
    return Objects(primitives, bounds, owners, instances, placed, geometries[0], geometries[1:], placements)


def _check_placings(spec: SceneSpec, layout: Layout) -> None:
    """Refuse instances that the ray caster cannot place."""
    for placing in layout.placings:
        moving = [compose(rows[0]) for rows in placing.trajectories]
        try:
            check_poses(np.concatenate([placing.poses, np.array(moving).reshape(-1, 4, 4)]))
        except ValueError as error:
            raise spec.error(str(error), "objects", placing.number) from None


def _pack_item(spec: SceneSpec, item: Item, placed: Static | Shift, reference: Any, assets: Assets) -> Any:
    """The table of one object."""
    try:
        table = item.spec.pack_exposed(placed.matrix, reference, assets.of(item.spec, item.keys), spec.camera.opening())
        check_extent(geometry(table))
    except ValueError as error:
        raise spec.error(str(error), *item.keys) from None
    return translated(table, placed.shift) if isinstance(placed, Shift) else table


def _single(reference: Reference) -> int:
    """The material of an instance, which is one: objects that bring several share no group with others."""
    assert isinstance(reference, int)
    return reference


def _joined(pieces: Sequence[_Piece]) -> Any:
    return concatenate(pieces[0].table, [piece.table for piece in pieces])


def _owners_of(pieces: Sequence[_Piece]) -> Owners:
    """Whose the rows of these pieces are, one after the other."""
    lengths = [len(piece.table.material) for piece in pieces]
    start = np.cumsum([0, *lengths[:-1]], dtype=np.int64)
    number, item, group = np.array([(piece.number, piece.item, piece.group) for piece in pieces], np.int32).T
    return Owners(start, np.ascontiguousarray(number), np.ascontiguousarray(item), np.ascontiguousarray(group))


def _pack_instances(
    layout: Layout, references: Sequence[Reference], bounds: NDArray[np.int64], tables: int
) -> tuple[Instances | None, NDArray[np.int32], list[Placements]]:
    """The instances, whose objects they are, and what Embree makes of them."""
    if not layout.placings:
        return None, np.empty(0, np.int32), []
    still = [(placing, placing.poses) for placing in layout.placings if len(placing.poses)]
    moving = sorted(
        ((placing, rows) for placing in layout.placings for rows in placing.trajectories), key=lambda pair: len(pair[1])
    )
    poses = pose_rows(np.concatenate([_STILL, *(pose for _, pose in still)]))
    order = [(placing, len(pose)) for placing, pose in still] + [(placing, 1) for placing, _ in moving]
    counts = [count for _, count in order]

    def by_instance(values: Iterable[int]) -> NDArray[np.int32]:
        return np.repeat(np.array(list(values), np.int32), counts)

    group = by_instance(placing.group for placing, _ in order)
    material = by_instance(
        _single(references[placing.material]) if placing.material >= 0 else -1 for placing, _ in order
    )
    numbers = by_instance(placing.number for placing, _ in order)

    # Embree takes instances by the array, all of one array with as many time steps.
    placements, starts = [], []
    if len(poses):
        starts.append(0)
        shown = np.ascontiguousarray(group[: len(poses)], np.uint32)
        placements.append(Placements(shown, (np.ascontiguousarray(poses.reshape(-1, 12), np.float32),)))
    for steps in sorted({len(rows) for _, rows in moving}):
        of_steps = [rows for _, rows in moving if len(rows) == steps]
        start = len(poses) + sum(len(rows) < steps for _, rows in moving)
        starts.append(start)
        by_step = np.ascontiguousarray(np.stack(of_steps, axis=1), np.float32)
        shown = np.ascontiguousarray(group[start : start + len(of_steps)], np.uint32)
        placements.append(Placements(shown, tuple(by_step)))
    instances = Instances(
        group=group,
        pose=poses,
        trajectories=pack_trajectories([rows for _, rows in moving]) if moving else None,
        material=material if (material >= 0).any() else None,
        rows=np.ascontiguousarray(bounds[1:, :, 0], np.int32),
        arrays=np.array(starts, np.int32),
        base=tables,
        glow=None,
    )
    return instances, numbers, placements
