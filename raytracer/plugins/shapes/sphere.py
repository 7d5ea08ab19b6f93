"""Sphere.

In a scene:

    - {type: sphere, center: [0, 1, 0], radius: 0.5, material: glass}
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from raytracer.core.primitives.spheres import Spheres
from raytracer.plugins.shapes.base import affine
from raytracer.plugins.shapes.base.interface import Assets, ShapeSpec
from raytracer.schema.fields import Length, Point


class Sphere(ShapeSpec):
    """A sphere; a negative radius turns its normal inwards, which makes a hollow inside glass."""

    type: Literal["sphere"] = "sphere"
    center: Point = Field(description="centre (m)")
    radius: Length = Field(description="radius (m), not zero; negative turns the normal inwards")

    @field_validator("radius")
    @classmethod
    def _not_zero(cls, radius: float) -> float:
        if radius == 0.0:
            raise ValueError("must not be zero")
        return radius

    def supports_transform(self, matrix: affine.Matrix) -> bool:
        return affine.is_uniform(matrix)

    def bounds(self, _: Assets) -> NDArray[np.float64]:
        return np.add(self.center, [[-abs(self.radius)], [abs(self.radius)]])

    def pack(self, matrix: affine.Matrix, material: int, _: Assets) -> Spheres:
        radius = affine.uniform_scale(matrix) * self.radius
        return Spheres(
            affine.transform_points(matrix, [self.center]), np.array([radius]), affine.material_references(material)
        )
