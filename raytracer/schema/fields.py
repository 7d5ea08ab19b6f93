"""What every kind's YAML schema is built of: the base classes `Spec` and `ObjectSpec`, and fields with units.

A kind declares its keys as annotated fields, and gets from them the check, the error sentence and the
documentation (JSON Schema); a field of several values is a tuple:

    class Sphere(ObjectSpec):
        type: Literal["sphere"] = "sphere"
        center: Point = Field(description="centre")
        radius: NonZeroLength = Field(description="radius; negative turns the normal inwards")

Checks across keys are `@model_validator(mode="after")` that raise ValueError with a sentence; `at("key", message)`
raises one that points at a key of the mapping.
"""

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Never, Self, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails, InitErrorDetails, PydanticCustomError, ValidationError, core_schema

from raytracer.errors import shown, suggestion
from raytracer.units import Dimension, parse_quantity, quantity_pattern, unit_of

Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = npt.NDArray[np.float64]

INLINE_MATERIAL = "material"
"""Key of the validation context under which the scene hands its check of inline materials to the objects."""


def at(key: str | int | tuple[str | int, ...], message: str) -> Never:
    """Raise from a model validator an error that points at `key` of the mapping (or a path below it)."""
    path = key if isinstance(key, tuple) else (key,)
    raise ValidationError.from_exception_data("spec", [_error(path, message)])


def _error(path: tuple[str | int, ...], message: str) -> InitErrorDetails:
    return InitErrorDetails(type=PydanticCustomError("spec", "{message}", {"message": message}), loc=path, input=None)


def class_noun(cls: type[BaseModel]) -> str:
    """What a sentence calls a mapping of this class: its `type`, or the class name in lower case."""
    field = cls.model_fields.get("type")
    return str(field.default) if field and isinstance(field.default, str) else cls.__name__.removesuffix("Spec").lower()


def a_noun(noun: str) -> str:
    """A noun with its article."""
    return f"an {noun}" if noun[0] in "aeiouAEIOU" else f"a {noun}"


class Spec(BaseModel):
    """A checked mapping of the scene file: unknown keys are errors, values are never coerced, instances are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    loads: ClassVar[Mapping[str, str]] = {}
    """Keys that name files, relative to the scene, and what each is read as."""

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        """The files that it names: by path of keys, the name and what it is read as."""
        given = ((key, getattr(self, key), kind) for key, kind in self.loads.items())
        return {(key,): (name, kind) for key, name, kind in given if name is not None}

    @classmethod
    def own_keys_first(cls) -> list[str]:
        """Its keys, those that all mappings of its family have at the end."""
        keys = (key for base in cls.__mro__ for key in vars(base).get("__annotations__", ()))
        return [key for key in dict.fromkeys(keys) if key in cls.model_fields]

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys_only(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(data, cls):
            return data
        if not isinstance(data, Mapping):
            given = a_noun(class_noun(type(data))) if isinstance(data, Spec) else shown(data)
            raise ValueError(f"must be a mapping ({', '.join(cls.model_fields)}), got {given}")  # noqa: TRY004

        # YAML's lists are fields' tuples, which cannot change either.
        known = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items() if k in cls.model_fields}
        if len(known) == len(data):
            return handler(known)

        # Tell the unknown keys with the other errors; a key that is missing is probably the one that is misspelt.
        noun = class_noun(cls)
        errors = [
            _error((key,), f"unknown key {shown(key)} of {noun}; {suggestion(str(key), cls.own_keys_first(), 'keys')}")
            for key in itertools.islice((key for key in data if key not in known), _UNKNOWN_TOLD)
        ]
        try:
            handler(known)
        except ValidationError as error:
            errors += [
                _error(item["loc"], sentence(item))
                for item in error.errors(include_url=False)
                if not (item["type"] == "missing" and len(item["loc"]) == 1)
            ]
        raise ValidationError.from_exception_data(cls.__name__, errors)


# ---- Sentences

_UNKNOWN_TOLD = 16
"""Unknown keys of a mapping that are looked for among the known ones: one of the first is what the user is told."""


def sentence(error: ErrorDetails) -> str:
    """What one of pydantic's errors says is wrong, in the words of YAML; the path stands before it."""
    kind, given, context = error["type"], shown(error["input"]), error.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "missing":
        last = error["loc"][-1]
        return "is missing" if isinstance(last, str) else f"is missing; the list needs at least {last + 1} values"
    if kind == "literal_error":
        known = [name.strip("'") for name in context["expected"].replace(" or ", ", ").split(", ")]
        return f"must be one of {', '.join(known)}, got {given}" + _meant(error["input"], known)
    if kind in ("too_short", "too_long"):
        bound = "at least" if kind == "too_short" else "at most"
        length = context["min_length"] if kind == "too_short" else context["max_length"]
        # Of mappings that are too long nobody has counted all.
        got = "more" if context["actual_length"] is None else context["actual_length"]
        return f"must hold {bound} {length} values, got {got}"
    if kind == "string_too_short":
        return "must not be empty"
    wanted = {
        "bool": "true or false",
        "string": "a text",
        "int": "a whole number",
        "float": "a number",
        "tuple": "a list",
        "list": "a list",
        "dict": "a mapping",
        "model": "a mapping",
    }.get(kind.removesuffix("_type").removesuffix("_parsing"))
    if wanted:
        return f"must be {wanted}, got {given}"
    message = str(error["msg"])
    return message.replace("Input should be", "must be", 1) + (f", got {given}" if "Input should be" in message else "")


def _meant(value: Any, known: list[str]) -> str:
    hint = suggestion(value, known, "") if isinstance(value, str) else ""
    return f"; {hint}" if hint.startswith("did you mean") else ""


# ---- Numbers

MOST = 1e30
"""The largest magnitude of a number in a scene, in its base unit, and the inverse of the smallest but 0.

Products of ten of them are within float64, so squares and cubes of lengths, and their ratios, never leave it.  The
observable universe is 1e27 m wide, and a proton 1e-15 m.
"""

_RANGE = f"be 0, or of a magnitude between {1.0 / MOST:g} and {MOST:g}"


class Check(ABC):
    """Annotation of a field: the check of its value, and that check as JSON Schema."""

    @abstractmethod
    def __call__(self, value: Any) -> Any:
        """The checked value; ValueError says what is wrong with it."""

    @abstractmethod
    def json_schema(self) -> JsonSchemaValue:
        """The values that pass."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self, serialization=core_schema.plain_serializer_function_ser_schema(lambda value: value)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return self.json_schema()


@dataclass(frozen=True)
class Quantity(Check):
    """Annotation of a float field: its dimension and range; texts with units are taken.

    `low` and `high` are inclusive unless `low_open` or `high_open`; `nonzero` bars 0; infinity needs `infinite`; what
    is smaller than 1 / MOST, as the zeros of computed rotations are, needs `tiny`.
    """

    dimension: Dimension = "number"
    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    high_open: bool = False
    nonzero: bool = False
    infinite: bool = False
    tiny: bool = False

    def __call__(self, value: Any) -> float:
        """The checked number.

        Raises
        ------
        ValueError: not a number, or out of range.
        """
        number = parse_quantity(value, self.dimension)
        if math.isinf(number):
            if not self.infinite:
                raise ValueError(f"must be finite, got {shown(value)}")
        elif abs(number) > MOST or (0.0 < abs(number) < 1.0 / MOST and not self.tiny):
            raise ValueError(f"must {_RANGE}, got {shown(value)}")
        if number < self.low or (self.low_open and number == self.low):
            raise ValueError(
                f"must be {'greater than' if self.low_open else 'at least'} {self.low:g}, got {shown(value)}"
            )
        if number > self.high or (self.high_open and number == self.high):
            raise ValueError(
                f"must be {'less than' if self.high_open else 'at most'} {self.high:g}, got {shown(value)}"
            )
        if self.nonzero and number == 0.0:
            raise ValueError(f"must not be zero, got {shown(value)}")
        return number

    def json_schema(self) -> JsonSchemaValue:
        """A number in range, or a text with a unit; `x-unit` names the unit of plain numbers."""
        number: JsonSchemaValue = {"type": "number"}
        if math.isfinite(self.low):
            number["exclusiveMinimum" if self.low_open else "minimum"] = self.low
        if math.isfinite(self.high):
            number["exclusiveMaximum" if self.high_open else "maximum"] = self.high
        if self.nonzero:
            number["not"] = {"const": 0}
        result: JsonSchemaValue = {"anyOf": [number, {"type": "string", "pattern": quantity_pattern(self.dimension)}]}
        if unit := unit_of(self.dimension):
            result["x-unit"] = unit
        return result


Length: TypeAlias = Annotated[float, Quantity("length")]
NonZeroLength: TypeAlias = Annotated[float, Quantity("length", nonzero=True)]
PositiveLength: TypeAlias = Annotated[float, Quantity("length", low=0.0, low_open=True)]
NonNegativeLength: TypeAlias = Annotated[float, Quantity("length", low=0.0)]
PositiveLengthOrInf: TypeAlias = Annotated[float, Quantity("length", low=0.0, low_open=True, infinite=True)]

Optic: TypeAlias = Annotated[float, Quantity("optic")]
PositiveOptic: TypeAlias = Annotated[float, Quantity("optic", low=0.0, low_open=True)]
NonNegativeOptic: TypeAlias = Annotated[float, Quantity("optic", low=0.0)]

Angle: TypeAlias = Annotated[float, Quantity("angle")]
PositiveAngle: TypeAlias = Annotated[float, Quantity("angle", low=0.0, low_open=True)]
NonNegativeAngle: TypeAlias = Annotated[float, Quantity("angle", low=0.0)]
FieldOfView: TypeAlias = Annotated[float, Quantity("angle", low=0.0, low_open=True, high=180.0, high_open=True)]

Time: TypeAlias = Annotated[float, Quantity("time")]
PositiveTime: TypeAlias = Annotated[float, Quantity("time", low=0.0, low_open=True)]
NonNegativeTime: TypeAlias = Annotated[float, Quantity("time", low=0.0)]

Number: TypeAlias = Annotated[float, Quantity()]
PositiveNumber: TypeAlias = Annotated[float, Quantity(low=0.0, low_open=True)]
NonNegativeNumber: TypeAlias = Annotated[float, Quantity(low=0.0)]
Fraction: TypeAlias = Annotated[float, Quantity(low=0.0, high=1.0)]


@dataclass(frozen=True)
class Count(Check):
    """Annotation of an int field: whole numbers from `low` to `high`, both inclusive; 64.0 counts as 64."""

    low: int
    high: int

    def __call__(self, value: Any) -> int:
        """The checked whole number.

        Raises
        ------
        ValueError: not a whole number, or out of range.
        """
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"must be a whole number, got {shown(value)}")  # noqa: TRY004
        if value < self.low:
            raise ValueError(f"must be at least {self.low}, got {shown(value)}")
        if value > self.high:
            raise ValueError(f"must be at most {self.high}, got {shown(value)}")
        return value

    def json_schema(self) -> JsonSchemaValue:
        """An integer in range."""
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


# ---- Triples


@dataclass(frozen=True)
class Triple(Check):
    """Annotation of a field of three numbers, each checked by `component`."""

    component: Quantity
    noun: str
    single: bool = False
    """One number stands for three equal ones."""
    nonzero: bool = False
    """Not all three may be zero."""

    def __call__(self, value: Any) -> Vector:
        """The checked triple.

        Raises
        ------
        ValueError: not three numbers, or a number out of range.
        """
        if isinstance(value, list | tuple):
            if len(value) != 3:
                raise ValueError(f"must be {self._wanted()}, got {shown(value)}")
            x, y, z = value
            result = (self._item(x, 0), self._item(y, 1), self._item(z, 2))
            if self.nonzero and result == (0.0, 0.0, 0.0):
                raise ValueError("must not be the zero vector")
            if 0.0 < max(map(abs, result)) < 1.0 / MOST:
                raise ValueError(f"must {_RANGE}, got {shown(value)}")
            return result
        if self.single and isinstance(value, int | float | str) and not isinstance(value, bool):
            number = self.component(value)
            return (number, number, number)
        raise ValueError(f"must be {self._wanted()}, got {shown(value)}")

    def _item(self, value: Any, index: int) -> float:
        # Next to a larger one, a component may come as close to 0 as rounding leaves it.
        tiny = not (self.component.nonzero or self.component.low_open)
        return _entry(value, replace(self.component, tiny=tiny), (index,))

    def _wanted(self) -> str:
        return f"{self.noun} of three numbers" + (" (or one number for all three)" if self.single else "")

    def json_schema(self) -> JsonSchemaValue:
        """An array of three, or one of its components; `x-unit` names the unit of plain numbers."""
        item = self.component.json_schema()
        unit = item.pop("x-unit", None)
        result: JsonSchemaValue = {"type": "array", "items": item, "minItems": 3, "maxItems": 3}
        if self.single:
            result = {"anyOf": [result, *item["anyOf"]]}
        if unit:
            result["x-unit"] = unit
        return result


@dataclass(frozen=True)
class Pair(Check):
    """Annotation of a field of two numbers, right and up, each checked by `component`; one stands for both."""

    component: Quantity

    def __call__(self, value: Any) -> tuple[float, float]:
        """The checked pair.

        Raises
        ------
        ValueError: neither two numbers nor one, or a number out of range.
        """
        if not isinstance(value, list | tuple):
            number = self.component(value)
            return number, number
        if len(value) != 2:
            raise ValueError(f"must be one number, or two, to the right and upwards, got {shown(value)}")
        return _entry(value[0], self.component, (0,)), _entry(value[1], self.component, (1,))

    def json_schema(self) -> JsonSchemaValue:
        """An array of two, or one of its components; `x-unit` names the unit of plain numbers."""
        item = self.component.json_schema()
        unit = item.pop("x-unit", None)
        result: JsonSchemaValue = {"anyOf": [{"type": "array", "items": item, "minItems": 2, "maxItems": 2}]}
        result["anyOf"] += item["anyOf"]
        return result | ({"x-unit": unit} if unit else {})


Extent: TypeAlias = Annotated[tuple[float, float], Pair(Quantity("length", low=0.0, low_open=True))]

Point: TypeAlias = Annotated[Vector, Triple(Quantity("length"), "a point")]
Displacement: TypeAlias = Annotated[Vector, Triple(Quantity("length"), "a vector", nonzero=True)]
Direction: TypeAlias = Annotated[Vector, Triple(Quantity(), "a direction", nonzero=True)]
Color: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0), "a colour", single=True)]
Radiance: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0), "a radiance", single=True)]
Albedo: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0, high=1.0), "an albedo", single=True)]


# ---- Transforms


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

    @model_validator(mode="after")
    def _exactly_one(self) -> "Step":
        if sum(step is not None for step in (self.scale, self.rotate, self.translate)) != 1:
            raise ValueError("must hold exactly one of scale, rotate, translate; write one list item a step")
        return self

    def matrix(self) -> Matrix:
        """The step's (4, 4) matrix, for column vectors."""
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
    """Rodrigues' rotation matrix (3, 3) about an axis of any length, with exact quarter turns.

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
        raise ValueError(f"must be {wanted}, got {shown(value)}")  # noqa: TRY004
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
        tuple(_entry(entry, check, (*path, i, j)) for j, entry in enumerate(row)) for i, row in enumerate(rows)
    )
    if matrix[3] != (0.0, 0.0, 0.0, 1.0):
        raise ValueError("must have [0, 0, 0, 1] as the last row of its matrix")
    _require_invertible(np.array(matrix))
    return matrix


def _require_invertible(matrix: Matrix) -> None:
    if not np.abs(matrix).max() <= MOST:
        raise ValueError(f"scales or moves by more than {MOST:g}")
    # Columns of one size, so that it is their directions that decide and not how much they scale.
    sizes = np.abs(matrix[:3, :3]).max(axis=0)
    if sizes.min() < 1.0 / MOST or np.linalg.matrix_rank(matrix[:3, :3] / sizes) < 3:
        raise ValueError("flattens the object: its matrix cannot be inverted")


def _entry(value: Any, check: Quantity, path: tuple[str | int, ...]) -> float:
    try:
        return check(value)
    except ValueError as error:
        at(path, str(error))


TRANSFORM_ROUNDING = 2.0**-40
"""What a transform's matrix may be off by, relative to its size, by rounding alone, for a thousand steps.

Each step adds at most 8 * 2^-53: the gamma_3 of a product of 3x3 matrices, and the sines and cosines in its own matrix.
References: Higham 2002, "Accuracy and Stability of Numerical Algorithms", 2nd ed., sec. 3.5.
"""


def matrix_of(transform: Transform | None) -> Matrix:
    """The (4, 4) float64 matrix, for column vectors, of a transform; identity for None."""
    if transform is None:
        return np.eye(4)
    if transform.matrix is not None:
        return np.array(transform.matrix)
    result = np.eye(4)
    for step in transform.steps:
        result = step.matrix() @ result
    return result


# ---- Objects


def _name(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"must be a name, got {shown(value)}")
    return value


Name: TypeAlias = Annotated[str, BeforeValidator(_name)]


def name_or_material(value: Any, info: ValidationInfo) -> Any:
    """The check of a field that holds a material: its name, or a mapping that is checked as one.

    Raises
    ------
    ValueError: neither.
    """
    if isinstance(value, Spec | Mapping):
        check = (info.context or {}).get(INLINE_MATERIAL)
        return check(value) if check else value
    return _name(value)


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
