"""What every shape kind gives to packing."""

from collections.abc import Mapping
from typing import Any

from raytracer.shapes.affine import Matrix
from raytracer.spec import ObjectSpec

Assets = Mapping[str, Any]
"""What an object's files held, by the key that names the file."""


class ShapeSpec(ObjectSpec):
    """Base of the shapes."""

    type: str

    def pack(self, matrix: Matrix, material: int, assets: Assets) -> Any:
        """The shape's rows of a primitive table, in world space.

        Raises
        ------
        ValueError : the matrix or an asset does not suit the shape; a sentence that says why.
        """
        raise NotImplementedError
