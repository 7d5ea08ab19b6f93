"""Pack a scene's objects: tables of primitives, and the groups of them that instances place."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import InstanceArray
from raytracer.core.geometry import Geometry, Primitive
from raytracer.core.instancing import Instances, pose_rows
from raytracer.core.motion.interpolation import pack_trajectories
from raytracer.core.motion.resolve import Shift, Static
from raytracer.core.motion.trajectory import compose
from raytracer.core.primitives.base.interface import (
    concatenate,
    geometry,
    group_key,
    slice_rows,
    subdivide_large,
    without_uv,
)
from raytracer.core.primitives.translated import translate_table
from raytracer.scene.pack.layout import NO_POSES, Item, Layout
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec

Reference: TypeAlias = int | NDArray[np.int64]


class Owners(NamedTuple):
    """The objects that the rows of a table belong to, by ranges of rows.

    start : first row of each range, which ends at the next one's.
    number : index of the object in `objects`; -1 for none of its own.
    item : index of the item in the layout.
    group : number of the group; -1 for none.
    """

    start: NDArray[np.int64]
    number: NDArray[np.int32]
    item: NDArray[np.int32]
    group: NDArray[np.int32]


class Objects(NamedTuple):
    """Packed objects.

    primitives : one table a kind.
    bounds : int64 (groups + 1, tables, 2), the first row, and that after the last, of what is in no group, then of each
        group.
    owners : one a table.
    instances : None if there are none.
    instance_objects : int32 (n,), index in `objects` of the object that each instance is or belongs to.
    geometries : of what is in no group, by table, as Embree takes them.
    groups : geometries of each group, by table.
    placements : of groups, as Embree takes them.
    """

    primitives: tuple[Any, ...]
    bounds: NDArray[np.int64]
    owners: tuple[Owners, ...]
    instances: Instances | None
    instance_objects: NDArray[np.int32]
    geometries: Mapping[int, Geometry]
    groups: Sequence[Mapping[int, Geometry]]
    placements: Sequence[InstanceArray]

    def moves(self) -> bool:
        """Return True if any object moves while the shutter is open."""
        geometries = (item for numbered in (self.geometries, *self.groups) for item in numbered.values())
        placed = any(len(item.poses) > 1 for item in self.placements)
        return placed or any(len(item.vertices) > 1 for item in geometries)


class _Piece(NamedTuple):
    """The rows of one item.

    group : -1 for none.
    table : the rows.
    number : of its object, -1 for none.
    item : its own number.
    """

    group: int
    table: Any
    number: int
    item: int


def pack_objects(
    spec: SceneSpec,
    layout: Layout,
    references: Sequence[Reference],
    assets: SceneAssets,
    *,
    textured: bool,
    eye: NDArray[np.float64],
) -> Objects:
    """Pack the objects of a layout, whose items have these material references, one, or one a face.

    textured : the scene has textures, so meshes keep the texture coordinates of their files.
    eye : (3,), position of the camera in the packed scene (m).

    Raises
    ------
    SceneError : an object's file cannot be read, or does not suit it.
    """
    pieces: dict[tuple[Any, ...], list[_Piece]] = {}
    for group, parts in enumerate((layout.ungrouped, *layout.groups), -1):
        for part in parts:
            item = layout.items[part.item]
            table = _pack_item(spec, item, part.placed, references[part.item], assets)
            if not textured:
                table = without_uv(table)
                # Groups and moving objects are near the eye in one place or moment and far in another.
                if group < 0 and not isinstance(part.placed, Shift):
                    table = subdivide_large(table, eye)
            number = item.number if group < 0 else -1
            pieces.setdefault(group_key(table), []).append(_Piece(group, table, number, part.item))
    _check_instances(spec, layout)
    order = sorted(pieces)
    bounds = np.zeros((len(layout.groups) + 1, len(order), 2), np.int64)
    for number, key in enumerate(order):
        lengths = np.zeros(len(layout.groups) + 1, np.int64)
        for piece in pieces[key]:
            lengths[piece.group + 1] += len(piece.table.material)
        bounds[:, number, 1] = np.cumsum(lengths)
        bounds[:, number, 0] = bounds[:, number, 1] - lengths
    owners = tuple(_owners_of(pieces[key]) for key in order)
    tables = ([piece.table for piece in pieces.pop(key)] for key in order)
    primitives = tuple(concatenate(parts[0], parts) for parts in tables)
    instances, placed, placements = _pack_instances(layout, references, bounds, len(order))
    geometries = [
        {
            number: geometry(slice_rows(primitives[number], int(start), int(stop)))
            for number, (start, stop) in enumerate(rows)
            if stop > start
        }
        for rows in bounds
    ]
    return Objects(primitives, bounds, owners, instances, placed, geometries[0], geometries[1:], placements)


def _check_instances(spec: SceneSpec, layout: Layout) -> None:
    """Reject instances that the ray caster cannot place."""
    for instance in layout.instances:
        moving = [compose(rows[0]) for rows in instance.trajectories]
        with spec.errors_at("objects", instance.number):
            check_poses(np.concatenate([instance.poses, np.array(moving).reshape(-1, 4, 4)]))


def _pack_item(spec: SceneSpec, item: Item, placed: Static | Shift, reference: Any, assets: SceneAssets) -> Any:
    files, shutter = assets.of(item.spec, item.keys), spec.camera.shutter_interval()
    with spec.errors_at(*item.keys):
        table = item.spec.pack_moving(placed.matrix, reference, files, shutter)
        check_extent(geometry(table))
    return translate_table(table, placed.shift) if isinstance(placed, Shift) else table


def _owners_of(pieces: Sequence[_Piece]) -> Owners:
    """Number the objects that the rows of these pieces belong to, one piece after the other."""
    lengths = [len(piece.table.material) for piece in pieces]
    start = np.cumsum([0, *lengths[:-1]], dtype=np.int64)
    number, item, group = np.array([(piece.number, piece.item, piece.group) for piece in pieces], np.int32).T
    return Owners(start, np.ascontiguousarray(number), np.ascontiguousarray(item), np.ascontiguousarray(group))


def _pack_instances(
    layout: Layout, references: Sequence[Reference], bounds: NDArray[np.int64], tables: int
) -> tuple[Instances | None, NDArray[np.int32], list[InstanceArray]]:
    """Pack the instances, their objects' indices, and their arrays for Embree."""
    if not layout.instances:
        return None, np.empty(0, np.int32), []
    still = [(instance, instance.poses) for instance in layout.instances if len(instance.poses)]
    moving = sorted(
        ((instance, rows) for instance in layout.instances for rows in instance.trajectories),
        key=lambda pair: len(pair[1]),
    )
    poses = pose_rows(np.concatenate([NO_POSES, *(pose for _, pose in still)]))
    order = [(instance, len(pose)) for instance, pose in still] + [(instance, 1) for instance, _ in moving]
    counts = [count for _, count in order]

    def by_instance(values: Iterable[int]) -> NDArray[np.int32]:
        return np.repeat(np.array(list(values), np.int32), counts)

    group = by_instance(instance.group for instance, _ in order)
    # Objects that bring several materials share no group with others, so each reference here is one number.
    given = [references[instance.material] if instance.material >= 0 else -1 for instance, _ in order]
    material = np.repeat(np.array(given, np.int32), counts)
    numbers = by_instance(instance.number for instance, _ in order)

    # Embree takes instances by the array, all of one array with as many time steps.
    placements, starts = [], []
    if len(poses):
        starts.append(0)
        shown = np.ascontiguousarray(group[: len(poses)], np.uint32)
        placements.append(InstanceArray(shown, (np.ascontiguousarray(poses.reshape(-1, 12), np.float32),)))
    for steps in sorted({len(rows) for _, rows in moving}):
        of_steps = [rows for _, rows in moving if len(rows) == steps]
        start = len(poses) + sum(len(rows) < steps for _, rows in moving)
        starts.append(start)
        by_step = np.ascontiguousarray(np.stack(of_steps, axis=1), np.float32)
        shown = np.ascontiguousarray(group[start : start + len(of_steps)], np.uint32)
        placements.append(InstanceArray(shown, tuple(by_step)))
    instances = Instances(
        group=group,
        pose=poses,
        trajectories=pack_trajectories([rows for _, rows in moving]) if moving else None,
        material=material if (material >= 0).any() else None,
        rows=np.ascontiguousarray(bounds[1:, :, 0], np.int32),
        arrays=np.array(starts, np.int32),
        base=tables,
        emissive=None,
    )
    return instances, numbers, placements


# ---- Limits of float32


MAX_COORDINATE = 1.844e18
"""Largest coordinate and radius (m) that Embree takes; it silently leaves out what lies beyond."""

_TINY, _HUGE = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)

MIN_EXTENT = float(np.sqrt(_TINY))
"""Smallest extent (m) whose square, as in an area, is a normal float32 number: 1.1e-19."""


def check_extent(geometry: Geometry) -> None:
    """Reject an object that is too far away, too large or too small to be hit by any ray.

    geometry : the object as the ray caster gets it.

    Raises
    ------
    ValueError : a sentence that says how far, or how small.
    """
    for vertices in geometry.vertices:
        rows = vertices
        if geometry.indices is not None and not _reach(rows) <= MAX_COORDINATE:
            # A file may hold vertices that no triangle has.
            rows = vertices[np.unique(geometry.indices)]
        reach = _reach(rows)
        if not reach <= MAX_COORDINATE:
            far = f"{reach:.3g} m" if np.isfinite(reach) else f"more than {_HUGE:.2g} m"
            raise ValueError(
                f"lies {far} from the origin, or is as large, and rays find nothing beyond {MAX_COORDINATE:.3g} m"
            )
        extent = float(np.ptp(rows[:, :3].astype(np.float64), axis=0).max(initial=0.0))
        if geometry.primitive is not Primitive.TRIANGLE:
            extent += 2.0 * float(rows[:, 3].max(initial=0.0))
        # Triangles that vanish only where they lie may be placed elsewhere: there are warnings for that.
        is_lost = geometry.primitive is Primitive.TRIANGLE and extent == 0.0
        if extent < MIN_EXTENT and not is_lost:
            raise ValueError(f"is {extent:.3g} m large, and rays find nothing smaller than {MIN_EXTENT:.2g} m")


def check_poses(matrices: NDArray[Any]) -> None:
    """Reject poses (n, 4, 4) of instances that Embree, which inverts them in float32, cannot invert.

    Raises
    ------
    ValueError : a sentence that says by how much one scales, or how far it goes.
    """
    reach = float(np.abs(matrices[:, :3]).max(initial=0.0))
    if not reach <= MAX_COORDINATE:
        raise ValueError(f"moves or scales by {reach:.3g}, and rays find nothing beyond {MAX_COORDINATE:.3g} m")
    volume = np.abs(np.linalg.det(matrices[:, :3, :3]))
    wrong = ~((volume >= _TINY) & (volume <= _HUGE))
    if wrong.any():
        scale = float(np.cbrt(volume[int(np.argmax(wrong))]))
        raise ValueError(
            f"scales by {scale:.3g}, and float32 only undoes factors from {np.cbrt(_TINY):.2g} to {np.cbrt(_HUGE):.2g}"
        )


def _reach(rows: NDArray[np.float32]) -> float:
    return float(np.abs(rows).max(initial=0.0))
