"""Point light: light from a single point, evenly in all directions.

In a scene:

    - {type: point, position: [0, 5, 0], intensity: [10, 10, 10]}
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.geometry import row3
from raytracer.core.sampling.alias import AliasTable
from raytracer.plugins.lights.base.interface import Intensity, LightSpec, point_light_sample, sample_light
from raytracer.plugins.lights.base.light_choice import choose_light
from raytracer.plugins.lights.base.light_tree import LightTree, build_choice
from raytracer.schema.fields import Point


class PointLight(LightSpec):
    """A point that radiates evenly: the irradiance of a surface at distance d is intensity cos / d^2.

    No ray can meet it, so it is not seen by the camera, in mirrors, or through glass.
    """

    type: Literal["point"] = "point"
    position: Point = Field(description="where it is")
    intensity: Intensity = Field(description="radiant intensity (W/sr) by channel, or one number for all")

    @staticmethod
    def pack(specs: Sequence["PointLight"]) -> "PointLights":
        intensity = np.array([spec.intensity for spec in specs], np.float64)
        position = np.array([spec.position for spec in specs], np.float64)
        return PointLights(
            position=position, intensity=intensity, choice=build_choice(intensity.sum(axis=1), (position, position))
        )


class PointLights(NamedTuple):
    """Packed point lights: position and intensity (n, 3) float64; choice by power and distance."""

    position: NDArray[np.float64]
    intensity: NDArray[np.float64]
    choice: AliasTable | LightTree


@sample_light.register(PointLights)
def sample_light_point_lights(table, scene, point, time, u, draws):
    chosen, probability, _ = choose_light(table.choice, point, u)
    return point_light_sample(point, row3(table.position, chosen), row3(table.intensity, chosen), probability)
