"""Interface of shapes: the spec's methods for packing."""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator

from raytracer.core.motion.resolve import matrix_at
from raytracer.core.motion.spec import Motion
from raytracer.core.primitives.base.interface import bounds
from raytracer.core.shutter.table import Shutter
from raytracer.plugins.shapes.base.affine import Matrix
from raytracer.schema.fields import Name, name_or_material
from raytracer.schema.rules import only
from raytracer.schema.spec import Spec
from raytracer.schema.transform import Transform, matrix_of

Assets = Mapping[str, Any]
"""Contents of an object's files, by the key that names the file."""


class ObjectSpec(Spec):
    """Base of the shapes: the keys that every object may have."""

    name: Name | None = Field(
        default=None, description="Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object"
    )
    material: Any = Field(
        default=None, description="Name of a material under `materials`, or a material itself: {type: ...}"
    )
    medium: Name | None = Field(
        default=None,
        description="Name of the medium under `media` that fills the object; without a material it has no surface",
    )
    outside_medium: Name | None = Field(
        default=None, description="Name of the medium round the object; the scene's `medium` by default"
    )
    transform: Transform | None = Field(
        default=None,
        description="Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], "
        "or a 4x4 matrix",
    )

    @field_validator("material", mode="before")
    @classmethod
    def _name_or_material(cls, value: Any, info: ValidationInfo) -> Any:
        return None if value is None else name_or_material(value, info)


class ShapeSpec(ObjectSpec):
    """Base of the shapes.

    is_closed : True for flat faces that are known to enclose a volume.
    faces : number of flat faces, for a kind with a fixed number; if they enclose a volume, it is convex.
    """

    is_closed: ClassVar[bool] = False
    faces: ClassVar[int | None] = None

    type: str
    motion: Motion | None = Field(
        default=None,
        description="how the object moves in world space, after its transform: velocity (m/s), "
        "spin {axis, rate (deg/s), center} or keyframes [{time, transform}]",
    )

    def at_time(self, time: float) -> Self:
        """Return the object as it is at a time of the scene (s), without its motion."""
        if self.motion is None:
            return self
        matrix = matrix_at(self.motion, time) @ matrix_of(self.transform)
        rows = tuple(tuple(map(float, row)) for row in matrix)
        return self.model_copy(update={"motion": None, "transform": Transform(matrix=rows)})

    def supports_transform(self, matrix: Matrix) -> bool:
        """Tell if its primitives can be packed under this transform; if not, it is placed by an instance."""
        return True

    def pack(self, matrix: Matrix, material: int, assets: Assets) -> Any:
        """Pack the shape's rows of a primitive table, in world space.

        Raises
        ------
        ValueError : the matrix or an asset does not suit the shape; a sentence that says why.
        """
        raise NotImplementedError

    def bounds(self, assets: Assets) -> NDArray[np.float64]:
        """Return the least and the greatest coordinates (2, 3) of the shape, in all its forms, before its transform.

        Raises
        ------
        ValueError : an asset does not suit the shape; a sentence that says why.
        """
        return np.array(bounds(self.pack(np.eye(4), 0, assets)))

    def pack_moving(self, matrix: Matrix, material: int, assets: Assets, shutter: Shutter) -> Any:
        """Pack a shape that changes its form while the shutter is open, as `pack` does; without regard to `motion`."""
        return self.pack(matrix, material, assets)


class PlacementSpec(ShapeSpec):
    """Base of the shapes that place groups or other objects."""

    of: Name = Field(description="name of a group under `groups`, or of an object")
    material: Any = Field(
        default=None,
        description="name of a material, or a material itself, that takes the place of all materials in it",
    )

    _has_no_medium_of_its_own = only(
        "medium",
        "outside_medium",
        where="material",
        message="takes effect together with a `material` here; else give it to the objects that are placed",
    )

    def poses(self, assets: Assets) -> NDArray[np.float64]:
        """Return the matrices (n, 4, 4) of the copies, n >= 1, `transform` included.

        Raises
        ------
        ValueError : what is asked for cannot be; a sentence that says why.
        """
        raise NotImplementedError
