"""Clear solids and liquids: their indices of refraction, absorption and priority, and dispersion in kernels."""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.spectra import FIRST, LAST
from raytracer.optics.glass import AIR, LINE_D, Glass, IndexField, constant_index_glass
from raytracer.plugins.materials.base.interface import BLACK, InteriorMedium, MaterialSpec
from raytracer.schema.fields import Color, Count, PositiveLength, Quantity, Triple, Vector
from raytracer.schema.rules import never, together

_Attenuation: TypeAlias = Annotated[
    Vector, Triple(Quantity(low=0.0, low_open=True, high=1.0), "a colour", single=True, color=True)
]


class ClearSpec(MaterialSpec):
    """Base of the boundaries of clear solids and liquids, which may overlap by priorities.

    References: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2); absorption: Beer 1852;
    attenuation by colour and distance: KHR_materials_volume of glTF.
    """

    ior: IndexField = Field(
        default=constant_index_glass(1.5),
        description="index of refraction on the inside: a number, a glass of the catalogue such as N-BK7, or {index, "
        "abbe}, {cauchy} or {sellmeier}; glass whose index depends on the wavelength disperses light",
    )
    outside_ior: IndexField = Field(
        default=AIR, description="index on the outside, likewise: of the glass that this one is embedded in"
    )
    priority: Annotated[int, Count(0, 2**31 - 1)] | None = Field(
        default=None,
        description="where objects overlap that have a priority, the one with the highest is there; takes the place of "
        "`outside_ior`",
    )
    absorption: Color | None = Field(
        default=None,
        description="absorption coefficient of the inside by channel (1/m); none by default; of a "
        "`rough_dielectric` it needs a `priority`",
    )
    attenuation_color: _Attenuation | None = Field(
        default=None, description="in place of `absorption`: the colour of white light after `attenuation_distance`"
    )
    attenuation_distance: PositiveLength | None = Field(
        default=None, description="the distance within which light takes on `attenuation_color` (m)"
    )

    _whole_attenuation = together(
        "attenuation_color",
        "attenuation_distance",
        message="is missing; attenuation_color and attenuation_distance go together",
    )
    _one_absorption = never(
        "absorption", where="attenuation_color", message="goes not with attenuation_color: give the one or the other"
    )
    _one_outside = never(
        "outside_ior",
        "outside_absorption",
        where="priority",
        message="goes not with priority, by which what is outside is found: leave it out",
    )

    def inside_absorption(self) -> Vector:
        """Return the absorption coefficient (1/m) of the inside, by channel."""
        if self.attenuation_color is not None and self.attenuation_distance is not None:
            r, g, b = (-math.log(left) / self.attenuation_distance for left in self.attenuation_color)
            return r, g, b
        return self.absorption or BLACK

    def interior_medium(self) -> InteriorMedium | None:
        return None if self.priority is None else InteriorMedium(self.priority, self.ior, self.inside_absorption())

    def disperses(self) -> bool:
        """Tell if the index on one of its sides depends on the wavelength."""
        return self.ior.disperses() or self.outside_ior.disperses()

    def eta(self, wavelength: float = LINE_D) -> float:
        """Return the index inside over that outside, for light of a wavelength (nm)."""
        return float(self.ior.ior(wavelength)) / float(self.outside_ior.ior(wavelength))

    def as_boundary_to(self, ior: Glass) -> MaterialSpec | None:
        if ior == self.ior:
            return None
        return self if ior == self.outside_ior else self.model_copy(update={"outside_ior": ior})

    def is_transmissive(self) -> bool:
        return True

    def has_interior(self) -> bool:
        return True


_PER_NANOMETRE = 2


class Dispersion(NamedTuple):
    """Indices that depend on the wavelength.

    eta (n, m) float64 : by material, index inside over index outside, at half nanometres from FIRST to LAST of
        `spectra`; between them it is linear, which for optical glass is right to 1e-6.
    disperses (n,) uint8 : 1 for a material that disperses.
    """

    eta: NDArray[np.float64]
    disperses: NDArray[np.uint8]


def pack_dispersion(specs: Sequence[ClearSpec]) -> Dispersion | None:
    """Pack the indices of boundaries by wavelength, a row each; None where none of them disperses."""
    if not any(spec.disperses() for spec in specs):
        return None
    wavelengths = np.linspace(FIRST, LAST, int(_PER_NANOMETRE * (LAST - FIRST)) + 1)
    rows = [spec.ior.ior(wavelengths) / spec.outside_ior.ior(wavelengths) for spec in specs]
    return Dispersion(np.array(rows, np.float64), np.array([spec.disperses() for spec in specs], np.uint8))


@kernel
def eta_at(dispersion: Dispersion, index: int, wavelength: float) -> float:
    """Return the index inside over that outside of boundary `index` of a table, at a wavelength (nm)."""
    place = _PER_NANOMETRE * (wavelength - FIRST)
    first = int(max(0, min(dispersion.eta.shape[1] - 2, int(place))))
    below, above = float(dispersion.eta[index, first]), float(dispersion.eta[index, first + 1])
    return below + (place - first) * (above - below)
