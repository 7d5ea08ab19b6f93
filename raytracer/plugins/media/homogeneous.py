"""Homogeneous: fog, smoke, milk, tinted liquids, the same everywhere.

In a scene:

    fog: {type: homogeneous, extinction: 0.01, albedo: 0.9, g: 0.5}
    juice: {type: homogeneous, absorption: [0.1, 2, 4], scattering: 0.5}
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import row3
from raytracer.core.vec import Vec3, is_black, scale
from raytracer.plugins.media.base import interface
from raytracer.schema.fields import Albedo


class Homogeneous(interface.MediumSpec):
    """A medium of the same density everywhere: what is absorbed and scattered per metre, by channel.

    Give `absorption` and `scattering`, one of which may be left out, or their sum `extinction` and the `albedo` that
    says which fraction of it is scattered.  Light is scattered by Henyey and Greenstein's phase function.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 11.1 and 14.2.
    """

    type: Literal["homogeneous"] = "homogeneous"
    absorption: interface.Coefficient | None = Field(default=None, description="absorbed per metre (1/m), by channel")
    scattering: interface.Coefficient | None = Field(default=None, description="scattered per metre (1/m), by channel")
    extinction: interface.Coefficient | None = Field(
        default=None, description="in place of both: their sum (1/m), by channel; 1 / extinction is the mean free path"
    )
    albedo: Albedo | None = Field(default=None, description="with `extinction`: the fraction of it that is scattered")
    g: interface.Asymmetry = Field(
        default=0.0, description="mean cosine of scattering: 1 forwards, 0 to all sides, -1 back to where it came from"
    )

    @model_validator(mode="after")
    def _one_way_to_say_it(self) -> "Homogeneous":
        parts = self.absorption is not None or self.scattering is not None
        if parts and (self.extinction is not None or self.albedo is not None):
            raise ValueError("must give absorption and scattering, or extinction and albedo, not some of both")
        if not parts and (self.extinction is None or self.albedo is None):
            raise ValueError("needs absorption or scattering, or else both extinction and albedo")
        return self

    def coefficients(self) -> tuple[Vec3, Vec3]:
        """Return (absorption, scattering), 1/m by channel."""
        if self.extinction is not None and self.albedo is not None:
            pairs = list(zip(self.extinction, self.albedo, strict=True))
            red, green, blue = (total * (1.0 - albedo) for total, albedo in pairs)
            r, g, b = (total * albedo for total, albedo in pairs)
            return (red, green, blue), (r, g, b)
        zero = (0.0, 0.0, 0.0)
        return self.absorption or zero, self.scattering or zero

    def is_clear(self, _: Mapping[str, Any]) -> bool:
        absorption, scattering = self.coefficients()
        return not any(absorption + scattering)

    def scatters(self) -> bool:
        return any(self.coefficients()[1])

    @staticmethod
    def pack(specs: Sequence["Homogeneous"], _: Sequence[Mapping[str, Any]]) -> "HomogeneousTable":
        absorption, scattering = (
            np.array(rows, np.float64) for rows in zip(*(spec.coefficients() for spec in specs), strict=True)
        )
        # The sum as it was given, if it was: an albedo of 1 then loses nothing to rounding.
        sums = zip((spec.extinction for spec in specs), absorption + scattering, strict=True)
        extinction = np.array([total if given is None else given for given, total in sums], np.float64)
        return HomogeneousTable(extinction, scattering, np.array([spec.g for spec in specs], np.float64))


class HomogeneousTable(NamedTuple):
    """Packed media, one row each.

    extinction, scattering (n, 3) float64 : coefficients (1/m) by channel.
    g (n,) float64 : mean cosine of scattering.
    """

    extinction: NDArray[np.float64]
    scattering: NDArray[np.float64]
    g: NDArray[np.float64]


class HomogeneousRow(NamedTuple):
    """One medium."""

    extinction: Vec3
    scattering: Vec3
    g: float


@interface.row.register(HomogeneousTable)
def row_homogeneous_table(table, index):
    return HomogeneousRow(row3(table.extinction, index), row3(table.scattering, index), table.g[index])


@kernel
def beer_lambert(extinction: Vec3, distance: float) -> Vec3:
    """Return the transmittance by channel; 1 where nothing is lost, however far light goes.

    References: Beer 1852, "Bestimmung der Absorption des rothen Lichts in farbigen Flüssigkeiten".
    """
    return (
        math.exp(-extinction[0] * distance) if extinction[0] > 0.0 else 1.0,
        math.exp(-extinction[1] * distance) if extinction[1] > 0.0 else 1.0,
        math.exp(-extinction[2] * distance) if extinction[2] > 0.0 else 1.0,
    )


@interface.sample_distance.register(HomogeneousRow)
def sample_distance_homogeneous_row(medium, origin, direction, distance, throughput, draws, numbers):
    """Draw a channel, then a distance by its extinction; weigh by the density that all channels have together.

    Channels are chosen by throughput, so the sum of the throughputs never grows: for equal ones it is the uniform
    choice with the balance heuristic.

    References: Pharr et al. 2016, "Physically Based Rendering", 3rd ed., sec. 15.2.1 (the balance of channels); Chiang
    et al. 2016, "Practical and Controllable Subsurface Scattering for Production Path Tracing" (by throughput).
    """
    # What only absorbs needs no chance.
    if is_black(medium.scattering):
        return interface.DistanceSample(math.inf, beer_lambert(medium.extinction, distance), numbers)
    u1, u2 = interface.distance_numbers(draws, numbers)
    total = throughput[0] + throughput[1] + throughput[2]
    red, green, blue = throughput[0] / total, throughput[1] / total, throughput[2] / total
    chosen = medium.extinction[2]
    if u1 < red:
        chosen = medium.extinction[0]
    elif u1 < red + green or blue == 0.0:
        chosen = medium.extinction[1]
    flown = -math.log1p(-u2) / chosen if chosen > 0.0 else math.inf
    come = beer_lambert(medium.extinction, min(flown, distance))
    if flown < distance:
        pdf = (
            red * medium.extinction[0] * come[0]
            + green * medium.extinction[1] * come[1]
            + blue * medium.extinction[2] * come[2]
        )
        weight = (
            medium.scattering[0] * come[0] / pdf,
            medium.scattering[1] * come[1] / pdf,
            medium.scattering[2] * come[2] / pdf,
        )
        return interface.DistanceSample(flown, weight, numbers + 1)
    probability = red * come[0] + green * come[1] + blue * come[2]
    return interface.DistanceSample(math.inf, scale(1.0 / probability, come), numbers + 1)


@interface.transmittance.register(HomogeneousRow)
def transmittance_homogeneous_row(medium, origin, direction, distance, draws, numbers):
    return beer_lambert(medium.extinction, distance), numbers
