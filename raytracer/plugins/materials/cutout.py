"""Cut-out: a material with holes, such as a leaf on a card, lace, or a fence.

In a scene:

    gauze: {type: cutout, material: {type: lambertian, albedo: 0.9}, opacity: 0.3}
    fence: {type: cutout, material: gauze, opacity: {type: checker, scale: 0.05, even: 0, odd: 1}}
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.plugins.materials.base import interface
from raytracer.plugins.textures.base.interface import NumberParameter, ParameterPacker, TexturedFraction, number
from raytracer.schema.fields import Fraction


class Cutout(interface.SelectorSpec):
    """A material where the surface is, and nothing where it is not.

    Between 0 and 1 the opacity is the share of light that meets the material; the rest goes straight on, as do the
    rays that look for shadows. What goes on counts no path segment of `max_depth`, for up to 1024 surfaces a path.
    """

    type: Literal["cutout"] = "cutout"
    material: interface.Child = Field(description="the material, by name or inline")
    opacity: TexturedFraction = Field(
        default=0.5, description="how much of the surface is there, from 0 to 1; of an image's alpha with `channel: a`"
    )
    threshold: Fraction | None = Field(
        default=None, description="opacity from which on the surface is all there, and below which it is not at all"
    )

    def children(self) -> Mapping[tuple[str | int, ...], Any]:
        return {("material",): self.material}

    def with_children(self, children: Sequence[interface.MaterialSpec]) -> interface.MaterialSpec:
        (material,) = children
        enough = 1.0 if self.threshold is None else self.threshold
        if isinstance(self.opacity, float) and self.opacity >= enough:
            return material
        return self.model_copy(update={"material": material})

    def with_mean_textures(self, means: Mapping[str, Any]) -> interface.MaterialSpec:
        # What a threshold makes of a mean is all or nothing; the mean itself leaves as much of the surface as there is.
        plain = {**means, "threshold": None} if "opacity" in means else means
        return super().with_mean_textures(plain)

    @staticmethod
    def pack_selectors(
        specs: Sequence["Cutout"], book: ParameterPacker, children: Sequence[Sequence[int]]
    ) -> "CutoutTable":
        return CutoutTable(
            np.array(children, np.int32)[:, 0].copy(),
            book.numbers([spec.opacity for spec in specs]),
            np.array([math.nan if spec.threshold is None else spec.threshold for spec in specs], np.float64),
        )

    def emitted_power(self, book: ParameterPacker) -> float:
        return sum(book.mean(self.opacity)) / 3.0 * float(self.material.emitted_power(book))

    def has_passthrough(self) -> bool:
        return True

    def is_invisible(self) -> bool:
        enough = 0.0 if self.threshold is None else self.threshold
        is_hole = isinstance(self.opacity, float) and (self.opacity == 0.0 or self.opacity < enough)
        return is_hole or super().is_invisible()


class CutoutTable(NamedTuple):
    """Packed cutouts, one row each.

    material (n,) int32 : the material's reference.
    opacity : a parameter.
    threshold (n,) float64 : NaN for none.
    """

    material: NDArray[np.int32]
    opacity: NumberParameter
    threshold: NDArray[np.float64]


@interface.select.register(CutoutTable)
def select_cutout_table(table, index, front, textures, site, u):
    opacity, threshold = number(table.opacity, index, textures, site), table.threshold[index]
    if opacity >= threshold:
        opacity = 1.0
    elif opacity < threshold:
        opacity = 0.0
    there, u = interface.split_random_number(u, opacity)
    return table.material[index] if there else interface.PASSTHROUGH, u
