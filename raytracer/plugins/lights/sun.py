"""Sun: light from so far away that it comes from the same directions everywhere.

In a scene:

    - {type: sun, direction: [-1, -2, -1], irradiance: [3.0, 2.9, 2.7]}
"""

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.geometry import row3
from raytracer.core.sampling import sample_2d
from raytracer.core.sampling.alias import AliasTable, build_alias
from raytracer.core.sampling.warp import one_minus_cosine, pdf_cone, sample_cone
from raytracer.core.vec import basis, dot, madd, neg, scale, sub, to_world
from raytracer.plugins.lights.base import interface
from raytracer.plugins.lights.base.light_choice import choose_light
from raytracer.plugins.materials.base.interface import BLACK, LIGHT_POINT
from raytracer.schema.fields import Direction, Quantity


class Sun(interface.LightSpec):
    """A disc at infinity of even radiance, or with angle 0 light that is exactly parallel.

    The disc is seen by the camera and in mirrors where nothing stands before it, on top of the environment.  Its
    radiance is irradiance / (pi sin^2(angle / 2)).
    """

    power: ClassVar[str] = "irradiance"

    type: Literal["sun"] = "sun"
    direction: Direction = Field(description="the direction in which the light travels, from the sun to the scene")
    irradiance: interface.Irradiance = Field(
        description="irradiance (W/m2) of a plane that faces the sun, by channel, or one number for all"
    )
    angle: Annotated[float, Quantity("angle", low=0.0, high=180.0)] = Field(
        default=0.53, description="angular diameter of the disc; 0: parallel light, which no ray can meet"
    )

    def sine2(self) -> float:
        """Return the squared sine of the disc's angular radius; 0 for parallel light."""
        return math.sin(math.radians(0.5 * self.angle)) ** 2

    def is_visible_to_paths(self) -> bool:
        return self.sine2() > 0.0 and self.shines()

    @staticmethod
    def pack(specs: Sequence["Sun"]) -> "Suns":
        irradiance = np.array([spec.irradiance for spec in specs], np.float64)
        return Suns(
            toward=np.array([neg(interface.unit_vector(spec.direction)) for spec in specs], np.float64),
            irradiance=irradiance,
            sine2=np.array([spec.sine2() for spec in specs], np.float64),
            choice=build_alias(irradiance.sum(axis=1)),
        )


class Suns(NamedTuple):
    """Packed suns, one row each.

    toward (n, 3) float64 : unit vector to the sun.
    irradiance (n, 3) float64 : of a plane that faces it.
    sine2 (n,) float64 : squared sine of the angular radius.
    choice : by irradiance.
    """

    toward: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    sine2: NDArray[np.float64]
    choice: AliasTable


@interface.sample_light.register(Suns)
def sample_light_suns(table, scene, point, time, u, draws):
    chosen, probability, _ = choose_light(table.choice, point, u)
    toward, sine2 = row3(table.toward, chosen), table.sine2[chosen]
    weight = scale(1.0 / probability, row3(table.irradiance, chosen))
    if sine2 == 0.0:
        return interface.infinite_light_sample(toward, weight, math.inf)

    # Of the irradiance, radiance pi sin^2, radiance over pdf leaves 2 (1 - cos) / sin^2.
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT_POINT)
    s, t = basis(toward)
    direction = to_world(sample_cone(u1, u2, sine2), s, t, toward)
    share = 2.0 * one_minus_cosine(sine2) / sine2
    return interface.infinite_light_sample(direction, scale(share, weight), probability * pdf_cone(sine2))


@interface.infinite_radiance.register(Suns)
def infinite_radiance_suns(table, scene, direction, pdf, heuristic):
    total = BLACK
    for row in range(len(table.sine2)):
        sine2 = table.sine2[row]
        if sine2 == 0.0:
            continue

        # The squared chord 2 (1 - cos) tells angles apart that have the same cosine in float64.
        chord = sub(direction, row3(table.toward, row))
        if dot(chord, chord) <= 2.0 * one_minus_cosine(sine2):
            by_light = table.choice.pmf[row] * pdf_cone(sine2)
            share = interface.mis_weight_path(heuristic, pdf, by_light) / (math.pi * sine2)
            total = madd(total, share, row3(table.irradiance, row))
    return total
