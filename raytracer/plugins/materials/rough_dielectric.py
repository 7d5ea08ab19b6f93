"""Rough dielectric: frosted glass, ice, sea glass.

In a scene:

    frosted glass: {type: rough_dielectric, ior: 1.5, roughness: 0.4}
    frosted flint: {type: rough_dielectric, ior: N-SF11, roughness: 0.2}
    sea glass: {type: rough_dielectric, ior: 1.5, roughness: 0.5, priority: 1, absorption: [8, 1, 4]}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core import microfacet
from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.core.sampling import sample_2d
from raytracer.core.spectra import FIRST, LAST, TERMINATE_ON_HIT, PathWavelengths
from raytracer.core.vec import Vec3, add, basis, dot, neg, normalize, reflect, scale, to_local, to_world
from raytracer.optics.glass import LINE_D
from raytracer.plugins.materials.base import interface
from raytracer.plugins.materials.base.clear import ClearSpec, Dispersion, eta_at, pack_dispersion
from raytracer.plugins.textures.base.interface import NumberParameter, ParameterPacker, TexturedFraction, number
from raytracer.schema.rules import only


class RoughDielectric(ClearSpec):
    """A clear boundary of small facets (GGX) that reflect and refract; alpha is the square of roughness.

    Each facet reflects by Fresnel's equations.  What is reflected or refracted into other facets is not lost: it
    leaves to both sides, and light in glass of any roughness is as much as came in.  Below a roughness of 0.032 the
    boundary is smooth.  Radiance is basic radiance, and objects may overlap by `priority`, as for `dielectric`.  Glass
    whose index depends on the wavelength is met at one wavelength at a time.

    Glass that absorbs needs a `priority`, by which light knows what it is in on all its ways, those to lights too:
    without one, `absorption` and `attenuation_color` are errors.

    References: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Kulla, Conty 2017,
    "Revisiting Physically Based Shading at Imageworks"; Burley 2012, "Physically-Based Shading at Disney" (roughness).
    """

    type: Literal["rough_dielectric"] = "rough_dielectric"
    roughness: TexturedFraction = Field(default=0.3, description="0 is smooth, 1 as rough as can be")
    multiple_scattering: bool = Field(
        default=True, description="count light that meets several facets; without it, rough glass is too dark"
    )

    _absorbs_by_priority = only(
        "absorption",
        "attenuation_color",
        where="priority",
        message="needs a priority, by which light knows what it is in; with it, {key} tells what it loses",
    )

    def dispersion_mode(self) -> int:
        return TERMINATE_ON_HIT if self.disperses() else 0

    def is_index_matched(self) -> bool:
        return self.priority is None and self.ior == self.outside_ior

    def has_non_delta_bsdf(self) -> bool:
        if self.is_index_matched():
            return False
        return not isinstance(self.roughness, float) or self.roughness**2 >= microfacet.SMOOTH_ALPHA

    @staticmethod
    def pack(specs: Sequence["RoughDielectric"], book: ParameterPacker) -> "RoughDielectricTable":
        bands = [_BANDS if spec.disperses() else (LINE_D,) for spec in specs]
        sides = [(spec, spec.eta(wavelength)) for spec, waves in zip(specs, bands, strict=True) for wavelength in waves]
        roughness = [spec.roughness if isinstance(spec.roughness, float) else None for spec, _ in sides]
        dispersion = pack_dispersion(specs)
        first = np.cumsum([0, *map(len, bands[:-1])]).astype(np.int32)
        return RoughDielectricTable(
            np.array([spec.eta() for spec in specs], np.float64),
            book.numbers([spec.roughness for spec in specs]),
            microfacet.deficits(
                roughness, [(eta, 1.0 / eta) if spec.multiple_scattering else None for spec, eta in sides]
            ),
            None if dispersion is None else WavelengthBands(dispersion, first),
        )


_BAND = 50.0
_BANDS = tuple(np.arange(FIRST + 0.5 * _BAND, LAST, _BAND).tolist())


class WavelengthBands(NamedTuple):
    """Dispersion by bands of wavelengths: a material that disperses has deficits for the middle of each band.

    dispersion : indices by wavelength.
    first (n,) int32 : offset of each material in the deficits.
    """

    dispersion: Dispersion
    first: NDArray[np.int32]


class RoughDielectricTable(NamedTuple):
    """Packed materials, one row each; roughness is a parameter.

    eta (n,) float64 : index inside over index outside, for the d line.
    deficits : energy that single scattering by the facets loses, on the outside and the inside.
    bands : None where no index depends on the wavelength.
    """

    eta: NDArray[np.float64]
    roughness: NumberParameter
    deficits: microfacet.Deficits
    bands: WavelengthBands | None


class RoughDielectricRow(NamedTuple):
    """One material; `outside` and `inside` are the places of its deficits on each side."""

    eta: float
    alpha: float
    cells: NDArray[np.float64]
    outside: microfacet.CellBlend
    inside: microfacet.CellBlend


class BoundarySide(NamedTuple):
    """Side of the boundary, for light that is traced from there.

    squared : square of its index of refraction over that of the near side.
    rows : of its deficits.
    mean : of its deficits.
    """

    squared: float
    rows: microfacet.CellBlend
    mean: float


@interface.row.register(RoughDielectricTable)
def row_rough_dielectric_table(table, index, textures, site):
    roughness = number(table.roughness, index, textures, site)
    alpha = min(1.0, roughness * roughness)
    eta, place = _index(site.wavelengths, table.bands, table, index)
    outside = microfacet.find_cells(table.deficits, place, max(microfacet.SMOOTH_ALPHA, alpha), 0)
    inside = microfacet.find_cells(table.deficits, place, max(microfacet.SMOOTH_ALPHA, alpha), 1)
    return RoughDielectricRow(eta, alpha, table.deficits.cells, outside, inside)


@optional
def _index(wavelengths, bands, table, index):
    """Return (index inside over index outside, place in the deficits) of a material, for light of these wavelengths."""
    return table.eta[index], index


@_index.register(PathWavelengths)
def _index_path_wavelengths(wavelengths, bands, table, index):
    return _index_in(bands, table, index, wavelengths)


@optional
def _index_in(bands, table, index, wavelengths):
    return table.eta[index], index


@_index_in.register(WavelengthBands)
def _index_in_wavelength_bands(bands, table, index, wavelengths):
    first = np.int64(bands.first[index])
    if bands.dispersion.disperses[index] == 0:
        return table.eta[index], first
    wavelength = wavelengths.wavelengths[0]
    band = min(len(_BANDS) - 1, int((wavelength - FIRST) / _BAND))
    return eta_at(bands.dispersion, index, wavelength), first + band


@kernel
def _sides(material: RoughDielectricRow, front: bool, eta: float) -> tuple[BoundarySide, BoundarySide]:
    """Return the side that light is on and the other one; `eta` is the other's index over the first's."""
    near = material.outside if front else material.inside
    far = material.inside if front else material.outside
    cells = material.cells
    return BoundarySide(1.0, near, microfacet.mean_deficit(cells, near)), BoundarySide(
        eta * eta, far, microfacet.mean_deficit(cells, far)
    )


@kernel
def _single_scattering(alpha: float, eta: float, toward: Vec3, outgoing: Vec3) -> float:
    """Return the density (1/sr) of light that one facet sends from `toward` to `outgoing`, which is f |cos|.

    References: Walter et al. 2007, eq. 20 and 21, with the factor (index of `toward` / index of `outgoing`)^2 of basic
    radiance; what is reflected with G2 as in Heitz 2014, eq. 99.
    """
    if outgoing[2] > 0.0:
        half = microfacet.half_vector(toward, outgoing)
        reflectance, _ = fresnel_dielectric(min(1.0, dot(toward, half)), eta)
        return reflectance * microfacet.reflection_density(alpha, toward[2], outgoing[2], half)

    # The facet's normal lies in the plane of both, to the side of `toward`.
    half = normalize(add(toward, scale(eta, outgoing)))
    if half[2] < 0.0:
        half = neg(half)
    near, far = dot(toward, half), dot(outgoing, half)
    if not (near > 0.0 and far < 0.0):
        return 0.0
    reflectance, _ = fresnel_dielectric(min(1.0, near), eta)
    visible = 2.0 * near * microfacet.ggx(alpha, half) / (toward[2] + microfacet.stretched(alpha, toward[2]))
    # That is near + eta far, in the form that does not cancel where the indices are nearly equal.
    bent = (1.0 - eta) * (1.0 + eta) / (near - eta * far)
    return (1.0 - reflectance) * visible * microfacet.masking(alpha, -outgoing[2]) * eta * eta * -far / (bent * bent)


@kernel
def _multiple_scattering(
    material: RoughDielectricRow, near: BoundarySide, far: BoundarySide, toward: Vec3, outgoing: Vec3
) -> float:
    """Return the density (1/sr) of light that more than one facet sends from `toward` to `outgoing`.

    With basic radiance, f / n^2 at the far end is the kernel that reciprocity makes symmetric, against the measure
    n^2 |cos|.  Here it is m m' / N, with the deficits m at both ends; N, the integral of the deficit over both sides,
    makes it give back what was dropped: the integral over all directions is m.
    """
    total = math.pi * (near.squared * near.mean + far.squared * far.mean)
    if total == 0.0:
        return 0.0
    cells = material.cells
    height = abs(outgoing[2])
    squared, rows = (near.squared, near.rows) if outgoing[2] > 0.0 else (far.squared, far.rows)
    return (
        microfacet.deficit(cells, near.rows, toward[2])
        * microfacet.deficit(cells, rows, height)
        * squared
        * height
        / total
    )


@interface.scatter.register(RoughDielectricRow)
def scatter_rough_dielectric_row(material, direction, normal, front, draws):
    if material.eta == 1.0:
        return interface.Scatter(direction, interface.WHITE, math.inf)
    eta = material.eta if front else 1.0 / material.eta
    u, v = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LOBE)
    if material.alpha < microfacet.SMOOTH_ALPHA:
        cos_i = min(1.0, abs(dot(direction, normal)))
        reflectance, cos_t = fresnel_dielectric(cos_i, eta)
        if u < reflectance:
            return interface.Scatter(reflect(direction, normal), interface.WHITE, math.inf)
        return interface.Scatter(refract(direction, normal, cos_i, cos_t, eta), interface.WHITE, math.inf)

    # Follow light to a facet, and on from there unless another is in its way.
    s, t = basis(normal)
    toward = microfacet.view_direction(direction, s, t, normal)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.DIRECTION)
    half = microfacet.sample_visible_normal(material.alpha, toward, u1, u2)
    cos_i = min(1.0, dot(toward, half))
    reflectance, cos_t = fresnel_dielectric(cos_i, eta)
    mirrors, rest = interface.split_random_number(u, reflectance)
    if mirrors:
        outgoing = microfacet.reflect_about(toward, half)
        leaves = microfacet.shadowing(material.alpha, toward[2], outgoing[2]) if outgoing[2] > 0.0 else 0.0
    else:
        outgoing = refract(neg(toward), half, cos_i, cos_t, eta)
        leaves = microfacet.masking(material.alpha, -outgoing[2]) if outgoing[2] < 0.0 else 0.0
    single, rest = interface.split_random_number(rest, leaves)
    near, far = _sides(material, front, eta)
    if not single:
        total = near.squared * near.mean + far.squared * far.mean
        if total == 0.0:
            return interface.absorbed_scatter(direction)
        returns, rest = interface.split_random_number(rest, near.squared * near.mean / total)
        x, y, z = microfacet.sample_multiple_scattering(material.cells, near.rows if returns else far.rows, rest, v)
        outgoing = (x, y, z if returns else -z)
    pdf = _single_scattering(material.alpha, eta, toward, outgoing) + _multiple_scattering(
        material, near, far, toward, outgoing
    )
    # Indices that differ in their last digits alone leave none to tell by which facet light came there.
    return interface.Scatter(to_world(outgoing, s, t, normal), interface.WHITE, pdf if pdf > 0.0 else math.inf)


@interface.evaluate.register(RoughDielectricRow)
def evaluate_rough_dielectric_row(material, direction, normal, front, outgoing):
    if material.eta == 1.0 or material.alpha < microfacet.SMOOTH_ALPHA:
        return interface.BLACK, 0.0
    eta = material.eta if front else 1.0 / material.eta
    s, t = basis(normal)
    toward, away = microfacet.view_direction(direction, s, t, normal), to_local(outgoing, s, t, normal)
    near, far = _sides(material, front, eta)
    pdf = _single_scattering(material.alpha, eta, toward, away) + _multiple_scattering(
        material, near, far, toward, away
    )
    return (pdf, pdf, pdf), pdf


@interface.reflectance.register(RoughDielectricRow)
def reflectance_rough_dielectric_row(material):
    return interface.WHITE
