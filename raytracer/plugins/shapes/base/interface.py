"""What every shape kind gives to packing."""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.motion import Motion, matrix_at
from raytracer.primitives.interface import bounds
from raytracer.shapes.affine import Matrix
from raytracer.shutter import Shutter
from raytracer.spec import Name, ObjectSpec, Transform, at, matrix_of

Assets = Mapping[str, Any]
"""What an object's files held, by the key that names the file."""


class ShapeSpec(ObjectSpec):
    """Base of the shapes.

    closed : whether it has flat faces that enclose a volume, as far as that is known of them.
    faces : how many flat faces it has, for a kind that has always as many; if they enclose a volume, it is convex.
    """

    closed: ClassVar[bool] = False
    faces: ClassVar[int | None] = None

    type: str
    motion: Motion | None = Field(
        default=None,
        description="how the object moves in world space, after its transform: velocity (m/s), "
        "spin {axis, rate (deg/s), center} or keyframes [{time, transform}]",
    )

    def at_rest(self, time: float) -> Self:
        """The object as it is at a time of the scene (s), without its motion."""
        if self.motion is None:
            return self
        matrix = matrix_at(self.motion, time) @ matrix_of(self.transform)
        rows = tuple(tuple(map(float, row)) for row in matrix)
        return self.model_copy(update={"motion": None, "transform": Transform(matrix=rows)})

    def takes(self, matrix: Matrix) -> bool:
        """Whether its primitives can be packed under this transform; if not, it is placed by an instance instead."""
        return True

    def pack(self, matrix: Matrix, material: int, assets: Assets) -> Any:
        """The shape's rows of a primitive table, in world space.

        Raises
        ------
        ValueError : the matrix or an asset does not suit the shape; a sentence that says why.
        """
        raise NotImplementedError

    def box(self, assets: Assets) -> NDArray[np.float64]:
        """The least and the greatest coordinates (2, 3) of the shape, in all its forms, before its transform.

        Raises
        ------
        ValueError : an asset does not suit the shape; a sentence that says why.
        """
        return np.array(bounds(self.pack(np.eye(4), 0, assets)))

    def pack_exposed(self, matrix: Matrix, material: int, assets: Assets, shutter: Shutter) -> Any:
        """As `pack`, for what changes its form while the shutter is open; without regard to `motion`."""
        return self.pack(matrix, material, assets)


class PlacingSpec(ShapeSpec):
    """Base of the shapes that place what is defined elsewhere."""

    of: Name = Field(description="name of a group under `groups`, or of an object")
    material: Any = Field(
        default=None,
        description="name of a material, or a material itself, that takes the place of all materials in it",
    )

    @model_validator(mode="after")
    def _has_no_medium_of_its_own(self) -> "PlacingSpec":
        for key in ("medium", "outside_medium"):
            if self.material is None and getattr(self, key) is not None:
                at(key, "takes effect together with a `material` here; else give it to the objects that are placed")
        return self

    def poses(self, assets: Assets) -> NDArray[np.float64]:
        """Where copies are placed: matrices (n, 4, 4), n >= 1, `transform` included.

        Raises
        ------
        ValueError : what is asked for cannot be; a sentence that says why.
        """
        raise NotImplementedError
