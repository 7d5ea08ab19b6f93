"""Point light: light from a single point, evenly in all directions.

In a scene:

    - {type: point, position: [0, 5, 0], intensity: [10, 10, 10]}
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.geometry import row3
from raytracer.lights.interface import Intensity, LightSpec, choose, from_point, sample_light
from raytracer.sampling.alias import AliasTable, build_alias
from raytracer.spec import Point


class PointLight(LightSpec):
    """A point that radiates evenly: the irradiance of a surface at distance d is intensity cos / d^2.

    No ray can meet it, so it is not seen by the camera, in mirrors, or through glass.
    """

    type: Literal["point"] = "point"
    position: Point = Field(description="where it is")
    intensity: Intensity = Field(description="radiant intensity (W/sr) by channel, or one number for all")

    @staticmethod
    def pack(specs: Sequence["PointLight"]) -> "PointLights | None":
        shining = [spec for spec in specs if any(spec.intensity)]
        if not shining:
            return None
        intensity = np.array([spec.intensity for spec in shining], np.float64)
        return PointLights(
            position=np.array([spec.position for spec in shining], np.float64),
            intensity=intensity,
            choice=build_alias(intensity.sum(axis=1)),
        )


class PointLights(NamedTuple):
    """position and intensity (n, 3) float64; choice by power."""

    position: NDArray[np.float64]
    intensity: NDArray[np.float64]
    choice: AliasTable


@sample_light.register(PointLights)
def _(table, scene, point, time, u, draws):
    chosen, probability = choose(table.choice, u)
    return from_point(point, row3(table.position, chosen), row3(table.intensity, chosen), probability)
