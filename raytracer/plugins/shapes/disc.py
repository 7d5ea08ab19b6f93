"""Disc: a flat circle.

In a scene:

    - {type: disc, center: [0, 3, 0], normal: [0, -1, 0], radius: 0.5, material: lamp}
"""

from typing import Literal

import numpy as np
from pydantic import Field

from raytracer.core.primitives.discs import Discs
from raytracer.plugins.shapes.base import affine
from raytracer.plugins.shapes.base.interface import Assets, ShapeSpec
from raytracer.schema.fields import Direction, Point, PositiveLength


class Disc(ShapeSpec):
    """A flat circle that faces along its normal."""

    type: Literal["disc"] = "disc"
    center: Point = Field(description="centre (m)")
    normal: Direction = Field(description="direction of its outside")
    radius: PositiveLength = Field(description="radius (m)")

    def supports_transform(self, matrix: affine.Matrix) -> bool:
        return affine.is_uniform(matrix)

    def pack(self, matrix: affine.Matrix, material: int, _: Assets) -> Discs:
        radius = affine.uniform_scale(matrix) * self.radius
        center, normal = affine.transform_points(matrix, [self.center]), affine.transform_normals(matrix, [self.normal])
        return Discs(center, normal, np.array([radius]), affine.material_references(material))
