"""Metal, as in One Weekend: a mirror whose reflection is moved by a random vector.

In a scene:

    brass: {type: metal, albedo: [0.8, 0.6, 0.2], fuzz: 0.1}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.warp import sample_sphere
from raytracer.core.vec import Vec3, dot, madd, normalize, reflect, scale, sub
from raytracer.plugins.materials.base import interface
from raytracer.plugins.textures.base.interface import (
    ColorParameter,
    NumberParameter,
    ParameterPacker,
    TexturedAlbedo,
    TexturedFraction,
    color,
    is_zero,
    number,
)


class Metal(interface.MaterialSpec):
    """The mirrored unit direction plus `fuzz` times a random unit vector; what would go below the surface is lost.

    References: Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 10.5.
    """

    type: Literal["metal"] = "metal"
    albedo: TexturedAlbedo = Field(default=(0.9, 0.9, 0.9), description="fraction of light reflected, by channel")
    fuzz: TexturedFraction = Field(default=0.0, description="radius of the random vector that is added; 0 is a mirror")

    def has_non_delta_bsdf(self) -> bool:
        return not is_zero(self.fuzz) and not is_zero(self.albedo)

    @staticmethod
    def pack(specs: Sequence["Metal"], book: ParameterPacker) -> "MetalTable":
        return MetalTable(book.colors([spec.albedo for spec in specs]), book.numbers([spec.fuzz for spec in specs]))


class MetalTable(NamedTuple):
    """Packed materials: albedo and fuzz by row."""

    albedo: ColorParameter
    fuzz: NumberParameter


class MetalRow(NamedTuple):
    """One material."""

    albedo: Vec3
    fuzz: float


@kernel
def pdf_fuzz(below: float, fuzz: float) -> float:
    """Return the density in solid angle of normalize(m + fuzz u) at an angle to m, u uniform on the unit sphere.

    `below` is 1 minus the angle's cosine c: of a narrow lobe the cosine itself has no digits.
    The ray along the direction meets the sphere of radius `fuzz` round the tip of m at distances t = c -+ h, both
    times at an angle of cosine h / fuzz to its surface; a patch of area A there fills A h / (fuzz t^2), and has the
    probability A / (4 pi fuzz^2).  The two roots sum to (c^2 + h^2) / (2 pi fuzz h), which is c / pi where fuzz is 1.
    """
    half2 = fuzz * fuzz - below * (2.0 - below)
    if half2 <= 0.0 or below >= 1.0:
        return 0.0
    return _pdf_fuzz(1.0 - below, math.sqrt(half2), fuzz)


@kernel
def _pdf_fuzz(cosine: float, half: float, fuzz: float) -> float:
    return (cosine * cosine + half * half) / (2.0 * math.pi * fuzz * half)


@interface.row.register(MetalTable)
def row_metal_table(table, index, textures, site):
    return MetalRow(color(table.albedo, index, textures, site), number(table.fuzz, index, textures, site))


@interface.scatter.register(MetalRow)
def scatter_metal_row(material, direction, normal, front, draws):
    mirrored = reflect(direction, normal)
    if material.fuzz == 0.0:
        return interface.Scatter(mirrored, material.albedo, math.inf)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.DIRECTION)
    shift = sample_sphere(u1, u2)
    outgoing = normalize(madd(mirrored, material.fuzz, shift))
    if not dot(outgoing, normal) > 0.0:
        return interface.absorbed_scatter(direction)
    # From the vector that was drawn: near the rim of the lobe the angle alone would round to a pdf of 0.
    half = material.fuzz * abs(dot(outgoing, shift))
    return interface.Scatter(outgoing, material.albedo, _pdf_fuzz(dot(outgoing, mirrored), half, material.fuzz))


@interface.evaluate.register(MetalRow)
def evaluate_metal_row(material, direction, normal, front, outgoing):
    if material.fuzz == 0.0 or dot(outgoing, normal) <= 0.0:
        return interface.BLACK, 0.0
    chord = sub(outgoing, reflect(direction, normal))
    pdf = pdf_fuzz(0.5 * dot(chord, chord), material.fuzz)
    return scale(pdf, material.albedo), pdf


@interface.reflectance.register(MetalRow)
def reflectance_metal_row(material):
    return material.albedo
