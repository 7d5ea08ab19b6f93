"""Oren-Nayar: a matte surface of many small facets, such as plaster, clay, or the Moon.

As an example of a new kind of material this is its whole code: put the file into raytracer/plugins/materials/.  In a
scene:

    plaster: {type: oren_nayar, albedo: [0.8, 0.75, 0.7], roughness: 20 deg}
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.warp import pdf_cosine_hemisphere, sample_cosine_hemisphere
from raytracer.core.vec import Vec3, basis, dot, scale, to_world
from raytracer.plugins.materials.base.interface import (
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
from raytracer.plugins.textures.base.interface import ParameterPacker, TexturedAlbedo, color, is_zero
from raytracer.schema.fields import Quantity


class OrenNayar(MaterialSpec):
    """A rough matte surface, whose V-shaped facets shadow and light each other: flatter than Lambert's, as the Moon is.

    With the directions of light and view at the angles i and o from the normal and p round it from each other,
    f = albedo / pi (A + B max(0, cos p) sin max(i, o) tan min(i, o)), where A = 1 - s^2 / (2 (s^2 + 0.33)) and
    B = 0.45 s^2 / (s^2 + 0.09), with the standard deviation s of the facets' slope angles.

    References: Oren, Nayar 1994, "Generalization of Lambert's Reflectance Model", SIGGRAPH, eq. 30.
    """

    type: Literal["oren_nayar"] = "oren_nayar"
    albedo: TexturedAlbedo = Field(default=(0.5, 0.5, 0.5), description="fraction of light a facet reflects")
    roughness: Annotated[float, Quantity("angle", low=0.0, high=90.0)] = Field(
        default=20.0, description="standard deviation of the facets' slope angles; 0 is lambertian"
    )

    def has_non_delta_bsdf(self) -> bool:
        # Next-event estimation and MIS follow from this: light that arrives from a sampled direction is reflected.
        return not is_zero(self.albedo)

    @staticmethod
    def pack(specs: Sequence["OrenNayar"], book: ParameterPacker) -> "OrenNayarTable":
        variance = np.radians([spec.roughness for spec in specs]) ** 2
        a, b = 1.0 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)
        return OrenNayarTable(book.colors([spec.albedo for spec in specs]), a, b)


class OrenNayarTable(NamedTuple):
    """Packed materials, one row each: albedo, and the terms A and B (n,) float64."""

    albedo: Any
    a: NDArray[np.float64]
    b: NDArray[np.float64]


class OrenNayarRow(NamedTuple):
    """One material at a point of a surface."""

    albedo: Vec3
    a: float
    b: float


@kernel
def facet_factor(material, direction, normal, outgoing):
    """Return f over albedo / pi, for light that arrives along `direction` and leaves along `outgoing`."""
    cos_i, cos_o = -dot(direction, normal), dot(outgoing, normal)
    # Of unit vectors with their parts along the normal taken off: sin i sin o cos p.
    across = -dot(direction, outgoing) - cos_i * cos_o
    return material.a + material.b * max(0.0, across) / max(cos_i, cos_o, 1e-9)


@row.register(OrenNayarTable)
def row_oren_nayar_table(table, index, textures, site):
    return OrenNayarRow(color(table.albedo, index, textures, site), table.a[index], table.b[index])


@scatter.register(OrenNayarRow)
def scatter_oren_nayar_row(material, direction, normal, front, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + DIRECTION)
    local = sample_cosine_hemisphere(u1, u2)
    s, t = basis(normal)
    outgoing = to_world(local, s, t, normal)
    # The density is cos / pi, so f |cos| / pdf is the albedo times the factor.
    weight = scale(facet_factor(material, direction, normal, outgoing), material.albedo)
    return Scatter(outgoing, weight, pdf_cosine_hemisphere(local[2]))


@evaluate.register(OrenNayarRow)
def evaluate_oren_nayar_row(material, direction, normal, front, outgoing):
    cosine = max(0.0, dot(outgoing, normal))
    factor = facet_factor(material, direction, normal, outgoing)
    return scale(factor * cosine / math.pi, material.albedo), pdf_cosine_hemisphere(cosine)


@emission.register(OrenNayarTable)
def emission_oren_nayar_table(table, index, front, textures, site):
    return BLACK


@reflectance.register(OrenNayarRow)
def reflectance_oren_nayar_row(material):
    return scale(material.a, material.albedo)
