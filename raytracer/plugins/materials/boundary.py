"""Boundary: no surface at all, only where a medium begins and ends.

In a scene:

    edge of the fog: {type: boundary}

An object with a `medium` and without a material has it by itself.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.plugins.materials.base.interface import PASSTHROUGH, MaterialSpec, SelectorSpec, select
from raytracer.plugins.textures.base.interface import ParameterPacker


class Boundary(SelectorSpec):
    """Light goes straight through and counts no path segment; only the medium that it is in may change."""

    type: Literal["boundary"] = "boundary"

    clear: bool = Field(
        default=False,
        description="whether inside there is no medium but the object's own; else light stays in the one that it comes "
        "through where the object has none",
    )

    def has_interior(self) -> bool:
        return self.clear

    def with_children(self, children: Sequence[MaterialSpec]) -> MaterialSpec:
        return self

    @staticmethod
    def pack_selectors(
        specs: Sequence["Boundary"], book: ParameterPacker, children: Sequence[Sequence[int]]
    ) -> "BoundaryTable":
        return BoundaryTable(np.zeros(len(specs), np.int32))

    def has_passthrough(self) -> bool:
        return True

    def is_invisible(self) -> bool:
        return True


class BoundaryTable(NamedTuple):
    """Packed boundaries, which have no parameters: only the length of `nothing` (n,) int32 counts."""

    nothing: NDArray[np.int32]


@select.register(BoundaryTable)
def select_boundary_table(table, index, front, textures, site, u):
    return PASSTHROUGH, u
