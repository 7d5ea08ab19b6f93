"""Dielectric: clear glass, water, air bubbles.

In a scene:

    glass: {type: dielectric, ior: 1.5}
    water in glass: {type: dielectric, ior: 1.33, outside_ior: 1.5}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.materials.interface import (
    BLACK,
    LOBE,
    WHITE,
    MaterialSpec,
    Scatter,
    emission,
    evaluate,
    reflectance,
    row,
    scatter,
)
from raytracer.optics import fresnel_dielectric, refract
from raytracer.sampling import sample_1d
from raytracer.spec import PositiveNumber
from raytracer.textures.interface import Book
from raytracer.vec import dot, reflect


class Dielectric(MaterialSpec):
    """A smooth, clear boundary with exact Fresnel reflection.

    Radiance is carried as basic radiance L / n^2, which refraction leaves unchanged; so what is lit and seen through
    glass is exact, and an emitter inside glass is given by the radiance it would show in air.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 9.5; basic radiance: Nicodemus 1963.
    """

    type: Literal["dielectric"] = "dielectric"
    ior: PositiveNumber = Field(default=1.5, description="index of refraction on the inside")
    outside_ior: PositiveNumber = Field(
        default=1.0, description="index on the outside: of the glass that this one is embedded in"
    )

    @staticmethod
    def pack(specs: Sequence["Dielectric"], book: Book) -> "DielectricTable":
        return DielectricTable(np.array([spec.ior / spec.outside_ior for spec in specs], np.float64))


class DielectricTable(NamedTuple):
    """eta (n,) float64: index inside over index outside."""

    eta: NDArray[np.float64]


class DielectricRow(NamedTuple):
    """One material."""

    eta: float


@row.register(DielectricTable)
def _(table, index, textures, site):
    return DielectricRow(table.eta[index])


@scatter.register(DielectricRow)
def _(material, direction, normal, front, draws):
    eta = material.eta if front else 1.0 / material.eta
    cos_i = min(1.0, abs(dot(direction, normal)))
    reflectance, cos_t = fresnel_dielectric(cos_i, eta)
    if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LOBE) < reflectance:
        return Scatter(reflect(direction, normal), WHITE, math.inf)
    return Scatter(refract(direction, normal, cos_i, cos_t, eta), WHITE, math.inf)


@evaluate.register(DielectricRow)
def _(material, direction, normal, front, outgoing):
    return BLACK, 0.0


@emission.register(DielectricTable)
def _(table, index, front, textures, site):
    return BLACK


@reflectance.register(DielectricRow)
def _(material):
    return WHITE
