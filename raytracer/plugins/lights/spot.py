"""Spot light: light from a single point into a cone.

In a scene:

    - {type: spot, position: [0, 4, 0], look_at: [0, 0, 0], intensity: 50, angle: 40, penumbra: 5}
"""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.geometry import row3
from raytracer.core.sampling.alias import AliasTable
from raytracer.core.vec import Vec3, cross, dot, norm, scale, sub
from raytracer.plugins.lights.base import interface
from raytracer.plugins.lights.base.light_choice import choose_light
from raytracer.plugins.lights.base.light_tree import LightTree, build_choice
from raytracer.schema.fields import Direction, NonNegativeAngle, Point, Quantity
from raytracer.schema.rules import some_of
from raytracer.schema.spec import field_error


class SpotLight(interface.LightSpec):
    """A point that radiates into a cone: evenly, and within the penumbra less and less, down to nothing at the edge.

    The falloff over the penumbra is linear in the angle from the axis.  No ray can meet the light itself.
    """

    type: Literal["spot"] = "spot"
    position: Point = Field(description="where it is")
    direction: Direction | None = Field(default=None, description="the cone's axis, along which the light travels")
    look_at: Point | None = Field(default=None, description="a point on the axis, in place of `direction`")
    intensity: interface.Intensity = Field(
        description="radiant intensity on the axis (W/sr) by channel, or one number for all"
    )
    angle: Annotated[float, Quantity("angle", low=0.0, low_open=True, high=180.0)] = Field(
        description="the cone's full angle, edge to edge"
    )
    penumbra: NonNegativeAngle = Field(
        default=0.0,
        description="angle within the cone, from its edge inwards, over which the intensity rises; 0: at once",
    )

    _one_aim = some_of("direction", "look_at", most=1, message="needs exactly one of direction and look_at")

    @model_validator(mode="after")
    def _aimed(self) -> "SpotLight":
        if self.look_at == self.position:
            field_error("look_at", "is the light's own position, so it names no direction")
        if self.penumbra > 0.5 * self.angle:
            field_error("penumbra", f"must be at most half the angle, {0.5 * self.angle:g}, got {self.penumbra:g}")
        return self

    def axis(self) -> Vec3:
        """Return the unit vector along the axis, away from the light."""
        if self.direction is not None:
            return interface.unit_vector(self.direction)
        assert self.look_at is not None
        return interface.unit_vector(sub(self.look_at, self.position))

    def solid_angle(self) -> float:
        """Return the cone's solid angle (sr), its penumbra weighted by the falloff: flux over intensity.

        With the half angle h and the penumbra's inner edge b, the integral of 2 pi sin t f(t) with f = 1 up to b, and
        (h - t) / (h - b) beyond, is 2 pi (1 - (sin h - sin b) / (h - b)).
        """
        half = math.radians(0.5 * self.angle)
        inner = half - math.radians(self.penumbra)
        mean_cosine = (math.sin(half) - math.sin(inner)) / (half - inner) if half > inner else math.cos(half)
        return 2.0 * math.pi * (1.0 - mean_cosine)

    @staticmethod
    def pack(specs: Sequence["SpotLight"]) -> "SpotLights":
        position = np.array([spec.position for spec in specs], np.float64)
        return SpotLights(
            position=position,
            axis=np.array([spec.axis() for spec in specs], np.float64),
            intensity=np.array([spec.intensity for spec in specs], np.float64),
            half_angle=np.radians([0.5 * spec.angle for spec in specs]),
            penumbra=np.radians([spec.penumbra for spec in specs]),
            choice=build_choice(
                np.array([sum(spec.intensity) * spec.solid_angle() for spec in specs]), (position, position)
            ),
        )


class SpotLights(NamedTuple):
    """Packed spots: position, axis (unit) and intensity (n, 3); half angle and penumbra (n,) in radians: float64."""

    position: NDArray[np.float64]
    axis: NDArray[np.float64]
    intensity: NDArray[np.float64]
    half_angle: NDArray[np.float64]
    penumbra: NDArray[np.float64]
    choice: AliasTable | LightTree


@kernel
def falloff(angle: float, half: float, penumbra: float) -> float:
    """Return the intensity at an angle from the axis, over that on the axis."""
    inside = half - angle
    if inside < 0.0:
        return 0.0
    return inside / penumbra if inside < penumbra else 1.0


@interface.sample_light.register(SpotLights)
def sample_light_spot_lights(table, scene, point, time, u, draws):
    chosen, probability, _ = choose_light(table.choice, point, u)
    position, axis = row3(table.position, chosen), row3(table.axis, chosen)
    out = sub(point, position)
    angle = math.atan2(norm(cross(out, axis)), dot(out, axis))
    share = falloff(angle, table.half_angle[chosen], table.penumbra[chosen])
    return interface.point_light_sample(point, position, scale(share, row3(table.intensity, chosen)), probability)
