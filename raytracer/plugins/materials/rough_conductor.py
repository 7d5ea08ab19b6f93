"""Rough conductor: gold, brushed aluminium, any metal that is not a perfect mirror.

In a scene:

    gold: {type: rough_conductor, metal: gold, roughness: 0.3}
    chromium: {type: rough_conductor, eta: [3.11, 3.18, 2.14], k: [3.31, 3.33, 3.19], roughness: 0.1}
    red foil: {type: rough_conductor, albedo: [0.9, 0.1, 0.05], roughness: 0.4}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core import microfacet
from raytracer.core.compiler.dispatch import entry, kernel
from raytracer.core.fresnel import fresnel_conductor, fresnel_schlick, fresnel_schlick_mean
from raytracer.core.geometry import row3
from raytracer.core.sampling import sample_2d
from raytracer.core.vec import Vec3, add, basis, dot, scale, to_local, to_world
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
from raytracer.schema.fields import Color
from raytracer.schema.rules import exclusive, some_of, together

METALS: dict[str, tuple[Vec3, Vec3]] = {
    "gold": ((0.1556, 0.4241, 1.3831), (3.6024, 2.4721, 1.9155)),
    "silver": ((0.0522, 0.0596, 0.0400), (4.4094, 3.5974, 2.6484)),
    "copper": ((0.2378, 1.0066, 1.2404), (3.6264, 2.5823, 2.3929)),
    "aluminium": ((1.5580, 1.0152, 0.6332), (7.7124, 6.6273, 5.4544)),
}
"""Index n and extinction k by channel, at 650, 550 and 450 nm, between the wavelengths that were measured.

References: gold, silver, copper: Johnson, Christy 1972, "Optical Constants of the Noble Metals", Phys. Rev. B 6, 4370;
aluminium: Rakic 1995, "Algorithm for the Determination of Intrinsic Optical Constants of Metal Films: Application to
Aluminum", Appl. Opt. 34, 4755.
"""


class RoughConductor(interface.MaterialSpec):
    """Metal of small mirrors (GGX), with the light that goes from mirror to mirror; alpha is the square of roughness.

    A mirror reflects by Fresnel's equations for a metal with measured indices, or with `eta` and `k`, or by Schlick's
    fit to them for a metal of a given `albedo`.  Below a roughness of 0.032 the surface is one mirror.

    References: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Kulla, Conty 2017,
    "Revisiting Physically Based Shading at Imageworks"; Burley 2012, "Physically-Based Shading at Disney" (roughness).
    """

    type: Literal["rough_conductor"] = "rough_conductor"
    metal: Literal["gold", "silver", "copper", "aluminium"] | None = Field(
        default=None, description="the metal, with indices as measured; or else `eta` and `k`, or `albedo`"
    )
    eta: Color | None = Field(default=None, description="index of refraction by channel; goes with `k`")
    k: Color | None = Field(default=None, description="extinction coefficient by channel; goes with `eta`")
    albedo: TexturedAlbedo | None = Field(
        default=None, description="fraction of light reflected at normal incidence, by channel"
    )
    roughness: TexturedFraction = Field(default=0.3, description="0 is a mirror, 1 as rough as can be")
    multiple_scattering: bool = Field(
        default=True, description="count light that meets several facets; without it, rough metal is too dark"
    )

    _whole_index = together("eta", "k", message="is missing; `eta` and `k` go together")
    _some_metal = some_of("metal", "eta", "albedo", message="needs a metal, or eta and k, or an albedo")
    _one_metal = exclusive(
        "metal", "eta", "albedo", message="cannot go with {first}: give a metal, or eta and k, or an albedo"
    )

    def has_non_delta_bsdf(self) -> bool:
        if self.albedo is not None and is_zero(self.albedo):
            return False
        return not isinstance(self.roughness, float) or self.roughness**2 >= microfacet.SMOOTH_ALPHA

    def index(self) -> tuple[Vec3, Vec3]:
        """Return n and k by channel; zeros where the metal has an albedo instead."""
        if self.metal is not None:
            return METALS[self.metal]
        if self.eta is not None and self.k is not None:
            return self.eta, self.k
        return interface.BLACK, interface.BLACK

    @staticmethod
    def pack(specs: Sequence["RoughConductor"], book: ParameterPacker) -> "RoughConductorTable":
        roughness = [spec.roughness if isinstance(spec.roughness, float) else None for spec in specs]
        indices = [spec.index() for spec in specs]
        # The mean over a hemisphere, by the cosine: the integral of F 2 c dc.
        nodes, weights = np.polynomial.legendre.leggauss(32)
        cosines = 0.5 + 0.5 * nodes
        return RoughConductorTable(
            book.numbers([spec.roughness for spec in specs]),
            np.array([spec.albedo is None for spec in specs], np.bool_),
            np.array([eta for eta, _ in indices], np.float64),
            np.array([k for _, k in indices], np.float64),
            np.array([_mean_reflectance(eta, k, cosines, weights * cosines) for eta, k in indices], np.float64),
            book.colors([interface.BLACK if spec.albedo is None else spec.albedo for spec in specs]),
            microfacet.deficits(roughness, [(0.0,) if spec.multiple_scattering else None for spec in specs]),
        )


@entry
def _mean_reflectance(eta: Vec3, k: Vec3, cosines: NDArray[np.float64], weights: NDArray[np.float64]) -> Vec3:
    """Integrate a metal's reflectance, by channel, over cosines with these weights."""
    total = interface.BLACK
    for node in range(len(cosines)):
        total = add(total, scale(weights[node], fresnel_conductor(cosines[node], eta, k)))
    return total


class RoughConductorTable(NamedTuple):
    """Packed materials, one row each; roughness and albedo are parameters.

    measured (n,) bool : True for indices, False for an albedo.
    eta, k (n, 3) float64 : the indices.
    mean (n, 3) float64 : cosine-weighted mean of the reflectance that the indices give.
    deficits : energy that single scattering by the facets loses.
    """

    roughness: NumberParameter
    measured: NDArray[np.bool_]
    eta: NDArray[np.float64]
    k: NDArray[np.float64]
    mean: NDArray[np.float64]
    albedo: ColorParameter
    deficits: microfacet.Deficits


class RoughConductorRow(NamedTuple):
    """One material; `multiple` is its reflectance for light that goes from mirror to mirror."""

    alpha: float
    measured: bool
    eta: Vec3
    k: Vec3
    albedo: Vec3
    multiple: Vec3
    cells: NDArray[np.float64]
    rows: microfacet.CellBlend


@interface.row.register(RoughConductorTable)
def row_rough_conductor_table(table, index, textures, site):
    roughness = number(table.roughness, index, textures, site)
    alpha = min(1.0, roughness * roughness)
    albedo = color(table.albedo, index, textures, site)
    measured = table.measured[index]
    mean = row3(table.mean, index) if measured else fresnel_schlick_mean(albedo)
    rows = microfacet.find_cells(table.deficits, index, max(microfacet.SMOOTH_ALPHA, alpha), 0)
    cells = table.deficits.cells
    multiple = microfacet.multiple_albedo(mean, microfacet.mean_deficit(cells, rows))
    return RoughConductorRow(
        alpha, measured, row3(table.eta, index), row3(table.k, index), albedo, multiple, cells, rows
    )


@kernel
def _fresnel(material: RoughConductorRow, cosine: float) -> Vec3:
    """Return the reflectance of a mirror of this metal, by channel."""
    if material.measured:
        return fresnel_conductor(cosine, material.eta, material.k)
    return fresnel_schlick(cosine, material.albedo)


@kernel
def _evaluated(material: RoughConductorRow, toward: Vec3, outgoing: Vec3) -> tuple[Vec3, float]:
    """Evaluate f |cos| and the pdf for directions in the surface's frame, both of which point away from it."""
    if outgoing[2] <= 0.0:
        return interface.BLACK, 0.0
    half = microfacet.half_vector(toward, outgoing)
    once = microfacet.reflection_density(material.alpha, toward[2], outgoing[2], half)
    value = scale(once, _fresnel(material, min(1.0, dot(toward, half))))
    cells, rows = material.cells, material.rows
    mean = microfacet.mean_deficit(cells, rows)
    if mean == 0.0:
        return value, once
    more = (
        microfacet.deficit(cells, rows, toward[2])
        * microfacet.deficit(cells, rows, outgoing[2])
        * outgoing[2]
        / (math.pi * mean)
    )
    return add(value, scale(more, material.multiple)), once + more


@interface.scatter.register(RoughConductorRow)
def scatter_rough_conductor_row(material, direction, normal, front, draws):
    s, t = basis(normal)
    toward = microfacet.view_direction(direction, s, t, normal)
    if material.alpha < microfacet.SMOOTH_ALPHA:
        mirror = to_world((-toward[0], -toward[1], toward[2]), s, t, normal)
        return interface.Scatter(mirror, _fresnel(material, min(1.0, toward[2])), math.inf)

    # Follow light to a facet, and on from there unless another is in its way.
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.DIRECTION)
    u, v = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LOBE)
    outgoing = microfacet.reflect_about(toward, microfacet.sample_visible_normal(material.alpha, toward, u1, u2))
    leaves = microfacet.shadowing(material.alpha, toward[2], outgoing[2]) if outgoing[2] > 0.0 else 0.0
    single, rest = interface.split_random_number(u, leaves)
    if not single:
        if microfacet.mean_deficit(material.cells, material.rows) == 0.0:
            return interface.absorbed_scatter(direction)
        outgoing = microfacet.sample_multiple_scattering(material.cells, material.rows, rest, v)
    value, pdf = _evaluated(material, toward, outgoing)
    if not pdf > 0.0:
        return interface.absorbed_scatter(direction)
    return interface.Scatter(to_world(outgoing, s, t, normal), scale(1.0 / pdf, value), pdf)


@interface.evaluate.register(RoughConductorRow)
def evaluate_rough_conductor_row(material, direction, normal, front, outgoing):
    if material.alpha < microfacet.SMOOTH_ALPHA:
        return interface.BLACK, 0.0
    s, t = basis(normal)
    return _evaluated(material, microfacet.view_direction(direction, s, t, normal), to_local(outgoing, s, t, normal))


@interface.reflectance.register(RoughConductorRow)
def reflectance_rough_conductor_row(material):
    return _fresnel(material, 1.0)
