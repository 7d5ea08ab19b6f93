"""Lambertian: a matte surface.

In a scene:

    clay: {type: lambertian, albedo: [0.7, 0.4, 0.3]}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.materials.interface import (
    BLACK,
    DIRECTION,
    MaterialSpec,
    Scatter,
    emission,
    evaluate,
    reflectance,
    row,
    scatter,
)
from raytracer.sampling import sample_2d
from raytracer.sampling.warp import pdf_cosine_hemisphere, sample_cosine_hemisphere
from raytracer.textures.interface import Book, Colors, TexturedAlbedo, TexturedColors, color, is_zero
from raytracer.vec import Vec3, basis, dot, scale, to_world


class Lambertian(MaterialSpec):
    """A matte surface: the same radiance to all sides.

    References: Lambert 1760, "Photometria"; f = albedo / pi.
    """

    type: Literal["lambertian"] = "lambertian"
    albedo: TexturedAlbedo = Field(default=(0.5, 0.5, 0.5), description="fraction of light reflected, by channel")

    def is_lit(self) -> bool:
        return not is_zero(self.albedo)

    @staticmethod
    def pack(specs: Sequence["Lambertian"], book: Book) -> "LambertianTable":
        return LambertianTable(book.colors([spec.albedo for spec in specs]))


class LambertianTable(NamedTuple):
    """albedo, by row."""

    albedo: Colors | TexturedColors


class LambertianRow(NamedTuple):
    """One material."""

    albedo: Vec3


@row.register(LambertianTable)
def _(table, index, textures, site):
    return LambertianRow(color(table.albedo, index, textures, site))


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


@emission.register(LambertianTable)
def _(table, index, front, textures, site):
    return BLACK


@reflectance.register(LambertianRow)
def _(material):
    return material.albedo
