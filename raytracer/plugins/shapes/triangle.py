"""Triangle.

In a scene:

    - {type: triangle, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], material: wall}
"""

from typing import Literal

import numpy as np
from pydantic import Field, field_validator

from raytracer.core.geometry import pad_buffer
from raytracer.core.primitives.triangles import Triangles
from raytracer.plugins.shapes.base import affine
from raytracer.plugins.shapes.base.interface import Assets, ShapeSpec
from raytracer.schema.fields import Point


class Triangle(ShapeSpec):
    """A triangle; its outside is where its vertices run anticlockwise."""

    type: Literal["triangle"] = "triangle"
    vertices: tuple[Point, Point, Point] = Field(description="the three corners (m), anticlockwise seen from outside")

    @field_validator("vertices")
    @classmethod
    def _has_area(cls, vertices: tuple[Point, Point, Point]) -> tuple[Point, Point, Point]:
        a, b, c = np.asarray(vertices)
        if not np.any(np.cross(b - a, c - a)):
            raise ValueError("the three vertices lie on a line, so the triangle has no area")
        return vertices

    def pack(self, matrix: affine.Matrix, material: int, _: Assets) -> Triangles:
        corners = affine.transform_points(matrix, self.vertices[:: -1 if affine.is_mirrored(matrix) else 1])
        return Triangles(
            pad_buffer(corners, np.float32),
            pad_buffer(np.array([[0, 1, 2]]), np.uint32),
            affine.material_references(material),
        )
