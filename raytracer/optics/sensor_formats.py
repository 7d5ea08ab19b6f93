"""Sensors in scenes: their formats, and the settings of their simulation.

In a scene:

    camera: {type: thin_lens, sensor: aps_c, focal_length: 35 mm, f_number: 2}
    camera: {type: thin_lens, sensor: {width: 36 mm, height: 24 mm}, focal_length: 50 mm}
    camera: {type: thin_lens, sensor: {format: full_frame, noise: true, read_noise: 2.5}, focal_length: 50 mm,
             f_number: 2, shutter: 1/125 s, iso: 3200}
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.schema.fields import Check, Count, PositiveLensLength, Quantity
from raytracer.schema.rules import never, only
from raytracer.schema.spec import Spec, field_error
from raytracer.util.errors import format_value, suggest_name

SENSORS = {
    "medium_format": (53.7, 40.2),
    "full_frame": (36.0, 23.9),
    "aps_h": (27.9, 18.6),
    "aps_c": (23.6, 15.8),
    "four_thirds": (17.3, 13.0),
    "1-inch": (13.2, 8.8),
    "1/1.63-inch": (8.38, 5.59),
    "1/2.3-inch": (6.16, 4.62),
    "1/3.2-inch": (4.54, 3.42),
}
"""Width and height (mm) of the named formats."""

_MAX_BITS = 16


class SensorSize(NamedTuple):
    """Width and height of a part of a sensor (mm)."""

    width: float
    height: float


def _normalize_name(name: str) -> str:
    return name.lower().replace("-", "_").replace(" ", "_").removesuffix("_inch")


class _Format(Check):
    """The name of a sensor; hyphens, blanks and underscores are the same, and `inch` may be left out."""

    def __call__(self, value: Any) -> str:
        known = {_normalize_name(name): name for name in SENSORS}
        text = str(value) if isinstance(value, str | int) and not isinstance(value, bool) else ""
        if _normalize_name(text) not in known:
            raise ValueError(f"unknown sensor {format_value(value)}; {suggest_name(text, SENSORS, 'sensors')}")
        return known[_normalize_name(text)]

    def json_schema(self) -> JsonSchemaValue:
        """List the names as this module writes them."""
        return {"enum": list(SENSORS)}


class SensorSpec(Spec):
    """A sensor, by its name, `sensor: full_frame`, or by its size and by what it does to light."""

    format: Annotated[str, _Format()] | None = Field(default=None, description=f"name of a size: {', '.join(SENSORS)}")
    width: PositiveLensLength | None = Field(default=None, description="width (mm), in place of a name")
    height: PositiveLensLength | None = Field(default=None, description="height (mm), in place of a name")
    noise: bool = Field(
        default=False,
        description="whether the sensor is simulated: photon shot noise, read noise, saturation and quantization; "
        "without it the keys below do nothing",
    )
    full_well: Annotated[float, Quantity(low=1.0, high=1e9)] = Field(
        default=50_000.0, description="electrons that a pixel holds, which saturate it at the base ISO"
    )
    read_noise: Annotated[float, Quantity(low=0.0, high=1e9)] = Field(
        default=3.0, description="standard deviation of what reading adds (electrons)"
    )
    base_iso: Annotated[float, Quantity(low=1.0, high=1e6)] = Field(
        default=100.0, description="ISO speed at which a full well is the largest number; a higher one amplifies"
    )
    bit_depth: Annotated[int, Count(1, _MAX_BITS)] = Field(
        default=14, description="bits of the numbers that the converter gives"
    )
    black_level: Annotated[int, Count(0, 2**_MAX_BITS - 2)] | None = Field(
        default=None,
        description="number that the converter gives for no light, which is subtracted again; default: 1/32 of the "
        "range, which is 512 of 14 bits",
    )
    bayer: Literal["rggb", "bggr", "grbg", "gbrg"] | None = Field(
        default=None,
        description="colours of the filters on the first two pixels of the first two rows, what is missing being "
        "filled in (needs the extra raytracer[bayer]); without it each pixel records all three",
    )
    seed: Annotated[int, Count(0, 2**32 - 1)] | None = Field(
        default=None, description="seed of the noise; that of the render by default"
    )

    @model_validator(mode="after")
    def _black_is_below_white(self) -> "SensorSpec":
        if self.black() >= self.white():
            field_error("black_level", f"must be less than the largest number of {self.bit_depth} bits, {self.white()}")
        return self

    def white(self) -> int:
        """The largest number that the converter gives."""
        return int(2**self.bit_depth - 1)

    def black(self) -> int:
        """The number that it gives for no light."""
        return 2**self.bit_depth // 32 if self.black_level is None else self.black_level

    _one_size = never(
        "format",
        where=lambda sensor: sensor.width is not None or sensor.height is not None,
        message="format and width and height both set the size of the sensor: give one of them",
    )
    _has_a_height = only(
        "width", where="height", message="height is missing: a sensor's size is its width and its height"
    )
    _has_a_width = only(
        "height", where="width", message="width is missing: a sensor's size is its width and its height"
    )

    @model_validator(mode="after")
    def _simulates_what_it_sets(self) -> "SensorSpec":
        idle = self.model_fields_set - {"format", "width", "height"}
        if idle and "noise" not in idle:
            key = next(key for key in type(self).model_fields if key in idle)
            field_error(key, f"{key} does nothing without noise: true, which simulates the sensor")
        return self

    def size(self) -> SensorSize | None:
        """Return width and height (mm); None if they are not given."""
        if self.format is not None:
            return SensorSize(*SENSORS[self.format])
        if self.width is None or self.height is None:
            return None
        return SensorSize(self.width, self.height)


class _OrFormat:
    """Annotation of a sensor: a mapping, or the name of a size."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def named(value: Any) -> Any:
            return value if isinstance(value, Mapping | SensorSpec) else SensorSpec(format=_Format()(value))

        return core_schema.no_info_before_validator_function(named, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [_Format().json_schema(), handler(schema)]}


SensorField: TypeAlias = Annotated[SensorSpec, _OrFormat()]


def fit_sensor(sensor: SensorSize, width: int, height: int, fit: str) -> SensorSize:
    """Fit the shape of a film of width x height square pixels to a sensor (mm); the result may reach beyond it.

    fit : `crop`, the largest part of the film's shape; `overscan`, the smallest such rectangle around the sensor;
        `horizontal` or `vertical`, the one with the sensor's width or height.
    """
    across, down = sensor.width / width, sensor.height / height
    pixel = {"crop": min(across, down), "overscan": max(across, down), "horizontal": across, "vertical": down}[fit]
    return SensorSize(pixel * width, pixel * height)
