"""Mixture: two materials in one surface, at each hit the one or the other by chance.

In a scene:

    rusty steel:
      type: mixture
      materials: [{type: metal, albedo: 0.6}, {type: lambertian, albedo: [0.4, 0.2, 0.1]}]
      weight: {type: noise, scale: 0.2}
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.plugins.materials.base.interface import Child, MaterialSpec, SelectorSpec, select, split_random_number
from raytracer.plugins.textures.base.interface import NumberParameter, ParameterPacker, TexturedFraction, number


class Mixture(SelectorSpec):
    """One of two materials at each hit: on average the mean of both, weighted.

    As with dust on paint or rust on steel, a texture as weight says where there is how much of which.
    """

    type: Literal["mixture"] = "mixture"
    materials: tuple[Child, Child] = Field(description="the two materials, by name or inline")
    weight: TexturedFraction = Field(default=0.5, description="share of the second material, from 0 to 1")

    def children(self) -> Mapping[tuple[str | int, ...], Any]:
        return {("materials", number): child for number, child in enumerate(self.materials)}

    def with_children(self, children: Sequence[MaterialSpec]) -> MaterialSpec:
        first, second = children
        if self.weight == 0.0 or first == second:
            return first
        if self.weight == 1.0:
            return second
        return self.model_copy(update={"materials": (first, second)})

    def nearest_child(self, book: ParameterPacker) -> MaterialSpec:
        first, second = self.materials
        chosen = second if sum(book.mean(self.weight, data=True)) > 1.5 else first
        assert isinstance(chosen, MaterialSpec)
        return chosen

    @staticmethod
    def pack_selectors(
        specs: Sequence["Mixture"], book: ParameterPacker, children: Sequence[Sequence[int]]
    ) -> "MixtureTable":
        return MixtureTable(np.array(children, np.int32), book.numbers([spec.weight for spec in specs]))

    def emitted_power(self, book: ParameterPacker) -> float:
        first, second = (child.emitted_power(book) for child in self.materials)
        weight = sum(book.mean(self.weight)) / 3.0
        return float((1.0 - weight) * first + weight * second)


class MixtureTable(NamedTuple):
    """Packed mixtures: children (n, 2) int32, references of the two; weight, a parameter, the share of the second."""

    children: NDArray[np.int32]
    weight: NumberParameter


@select.register(MixtureTable)
def select_mixture_table(table, index, front, textures, site, u):
    second, u = split_random_number(u, number(table.weight, index, textures, site))
    return table.children[index, 1 if second else 0], u
