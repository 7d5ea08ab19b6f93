"""Lambertian: a matte surface.

In a scene:

    clay: {type: lambertian, albedo: [0.7, 0.4, 0.3]}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.warp import pdf_cosine_hemisphere, sample_cosine_hemisphere
from raytracer.core.vec import Vec3, basis, dot, scale, to_world
from raytracer.plugins.materials.base import interface
from raytracer.plugins.textures.base.interface import ColorParameter, ParameterPacker, TexturedAlbedo, color, is_zero


class Lambertian(interface.MaterialSpec):
    """A matte surface: the same radiance to all sides.

    References: Lambert 1760, "Photometria"; f = albedo / pi.
    """

    type: Literal["lambertian"] = "lambertian"
    albedo: TexturedAlbedo = Field(default=(0.5, 0.5, 0.5), description="fraction of light reflected, by channel")

    def has_non_delta_bsdf(self) -> bool:
        return not is_zero(self.albedo)

    @staticmethod
    def pack(specs: Sequence["Lambertian"], book: ParameterPacker) -> "LambertianTable":
        return LambertianTable(book.colors([spec.albedo for spec in specs]))


class LambertianTable(NamedTuple):
    """Packed materials: albedo by row."""

    albedo: ColorParameter


class LambertianRow(NamedTuple):
    """One material."""

    albedo: Vec3


@interface.row.register(LambertianTable)
def row_lambertian_table(table, index, textures, site):
    return LambertianRow(color(table.albedo, index, textures, site))


@interface.scatter.register(LambertianRow)
def scatter_lambertian_row(material, direction, normal, front, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.DIRECTION)
    local = sample_cosine_hemisphere(u1, u2)
    s, t = basis(normal)
    return interface.Scatter(to_world(local, s, t, normal), material.albedo, pdf_cosine_hemisphere(local[2]))


@interface.evaluate.register(LambertianRow)
def evaluate_lambertian_row(material, direction, normal, front, outgoing):
    cosine = max(0.0, dot(outgoing, normal))
    return scale(cosine / math.pi, material.albedo), pdf_cosine_hemisphere(cosine)


@interface.reflectance.register(LambertianRow)
def reflectance_lambertian_row(material):
    return material.albedo
