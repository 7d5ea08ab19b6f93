"""Types of fields with units and ranges, which annotate the keys of a kind: `radius: PositiveLength`.

A type names the dimension of its key: a `Length` is given in metres or with a unit (`50 mm`), an `Angle` in degrees, a
`Time` in seconds.  `units.py` parses the strings; the kind gets plain numbers in the unit of the dimension.
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.schema.spec import Spec, field_error
from raytracer.schema.units import Dimension, parse_quantity, quantity_pattern, unit_of
from raytracer.util import srgb
from raytracer.util.errors import format_value

Vector: TypeAlias = tuple[float, float, float]

# ---- Numbers

MAX_MAGNITUDE = 1e30
"""The largest magnitude of a number in a scene, in its base unit, and the inverse of the smallest but 0.

Products of ten of them are within float64, so squares and cubes of lengths, and their ratios, never leave it.  The
observable universe is 1e27 m wide, and a proton 1e-15 m.
"""

_RANGE = f"be 0, or of a magnitude between {1.0 / MAX_MAGNITUDE:g} and {MAX_MAGNITUDE:g}"


class Check(ABC):
    """Base of annotations that validate a field, and describe the valid values as JSON Schema."""

    @abstractmethod
    def __call__(self, value: Any) -> Any:
        """Validate a value; ValueError says what is wrong with it."""

    @abstractmethod
    def json_schema(self) -> JsonSchemaValue:
        """Describe the valid values."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self, serialization=core_schema.plain_serializer_function_ser_schema(lambda value: value)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return self.json_schema()


@dataclass(frozen=True)
class Quantity(Check):
    """Annotation of a float field: its dimension and range; strings with units are taken.

    `low` and `high` are inclusive unless `low_open` or `high_open`; `nonzero` bars 0; infinity needs `infinite`; what
    is smaller than 1 / MAX_MAGNITUDE, as the zeros of computed rotations are, needs `tiny`.
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
        """Convert a value to a number in the unit of the dimension."""
        number = parse_quantity(value, self.dimension)
        if math.isinf(number):
            if not self.infinite:
                raise ValueError(f"must be finite, got {format_value(value)}")
        elif abs(number) > MAX_MAGNITUDE or (0.0 < abs(number) < 1.0 / MAX_MAGNITUDE and not self.tiny):
            raise ValueError(f"must {_RANGE}, got {format_value(value)}")
        if number < self.low or (self.low_open and number == self.low):
            bound = f"{'greater than' if self.low_open else 'at least'} {self.low:g}"
            raise ValueError(f"must be {bound}, got {format_value(value)}")
        if number > self.high or (self.high_open and number == self.high):
            bound = f"{'less than' if self.high_open else 'at most'} {self.high:g}"
            raise ValueError(f"must be {bound}, got {format_value(value)}")
        if self.nonzero and number == 0.0:
            raise ValueError(f"must not be zero, got {format_value(value)}")
        return number

    def json_schema(self) -> JsonSchemaValue:
        """Describe a number in range, or a string with a unit; `x-unit` names the unit of plain numbers."""
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


# Lengths in the world (m).
Length: TypeAlias = Annotated[float, Quantity("length")]
NonZeroLength: TypeAlias = Annotated[float, Quantity("length", nonzero=True)]
PositiveLength: TypeAlias = Annotated[float, Quantity("length", low=0.0, low_open=True)]
NonNegativeLength: TypeAlias = Annotated[float, Quantity("length", low=0.0)]
PositiveLengthOrInf: TypeAlias = Annotated[float, Quantity("length", low=0.0, low_open=True, infinite=True)]

# Lengths of lenses, sensors and apertures (mm).
LensLength: TypeAlias = Annotated[float, Quantity("optic")]
PositiveLensLength: TypeAlias = Annotated[float, Quantity("optic", low=0.0, low_open=True)]
NonNegativeLensLength: TypeAlias = Annotated[float, Quantity("optic", low=0.0)]

# Angles (deg).
Angle: TypeAlias = Annotated[float, Quantity("angle")]
NonNegativeAngle: TypeAlias = Annotated[float, Quantity("angle", low=0.0)]
FieldOfView: TypeAlias = Annotated[float, Quantity("angle", low=0.0, low_open=True, high=180.0, high_open=True)]

# Times (s).
Time: TypeAlias = Annotated[float, Quantity("time")]
PositiveTime: TypeAlias = Annotated[float, Quantity("time", low=0.0, low_open=True)]
NonNegativeTime: TypeAlias = Annotated[float, Quantity("time", low=0.0)]

# Ratios of focal length to aperture.
FNumber: TypeAlias = Annotated[float, Quantity(low=0.0, low_open=True)]
FNumberOrInf: TypeAlias = Annotated[float, Quantity(low=0.0, low_open=True, infinite=True)]

# Pure numbers.
Number: TypeAlias = Annotated[float, Quantity()]
PositiveNumber: TypeAlias = Annotated[float, Quantity(low=0.0, low_open=True)]
NonNegativeNumber: TypeAlias = Annotated[float, Quantity(low=0.0)]
Fraction: TypeAlias = Annotated[float, Quantity(low=0.0, high=1.0)]


@dataclass(frozen=True)
class Count(Check):
    """Annotation of an int field: integers from `low` to `high`, both inclusive; 64.0 counts as 64."""

    low: int
    high: int

    def __call__(self, value: Any) -> int:
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"must be an integer, got {format_value(value)}")  # noqa: TRY004
        if value < self.low:
            raise ValueError(f"must be at least {self.low}, got {format_value(value)}")
        if value > self.high:
            raise ValueError(f"must be at most {self.high}, got {format_value(value)}")
        return value

    def json_schema(self) -> JsonSchemaValue:
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


# ---- Triples and pairs


def check_item(value: Any, check: Quantity, path: tuple[str | int, ...]) -> float:
    """Validate a number in a list; its error points at `path`, its place in the list.

    Raises
    ------
    ValidationError: not a number, or out of range.
    """
    try:
        return check(value)
    except ValueError as error:
        field_error(path, str(error))


def list_schema(component: Quantity, length: int, *, single: bool) -> JsonSchemaValue:
    """Describe a list of numbers, or one of its components; `x-unit` names the unit of plain numbers."""
    item = component.json_schema()
    unit = item.pop("x-unit", None)
    result: JsonSchemaValue = {"type": "array", "items": item, "minItems": length, "maxItems": length}
    if single:
        result = {"anyOf": [result, *item["anyOf"]]}
    return result | ({"x-unit": unit} if unit else {})


_HEX_COLOR = re.compile(r"#(?:[0-9a-fA-F]{3}){1,2}")


def is_hex_color(value: Any) -> bool:
    """Tell if a value is a colour as in HTML: `#b46450`, or `#fff` for `#ffffff`."""
    return isinstance(value, str) and _HEX_COLOR.fullmatch(value) is not None


def linear_color(text: str) -> Vector:
    """Convert a colour as in HTML, which is sRGB, to linear Rec. 709."""
    digits = text[1:] if len(text) == 7 else "".join(2 * digit for digit in text[1:])
    red, green, blue = srgb.decode([int(digits[at : at + 2], 16) / 255.0 for at in (0, 2, 4)]).tolist()
    return red, green, blue


def _is_of_bytes(values: Sequence[Any]) -> bool:
    """Tell if three values look like a colour of 0 to 255."""
    return all(type(x) is int and 0 <= x <= 255 for x in values) and max(values) > 1


@dataclass(frozen=True)
class Triple(Check):
    """Annotation of a field of three numbers, each checked by `component`."""

    component: Quantity
    noun: str
    single: bool = False
    """True if one number may stand for three equal ones."""
    color: bool = False
    """True if `'#rrggbb'`, in sRGB, may stand for three linear ones."""
    nonzero: bool = False
    """True if not all three may be zero."""

    def __call__(self, value: Any) -> Vector:
        if self.color and is_hex_color(value):
            value = linear_color(value)
        if isinstance(value, list | tuple):
            if len(value) != 3:
                raise ValueError(f"must be {self._wanted()}, got {format_value(value)}")
            if self.color and self.component.high == 1.0 and _is_of_bytes(value):
                written = "".join(f"{number:02x}" for number in value)
                raise ValueError(f"must be of at most 1, got {max(value)}; did you mean '#{written}', in sRGB?")
            x, y, z = value
            check = self._component
            result = (check_item(x, check, (0,)), check_item(y, check, (1,)), check_item(z, check, (2,)))
            if self.nonzero and result == (0.0, 0.0, 0.0):
                raise ValueError("must not be the zero vector")
            if 0.0 < max(map(abs, result)) < 1.0 / MAX_MAGNITUDE:
                raise ValueError(f"must {_RANGE}, got {format_value(value)}")
            return result
        if self.single and isinstance(value, int | float | str) and not isinstance(value, bool):
            number = self.component(value)
            return (number, number, number)
        raise ValueError(f"must be {self._wanted()}, got {format_value(value)}")

    @cached_property
    def _component(self) -> Quantity:
        # Next to a larger one, a component may come as close to 0 as rounding leaves it.
        return replace(self.component, tiny=not (self.component.nonzero or self.component.low_open))

    def _wanted(self) -> str:
        others = ["one for all three"] * self.single + ["'#rrggbb' in sRGB"] * self.color
        return f"{self.noun} of three numbers" + (f" (or {', or '.join(others)})" if others else "")

    def json_schema(self) -> JsonSchemaValue:
        result = list_schema(self.component, 3, single=self.single)
        if self.color:
            result["anyOf"] = [*result["anyOf"], {"type": "string", "pattern": f"^{_HEX_COLOR.pattern}$"}]
        return result


@dataclass(frozen=True)
class Pair(Check):
    """Annotation of a field of two numbers, each checked by `component`; one stands for both."""

    component: Quantity
    meaning: str = "to the right and upwards"
    """Words for the two numbers, in the sentence about a wrong value."""

    def __call__(self, value: Any) -> tuple[float, float]:
        if not isinstance(value, list | tuple):
            number = self.component(value)
            return number, number
        if len(value) != 2:
            raise ValueError(f"must be one number, or two, {self.meaning}, got {format_value(value)}")
        return check_item(value[0], self.component, (0,)), check_item(value[1], self.component, (1,))

    def json_schema(self) -> JsonSchemaValue:
        return list_schema(self.component, 2, single=True)


# Width and height (m).
Extent: TypeAlias = Annotated[tuple[float, float], Pair(Quantity("length", low=0.0, low_open=True))]

Point: TypeAlias = Annotated[Vector, Triple(Quantity("length"), "a point")]
Displacement: TypeAlias = Annotated[Vector, Triple(Quantity("length"), "a vector", nonzero=True)]
Direction: TypeAlias = Annotated[Vector, Triple(Quantity(), "a direction", nonzero=True)]
Color: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0), "a colour", single=True, color=True)]
Radiance: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0), "a radiance", single=True, color=True)]
Albedo: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0, high=1.0), "an albedo", single=True, color=True)]


# ---- Names


def check_name(value: Any) -> str:
    """Validate a name: a string that is not blank.

    Raises
    ------
    ValueError: it is something else.
    """
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"must be a name, got {format_value(value)}")
    return value


Name: TypeAlias = Annotated[str, BeforeValidator(check_name)]

INLINE_MATERIAL = "material"
"""Key of the validation context under which the scene hands its check of inline materials to the objects."""


def name_or_material(value: Any, info: ValidationInfo) -> Any:
    """Validate a field that holds a material: its name, or a mapping that is checked as one.

    Raises
    ------
    ValueError: neither.
    """
    if isinstance(value, Spec | Mapping):
        check = (info.context or {}).get(INLINE_MATERIAL)
        return check(value) if check else value
    return check_name(value)
