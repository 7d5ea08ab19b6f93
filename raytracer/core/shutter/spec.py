"""Shutters as scenes write them: a duration, times, a curve of transmission, a readout.

In a scene:

    camera: {type: pinhole, shutter: 1/125 s, time: 2}
    camera: {type: pinhole, shutter: {open: 0, close: 1}}
    camera: {type: pinhole, shutter: {duration: 1/500 s, opening: trapezoid, ramp: 1/4000 s}}
    camera: {type: pinhole, shutter: {opening: [[0, 0], [2 ms, 1], [6 ms, 0.5], [8 ms, 0]]}}
    camera: {type: pinhole, shutter: {duration: 1/1000 s, readout: 1/30 s, direction: down}}
    camera: {type: pinhole, shutter: {duration: 1/1000 s, readout: 1/250 s, curtain: focal_plane}}

A *line* is what is exposed at one time: the whole film, or with a readout time one of its rows or columns.  Line y of n
begins to open `readout` y / n after the first.  Of an `electronic` shutter lines are rows or columns of pixels; a
`focal_plane` shutter lets light through a slit that travels, so that there every point of the film is a line.

References: ISO 516:2019 (a shutter's opening, its full width at half maximum); Liang, Chang, Chen 2008, "Analysis and
Compensation of Rolling Shutter Effect", IEEE Trans. Image Processing 17(8), sec. II.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.core.shutter.timing import Profile, Timing, ensure_distinct_times
from raytracer.schema.fields import Check, NonNegativeTime, Quantity, Time
from raytracer.schema.rules import exclusive, only, requires
from raytracer.schema.spec import Spec, field_error
from raytracer.util.errors import format_value


class _Opening(Check):
    """Annotation of a shutter's opening: a word, or a curve [[time, transmission], ...]."""

    _words = ("instant", "trapezoid")
    _columns = (Quantity("time", low=0.0), Quantity(low=0.0, high=1.0))

    def __call__(self, value: Any) -> str | Profile:
        """Check the word, or the points of the curve.

        Raises
        ------
        ValueError : neither, or a curve that goes back in time or lets no light through.
        """
        if isinstance(value, str) and value in self._words:
            return value
        if not isinstance(value, list | tuple):
            wanted = " or ".join(self._words)
            raise ValueError(f"must be {wanted}, or [[time, transmission], ...], got {format_value(value)}")  # noqa: TRY004
        for number, point in enumerate(value):
            if not isinstance(point, list | tuple) or len(point) != 2:
                field_error(number, f"must be a time and a transmission, got {format_value(point)}")
        points = tuple((self._entry(point, i, 0), self._entry(point, i, 1)) for i, point in enumerate(value))
        for number, (before, after) in enumerate(pairwise(points), start=1):
            if after[0] <= before[0]:
                field_error((number, 0), f"must be later than the point before, {before[0]:g} s, got {after[0]:g} s")
        if len(points) < 2 or not any(transmission for _, transmission in points):
            raise ValueError("lets no light through: it needs two points, of which one has a transmission above 0")
        return points

    def _entry(self, point: Sequence[Any], number: int, column: int) -> float:
        try:
            return self._columns[column](point[column])
        except ValueError as error:
            field_error((number, column), str(error))

    def json_schema(self) -> JsonSchemaValue:
        """Describe a word, or an array of pairs."""
        items = [column.json_schema() for column in self._columns]
        point = {"type": "array", "prefixItems": items, "minItems": 2, "maxItems": 2}
        return {"anyOf": [{"enum": list(self._words)}, {"type": "array", "items": point, "minItems": 2}]}


class ShutterSpec(Spec):
    """The time in which light is gathered."""

    open: Time | None = Field(
        default=None, description="time of the scene at which the shutter begins to open (s); default 0"
    )
    close: Time | None = Field(default=None, description="time of the scene at which it begins to close (s)")
    duration: NonNegativeTime | None = Field(
        default=None, description="for how long it is open (s), in place of `close`; with a ramp, at half its height"
    )
    opening: Annotated[str | Profile, _Opening()] = Field(
        default="instant",
        description="instant; or trapezoid, which opens and closes linearly within `ramp`; or a curve "
        "[[time, transmission], ...], with times in seconds after it begins to open, linear between these points",
    )
    ramp: NonNegativeTime | None = Field(
        default=None, description="time (s) in which a trapezoid opens, and closes; at most the duration"
    )
    readout: NonNegativeTime = Field(
        default=0.0,
        description="rolling shutter: time (s) that it takes from one edge of the picture to the other; 0: all at once",
    )
    direction: Literal["down", "up", "left", "right"] = Field(
        default="down", description="direction in the picture in which the readout, or the slit, travels"
    )
    curtain: Literal["electronic", "focal_plane"] = Field(
        default="electronic",
        description="electronic: whole rows or columns of pixels are exposed at once; focal_plane: a slit travels "
        "continuously",
    )

    _is_open_for_its_curve = only(
        "close",
        "duration",
        where=lambda shutter: isinstance(shutter.opening, str),
        message="the curve of `opening` says for how long the shutter is open: leave this out",
    )
    _is_open_for_some_time = requires(
        "close",
        where=lambda shutter: isinstance(shutter.opening, str) and shutter.duration is None,
        message="is missing: a shutter needs `close`, `duration`, or a curve as its `opening`",
    )
    _is_open_for_one_time = exclusive(
        "close", "duration", message="{key} and {first} both say for how long the shutter is open: give one of them"
    )

    @model_validator(mode="after")
    def _closes_after_it_opens(self) -> "ShutterSpec":
        if self.close is not None and self.close < (self.open or 0.0):
            field_error("close", f"must not be before the shutter opens, {self.open or 0.0:g} s, got {self.close:g} s")
        return self

    _has_a_trapezoid = only(
        "ramp",
        where={"opening": "trapezoid"},
        message="belongs to `opening: trapezoid`, which this shutter does not have",
    )
    _has_a_ramp = requires(
        "ramp", where={"opening": "trapezoid"}, message="is missing: a trapezoid needs the time in which it opens"
    )

    @model_validator(mode="after")
    def _ramps_within(self) -> "ShutterSpec":
        if self.ramp is not None and self.ramp > self._open_for():
            field_error("ramp", f"must be at most the duration, {self._open_for():g} s, got {self.ramp:g} s")
        return self

    def _open_for(self) -> float:
        if self.duration is not None:
            return self.duration
        return 0.0 if self.close is None else self.close - (self.open or 0.0)

    def timing(self, opens: float) -> Timing:
        """Compute the timing if the shutter begins to open at this time of the scene (s).

        Raises
        ------
        ValueError : as `ensure_distinct_times` does.
        """
        profile = None if isinstance(self.opening, str) else self.opening
        length = self._open_for()
        if self.ramp:
            held, ramp = length, self.ramp
            top = ((ramp, 1.0), (held, 1.0)) if held > ramp else ((ramp, 1.0),)
            profile = ((0.0, 0.0), *top, (held + ramp, 0.0))
        if profile is not None:
            length = profile[-1][0]
        closes = self.close if profile is None and self.close is not None else opens + length
        return ensure_distinct_times(Timing(opens, closes, profile, self.readout, self.direction, self.curtain), length)


class _OrDuration:
    """Annotation of a shutter: a mapping, or the time for which it is open."""

    _duration = Quantity("time", low=0.0)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def check(value: Any, interval: Any) -> Any:
            return interval(value) if isinstance(value, Mapping | ShutterSpec) else self._duration(value)

        return core_schema.no_info_wrap_validator_function(check, handler.generate_schema(ShutterSpec))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        duration = self._duration.json_schema()
        return {"anyOf": [handler(schema), *duration.pop("anyOf")], **duration}


ShutterField: TypeAlias = Annotated[ShutterSpec | float, _OrDuration()]


def exposure_timing(given: ShutterSpec | float | None, time: float | None) -> Timing:
    """Compute the timing of a camera's shutter: a mapping, a duration from `time` (s, default 0) on, or None: a moment.

    Raises
    ------
    ValueError : `time` besides a shutter that says itself when it opens; or as `ensure_distinct_times` does.
    """
    if isinstance(given, ShutterSpec):
        if time is not None and (given.open is not None or given.close is not None):
            raise ValueError("time says when a shutter given by its duration opens; this one says itself: give one")
        return given.timing(given.open or time or 0.0)
    opens, duration = time or 0.0, given or 0.0
    return ensure_distinct_times(Timing(opens, opens + duration), duration)
