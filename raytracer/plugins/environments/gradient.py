"""Gradient environment: One Weekend's sky.

In a scene:

    environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1.0]}
"""

from typing import Literal, NamedTuple

from pydantic import Field

from raytracer.core.vec import Vec3, add, scale
from raytracer.plugins.environments.base.interface import Assets, EnvironmentSpec, background
from raytracer.schema.fields import Radiance


class Gradient(EnvironmentSpec):
    """Blends linearly with the height y of the unit direction: `horizon` at y = -1, `zenith` at y = +1.

    References: Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 4.2.
    """

    type: Literal["gradient"] = "gradient"
    horizon: Radiance = Field(default=(1.0, 1.0, 1.0), description="radiance straight down, at y = -1")
    zenith: Radiance = Field(default=(0.5, 0.7, 1.0), description="radiance straight up, at y = +1")

    def pack(self, assets: Assets) -> "GradientEnvironment | None":
        return GradientEnvironment(self.horizon, self.zenith) if any(self.horizon + self.zenith) else None


class GradientEnvironment(NamedTuple):
    """Packed gradient."""

    horizon: Vec3
    zenith: Vec3


@background.register(GradientEnvironment)
def background_gradient_environment(environment, direction):
    # A height that rounding has left below -1 would subtract light.
    a = min(1.0, max(0.0, 0.5 * (direction[1] + 1.0)))
    return add(scale(1.0 - a, environment.horizon), scale(a, environment.zenith))
