"""Sort a scene's objects into what is baked into tables and what instances place.

An object is baked, its transform applied once and for all, into the tables of what it is part of: the scene, or a
group.  It becomes a group of its own, placed by an instance, if it moves otherwise than straight on, if its primitives
cannot take its transform (an ellipsoid), if another object is an instance of it, or if another object names the same
file, so that what is stored is stored once.  Groups in groups are flattened: what is placed are primitives.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.motion.resolve import Moving, Shift, Static, resolve_motion, trajectory_of
from raytracer.core.motion.trajectory import Rows, compose_trajectories, decompose
from raytracer.plugins.shapes.base.interface import PlacementSpec, ShapeSpec
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.transform import matrix_of
from raytracer.schema.yaml_nodes import KeyPath

Matrices: TypeAlias = NDArray[np.float64]

_MAX_INSTANCES = 2**24

# Each `GroupInstances` takes some microseconds and a kilobyte, however many copies it holds.
_MAX_GROUP_INSTANCES = 2**20

NO_POSES = np.empty((0, 4, 4))


class Item(NamedTuple):
    """An object with a material of its own.

    spec : the object.
    keys : its path in the scene.
    number : its index in `objects`, -1 in a group.
    """

    spec: ShapeSpec
    keys: KeyPath
    number: int


class Part(NamedTuple):
    """An item with primitives, and its pose in the space of what it is part of."""

    item: int
    placed: Static | Shift


class GroupInstances(NamedTuple):
    """Instances of a group.

    group : the group's number.
    poses : (n, 4, 4), of those that stand still.
    trajectories : of those that move.
    material : the item whose material replaces all others, or -1.
    number : index in `objects` of the object that places them.
    """

    group: int
    poses: Matrices
    trajectories: tuple[Rows, ...]
    material: int
    number: int


class Layout(NamedTuple):
    """The objects of a scene, sorted.

    items : all objects with materials of their own.
    ungrouped : parts in no group.
    groups : parts by number of the group.
    instances : of groups.
    """

    items: Sequence[Item]
    ungrouped: Sequence[Part]
    groups: Sequence[Sequence[Part]]
    instances: Sequence[GroupInstances]


def lay_out(spec: SceneSpec, assets: SceneAssets) -> Layout:
    """Sort the objects of a scene into baked ones and those placed by instances.

    Raises
    ------
    SceneError : an object's motion or placements are impossible.
    """
    builder = _Builder(spec, assets)
    ungrouped, instances = builder.gather(builder.entries_of(None))
    return Layout(builder.items, ungrouped, builder.groups, instances)


_Entries: TypeAlias = Iterable[tuple[KeyPath, ShapeSpec, int]]


class _Builder:
    """Builder of a layout, which walks through the objects."""

    def __init__(self, spec: SceneSpec, assets: SceneAssets) -> None:
        self._spec, self._assets = spec, assets
        self._shutter = spec.camera.shutter_interval()
        self.items: list[Item] = []
        self.groups: list[list[Part]] = []
        self._numbers: dict[KeyPath, int] = {}
        self._named: dict[str, list[GroupInstances]] = {}
        self._alike: dict[tuple[ShapeSpec, bool], int] = {}
        self._count = self._group_instances = 0
        every = [item for name in (None, *spec.groups) for _, item, _ in self.entries_of(name)]
        self._placed_objects = {item.of for item in every if isinstance(item, PlacementSpec)}
        filed = [_bare(item) for item in every if item.files() and not isinstance(item, PlacementSpec)]
        self._shared = {item for item, times in Counter(filed).items() if times > 1}

    def entries_of(self, group: str | None) -> _Entries:
        """List the objects of the scene, or of one of its groups, with their paths and numbers."""
        if group is None:
            return [(("objects", number), item, number) for number, item in enumerate(self._spec.objects)]
        return [(("groups", group, place), item, -1) for place, item in enumerate(self._spec.groups[group])]

    def _item(self, item: ShapeSpec, keys: KeyPath, number: int) -> int:
        """Return the number of an item, a new one for a new item."""
        if keys not in self._numbers:
            self._numbers[keys] = len(self.items)
            self.items.append(Item(item, keys, number))
        return self._numbers[keys]

    def gather(self, entries: _Entries) -> tuple[list[Part], list[GroupInstances]]:
        """Sort objects into parts to be baked and instances, both in the space that they share."""
        parts: list[Part] = []
        instances: list[GroupInstances] = []
        for keys, item, number in entries:
            if isinstance(item, PlacementSpec):
                instances += self._instances(item, keys, number)
                continue
            placed = self._place(item, matrix_of(item.transform), keys)
            is_also_placed = number >= 0 and item.name in self._placed_objects
            if (
                isinstance(placed, Moving)
                or is_also_placed
                or not item.supports_transform(placed.matrix)
                or (self._shared and _bare(item) in self._shared)
            ):
                instances.append(self._alone(item, keys, number, placed))
            else:
                parts.append(Part(self._item(item, keys, number), placed))
        return parts, instances

    def _place(self, item: ShapeSpec, matrix: Matrices, keys: KeyPath) -> Static | Shift | Moving:
        with self._spec.errors_at(*keys, "motion"):
            return resolve_motion(item.motion, matrix, self._shutter)

    def _alone(self, item: ShapeSpec, keys: KeyPath, number: int, placed: Static | Shift | Moving) -> GroupInstances:
        """Make an object an instance of a group, which it shares with others that differ by material only."""
        own = self._item(item, keys, number)
        files = self._assets.of(item, keys).values() if item.material is None else ()
        bare = _bare(item), any(getattr(held, "kinds", None) is not None for held in files)
        if bare not in self._alike:
            self._alike[bare] = len(self.groups)
            self.groups.append([Part(own, Static(np.eye(4)))])
        group = self._alike[bare]
        first = self.items[self.groups[group][0].item].spec
        matter = (item.material, item.medium, item.outside_medium)
        material = -1 if (first.material, first.medium, first.outside_medium) == matter else own
        self._count_more(1, keys)
        if isinstance(placed, Static):
            return GroupInstances(group, placed.matrix[None], (), material, number)
        return GroupInstances(group, NO_POSES, (trajectory_of(placed),), material, number)

    def _instances(self, item: PlacementSpec, keys: KeyPath, number: int) -> list[GroupInstances]:
        """List the contents that an instance places."""
        inner = self._contents(item.of)
        with self._spec.errors_at(*keys):
            poses = item.poses(self._assets.of(item, keys))
        moving: list[Rows] = []
        if item.motion is not None:
            placed = [self._place(item, pose, keys) for pose in poses]
            poses = np.array([one.matrix for one in placed if isinstance(one, Static)]).reshape(-1, 4, 4)
            moving = [trajectory_of(one) for one in placed if not isinstance(one, Static)]
        material = self._item(item, keys, number) if item.material is not None else -1
        result: list[GroupInstances] = []
        for below in inner:
            self._count_more((len(poses) + len(moving)) * (len(below.poses) + len(below.trajectories)), keys)
            still, trajectories = _composed(poses, moving, below)
            own = below.material if material < 0 else material
            result.append(GroupInstances(below.group, still, trajectories, own, number))
        return result

    def _contents(self, name: str) -> list[GroupInstances]:
        """List the contents of a named group or object, as instances in its own space."""
        if name not in self._named:
            if name in self._spec.groups:
                parts, instances = self.gather(self.entries_of(name))
                if parts:
                    instances.append(GroupInstances(len(self.groups), np.eye(4)[None], (), -1, -1))
                    self.groups.append(parts)
            else:
                entry = next(entry for entry in self.entries_of(None) if entry[1].name == name)
                instances = self.gather([entry])[1]
            self._named[name] = instances
        return self._named[name]

    def _count_more(self, count: int, keys: KeyPath) -> None:
        """Count instances, which are `count` copies of one group."""
        self._count += count
        self._group_instances += 1
        if self._group_instances > _MAX_GROUP_INSTANCES:
            sentence = f"more than {_MAX_GROUP_INSTANCES:,} times by instances that are written one by one"
            raise self._spec.error(f"places groups in groups {sentence}", *keys)
        if self._count > _MAX_INSTANCES:
            sentence = f"{self._count:,} times in all, and at most {_MAX_INSTANCES:,} are possible"
            raise self._spec.error(f"places groups in groups {sentence}", *keys)


def _bare(item: ShapeSpec) -> ShapeSpec:
    """Strip an object of the keys that an instance can add: equal results have the same primitives."""
    without = ("name", "material", "medium", "outside_medium", "transform", "motion")
    return item.model_copy(update=dict.fromkeys(without))


def _composed(poses: Matrices, moving: Sequence[Rows], below: GroupInstances) -> tuple[Matrices, tuple[Rows, ...]]:
    """Compose the poses and trajectories of instances with those of the instances in them."""
    still = (poses[:, None] @ below.poses[None]).reshape(-1, 4, 4)
    if not moving and not below.trajectories:
        return still, ()
    outer_still, inner_still = ([decompose(pose)[None] for pose in some] for some in (poses, below.poses))
    pairs = [(outer, inner) for outer in outer_still for inner in below.trajectories]
    pairs += [(outer, inner) for outer in moving for inner in (*inner_still, *below.trajectories)]
    return still, tuple(compose_trajectories(outer, inner) for outer, inner in pairs)
