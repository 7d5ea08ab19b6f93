"""Disc: a flat circle.

In a scene:

    - {type: disc, center: [0, 3, 0], normal: [0, -1, 0], radius: 0.5, material: lamp}
"""

from typing import Literal

import numpy as np
from pydantic import Field

from raytracer.primitives.discs import Discs
from raytracer.shapes.affine import Matrix, is_uniform, normals, points, references, uniform_scale
from raytracer.shapes.interface import Assets, ShapeSpec
from raytracer.spec import Direction, Point, PositiveLength


class Disc(ShapeSpec):
    """A flat circle that faces along its normal."""

    type: Literal["disc"] = "disc"
    center: Point = Field(description="centre (m)")
    normal: Direction = Field(description="direction of its outside")
    radius: PositiveLength = Field(description="radius (m)")

    def takes(self, matrix: Matrix) -> bool:
        """Whether it stays a disc."""
        return is_uniform(matrix)

    def pack(self, matrix: Matrix, material: int, _: Assets) -> Discs:
        """One row."""
        radius = uniform_scale(matrix) * self.radius
        return Discs(
            points(matrix, [self.center]), normals(matrix, [self.normal]), np.array([radius]), references(material)
        )
