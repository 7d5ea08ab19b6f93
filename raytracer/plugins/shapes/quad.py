"""Quad: a parallelogram.

In a scene:

    - {type: quad, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 1, 0]], material: wall}
"""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.plugins.shapes.base import affine
from raytracer.plugins.shapes.base.interface import Assets, ShapeSpec
from raytracer.schema.fields import Point


class Quad(ShapeSpec):
    """A parallelogram; its normal is u x v."""

    faces: ClassVar[int | None] = 1

    type: Literal["quad"] = "quad"
    corner: Point = Field(description="one corner (m)")
    edges: tuple[Point, Point] = Field(description="the two edges from the corner, u and v (m); the normal is u x v")

    @field_validator("edges")
    @classmethod
    def _has_area(cls, edges: tuple[Point, Point]) -> tuple[Point, Point]:
        if not np.any(np.cross(*edges)):
            raise ValueError("the two edges must be neither zero nor parallel, or the quad has no area")
        return edges

    def pack(self, matrix: affine.Matrix, material: int, _: Assets) -> Parallelograms:
        edges = self.edges[::-1] if affine.is_mirrored(matrix) else self.edges
        u, v = (affine.transform_vectors(matrix, [edge]) for edge in edges)
        return Parallelograms(
            affine.transform_points(matrix, [self.corner]), u, v, affine.material_references(material)
        )
