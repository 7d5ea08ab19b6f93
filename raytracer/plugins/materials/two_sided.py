"""Two-sided: one material on the outside of a surface, another on the inside.

In a scene:

    book cover: {type: two_sided, front: {type: principled, base_color: [0.6, 0.1, 0.1]}, back: {type: lambertian}}
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.plugins.materials.base.interface import Child, MaterialSpec, SelectorSpec, select
from raytracer.plugins.textures.base.interface import ParameterPacker


class TwoSided(SelectorSpec):
    """One material for what arrives on the side of the normal, another for what arrives on the other side.

    An emitter as `back` radiates to the back.
    """

    type: Literal["two_sided"] = "two_sided"
    front: Child = Field(description="material of the side that the normal points to, by name or inline")
    back: Child = Field(description="material of the other side")

    def children(self) -> Mapping[tuple[str | int, ...], Any]:
        return {("front",): self.front, ("back",): self.back}

    def with_children(self, children: Sequence[MaterialSpec]) -> MaterialSpec:
        front, back = children[0], children[1].flipped()
        return front if front == back else self.model_copy(update={"front": front, "back": back})

    def flipped(self) -> MaterialSpec:
        return self.model_copy(update={"front": self.back, "back": self.front.flipped()})

    @staticmethod
    def pack_selectors(
        specs: Sequence["TwoSided"], book: ParameterPacker, children: Sequence[Sequence[int]]
    ) -> "TwoSidedTable":
        return TwoSidedTable(np.array(children, np.int32))

    def emitted_power(self, book: ParameterPacker) -> float:
        return float(self.front.emitted_power(book) + self.back.emitted_power(book))


class TwoSidedTable(NamedTuple):
    """Packed selectors: children (n, 2) int32, references of the materials of the front and of the back."""

    children: NDArray[np.int32]


@select.register(TwoSidedTable)
def select_two_sided_table(table, index, front, textures, site, u):
    return table.children[index, 0 if front else 1], u
