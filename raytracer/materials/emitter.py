"""Emitter: a surface that gives light and reflects none.

In a scene:

    lamp: {type: emitter, radiance: [15, 15, 15]}
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.geometry import row3
from raytracer.materials.interface import BLACK, MaterialSpec, absorbed, emission, evaluate, row, scatter
from raytracer.spec import Radiance
from raytracer.vec import Vec3


class Emitter(MaterialSpec):
    """A surface that radiates evenly to the side of its normal (outwards from a sphere or box), and absorbs."""

    type: Literal["emitter"] = "emitter"
    radiance: Radiance = Field(description="radiance (W/(m2 sr)) by channel, or plain numbers as in One Weekend")
    two_sided: bool = Field(default=False, description="radiate to both sides")

    @staticmethod
    def pack(specs: Sequence["Emitter"]) -> "EmitterTable":
        return EmitterTable(
            np.array([spec.radiance for spec in specs], np.float64),
            np.array([spec.two_sided for spec in specs], np.bool_),
        )

    def exitance(self) -> float:
        return sum(self.radiance) * (2.0 if self.two_sided else 1.0)


class EmitterTable(NamedTuple):
    """radiance (n, 3) float64, two_sided (n,) bool."""

    radiance: NDArray[np.float64]
    two_sided: NDArray[np.bool_]


class EmitterRow(NamedTuple):
    """One material."""

    radiance: Vec3
    two_sided: bool


@row.register(EmitterTable)
def _(table, index):
    return EmitterRow(row3(table.radiance, index), table.two_sided[index])


@scatter.register(EmitterRow)
def _(material, direction, normal, front, draws):
    return absorbed(direction)


@evaluate.register(EmitterRow)
def _(material, direction, normal, front, outgoing):
    return BLACK, 0.0


@emission.register(EmitterRow)
def _(material, front):
    return material.radiance if front or material.two_sided else BLACK
