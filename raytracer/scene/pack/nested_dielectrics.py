"""Nested dielectrics: materials with priorities, and the boundaries between them where objects overlap."""

import math
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import numpy as np

from raytracer.core.vec import Vec3
from raytracer.kernel.nested_dielectrics import NestedDielectrics, SubmergedCamera
from raytracer.optics.glass import AIR
from raytracer.plugins.cameras.base.interface import CameraParts, camera_parts
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.plugins.cameras.base.placement import PlacedSpec
from raytracer.plugins.materials.base.interface import PASSTHROUGH, InteriorMedium, MaterialSpec, SelectorSpec
from raytracer.plugins.shapes.base.interface import PlacementSpec
from raytracer.scene.object_bounds import ObjectBounds
from raytracer.scene.pack.layout import Item
from raytracer.scene.pack.materials import collect_components
from raytracer.scene.spec import SceneSpec

MAX_SOLIDS = 256
"""Materials of a scene that may have a priority: all boundaries between so many pack in 5 s.

The number of boundaries grows with its square, and the state that a ray keeps of where it is with the number itself.
"""

_UP: Vec3 = (3.0 / 13.0, 12.0 / 13.0, 4.0 / 13.0)
"""Direction in which a camera looks for what it stands in: steeply up, to leave water by its surface; along no axis."""


class _Solid(NamedTuple):
    """Resolved material that fills objects.

    material : that has a priority.
    space : the media around it.
    interior_medium : priority, index and absorption of its inside.
    place : its number among the materials in use.
    """

    material: MaterialSpec
    space: Hashable
    interior_medium: InteriorMedium
    place: int


class PrioritySolids:
    """Materials in use that have priorities, from the lowest rank to the highest.

    Of equal priorities that has the higher rank which comes first in the scene.

    used, spaces, owners : the materials in use, the media around each, and the number in `items` of its first user.

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
        solids: dict[tuple[MaterialSpec, Hashable], _Solid] = {}
        for place, (material, space) in enumerate(zip(used, spaces, strict=True)):
            with spec.errors_at(*_keys(items[owners[place]])):
                filling = material.interior_medium()
            if filling is not None:
                solids.setdefault((material, space), _Solid(material, space, filling, place))
        self._ranked = sorted(solids.values(), key=lambda solid: (solid.interior_medium.priority, -solid.place))
        if len(self._ranked) > MAX_SOLIDS:
            last = items[owners[max(solid.place for solid in self._ranked)]]
            many = f"is one of {len(self._ranked):,} materials with a priority, and there may be {MAX_SOLIDS:,}"
            raise spec.error(f"{many}: take the priority from those that overlap nothing", *_keys(last))
        self._spec, self._items = spec, items
        self._owners = {
            owner for owner, key in zip(owners, zip(used, spaces, strict=True), strict=True) if key in solids
        }

        # Each surface as a boundary to air, and to every solid of a lower rank.
        self._boundaries: list[tuple[MaterialSpec, list[MaterialSpec | None], Hashable]] = []
        for rank, solid in enumerate(self._ranked):
            outsides = [AIR, *(other.interior_medium.ior for other in self._ranked[:rank])]
            for part in collect_components([solid.material]):
                if not isinstance(part, SelectorSpec):
                    against = {ior: part.as_boundary_to(ior) for ior in dict.fromkeys(outsides)}
                    self._boundaries.append((part, [against[ior] for ior in outsides], solid.space))

    def materials(self) -> tuple[list[MaterialSpec], list[Hashable]]:
        """List the boundaries to be packed besides the materials in use, and the media around each."""
        rows = [(part, space) for part, _, space in self._boundaries]
        for _, against, space in self._boundaries:
            rows += [(material, space) for material in dict.fromkeys(against) if material is not None]
        return [material for material, _ in rows], [space for _, space in rows]

    def pack(
        self,
        references: Sequence[int],
        boundaries: Sequence[int],
        where: ObjectBounds,
        seen_by: PlacedSpec,
        camera: Any,
    ) -> NestedDielectrics | None:
        """Pack the solids; None where no material in use has a priority.

        references, boundaries : of the materials in use, and of `materials()`.
        where : the bounds of the scene's objects.
        seen_by, camera : the camera's spec, and the packed camera.
        """
        if not self._ranked:
            return None
        rank = np.full(max(references) + 1, -1, np.int32)
        for number, solid in enumerate(self._ranked):
            rank[references[solid.place]] = number
        # Objects' materials come first, then those of surfaces where objects overlap.
        own, left = boundaries[: len(self._boundaries)], iter(boundaries[len(self._boundaries) :])
        against = np.full((max((*references, *own)) + 1, len(self._ranked) + 1), PASSTHROUGH, np.int32)
        for reference, (_, variants, _) in zip(own, self._boundaries, strict=True):
            met = {variant: next(left) for variant in dict.fromkeys(variants) if variant is not None}
            against[reference, : len(variants)] = [
                PASSTHROUGH if variant is None else met[variant] for variant in variants
            ]
        absorption = np.array([solid.interior_medium.absorption for solid in self._ranked], np.float64)
        return NestedDielectrics(
            rank,
            against,
            absorption if absorption.any() else None,
            np.array([references[solid.place] for solid in self._ranked], np.int32),
            SubmergedCamera(_UP) if self._may_hold(where, seen_by, camera) else None,
        )

    def _may_hold(self, where: ObjectBounds, seen_by: PlacedSpec, camera: Any) -> bool:
        """Tell if a ray of the camera may begin in something that has a priority."""
        parts: CameraParts = camera_parts(camera)
        if parts.moves or parts.ray_radius == math.inf:
            return True
        placing = {number for number, item in enumerate(self._spec.objects) if isinstance(item, PlacementSpec)}
        holding = {self._items[owner].number for owner in self._owners} | placing
        if any(number >= 0 and where.moves(number) for number in holding):
            return True
        time = seen_by.shutter_interval().open
        camera_then = camera_at_time(seen_by, time)
        eye = np.array(camera_then.look_from)
        # The farthest view of a camera with many.
        layout = camera_then.layout(self._spec.film.width, self._spec.film.height)
        spread = 0.0 if layout is None else layout.views.farthest(eye)
        reach = parts.ray_radius + spread
        for number in holding - {-1}:
            corners = where.corners(number, time)
            low, high = corners.min(axis=0), corners.max(axis=0)
            # Below what is flat there may be water without a bottom.
            if np.any(low == high) or np.all((low - reach <= eye) & (eye <= high + reach)):
                return True
        return False


def _keys(item: Item) -> tuple[str | int, ...]:
    """Return the path to an object's material in the scene file."""
    given = item.spec.material
    return ("materials", given) if isinstance(given, str) else (*item.keys, "material")
