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
from pydantic import Field, model_validator

from raytracer.glass import LINE_D
from raytracer.jit import generic, kernel
from raytracer.materials.interface import (
    BLACK,
    DIRECTION,
    LOBE,
    WHITE,
    ClearSpec,
    Dispersion,
    Scatter,
    absorbed,
    chance,
    emission,
    eta_at,
    evaluate,
    pack_dispersion,
    reflectance,
    row,
    scatter,
)
from raytracer.microfacet import (
    SMOOTH_ALPHA,
    Deficits,
    Rows,
    deficit,
    deficits,
    ggx,
    half_vector,
    masking,
    mean_deficit,
    reflect_about,
    reflected,
    rows_of,
    sample_lost,
    sample_visible_normal,
    seen_from,
    shadowing,
    stretched,
)
from raytracer.optics import fresnel_dielectric, refract
from raytracer.sampling import sample_2d
from raytracer.spec import at
from raytracer.spectra import ALONE, FIRST, LAST, Hue
from raytracer.textures.interface import Book, Numbers, TexturedFraction, TexturedNumbers, number
from raytracer.vec import Vec3, add, basis, dot, neg, normalize, reflect, scale, to_local, to_world


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

    @model_validator(mode="after")
    def _absorbs_by_priority(self) -> "RoughDielectric":
        for key in ("absorption", "attenuation_color"):
            if self.priority is None and getattr(self, key) is not None:
                at(key, f"needs a priority, by which light knows what it is in; with it, {key} tells what it loses")
        return self

    def parting(self) -> int:
        return ALONE if self.disperses() else 0

    def is_nothing(self) -> bool:
        return self.priority is None and self.ior == self.outside_ior

    def is_lit(self) -> bool:
        if self.is_nothing():
            return False
        return not isinstance(self.roughness, float) or self.roughness**2 >= SMOOTH_ALPHA

    @staticmethod
    def pack(specs: Sequence["RoughDielectric"], book: Book) -> "RoughDielectricTable":
        bands = [_BANDS if spec.disperses() else (LINE_D,) for spec in specs]
        sides = [(spec, spec.eta(wavelength)) for spec, waves in zip(specs, bands, strict=True) for wavelength in waves]
        roughness = [spec.roughness if isinstance(spec.roughness, float) else None for spec, _ in sides]
        dispersion = pack_dispersion(specs)
        first = np.cumsum([0, *map(len, bands[:-1])]).astype(np.int32)
        return RoughDielectricTable(
            np.array([spec.eta() for spec in specs], np.float64),
            book.numbers([spec.roughness for spec in specs]),
            deficits(roughness, [(eta, 1.0 / eta) if spec.multiple_scattering else None for spec, eta in sides]),
            None if dispersion is None else Bands(dispersion, first),
        )


_BAND = 50.0
_BANDS = tuple(np.arange(FIRST + 0.5 * _BAND, LAST, _BAND).tolist())


class Bands(NamedTuple):
    """Indices that depend on the wavelength, and first (n,) int32, where in the deficits those of each material begin.

    A material that disperses has them for the middle of each of several bands of wavelengths.
    """

    dispersion: Dispersion
    first: NDArray[np.int32]


class RoughDielectricTable(NamedTuple):
    """By row: eta (n,) float64, index inside over index outside; roughness; deficits, on the outside and the inside.

    bands, None where no index depends on the wavelength; eta is that of the d line.
    """

    eta: NDArray[np.float64]
    roughness: Numbers | TexturedNumbers
    deficits: Deficits
    bands: Bands | None


class RoughDielectricRow(NamedTuple):
    """One material; outside and inside, where its deficits on each side are."""

    eta: float
    alpha: float
    cells: NDArray[np.float64]
    outside: Rows
    inside: Rows


class Side(NamedTuple):
    """A side of the boundary, as light sees it that is followed from there.

    squared, the square of its index of refraction over that of the near side; rows of its deficits; mean, their mean.
    """

    squared: float
    rows: Rows
    mean: float


@row.register(RoughDielectricTable)
def _(table, index, textures, site):
    roughness = number(table.roughness, index, textures, site)
    alpha = min(1.0, roughness * roughness)
    eta, place = _index(site.hue, table.bands, table, index)
    outside = rows_of(table.deficits, place, max(SMOOTH_ALPHA, alpha), 0)
    inside = rows_of(table.deficits, place, max(SMOOTH_ALPHA, alpha), 1)
    return RoughDielectricRow(eta, alpha, table.deficits.cells, outside, inside)


@generic
def _index(hue, bands, table, index):
    """(index inside over index outside, place in the deficits) of a material for light of this Hue, or of none."""
    raise NotImplementedError


@_index.register(type(None))
def _(hue, bands, table, index):
    return table.eta[index], index


@_index.register(Hue)
def _(hue, bands, table, index):
    return _index_in(bands, table, index, hue)


@generic
def _index_in(bands, table, index, hue):
    raise NotImplementedError


@_index_in.register(type(None))
def _(bands, table, index, hue):
    return table.eta[index], index


@_index_in.register(Bands)
def _(bands, table, index, hue):
    first = np.int64(bands.first[index])
    if bands.dispersion.disperses[index] == 0:
        return table.eta[index], first
    wavelength = hue.wavelengths[0]
    band = min(len(_BANDS) - 1, int((wavelength - FIRST) / _BAND))
    return eta_at(bands.dispersion, index, wavelength), first + band


@kernel
def _sides(material: RoughDielectricRow, front: bool, eta: float) -> tuple[Side, Side]:
    """The side that light is on and the other one; `eta` is the other's index over the first's."""
    near = material.outside if front else material.inside
    far = material.inside if front else material.outside
    cells = material.cells
    return Side(1.0, near, mean_deficit(cells, near)), Side(eta * eta, far, mean_deficit(cells, far))


@kernel
def _once(alpha: float, eta: float, toward: Vec3, outgoing: Vec3) -> float:
    """Density (1/sr) of light that one facet sends from `toward` to `outgoing`: f |cos|, as no light is absorbed.

    References: Walter et al. 2007, eq. 20 and 21, with the factor (index of `toward` / index of `outgoing`)^2 of basic
    radiance; what is reflected with G2 as in Heitz 2014, eq. 99.
    """
    if outgoing[2] > 0.0:
        half = half_vector(toward, outgoing)
        reflectance, _ = fresnel_dielectric(min(1.0, dot(toward, half)), eta)
        return reflectance * reflected(alpha, toward[2], outgoing[2], half)

    # The facet's normal lies in the plane of both, to the side of `toward`.
    half = normalize(add(toward, scale(eta, outgoing)))
    if half[2] < 0.0:
        half = neg(half)
    near, far = dot(toward, half), dot(outgoing, half)
    if not (near > 0.0 and far < 0.0):
        return 0.0
    reflectance, _ = fresnel_dielectric(min(1.0, near), eta)
    visible = 2.0 * near * ggx(alpha, half) / (toward[2] + stretched(alpha, toward[2]))
    # That is near + eta far, in the form that does not cancel where the indices are nearly equal.
    bent = (1.0 - eta) * (1.0 + eta) / (near - eta * far)
    return (1.0 - reflectance) * visible * masking(alpha, -outgoing[2]) * eta * eta * -far / (bent * bent)


@kernel
def _more(material: RoughDielectricRow, near: Side, far: Side, toward: Vec3, outgoing: Vec3) -> float:
    """Density (1/sr) of light that more than one facet sends from `toward` to `outgoing`.

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
    return deficit(cells, near.rows, toward[2]) * deficit(cells, rows, height) * squared * height / total


@scatter.register(RoughDielectricRow)
def _(material, direction, normal, front, draws):
    if material.eta == 1.0:
        return Scatter(direction, WHITE, math.inf)
    eta = material.eta if front else 1.0 / material.eta
    u, v = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LOBE)
    if material.alpha < SMOOTH_ALPHA:
        cos_i = min(1.0, abs(dot(direction, normal)))
        reflectance, cos_t = fresnel_dielectric(cos_i, eta)
        if u < reflectance:
            return Scatter(reflect(direction, normal), WHITE, math.inf)
        return Scatter(refract(direction, normal, cos_i, cos_t, eta), WHITE, math.inf)

    # Follow light to a facet, and on from there unless another is in its way.
    s, t = basis(normal)
    toward = seen_from(direction, s, t, normal)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + DIRECTION)
    half = sample_visible_normal(material.alpha, toward, u1, u2)
    cos_i = min(1.0, dot(toward, half))
    reflectance, cos_t = fresnel_dielectric(cos_i, eta)
    mirrors, rest = chance(u, reflectance)
    if mirrors:
        outgoing = reflect_about(toward, half)
        leaves = shadowing(material.alpha, toward[2], outgoing[2]) if outgoing[2] > 0.0 else 0.0
    else:
        outgoing = refract(neg(toward), half, cos_i, cos_t, eta)
        leaves = masking(material.alpha, -outgoing[2]) if outgoing[2] < 0.0 else 0.0
    single, rest = chance(rest, leaves)
    near, far = _sides(material, front, eta)
    if not single:
        total = near.squared * near.mean + far.squared * far.mean
        if total == 0.0:
            return absorbed(direction)
        returns, rest = chance(rest, near.squared * near.mean / total)
        x, y, z = sample_lost(material.cells, near.rows if returns else far.rows, rest, v)
        outgoing = (x, y, z if returns else -z)
    pdf = _once(material.alpha, eta, toward, outgoing) + _more(material, near, far, toward, outgoing)
    # Indices that differ in their last digits alone leave none to tell by which facet light came there.
    return Scatter(to_world(outgoing, s, t, normal), WHITE, pdf if pdf > 0.0 else math.inf)


@evaluate.register(RoughDielectricRow)
def _(material, direction, normal, front, outgoing):
    if material.eta == 1.0 or material.alpha < SMOOTH_ALPHA:
        return BLACK, 0.0
    eta = material.eta if front else 1.0 / material.eta
    s, t = basis(normal)
    toward, away = seen_from(direction, s, t, normal), to_local(outgoing, s, t, normal)
    near, far = _sides(material, front, eta)
    pdf = _once(material.alpha, eta, toward, away) + _more(material, near, far, toward, away)
    return (pdf, pdf, pdf), pdf


@emission.register(RoughDielectricTable)
def _(table, index, front, textures, site):
    return BLACK


@reflectance.register(RoughDielectricRow)
def _(material):
    return WHITE
