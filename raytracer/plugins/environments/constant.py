"""Constant environment: the same radiance from everywhere.

In a scene:

    environment: {type: constant, radiance: 1}
"""

from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.environments.interface import Assets, EnvironmentSpec, background
from raytracer.spec import Radiance
from raytracer.vec import Vec3


class Constant(EnvironmentSpec):
    """The same radiance from all directions; 0 is no environment."""

    type: Literal["constant"] = "constant"
    radiance: Radiance = Field(description="radiance (W/(m2 sr)), by channel or grey")

    def pack(self, assets: Assets) -> "ConstantEnvironment | None":
        return ConstantEnvironment(self.radiance) if any(self.radiance) else None


class ConstantEnvironment(NamedTuple):
    """Packed."""

    radiance: Vec3


@background.register(ConstantEnvironment)
def _(environment, direction):
    return environment.radiance
