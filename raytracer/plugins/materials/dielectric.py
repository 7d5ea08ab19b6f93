"""Dielectric: clear glass, water, air bubbles.

In a scene:

    glass: {type: dielectric, ior: 1.5}
    water in glass: {type: dielectric, ior: 1.33, outside_ior: 1.5}
    bottle: {type: dielectric, attenuation_color: [0.2, 0.7, 0.3], attenuation_distance: 5 mm}

Glass that splits light into its colours, by the index of a catalogue, or at the d line with the Abbe number:

    prism: {type: dielectric, ior: N-SF11}
    diamond: {type: dielectric, ior: diamond}
    strong flint: {type: dielectric, ior: {index: 1.785, abbe: 25.7}}

Solids and liquids that touch, made to overlap:

    tumbler: {type: dielectric, ior: 1.5, priority: 3}
    ice: {type: dielectric, ior: 1.31, priority: 2}
    lemonade: {type: dielectric, ior: 1.34, priority: 1, absorption: [1, 2, 9]}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.compiler.dispatch import optional
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.core.sampling import sample_1d
from raytracer.core.spectra import TERMINATE_ON_REFRACTION, PathWavelengths, upsample_at_wavelengths
from raytracer.core.vec import Vec3, dot, mul, reflect, scale
from raytracer.plugins.materials.base import interface
from raytracer.plugins.materials.base.clear import ClearSpec, Dispersion, eta_at, pack_dispersion
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.schema.fields import Color, Vector


class Dielectric(ClearSpec):
    """A smooth, clear boundary with exact Fresnel reflection.

    Radiance is carried as basic radiance L / n^2, which refraction leaves unchanged; so what is lit and seen through
    glass is exact, and an emitter inside glass is given by the radiance it would show in air.

    Of light that comes to the boundary from within, over a distance d, the fraction exp(-absorption d) is kept. On the
    way to other things inside the glass none is lost: give it a `priority` where that matters.

    Where an index depends on the wavelength, wavelengths part: see docs/dispersion.md.

    Closed objects whose materials have a `priority` may overlap. Where they do, the one with the highest is there, of
    equals the one that comes first in the scene; surfaces hidden in it let light straight through, shadow rays too, and
    each surface that is seen is a boundary to what lies behind it. Light knows what it is in, also where the camera
    stands in it, and loses what that absorbs on all its ways. Make things that touch overlap by a little, as water and
    its glass: of two faces in the same place a ray meets but one. Glass without a priority has no part in this: within
    water that has one, its surface is one to `outside_ior`, and the water goes on absorbing in it. Where nothing has a
    priority, a face between two glasses is one surface, with `ior` and `outside_ior`. Up to 256 materials of a scene
    may have a priority; how many objects have them, and overlap, is not limited.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 9.5; basic radiance: Nicodemus 1963;
    priorities: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2); absorption: Beer 1852;
    attenuation by colour and distance: KHR_materials_volume of glTF.
    """

    type: Literal["dielectric"] = "dielectric"
    outside_absorption: Color | None = Field(
        default=None, description="absorption coefficient of the outside by channel (1/m); none by default"
    )

    def dispersion_mode(self) -> int:
        return TERMINATE_ON_REFRACTION if self.disperses() else 0

    def is_index_matched(self) -> bool:
        return self.priority is None and self.ior == self.outside_ior and not any(map(any, self.coefficients()))

    def coefficients(self) -> tuple[Vector, Vector]:
        """Return the absorption (1/m) by channel that the boundary accounts for: of the inside, and of the outside."""
        # With a priority, light knows at each place what it is in.
        inside = interface.BLACK if self.priority is not None else self.inside_absorption()
        return inside, self.outside_absorption or interface.BLACK

    @staticmethod
    def pack(specs: Sequence["Dielectric"], book: ParameterPacker) -> "DielectricTable":
        coefficients = np.array([spec.coefficients() for spec in specs], np.float64)
        return DielectricTable(
            np.array([spec.eta() for spec in specs], np.float64),
            Absorption(coefficients) if coefficients.any() else None,
            pack_dispersion(specs),
        )


class Absorption(NamedTuple):
    """Absorption of dielectrics: coefficients (n, 2, 3) float64 (1/m), of the inside and the outside, by channel."""

    coefficients: NDArray[np.float64]


class DielectricTable(NamedTuple):
    """Packed dielectrics, one row each.

    eta (n,) float64 : index inside over index outside, for the d line.
    absorption : None where nothing absorbs.
    dispersion : None where no index depends on the wavelength.
    """

    eta: NDArray[np.float64]
    absorption: Absorption | None
    dispersion: Dispersion | None


class DielectricRow(NamedTuple):
    """One material, with the transmittances of the distance that light has come inside of it, or outside."""

    eta: float
    transmittance_inside: Vec3
    transmittance_outside: Vec3


class SpectralDielectricRow(NamedTuple):
    """One material as in DielectricRow, for light of single wavelengths.

    wavelength_count : of the light, or 0 where the material has one eta.
    number : index of the wavelength that is refracted.
    transmittance_inside, transmittance_outside : by wavelength, or by channel where the material has one eta.
    """

    eta: Vec3
    wavelength_count: float
    number: np.int64
    transmittance_inside: Vec3
    transmittance_outside: Vec3


@interface.row.register(DielectricTable)
def row_dielectric_table(table, index, textures, site):
    return _row(site.wavelengths, table, index, site.distance)


@optional
def _row(wavelengths, table, index, distance):
    """Make the record of a material for light of these wavelengths, or None, that has come so far (m)."""
    return DielectricRow(
        table.eta[index],
        transmittance(table.absorption, index, 0, distance),
        transmittance(table.absorption, index, 1, distance),
    )


@_row.register(PathWavelengths)
def _row_path_wavelengths(wavelengths, table, index, distance):
    return _spectral_row(table.dispersion, table, index, wavelengths, distance)


@optional
def _spectral_row(dispersion, table, index, wavelengths, distance):
    return _row(None, table, index, distance)


@_spectral_row.register(Dispersion)
def _spectral_row_dispersion(dispersion, table, index, wavelengths, distance):
    inside = transmittance(table.absorption, index, 0, distance)
    outside = transmittance(table.absorption, index, 1, distance)
    if dispersion.disperses[index] == 0:
        eta = table.eta[index]
        return SpectralDielectricRow((eta, eta, eta), 0.0, np.int64(0), inside, outside)
    eta = (
        eta_at(dispersion, index, wavelengths.wavelengths[0]),
        eta_at(dispersion, index, wavelengths.wavelengths[1]),
        eta_at(dispersion, index, wavelengths.wavelengths[2]),
    )
    return SpectralDielectricRow(
        eta,
        wavelengths.wavelength_count,
        wavelengths.number,
        upsample_at_wavelengths(wavelengths, inside),
        upsample_at_wavelengths(wavelengths, outside),
    )


@optional
def transmittance(absorption, index, side, distance):
    """Return the transmittance by channel of a distance (m) on the inside (side 0) or outside (1) of a material."""
    return interface.WHITE


@transmittance.register(Absorption)
def transmittance_absorption(absorption, index, side, distance):
    sigma = absorption.coefficients
    return (
        math.exp(-sigma[index, side, 0] * distance),
        math.exp(-sigma[index, side, 1] * distance),
        math.exp(-sigma[index, side, 2] * distance),
    )


@interface.scatter.register(DielectricRow)
def scatter_dielectric_row(material, direction, normal, front, draws):
    eta = material.eta if front else 1.0 / material.eta
    cos_i = min(1.0, abs(dot(direction, normal)))
    reflectance, cos_t = fresnel_dielectric(cos_i, eta)
    attenuation = material.transmittance_outside if front else material.transmittance_inside
    if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LOBE) < reflectance:
        return interface.Scatter(reflect(direction, normal), attenuation, math.inf)
    return interface.Scatter(refract(direction, normal, cos_i, cos_t, eta), attenuation, math.inf)


@interface.scatter.register(SpectralDielectricRow)
def scatter_spectral_dielectric_row(material, direction, normal, front, draws):
    first, second, third = material.eta
    if not front:
        first, second, third = 1.0 / first, 1.0 / second, 1.0 / third
    cos_i = min(1.0, abs(dot(direction, normal)))
    attenuation = material.transmittance_outside if front else material.transmittance_inside
    u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LOBE)
    of_first, cos_t = fresnel_dielectric(cos_i, first)
    if material.wavelength_count == 0.0:
        if u < of_first:
            return interface.Scatter(reflect(direction, normal), attenuation, math.inf)
        return interface.Scatter(refract(direction, normal, cos_i, cos_t, first), attenuation, math.inf)

    # Wavelengths have one way when reflected, with one chance for all of them.
    of_all, chance = (of_first, of_first, of_first), of_first
    if material.wavelength_count > 1.0:
        of_all = (of_first, fresnel_dielectric(cos_i, second)[0], fresnel_dielectric(cos_i, third)[0])
        chance = (of_all[0] + of_all[1] + of_all[2]) / 3.0
    if u < chance:
        return interface.Scatter(reflect(direction, normal), mul(scale(1.0 / chance, of_all), attenuation), math.inf)

    # Refracted, each has its own.
    number = material.number
    eta = (first, second, third)[number]
    reflectance, cos_t = fresnel_dielectric(cos_i, eta)
    if reflectance == 1.0:
        return interface.absorbed_scatter(direction)
    part = (1.0 - reflectance) / (1.0 - chance) * attenuation[number]
    weight = (part if number == 0 else 0.0, part if number == 1 else 0.0, part if number == 2 else 0.0)
    return interface.Scatter(refract(direction, normal, cos_i, cos_t, eta), weight, math.inf)


@interface.reflectance.register(SpectralDielectricRow)
@interface.reflectance.register(DielectricRow)
def reflectance_spectral_dielectric_row(material):
    return interface.WHITE
