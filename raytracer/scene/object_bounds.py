"""Bounds of a scene's objects at a time, for focusing and `rt explain`."""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.core.motion.resolve import matrix_at
from raytracer.core.motion.spec import Motion
from raytracer.core.primitives.base.interface import bounds
from raytracer.core.shutter.table import Shutter
from raytracer.plugins.shapes.base.interface import PlacementSpec, ShapeSpec
from raytracer.scene.scene_assets import SceneAssets
from raytracer.scene.spec import SceneSpec
from raytracer.schema.transform import matrix_of, translation_matrix
from raytracer.schema.yaml_nodes import KeyPath, path_text

Point: TypeAlias = NDArray[np.float64]

_REST = np.eye(4)

_FAR = 2.0**10
"""Distance from its own origin, in its sizes, beyond which a shape is moved there to be measured."""


class Box(NamedTuple):
    """An axis-parallel box: the least and the greatest coordinates (3,) (m)."""

    low: Point
    high: Point

    def center(self) -> Point:
        """Compute its centre (3,)."""
        return np.asarray(self.low + 0.5 * (self.high - self.low))

    def corners(self) -> NDArray[np.float64]:
        """Compute its corners (8, 3)."""
        return np.array(list(product(*zip(self.low, self.high, strict=True))))

    def shifted(self, by: Point) -> "Box":
        """Displace the box by a vector (3,); by zero it is itself, to the bit."""
        return Box(self.low + by, self.high + by) if by.any() else self

    def moved(self, matrices: NDArray[np.float64]) -> "Box":
        """Bound the box as transformed by each of the matrices (n, 4, 4)."""
        corners = np.einsum("nij,kj->nki", matrices[:, :3, :3], self.corners()) + matrices[:, None, :3, 3]
        return Box(corners.min(axis=(0, 1)), corners.max(axis=(0, 1)))


class ObjectBounds:
    """Bounds of a scene's objects by time.

    An object's centre is that of the axis-parallel box round what it is before its `transform` and `motion`;
    these move it.  The box of an `instance` or a `scatter` is that round the boxes of all copies.

    Raises
    ------
    SceneError : a file of an object cannot be read, or does not suit it.
    """

    def __init__(self, spec: SceneSpec, assets: SceneAssets) -> None:
        self._spec, self._assets = spec, assets
        self._numbers = {item.name: number for number, item in enumerate(spec.objects) if item.name is not None}
        self._boxes: dict[tuple[KeyPath, float | None], Box] = {}

    def number(self, name: str) -> int:
        """Find the index in `objects` of the object with this name.

        Raises
        ------
        KeyError : there is none.
        """
        return self._numbers[name]

    def center(self, number: int, time: float) -> Point:
        """Compute the centre (3,) of an object, by its index in `objects`, at a scene time (s), in the world (m)."""
        matrix, box = self._placed(number, time)
        return np.asarray(matrix[:3, :3] @ box.center() + matrix[:3, 3])

    def corners(self, number: int, time: float) -> NDArray[np.float64]:
        """Compute the corners (8, 3) of its box, which turns with the object."""
        matrix, box = self._placed(number, time)
        return np.asarray(box.corners() @ matrix[:3, :3].T + matrix[:3, 3])

    def moves(self, number: int) -> bool:
        """Return True if an object, or what it places, has a motion or frames."""
        return any(_changes(item) for item in self._with_contents(self._spec.objects[number]))

    def _with_contents(self, item: ShapeSpec) -> Iterator[ShapeSpec]:
        """Walk through an object and all that it places."""
        yield item
        if isinstance(item, PlacementSpec):
            for _, below in self._named(item.of):
                yield from self._with_contents(below)

    def _placed(self, number: int, time: float) -> tuple[NDArray[np.float64], Box]:
        """Compute the pose of an object at a time, and the box in its own space."""
        item = self._spec.objects[number]
        box = self._own(("objects", number), item, time)
        motion = _pose(item.motion, time)
        return (motion if isinstance(item, PlacementSpec) else motion @ matrix_of(item.transform)), box

    def _own(self, keys: KeyPath, item: ShapeSpec, time: float) -> Box:
        """Bound a shape before its transform, or what a placement places after it; each is measured once."""
        still = not any(_changes(part) for part in self._with_contents(item) if part is not item)
        known = keys, None if still and getattr(item, "frames", None) is None else time
        if known not in self._boxes:
            self._boxes[known] = self._measured(keys, item, time)
        return self._boxes[known]

    def _measured(self, keys: KeyPath, item: ShapeSpec, time: float) -> Box:
        assets: Mapping[str, Any] = self._assets.of(item, keys)
        with self._spec.errors_at(*keys):
            if isinstance(item, PlacementSpec):
                boxes = [self._outer(path, below, time) for path, below in self._named(item.of)]
                lows, highs = zip(*boxes, strict=True)
                return Box(np.min(lows, axis=0), np.max(highs, axis=0)).moved(item.poses(assets))
            away = _far_away(item.bounds(assets))
            packed = item.pack_moving(translation_matrix(-away), 0, assets, Shutter(time, time))
            return Box(*bounds(packed)).shifted(away)

    def _outer(self, keys: KeyPath, item: ShapeSpec, time: float) -> Box:
        """Bound an object in the space of what it is part of."""
        matrix = _pose(item.motion, time)
        if not isinstance(item, PlacementSpec):
            matrix = matrix @ matrix_of(item.transform)
        return self._own(keys, item, time).moved(matrix[None])

    def _named(self, name: str) -> list[tuple[KeyPath, ShapeSpec]]:
        """List the objects that a placed name stands for: a group's objects, or one object."""
        if name in self._spec.groups:
            return [(("groups", name, place), item) for place, item in enumerate(self._spec.groups[name])]
        number = self._numbers[name]
        return [(("objects", number), self._spec.objects[number])]


def _far_away(box: Point) -> Point:
    """Compute the centre (3,) of a box (2, 3) too far away for float32 to keep 13 bits of its size; else 0."""
    middle, half = box.mean(axis=0), 0.5 * (box[1] - box[0]).max()
    return np.asarray(middle if np.abs(middle).max() > _FAR * half else np.zeros(3))


def _pose(motion: Motion | None, time: float) -> NDArray[np.float64]:
    return _REST if motion is None else matrix_at(motion, time)


def _changes(item: ShapeSpec) -> bool:
    return item.motion is not None or getattr(item, "frames", None) is not None


def object_name(spec: SceneSpec, number: int) -> str:
    """Return the name of an object, or its path in the scene."""
    return spec.objects[number].name or path_text(("objects", number))
