"""What objects are filled with that have priorities, and what their surfaces are to each other where they overlap."""

import math
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import numpy as np

from raytracer.cameras.moving import MovingCamera, camera_at
from raytracer.cameras.placement import PlacedSpec
from raytracer.glass import AIR
from raytracer.interior import Interior, Submerged
from raytracer.materials.interface import PASS, Filling, MaterialSpec, SelectorSpec
from raytracer.scene.materials import parts
from raytracer.scene.objects import Item
from raytracer.scene.spec import SceneSpec
from raytracer.scene.whereabouts import Whereabouts
from raytracer.shapes.interface import PlacingSpec
from raytracer.vec import Vec3

MOST_SOLIDS = 256
"""Materials of a scene that may have a priority: of so many indices, all boundaries between them pack in 5 s.

Their number grows by its square, and what a ray takes to know where it is by itself.
"""

_UP: Vec3 = (3.0 / 13.0, 12.0 / 13.0, 4.0 / 13.0)
"""Where a camera looks for what it stands in: steeply up, so that it leaves water by its surface, but along no axis."""


class _Solid(NamedTuple):
    """A resolved material that fills what has it, with the media around it, and its place among the materials used."""

    material: MaterialSpec
    space: Hashable
    filling: Filling
    place: int


class Solids:
    """The materials in use that have priorities, from the lowest rank to the highest.

    Of equal priorities the rank is higher of what comes first in the scene.

    Parameters
    ----------
    used, spaces, owners : the materials in use, the media around each, and the number in `items` of what has it first.

    Raises
    ------
    SceneError : there are too many of them, or a material would fill an object with different things.
    """

    def __init__(
        self,
        spec: SceneSpec,
        used: Sequence[MaterialSpec],
        spaces: Sequence[Hashable],
        owners: Sequence[int],
        items: Sequence[Item],
    ) -> None:
        found: dict[tuple[MaterialSpec, Hashable], _Solid] = {}
        for place, (material, space) in enumerate(zip(used, spaces, strict=True)):
            try:
                filling = material.filling()
            except ValueError as error:
                raise spec.error(str(error), *_keys(items[owners[place]])) from None
            if filling is not None:
                found.setdefault((material, space), _Solid(material, space, filling, place))
        self._ranked = sorted(found.values(), key=lambda solid: (solid.filling.priority, -solid.place))
        if len(self._ranked) > MOST_SOLIDS:
            last = items[owners[max(solid.place for solid in self._ranked)]]
            raise spec.error(
                f"is one of {len(self._ranked):,} materials with a priority, and there may be {MOST_SOLIDS:,}: "
                "take the priority from those that overlap nothing",
                *_keys(last),
            )
        self._spec, self._items = spec, items
        self._owners = {
            owner for owner, key in zip(owners, zip(used, spaces, strict=True), strict=True) if key in found
        }

        # What each surface is as a boundary to nothing, and to what has a lower rank.
        self._boundaries: list[tuple[MaterialSpec, list[MaterialSpec | None], Hashable]] = []
        for rank, solid in enumerate(self._ranked):
            outsides = [AIR, *(other.filling.ior for other in self._ranked[:rank])]
            for part in parts([solid.material]):
                if not isinstance(part, SelectorSpec):
                    against = {ior: part.against(ior) for ior in dict.fromkeys(outsides)}
                    self._boundaries.append((part, [against[ior] for ior in outsides], solid.space))

    def materials(self) -> tuple[list[MaterialSpec], list[Hashable]]:
        """What is to be packed besides the materials in use: boundaries, and the media around each."""
        rows = [(part, space) for part, _, space in self._boundaries]
        for _, against, space in self._boundaries:
            rows += [(material, space) for material in dict.fromkeys(against) if material is not None]
        return [material for material, _ in rows], [space for _, space in rows]

    def pack(
        self, references: Sequence[int], boundaries: Sequence[int], where: Whereabouts, seen_by: PlacedSpec, camera: Any
    ) -> Interior | None:
        """The packed solids; None where no material in use has a priority.

        Parameters
        ----------
        references, boundaries : of the materials in use, and of `materials()`.
        where : the places of the scene's objects.
        seen_by, camera : the camera, and as it is packed.
        """
        if not self._ranked:
            return None
        rank = np.full(max(references) + 1, -1, np.int32)
        for number, solid in enumerate(self._ranked):
            rank[references[solid.place]] = number
        # Surfaces have the materials of objects, which come before those that are only met where objects overlap.
        own, left = boundaries[: len(self._boundaries)], iter(boundaries[len(self._boundaries) :])
        against = np.full((max((*references, *own)) + 1, len(self._ranked) + 1), PASS, np.int32)
        for reference, (_, variants, _) in zip(own, self._boundaries, strict=True):
            met = {variant: next(left) for variant in dict.fromkeys(variants) if variant is not None}
            against[reference, : len(variants)] = [PASS if variant is None else met[variant] for variant in variants]
        absorption = np.array([solid.filling.absorption for solid in self._ranked], np.float64)
        return Interior(
            rank,
            against,
            absorption if absorption.any() else None,
            np.array([references[solid.place] for solid in self._ranked], np.int32),
            Submerged(_UP) if self._may_hold(where, seen_by, camera) else None,
        )

    def _may_hold(self, where: Whereabouts, seen_by: PlacedSpec, camera: Any) -> bool:
        """Whether a ray of the camera may begin in something that has a priority."""
        if isinstance(camera, MovingCamera) or not hasattr(camera, "lens"):
            return True
        placing = {number for number, item in enumerate(self._spec.objects) if isinstance(item, PlacingSpec)}
        holding = {self._items[owner].number for owner in self._owners} | placing
        if any(number >= 0 and where.moves(number) for number in holding):
            return True
        time = seen_by.opening().open
        eye = np.array(camera_at(seen_by, time).look_from)
        reach = 0.0 if camera.lens is None else camera.lens.radius
        if camera.lens is not None and camera.lens.shape is not None:
            # Blades and masks reach farther than the round opening of the same area.
            reach = math.inf
        reach += self._spread(seen_by)
        for number in holding - {-1}:
            corners = where.corners(number, time)
            low, high = corners.min(axis=0), corners.max(axis=0)
            # Below what is flat there may be water without a bottom.
            if np.any(low == high) or np.all((low - reach <= eye) & (eye <= high + reach)):
                return True
        return False

    def _spread(self, seen_by: PlacedSpec) -> float:
        """How far the views of a camera are from where it stands (m)."""
        film = self._spec.film
        layout = seen_by.layout(film.width, film.height)
        return 0.0 if layout is None else float(np.linalg.norm(layout.views.position, axis=-1).max())


def _keys(item: Item) -> tuple[str | int, ...]:
    """The path to where an object's material is written."""
    given = item.spec.material
    return ("materials", given) if isinstance(given, str) else (*item.keys, "material")
