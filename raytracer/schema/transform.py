"""Transforms of objects: steps of scaling, rotation and translation, or a 4x4 matrix."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.schema.fields import MAX_MAGNITUDE, Angle, Direction, Point, Quantity, Triple, Vector, check_item
from raytracer.schema.rules import some_of
from raytracer.schema.spec import Spec
from raytracer.util.errors import format_value

Matrix: TypeAlias = npt.NDArray[np.float64]


class Rotate(Spec):
    """Rotation about an axis through the origin, counter-clockwise as seen from the axis' tip."""

    axis: Direction = Field(description="Axis; its length does not matter")
    angle: Angle = Field(description="Angle of rotation")


Scale: TypeAlias = Annotated[Vector, Triple(Quantity(nonzero=True), "a scale", single=True)]


class Step(Spec):
    """One step of a transform: exactly one of its keys."""

    scale: Scale | None = Field(default=None, description="Factor, or one factor an axis")
    rotate: Rotate | None = Field(default=None, description="Rotation about an axis through the origin")
    translate: Point | None = Field(default=None, description="Displacement")

    _one_step = some_of(
        "scale",
        "rotate",
        "translate",
        most=1,
        message="must hold exactly one of scale, rotate, translate; write one list item a step",
    )

    def matrix(self) -> Matrix:
        """Compute the step's (4, 4) matrix, for column vectors."""
        result = np.eye(4)
        if self.scale is not None:
            result[:3, :3] = np.diag(self.scale)
        if self.rotate is not None:
            result[:3, :3] = rotation_matrix(self.rotate.axis, self.rotate.angle)
        if self.translate is not None:
            result[:3, 3] = self.translate
        return result


_QUARTER_TURNS = {0: (1.0, 0.0), 1: (0.0, 1.0), 2: (-1.0, 0.0), 3: (0.0, -1.0)}


def rotation_matrix(axis: Vector, degrees: float) -> Matrix:
    """Compute Rodrigues' rotation matrix (3, 3) about an axis of any length, with exact quarter turns.

    References: https://mathworld.wolfram.com/RodriguesRotationFormula.html
    """
    # Divide by the largest component first: squares of the raw ones could overflow or vanish.
    unit = np.array(axis) / max(abs(component) for component in axis)
    x, y, z = unit / np.linalg.norm(unit)
    turn = math.fmod(degrees, 360.0)
    radians = math.radians(turn)
    cos, sin = _QUARTER_TURNS[int(turn // 90.0) % 4] if turn % 90.0 == 0.0 else (math.cos(radians), math.sin(radians))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    outer = np.outer((x, y, z), (x, y, z))
    return cos * np.eye(3) + sin * cross + (1.0 - cos) * outer


def translation_matrix(by: npt.ArrayLike) -> Matrix:
    """Make the matrix (4, 4) that displaces by a vector (3,)."""
    result = np.eye(4)
    result[:3, 3] = by
    return result


Rows: TypeAlias = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Transform:
    """Steps in the order in which they happen to the object, or a 4x4 matrix for column vectors.

    A scene writes a list of steps, `{matrix: ROWS}`, or the four rows themselves.
    """

    steps: tuple[Step, ...] = ()
    matrix: Rows | None = None

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(_transform, handler.generate_schema(list[Step]))

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        steps = handler(schema["schema"])
        row = {"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4}
        rows = {"type": "array", "items": row, "minItems": 4, "maxItems": 4}
        matrix = {
            "type": "object",
            "properties": {
                "matrix": {**rows, "description": "Four rows of four numbers, for column vectors; the last 0, 0, 0, 1"}
            },
            "required": ["matrix"],
            "additionalProperties": False,
        }
        return {"anyOf": [steps, matrix, rows]}


def _transform(value: Any, check_steps: Callable[[Any], list[Step]]) -> Transform:
    if isinstance(value, Transform):
        return value
    if isinstance(value, Mapping) and list(value) == ["matrix"]:
        return Transform(matrix=_rows(value["matrix"], ("matrix",)))
    if not isinstance(value, list | tuple):
        wanted = "a list of steps (scale, rotate, translate) or a 4x4 matrix"
        raise ValueError(f"must be {wanted}, got {format_value(value)}")  # noqa: TRY004
    if any(isinstance(row, list | tuple) for row in value):
        return Transform(matrix=_rows(value, ()))
    result = Transform(steps=tuple(check_steps(list(value))))
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        _require_invertible(matrix_of(result))
    return result


def _rows(value: Any, path: tuple[str, ...]) -> Rows:
    rows = value if isinstance(value, list | tuple) else ()
    if len(rows) != 4 or not all(isinstance(row, list | tuple) and len(row) == 4 for row in rows):
        raise ValueError("must be a 4x4 matrix, four rows of four numbers")
    check = Quantity(tiny=True)
    matrix = tuple(
        tuple(check_item(entry, check, (*path, i, j)) for j, entry in enumerate(row)) for i, row in enumerate(rows)
    )
    if matrix[3] != (0.0, 0.0, 0.0, 1.0):
        raise ValueError("must have [0, 0, 0, 1] as the last row of its matrix")
    _require_invertible(np.array(matrix))
    return matrix


def _require_invertible(matrix: Matrix) -> None:
    if not np.abs(matrix).max() <= MAX_MAGNITUDE:
        raise ValueError(f"scales or moves by more than {MAX_MAGNITUDE:g}")
    # Normalised columns, so that their directions decide and not their scale.
    sizes = np.abs(matrix[:3, :3]).max(axis=0)
    if sizes.min() < 1.0 / MAX_MAGNITUDE or np.linalg.matrix_rank(matrix[:3, :3] / sizes) < 3:
        raise ValueError("flattens the object: its matrix cannot be inverted")


TRANSFORM_ROUNDING = 2.0**-40
"""Rounding error of a transform's matrix, relative to its size, for a thousand steps.

Each step adds at most 8 * 2^-53: the gamma_3 of a product of 3x3 matrices, and the sines and cosines in its own matrix.
References: Higham 2002, "Accuracy and Stability of Numerical Algorithms", 2nd ed., sec. 3.5.
"""


def matrix_of(transform: Transform | None) -> Matrix:
    """Compute the (4, 4) float64 matrix, for column vectors, of a transform; identity for None."""
    if transform is None:
        return np.eye(4)
    if transform.matrix is not None:
        return np.array(transform.matrix)
    result = np.eye(4)
    for step in transform.steps:
        result = step.matrix() @ result
    return result
