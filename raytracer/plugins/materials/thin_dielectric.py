"""Thin dielectric: a window pane or a bubble's film, both faces of which are one surface of the scene.

In a scene:

    window: {type: thin_dielectric, ior: 1.5, color: [0.9, 1.0, 0.95]}
    bubble: {type: thin_dielectric, ior: 1.33}
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.fresnel import fresnel_dielectric
from raytracer.core.sampling import sample_1d
from raytracer.core.vec import Vec3, dot, reflect
from raytracer.plugins.materials.base import interface
from raytracer.plugins.textures.base.interface import ColorParameter, ParameterPacker, TexturedAlbedo, color
from raytracer.schema.fields import PositiveNumber


class ThinDielectric(interface.MaterialSpec):
    """A pane of clear material too thin to shift what is seen through it: it mirrors, or lets light straight through.

    Light goes to and fro between the two faces; with the reflectance R of one, all together they reflect 2 R / (1 + R).
    Interference, as of soap films, is not simulated.

    References: Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates";
    Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 9.5.
    """

    type: Literal["thin_dielectric"] = "thin_dielectric"
    ior: PositiveNumber = Field(default=1.5, description="index of refraction of the pane over that around it")
    color: TexturedAlbedo = Field(
        default=(1.0, 1.0, 1.0), description="fraction of the light that goes through which is not absorbed, by channel"
    )

    def is_index_matched(self) -> bool:
        return self.ior == 1.0 and self.color == interface.WHITE

    def is_transmissive(self) -> bool:
        return True

    @staticmethod
    def pack(specs: Sequence["ThinDielectric"], book: ParameterPacker) -> "ThinDielectricTable":
        return ThinDielectricTable(
            np.array([spec.ior for spec in specs], np.float64), book.colors([spec.color for spec in specs])
        )


class ThinDielectricTable(NamedTuple):
    """Packed panes: eta (n,) float64, index inside over index outside; color, a parameter."""

    eta: NDArray[np.float64]
    color: ColorParameter


class ThinDielectricRow(NamedTuple):
    """One material."""

    eta: float
    color: Vec3


@interface.row.register(ThinDielectricTable)
def row_thin_dielectric_table(table, index, textures, site):
    return ThinDielectricRow(table.eta[index], color(table.color, index, textures, site))


@kernel
def pane_reflectance(cos_i: float, eta: float) -> float:
    """Return the reflectance of both faces of a clear pane: R + T R T + T R^3 T + ... = 2 R / (1 + R), T = 1 - R."""
    single, _ = fresnel_dielectric(cos_i, eta)
    return 2.0 * single / (1.0 + single)


@interface.scatter.register(ThinDielectricRow)
def scatter_thin_dielectric_row(material, direction, normal, front, draws):
    reflected = pane_reflectance(min(1.0, abs(dot(direction, normal))), material.eta)
    if sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LOBE) < reflected:
        return interface.Scatter(reflect(direction, normal), interface.WHITE, math.inf)
    return interface.Scatter(direction, material.color, math.inf)


@interface.reflectance.register(ThinDielectricRow)
def reflectance_thin_dielectric_row(material):
    return material.color
