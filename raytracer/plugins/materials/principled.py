"""Principled: plastic, paint, wood, metal, thin glass, by the few parameters of glTF's metallic-roughness model.

In a scene:

    plastic: {type: principled, base_color: [0.8, 0.1, 0.1], roughness: 0.3}
    worn gold: {type: principled, base_color: [1.0, 0.77, 0.34], metallic: 1, roughness: {type: noise, scale: 0.1}}
"""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core import microfacet
from raytracer.core.compiler.dispatch import kernel, routine
from raytracer.core.fresnel import SCHLICK_MEAN, fresnel_schlick_mean, schlick_weight
from raytracer.core.sampling import sample_1d, sample_2d
from raytracer.core.sampling.warp import pdf_cosine_hemisphere, sample_cosine_hemisphere
from raytracer.core.vec import Vec3, add, basis, dot, scale, sub, to_local, to_world
from raytracer.plugins.materials.base import interface
from raytracer.plugins.textures.base.interface import (
    ColorParameter,
    NumberParameter,
    ParameterPacker,
    TexturedAlbedo,
    TexturedFraction,
    TexturedRadiance,
    color,
    is_zero,
    number,
)
from raytracer.schema.fields import Fraction, Quantity


class Principled(interface.MaterialSpec):
    """glTF's metallic-roughness material, made to keep energy.

    A metal of the base colour, mixed by `metallic` with a matte body of the base colour under a clear coat; `roughness`
    is that of the metal and of the coat. Facets are GGX with the Fresnel term by Schlick. The body gets what the coat
    leaves, by the coat's directional albedo on the way in and out, where glTF's sample code would reflect up to twice
    the light at grazing angles; and the metal gets back what facets reflect more than once. With `transmission` a part
    of the body is thin-walled glass of the base colour: light goes through as if mirrored to the other side.

    References: Khronos Group, "glTF 2.0 Specification", appendix B, and KHR_materials_transmission, _ior, _specular;
    Ashikhmin, Shirley 2000, "An Anisotropic Phong BRDF Model", sec. 3 (body and coat), with albedos as in Kelemen,
    Szirmay-Kalos 2001, "A Microfacet Based Coupled Specular-Matte BRDF Model"; Kulla, Conty 2017, "Revisiting
    Physically Based Shading at Imageworks".
    """

    type: Literal["principled"] = "principled"
    base_color: TexturedAlbedo = Field(default=(0.8, 0.8, 0.8), description="colour of the body, or of the metal")
    metallic: TexturedFraction = Field(default=0.0, description="0 is not a metal, 1 is one; between them a mixture")
    roughness: TexturedFraction = Field(
        default=0.5, description="0 is a mirror, 1 is dull; its square is the slope of the facets"
    )
    ior: Annotated[float, Quantity(low=1.0)] = Field(default=1.5, description="index of refraction of the coat")
    specular: Fraction = Field(default=1.0, description="strength of the coat's reflection; 0 is no coat")
    transmission: TexturedFraction = Field(
        default=0.0, description="part of the body that is thin-walled glass, with the coat's roughness"
    )
    emission: TexturedRadiance = Field(
        default=(0.0, 0.0, 0.0), description="radiance that it gives besides (W/(m2 sr)), on the side of the normal"
    )
    two_sided: bool = Field(default=False, description="give the `emission` to both sides")

    def is_index_matched(self) -> bool:
        # Facets bend light only by their index.
        clear = self.transmission == 1.0 and self.metallic == 0.0 and self.base_color == interface.WHITE
        return clear and self.ior == 1.0 and not self.is_emissive()

    def is_transmissive(self) -> bool:
        return not is_zero(self.transmission)

    def has_delta_bsdf(self) -> bool:
        return not isinstance(self.roughness, float) or self.roughness**2 < microfacet.SMOOTH_ALPHA

    def has_non_delta_bsdf(self) -> bool:
        body = not is_zero(self.base_color) and self.metallic != 1.0 and self.transmission != 1.0
        smooth = isinstance(self.roughness, float) and self.roughness**2 < microfacet.SMOOTH_ALPHA
        coated = self._coat() != (0.0, 0.0) and self.metallic != 1.0
        return body or (not smooth and (coated or not is_zero(self.base_color)))

    def _coat(self) -> tuple[float, float]:
        """Return the coat's Fresnel term as a + b (1 - cos)^5; equal indices are no coat."""
        if self.ior == 1.0:
            return 0.0, 0.0
        head_on = ((self.ior - 1.0) / (self.ior + 1.0)) ** 2
        return self.specular * head_on, self.specular * (1.0 - head_on)

    def is_emissive(self) -> bool:
        return not is_zero(self.emission)

    def flipped(self) -> "Principled":
        return self.model_copy(update={"two_sided": True})

    def emitted_power(self, book: ParameterPacker) -> float:
        return sum(book.mean(self.emission)) * (2.0 if self.two_sided else 1.0)

    @staticmethod
    def pack(specs: Sequence["Principled"], book: ParameterPacker) -> "PrincipledTable":
        roughness = [spec.roughness if isinstance(spec.roughness, float) else None for spec in specs]
        lost = microfacet.deficits(roughness, [(0.0,)] * len(specs))
        widths = np.diff(lost.cells[:, :, 0], axis=1)
        means = (0.5 * widths * (lost.cells[:, :-1, 3] + lost.cells[:, 1:, 3])).sum(axis=1)
        return PrincipledTable(
            book.colors([spec.base_color for spec in specs]),
            book.numbers([spec.metallic for spec in specs]),
            book.numbers([spec.roughness for spec in specs]),
            book.numbers([spec.transmission for spec in specs]),
            book.colors([spec.emission for spec in specs]),
            np.array([spec._coat() for spec in specs], np.float64),
            np.array([spec.two_sided for spec in specs], np.bool_),
            lost,
            np.ascontiguousarray(means),
        )


class PrincipledTable(NamedTuple):
    """Packed materials, one row each; base_color to emission are parameters.

    coat (n, 2) float64, two_sided (n,) bool : its Fresnel term a + b (1 - cos)^5; it emits to the back too.
    deficits, grazing (m,) float64 : of the facets; by row of these, the mean of `grazing_albedo` over the hemisphere.
    """

    base_color: ColorParameter
    metallic: NumberParameter
    roughness: NumberParameter
    transmission: NumberParameter
    emission: ColorParameter
    coat: NDArray[np.float64]
    two_sided: NDArray[np.bool_]
    deficits: microfacet.Deficits
    grazing: NDArray[np.float64]


class PrincipledRow(NamedTuple):
    """One material at one place; colours include their share of the material.

    base, rise : of the Fresnel term of metal and coat together, base + rise (1 - cos)^5.
    body, glass : colours.
    multiple : reflectance for light that facets reflect more than once.
    coat_base, coat_rise : of the Fresnel term of the coat alone.
    body_mean, lost_mean : transmittance of the coat for diffuse light, and the facets' deficit for it.
    """

    alpha: float
    base: Vec3
    rise: Vec3
    body: Vec3
    glass: Vec3
    multiple: Vec3
    coat_base: float
    coat_rise: float
    body_mean: float
    lost_mean: float
    cells: NDArray[np.float64]
    rows: microfacet.CellBlend


@routine
def _row(table, index, textures, site):
    """Make the record of `row`; a call, since textures may be looked up in six places."""
    base_color = color(table.base_color, index, textures, site)
    metal = number(table.metallic, index, textures, site)
    roughness = number(table.roughness, index, textures, site)
    clear = number(table.transmission, index, textures, site)
    alpha = min(1.0, roughness * roughness)
    a, b = table.coat[index, 0], table.coat[index, 1]
    cells = table.deficits.cells
    rows = microfacet.find_cells(table.deficits, index, max(microfacet.SMOOTH_ALPHA, alpha), 0)
    lost, grazing = 0.0, SCHLICK_MEAN
    if alpha >= microfacet.SMOOTH_ALPHA:
        lost = microfacet.mean_deficit(cells, rows)
        grazing = table.grazing[rows.low] + rows.blend * (table.grazing[rows.high] - table.grazing[rows.low])

    # Mix the metal with the coated body.
    mirror = scale(metal, base_color)
    rest = (1.0 - metal) * a
    rise = (1.0 - metal) * b + metal
    glass = scale((1.0 - metal) * clear, base_color)
    # Of what facets of glass scatter more than once, half leaves to each side.
    multiple = add(scale(metal, microfacet.multiple_albedo(fresnel_schlick_mean(base_color), lost)), scale(0.5, glass))
    return PrincipledRow(
        alpha,
        add(mirror, (rest, rest, rest)),
        sub((rise, rise, rise), mirror),
        scale((1.0 - metal) * (1.0 - clear), base_color),
        glass,
        multiple,
        a,
        b,
        1.0 - a * (1.0 - lost) - b * grazing,
        lost,
        cells,
        rows,
    )


@interface.row.register(PrincipledTable)
def row_principled_table(table, index, textures, site):
    return _row(table, index, textures, site)


class LobeWeights(NamedTuple):
    """Probabilities of the lobes for one direction of view; their sum is 1, or 0 where nothing is reflected.

    facets, mirrored at the facets; body; glass, mirrored and turned to the other side; multiple, and its part on the
    other side.  lost is the facets' deficit for that direction, and under what comes to the body through the coat.
    """

    facets: float
    body: float
    glass: float
    multiple: float
    beyond: float
    lost: float
    under: float


@kernel
def _mean(rgb: Vec3) -> float:
    return (rgb[0] + rgb[1] + rgb[2]) / 3.0


@kernel
def _energy_losses(material: PrincipledRow, z: float) -> tuple[float, float, float]:
    """Return, at height z, the facets' deficit, their grazing albedo, and the part that the coat leaves to the body."""
    lost, grazing = 0.0, schlick_weight(z)
    if material.alpha >= microfacet.SMOOTH_ALPHA:
        lost = microfacet.deficit(material.cells, material.rows, z)
        grazing = microfacet.grazing_albedo(material.cells, material.rows, z)
    return lost, grazing, max(0.0, 1.0 - material.coat_base * (1.0 - lost) - material.coat_rise * grazing)


@routine
def _lobe_weights(material: PrincipledRow, z: float) -> LobeWeights:
    """Return the probabilities of the lobes, by their directional albedos."""
    lost, grazing, under = _energy_losses(material, z)
    facets = _mean(material.base) * (1.0 - lost) + _mean(material.rise) * grazing
    body = _mean(material.body) * under
    glass = _mean(material.glass) * max(0.0, under - lost)
    multiple = _mean(material.multiple) * lost
    beyond = 0.5 * _mean(material.glass) * lost
    total = facets + body + glass + multiple + beyond
    share = 1.0 / total if total > 0.0 else 0.0
    return LobeWeights(share * facets, share * body, share * glass, share * multiple, share * beyond, lost, under)


@routine
def _evaluated(material: PrincipledRow, shares: LobeWeights, toward: Vec3, outgoing: Vec3) -> tuple[Vec3, float]:
    """Evaluate f |cos| and the pdf for directions in the surface's frame, both of which point away from it."""
    z = outgoing[2]
    if z == 0.0 or toward[2] <= 0.0:
        return interface.BLACK, 0.0
    smooth = material.alpha < microfacet.SMOOTH_ALPHA
    if z < 0.0:
        if smooth:
            return interface.BLACK, 0.0
        half = microfacet.half_vector(toward, (outgoing[0], outgoing[1], -z))
        once = microfacet.reflection_density(material.alpha, toward[2], -z, half)
        coat = material.coat_base + material.coat_rise * schlick_weight(dot(toward, half))
        value = scale((1.0 - coat) * once, material.glass)
        pdf = shares.glass * _pdf_mirrored(material.alpha, toward, half)
        lost, _, _ = _energy_losses(material, -z)
        spread = _multiple_scattering_pdf(material, lost, -z)
        return add(value, scale(0.5 * shares.lost * spread, material.glass)), pdf + shares.beyond * spread

    # What comes out of the body, and what leaves the facets after more than one reflection.
    lost, _, under = _energy_losses(material, z)
    under = shares.under * under / material.body_mean if material.body_mean > 0.0 else 0.0
    spread = _multiple_scattering_pdf(material, lost, z)
    value = add(scale(under * z / math.pi, material.body), scale(shares.lost * spread, material.multiple))
    pdf = shares.body * pdf_cosine_hemisphere(z) + shares.multiple * spread
    if smooth:
        return value, pdf

    # What facets mirror.
    half = microfacet.half_vector(toward, outgoing)
    once = microfacet.reflection_density(material.alpha, toward[2], z, half)
    fresnel = add(material.base, scale(schlick_weight(dot(toward, half)), material.rise))
    return add(value, scale(once, fresnel)), pdf + shares.facets * _pdf_mirrored(material.alpha, toward, half)


@kernel
def _multiple_scattering_pdf(material: PrincipledRow, lost: float, z: float) -> float:
    """Return the density (1/sr) of light that facets scatter more than once, to a height z with the deficit `lost`."""
    return lost * z / (math.pi * material.lost_mean) if material.lost_mean > 0.0 else 0.0


@kernel
def _pdf_mirrored(alpha: float, toward: Vec3, half: Vec3) -> float:
    """Return the density (1/sr) of the direction to which a visible facet mirrors light."""
    return microfacet.ggx(alpha, half) * microfacet.masking(alpha, toward[2]) / (4.0 * toward[2])


@interface.scatter.register(PrincipledRow)
def scatter_principled_row(material, direction, normal, front, draws):
    s, t = basis(normal)
    toward = microfacet.view_direction(direction, s, t, normal)
    shares = _lobe_weights(material, toward[2])
    lobe = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LOBE)
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.DIRECTION)
    if lobe < shares.body:
        outgoing = sample_cosine_hemisphere(u1, u2)
    elif lobe < shares.body + shares.multiple + shares.beyond:
        x, y, z = microfacet.sample_multiple_scattering(material.cells, material.rows, u1, u2)
        outgoing = (x, y, -z if lobe >= shares.body + shares.multiple else z)
    else:
        # All shares are 0 where nothing is reflected.
        through = shares.glass > 0.0 and lobe < 1.0 - shares.facets
        if material.alpha < microfacet.SMOOTH_ALPHA:
            return _smooth(material, shares, through, toward, direction, s, t, normal)
        x, y, z = microfacet.reflect_about(toward, microfacet.sample_visible_normal(material.alpha, toward, u1, u2))
        # What a facet sends below the surface is lost.
        if z <= 0.0:
            return interface.absorbed_scatter(direction)
        outgoing = (x, y, -z if through else z)
    value, pdf = _evaluated(material, shares, toward, outgoing)
    if not pdf > 0.0:
        return interface.absorbed_scatter(direction)
    return interface.Scatter(to_world(outgoing, s, t, normal), scale(1.0 / pdf, value), pdf)


@kernel
def _smooth(
    material: PrincipledRow,
    shares: LobeWeights,
    through: bool,
    toward: Vec3,
    direction: Vec3,
    s: Vec3,
    t: Vec3,
    normal: Vec3,
) -> interface.Scatter:
    """Return the one direction of a smooth coat, or of a smooth pane's far side."""
    weight = schlick_weight(toward[2])
    if through:
        coat = material.coat_base + material.coat_rise * weight
        return interface.Scatter(direction, scale((1.0 - coat) / shares.glass, material.glass), math.inf)
    if shares.facets == 0.0:
        return interface.absorbed_scatter(direction)
    fresnel = add(material.base, scale(weight, material.rise))
    mirror = to_world((-toward[0], -toward[1], toward[2]), s, t, normal)
    return interface.Scatter(mirror, scale(1.0 / shares.facets, fresnel), math.inf)


@interface.evaluate.register(PrincipledRow)
def evaluate_principled_row(material, direction, normal, front, outgoing):
    s, t = basis(normal)
    toward = microfacet.view_direction(direction, s, t, normal)
    return _evaluated(material, _lobe_weights(material, toward[2]), toward, to_local(outgoing, s, t, normal))


@interface.emission.register(PrincipledTable)
def emission_principled_table(table, index, front, textures, site):
    if front or table.two_sided[index]:
        return color(table.emission, index, textures, site)
    return interface.BLACK


@interface.reflectance.register(PrincipledRow)
def reflectance_principled_row(material):
    coat = 1.0 - material.coat_base
    return add(material.base, scale(coat, add(material.body, material.glass)))
