"""Box: six faces, parallel to the axes until a transform turns it.

In a scene:

    - {type: box, min: [0, 0, 0], max: [1, 2, 1], material: white, transform: [{rotate: {axis: [0, 1, 0], angle: 15}}]}
"""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.plugins.shapes.base import affine
from raytracer.plugins.shapes.base.interface import Assets, ShapeSpec
from raytracer.schema.fields import Point

# Corner, and the axes of the edges u and v, of each face of the unit cube, such that u x v points outwards.
_FACES = (
    ((0, 0, 0), 2, 1),
    ((1, 0, 0), 1, 2),
    ((0, 0, 0), 0, 2),
    ((0, 1, 0), 2, 0),
    ((0, 0, 0), 1, 0),
    ((0, 0, 1), 0, 1),
)


class Box(ShapeSpec):
    """A box between two opposite corners; a transform may turn or shear it."""

    is_closed: ClassVar[bool] = True
    faces: ClassVar[int | None] = 6

    type: Literal["box"] = "box"
    min: Point = Field(description="corner with the smallest coordinates (m)")
    max: Point = Field(description="corner with the largest coordinates (m)")

    @model_validator(mode="after")
    def _has_volume(self) -> "Box":
        if not all(low < high for low, high in zip(self.min, self.max, strict=True)):
            raise ValueError("every coordinate of min must be less than that of max")
        return self

    def pack(self, matrix: affine.Matrix, material: int, _: Assets) -> Parallelograms:
        size = np.subtract(self.max, self.min)
        corners = self.min + size * [corner for corner, _, _ in _FACES]
        edges = np.diag(size)
        first, second = (
            edges[[face[axis] for face in _FACES]] for axis in ((2, 1) if affine.is_mirrored(matrix) else (1, 2))
        )
        u, v = affine.transform_vectors(matrix, first), affine.transform_vectors(matrix, second)
        return Parallelograms(
            affine.transform_points(matrix, corners), u, v, affine.material_references(material, len(_FACES))
        )
