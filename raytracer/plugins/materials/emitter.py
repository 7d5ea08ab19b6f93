"""Emitter: a surface that gives light and reflects none.

In a scene:

    lamp: {type: emitter, radiance: [15, 15, 15]}
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.plugins.materials.base import interface
from raytracer.plugins.textures.base.interface import ColorParameter, ParameterPacker, TexturedRadiance, color, is_zero


class Emitter(interface.MaterialSpec):
    """A surface that radiates evenly to the side of its normal (outwards from a sphere or box), and absorbs."""

    type: Literal["emitter"] = "emitter"
    radiance: TexturedRadiance = Field(
        description="radiance (W/(m2 sr)) by channel, or plain numbers as in One Weekend"
    )
    two_sided: bool = Field(default=False, description="radiate to both sides")

    @staticmethod
    def pack(specs: Sequence["Emitter"], book: ParameterPacker) -> "EmitterTable":
        return EmitterTable(
            book.colors([spec.radiance for spec in specs]), np.array([spec.two_sided for spec in specs], np.bool_)
        )

    def is_emissive(self) -> bool:
        return not is_zero(self.radiance)

    def flipped(self) -> "Emitter":
        return self.model_copy(update={"two_sided": True})

    def emitted_power(self, book: ParameterPacker) -> float:
        return sum(book.mean(self.radiance)) * (2.0 if self.two_sided else 1.0)


class EmitterTable(NamedTuple):
    """Packed emitters: radiance by row, and two_sided (n,) bool."""

    radiance: ColorParameter
    two_sided: NDArray[np.bool_]


class EmitterRow(NamedTuple):
    """One material, which scatters nothing."""


@interface.row.register(EmitterTable)
def row_emitter_table(table, index, textures, site):
    return EmitterRow()


@interface.scatter.register(EmitterRow)
def scatter_emitter_row(material, direction, normal, front, draws):
    return interface.absorbed_scatter(direction)


@interface.emission.register(EmitterTable)
def emission_emitter_table(table, index, front, textures, site):
    if not (front or table.two_sided[index]):
        return interface.BLACK
    return color(table.radiance, index, textures, site)


@interface.reflectance.register(EmitterRow)
def reflectance_emitter_row(material):
    return interface.BLACK
