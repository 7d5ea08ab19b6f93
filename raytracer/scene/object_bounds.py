"""Where an object of a scene is at a time: what focusing and `rt explain` go by."""

from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.document import path_text
from raytracer.motion import Motion, matrix_at
from raytracer.primitives.interface import bounds
from raytracer.scene.objects import Assets, Keys
from raytracer.scene.recentring import translation
from raytracer.scene.spec import SceneSpec
from raytracer.shapes.interface import PlacingSpec, ShapeSpec
from raytracer.shutter import Shutter
from raytracer.spec import matrix_of

Point: TypeAlias = NDArray[np.float64]

_REST = np.eye(4)

_FAR = 2.0**10
"""Sizes away from its own origin at which a shape is measured near it."""


class Box(NamedTuple):
    """The least and the greatest coordinates (3,) of something (m)."""

    low: Point
    high: Point

    def center(self) -> Point:
        """Its middle (3,)."""
        return np.asarray(self.low + 0.5 * (self.high - self.low))

    def corners(self) -> NDArray[np.float64]:
        """Its corners (8, 3)."""
        return np.array(list(product(*zip(self.low, self.high, strict=True))))

    def shifted(self, by: Point) -> "Box":
        """The box displaced by a vector (3,); itself, with its bits, by none."""
        return Box(self.low + by, self.high + by) if by.any() else self

    def moved(self, matrices: NDArray[np.float64]) -> "Box":
        """The box round itself, as each of some matrices (n, 4, 4) moves it."""
        corners = np.einsum("nij,kj->nki", matrices[:, :3, :3], self.corners()) + matrices[:, None, :3, 3]
        return Box(corners.min(axis=(0, 1)), corners.max(axis=(0, 1)))


def _around(boxes: Iterable[Box]) -> Box:
    return reduce(lambda a, b: Box(np.minimum(a.low, b.low), np.maximum(a.high, b.high)), boxes)


class Whereabouts:
    """The places of a scene's objects by time.

    A place is the middle of the box, parallel to the axes, round what an object is before its `transform` and `motion`;
    these move it.  For what an `instance` or a `scatter` places, it is the box round the boxes of all copies.

    Raises
    ------
    SceneError : a file of an object cannot be read, or does not suit it.
    """

    def __init__(self, spec: SceneSpec, assets: Assets) -> None:
        self._spec, self._assets = spec, assets
        self._numbers = {item.name: number for number, item in enumerate(spec.objects) if item.name is not None}
        self._boxes: dict[tuple[Keys, float | None], Box] = {}

    def number(self, name: str) -> int:
        """The place in `objects` of the object with this name.

        Raises
        ------
        KeyError : there is none.
        """
        return self._numbers[name]

    def center(self, number: int, time: float) -> Point:
        """The middle (3,) of an object, by its place in `objects`, at a time of the scene (s), in world space (m)."""
        matrix, box = self._placed(number, time)
        return np.asarray(matrix[:3, :3] @ box.center() + matrix[:3, 3])

    def corners(self, number: int, time: float) -> NDArray[np.float64]:
        """The corners (8, 3) of its box, which turns with the object."""
        matrix, box = self._placed(number, time)
        return np.asarray(box.corners() @ matrix[:3, :3].T + matrix[:3, 3])

    def moves(self, number: int) -> bool:
        """Whether an object, or what it places, has a motion or frames."""
        return any(_changes(item) for item in self._with_contents(self._spec.objects[number]))

    def _with_contents(self, item: ShapeSpec) -> Iterator[ShapeSpec]:
        """An object, and all that it places."""
        yield item
        if isinstance(item, PlacingSpec):
            for _, below in self._named(item.of):
                yield from self._with_contents(below)

    def _placed(self, number: int, time: float) -> tuple[NDArray[np.float64], Box]:
        """The pose of an object at a time, and the box in it."""
        item = self._spec.objects[number]
        box = self._own(("objects", number), item, time)
        motion = _pose(item.motion, time)
        return (motion if isinstance(item, PlacingSpec) else motion @ matrix_of(item.transform)), box

    def _own(self, keys: Keys, item: ShapeSpec, time: float) -> Box:
        """The box of a shape before its transform; of what is placed, after it."""
        still = not any(_changes(part) for part in self._with_contents(item) if part is not item)
        known = keys, None if still and getattr(item, "frames", None) is None else time
        if known not in self._boxes:
            self._boxes[known] = self._measured(keys, item, time)
        return self._boxes[known]

    def _measured(self, keys: Keys, item: ShapeSpec, time: float) -> Box:
        assets: Mapping[str, Any] = self._assets.of(item, keys)
        try:
            if isinstance(item, PlacingSpec):
                inside = _around(self._outer(path, below, time) for path, below in self._named(item.of))
                return inside.moved(item.poses(assets))
            away = _far_away(item.box(assets))
            return Box(*bounds(item.pack_exposed(translation(-away), 0, assets, Shutter(time, time)))).shifted(away)
        except ValueError as error:
            raise self._spec.error(str(error), *keys) from None

    def _outer(self, keys: Keys, item: ShapeSpec, time: float) -> Box:
        """The box of an object in the space of what it is part of."""
        matrix = _pose(item.motion, time)
        if not isinstance(item, PlacingSpec):
            matrix = matrix @ matrix_of(item.transform)
        return self._own(keys, item, time).moved(matrix[None])

    def _named(self, name: str) -> list[tuple[Keys, ShapeSpec]]:
        """What a name that is placed stands for: a group's objects, or an object."""
        if name in self._spec.groups:
            return [(("groups", name, place), item) for place, item in enumerate(self._spec.groups[name])]
        number = self._numbers[name]
        return [(("objects", number), self._spec.objects[number])]


def _far_away(box: Point) -> Point:
    """The middle (3,) of a box (2, 3) that is so far away that float32 would not keep 13 bits of its size; else 0."""
    middle, half = box.mean(axis=0), 0.5 * (box[1] - box[0]).max()
    return np.asarray(middle if np.abs(middle).max() > _FAR * half else np.zeros(3))


def _pose(motion: Motion | None, time: float) -> NDArray[np.float64]:
    return _REST if motion is None else matrix_at(motion, time)


def _changes(item: ShapeSpec) -> bool:
    return item.motion is not None or getattr(item, "frames", None) is not None


def label(spec: SceneSpec, number: int) -> str:
    """What an object is called: its name, or its path in the scene."""
    return spec.objects[number].name or path_text(("objects", number))
