"""Constant environment: the same radiance from everywhere.

In a scene:

    environment: {type: constant, radiance: 1}
"""

from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.vec import Vec3
from raytracer.plugins.environments.base.interface import Assets, EnvironmentSpec, background
from raytracer.schema.fields import Radiance


class Constant(EnvironmentSpec):
    """The same radiance from all directions; 0 is no environment."""

    type: Literal["constant"] = "constant"
    radiance: Radiance = Field(description="radiance (W/(m2 sr)), by channel or grey")

    def pack(self, assets: Assets) -> "ConstantEnvironment | None":
        return ConstantEnvironment(self.radiance) if any(self.radiance) else None


class ConstantEnvironment(NamedTuple):
    """Packed radiance."""

    radiance: Vec3


@background.register(ConstantEnvironment)
def background_constant_environment(environment, direction):
    return environment.radiance
