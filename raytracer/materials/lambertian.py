"""Lambertian: a matte surface.

In a scene:

    clay: {type: lambertian, albedo: [0.7, 0.4, 0.3]}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.geometry import row3
from raytracer.materials.interface import BLACK, DIRECTION, MaterialSpec, Scatter, emission, evaluate, row, scatter
from raytracer.sampling import sample_2d
from raytracer.sampling.warp import pdf_cosine_hemisphere, sample_cosine_hemisphere
from raytracer.spec import Albedo
from raytracer.vec import Vec3, basis, dot, scale, to_world


class Lambertian(MaterialSpec):
    """A matte surface: the same radiance to all sides.

    References: Lambert 1760, "Photometria"; f = albedo / pi.
    """

    type: Literal["lambertian"] = "lambertian"
    albedo: Albedo = Field(default=(0.5, 0.5, 0.5), description="fraction of light reflected, by channel")

    def is_lit(self) -> bool:
        return any(self.albedo)

    @staticmethod
    def pack(specs: Sequence["Lambertian"]) -> "LambertianTable":
        return LambertianTable(np.array([spec.albedo for spec in specs], np.float64))


class LambertianTable(NamedTuple):
    """albedo (n, 3) float64."""

    albedo: NDArray[np.float64]


class LambertianRow(NamedTuple):
    """One material."""

    albedo: Vec3


@row.register(LambertianTable)
def _(table, index):
    return LambertianRow(row3(table.albedo, index))


@scatter.register(LambertianRow)
def _(material, direction, normal, front, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + DIRECTION)
    local = sample_cosine_hemisphere(u1, u2)
    s, t = basis(normal)
    return Scatter(to_world(local, s, t, normal), material.albedo, pdf_cosine_hemisphere(local[2]))


@evaluate.register(LambertianRow)
def _(material, direction, normal, front, outgoing):
    cosine = max(0.0, dot(outgoing, normal))
    return scale(cosine / math.pi, material.albedo), pdf_cosine_hemisphere(cosine)


@emission.register(LambertianRow)
def _(material, front):
    return BLACK
