"""Shutters: when which part of the film is exposed, and how times are drawn from that.

In a scene:

    camera: {type: pinhole, shutter: 1/125 s, time: 2}
    camera: {type: pinhole, shutter: {open: 0, close: 1}}
    camera: {type: pinhole, shutter: {duration: 1/500 s, opening: trapezoid, ramp: 1/4000 s}}
    camera: {type: pinhole, shutter: {opening: [[0, 0], [2 ms, 1], [6 ms, 0.5], [8 ms, 0]]}}
    camera: {type: pinhole, shutter: {duration: 1/1000 s, readout: 1/30 s, direction: down}}
    camera: {type: pinhole, shutter: {duration: 1/1000 s, readout: 1/250 s, curtain: focal_plane}}

A *line* is what is exposed at one time: the whole film, or with a readout time one of its rows or columns.  Line y of n
begins to open `readout` y / n after the first.  Of an `electronic` shutter lines are rows or columns of pixels; a
`focal_plane` shutter lets light through a slit that travels, so that there every place of the film is a line.

A picture is a mean over the time for which a line is exposed: the integral of radiance times transmission over time,
divided by `Timing.seconds`, the integral of transmission.

References: ISO 516:2019 (a shutter's opening, its full width at half maximum); Liang, Chang, Chen 2008, "Analysis and
Compensation of Rolling Shutter Effect", IEEE Trans. Image Processing 17(8), sec. II.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.errors import shown
from raytracer.jit import generic, kernel
from raytracer.spec import Check, NonNegativeTime, Quantity, Spec, Time, at

Profile: TypeAlias = tuple[tuple[float, float], ...]

TICK = 2.0**-23
"""The part of a shutter's time within which two times are the same to paths, whose times are float32 numbers."""

# What part of the times is drawn from the flashes, where there are any.
_PULSED = 0.5


# ---- What a scene writes


class _Opening(Check):
    """Annotation of the way in which a shutter opens: a word, or [[time, transmission], ...]."""

    _words = ("instant", "trapezoid")
    _columns = (Quantity("time", low=0.0), Quantity(low=0.0, high=1.0))

    def __call__(self, value: Any) -> str | Profile:
        """The word, or the points of the curve.

        Raises
        ------
        ValueError : neither, or a curve that goes back in time or lets no light through.
        """
        if isinstance(value, str) and value in self._words:
            return value
        if not isinstance(value, list | tuple):
            wanted = " or ".join(self._words)
            raise ValueError(f"must be {wanted}, or [[time, transmission], ...], got {shown(value)}")  # noqa: TRY004
        for number, point in enumerate(value):
            if not isinstance(point, list | tuple) or len(point) != 2:
                at(number, f"must be a time and a transmission, got {shown(point)}")
        points = tuple((self._entry(point, i, 0), self._entry(point, i, 1)) for i, point in enumerate(value))
        for number, (before, after) in enumerate(pairwise(points), start=1):
            if after[0] <= before[0]:
                at((number, 0), f"must be later than the point before, {before[0]:g} s, got {after[0]:g} s")
        if len(points) < 2 or not any(transmission for _, transmission in points):
            raise ValueError("lets no light through: it needs two points, of which one has a transmission above 0")
        return points

    def _entry(self, point: Sequence[Any], number: int, column: int) -> float:
        try:
            return self._columns[column](point[column])
        except ValueError as error:
            at((number, column), str(error))

    def json_schema(self) -> JsonSchemaValue:
        """A word, or an array of pairs."""
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

    @model_validator(mode="after")
    def _is_open_for_one_time(self) -> "ShutterSpec":
        if not isinstance(self.opening, str):
            for key in ("close", "duration"):
                if getattr(self, key) is not None:
                    at(key, "the curve of `opening` says for how long the shutter is open: leave this out")
        elif self.close is None and self.duration is None:
            at("close", "is missing: a shutter needs `close`, `duration`, or a curve as its `opening`")
        elif self.close is not None and self.duration is not None:
            at("duration", "duration and close both say for how long the shutter is open: give one of them")
        elif self.close is not None and self.close < (self.open or 0.0):
            at("close", f"must not be before the shutter opens, {self.open or 0.0:g} s, got {self.close:g} s")
        return self

    @model_validator(mode="after")
    def _ramps_within(self) -> "ShutterSpec":
        if self.opening != "trapezoid":
            if self.ramp is not None:
                at("ramp", "belongs to `opening: trapezoid`, which this shutter does not have")
        elif self.ramp is None:
            at("ramp", "is missing: a trapezoid needs the time in which it opens")
        elif self.ramp > self._open_for():
            at("ramp", f"must be at most the duration, {self._open_for():g} s, got {self.ramp:g} s")
        return self

    def _open_for(self) -> float:
        if self.duration is not None:
            return self.duration
        return 0.0 if self.close is None else self.close - (self.open or 0.0)

    def timing(self, opens: float) -> "Timing":
        """When light is gathered if the shutter begins to open at this time of the scene (s).

        Raises
        ------
        ValueError : as `_distinct` does.
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
        return _distinct(Timing(opens, closes, profile, self.readout, self.direction, self.curtain), length)


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


class Timing(NamedTuple):
    """When light is gathered, in seconds.

    opens, closes : times of the scene at which the first line begins to open, and is closed again.
    profile : (time after the line begins to open, transmission), linear between these; None for a line that is fully
        open from the one to the other.
    readout, direction, curtain : as in `ShutterSpec`.
    """

    opens: float
    closes: float
    profile: Profile | None = None
    readout: float = 0.0
    direction: str = "down"
    curtain: str = "electronic"

    def span(self) -> "Shutter":
        """From where the first line begins to open to where the last is closed."""
        return Shutter(self.opens, self.closes + self.readout)

    def seconds(self) -> float:
        """The exposure time of a line: the integral of its transmission."""
        return self.transmitted(self.opens, self.closes)

    def transmitted(self, begin: float, end: float) -> float:
        """The integral of the first line's transmission between two times of the scene (s)."""
        if self.profile is None:
            return max(0.0, min(end, self.closes) - max(begin, self.opens))
        points = np.array(self.profile)
        integral = np.concatenate([[0.0], np.cumsum(np.diff(points[:, 0]) * (points[1:, 1] + points[:-1, 1]) / 2.0)])
        low, high = (_integral(points, integral, time - self.opens) for time in (begin, max(begin, end)))
        return high - low

    def full(self) -> tuple[float, float]:
        """Times of the scene (s) at which the first line is fully open, and at which it begins to close."""
        if self.profile is None:
            return self.opens, self.closes
        most = max(transmission for _, transmission in self.profile)
        times = [time for time, transmission in self.profile if transmission == most]
        return self.opens + times[0], self.opens + times[-1]


def _integral(points: NDArray[np.float64], integral: NDArray[np.float64], time: float) -> float:
    """The integral of a piecewise linear curve (n, 2) up to a time; `integral` (n,), up to its points."""
    if time <= points[0, 0]:
        return 0.0
    if time >= points[-1, 0]:
        return float(integral[-1])
    number = int(np.searchsorted(points[:, 0], time, side="right")) - 1
    there = float(np.interp(time, points[:, 0], points[:, 1]))
    return float(integral[number] + (time - points[number, 0]) * (points[number, 1] + there) / 2.0)


def timing_of(given: ShutterSpec | float | None, time: float | None) -> Timing:
    """The timing of a camera's shutter: a mapping, or a duration from `time` (s, default 0) on; None is a moment.

    Raises
    ------
    ValueError : `time` besides a shutter that says itself when it opens; or as `_distinct` does.
    """
    if isinstance(given, ShutterSpec):
        if time is not None and (given.open is not None or given.close is not None):
            raise ValueError("time says when a shutter given by its duration opens; this one says itself: give one")
        return given.timing(given.open or time or 0.0)
    opens, duration = time or 0.0, given or 0.0
    return _distinct(Timing(opens, opens + duration), duration)


def _distinct(timing: Timing, length: float) -> Timing:
    """A timing of lines that are open for this long (s), where numbers can tell its times apart.

    Raises
    ------
    ValueError : it is so late in the scene that the shutter closes, or its readout ends, at the time when it begins.
    """
    ends = (("is open", length, timing.closes), ("is read out", timing.readout, timing.span().close))
    for what, seconds, end in ends:
        if seconds > 0.0 and end == timing.opens:
            raise ValueError(
                f"{what} for {seconds:g} s, too short to be told from none at a time of {timing.opens:g} s"
            )
    return timing


# ---- Packed


class Curve(NamedTuple):
    """How a line's transmission changes, over its time from 0 to 1: float64 (n,).

    time, increasing; density, linear between the times, with an integral of 1; cumulative, its integral.
    """

    time: NDArray[np.float64]
    density: NDArray[np.float64]
    cumulative: NDArray[np.float64]


class Scan(NamedTuple):
    """Lines that are exposed one after another.

    delay, how long the scan takes from edge to edge, and width, for how long each is exposed, as fractions of
    the whole; lines, how many there are from edge to edge; across, whether they are columns; backwards, whether the
    last of the picture is the first in time; whole, whether all of a line is exposed at one time.
    """

    delay: float
    width: float
    lines: float
    across: bool
    backwards: bool
    whole: bool


class Pulses(NamedTuple):
    """When flashes shine: begin and end (n,) float64, as fractions of the shutter's whole time, may lie outside."""

    begin: NDArray[np.float64]
    end: NDArray[np.float64]


class Shutter(NamedTuple):
    """The span of scene time in which light is gathered (s), and how; open and close are equal for a moment.

    curve, a Curve, None if all lines are fully open at once; scan, a Scan, None if all of the film is exposed at the
    same time; pulses, the Pulses of flashes that times are drawn from besides, or None.
    """

    open: float
    close: float
    curve: Any = None
    scan: Any = None
    pulses: Any = None


def pack_shutter(timing: Timing, width: int, height: int, pulses: Sequence[Pulses] = ()) -> Shutter:
    """The packed shutter for a film of width x height pixels, and flashes that shine in its time."""
    span = timing.span()
    scan = None
    if timing.readout > 0.0:
        whole = span.close - span.open
        across = timing.direction in ("left", "right")
        scan = Scan(
            delay=timing.readout / whole,
            width=(timing.closes - timing.opens) / whole,
            lines=float(width if across else height),
            across=across,
            backwards=timing.direction in ("up", "left"),
            whole=timing.curtain == "electronic",
        )
    found = None
    if pulses:
        both = np.unique(np.concatenate([np.stack([item.begin, item.end], axis=1) for item in pulses]), axis=0)
        found = Pulses(np.ascontiguousarray(both[:, 0]), np.ascontiguousarray(both[:, 1]))
    return span._replace(curve=_pack_curve(timing.profile), scan=scan, pulses=found)


def _pack_curve(profile: Profile | None) -> Curve | None:
    """A profile over the time of a line; None where the line is evenly open all the time."""
    if profile is None:
        return None
    points = np.array(profile)
    if points[0, 0] > 0.0:
        points = np.concatenate([[[0.0, 0.0], [points[0, 0], 0.0]], points])
    elif np.all(points[:, 1] == points[0, 1]):
        return None
    time = points[:, 0] / points[-1, 0]
    cumulative = np.concatenate([[0.0], np.cumsum(np.diff(time) * (points[1:, 1] + points[:-1, 1]) / 2.0)])
    return Curve(time, np.ascontiguousarray(points[:, 1] / cumulative[-1]), cumulative / cumulative[-1])


def pulse_of(shutter: Shutter, begin: float, end: float) -> tuple[float, float]:
    """Two times of the scene (s) as fractions of the shutter's whole time, of which an Embree ray has one.

    They are float32 numbers, so that a time between them that is rounded to float32 stays between them.  A pulse that
    is shorter than two such numbers are apart is made as long as they are.
    """
    whole = shutter.close - shutter.open
    # What lies too far outside for a float32 number is infinitely far outside.
    with np.errstate(over="ignore"):
        first = float(np.float32((begin - shutter.open) / whole))
        last = float(np.float32((end - shutter.open) / whole))
    return first, max(last, float(np.float32(first + TICK)))


# ---- For kernels


@generic
def sample_curve(curve, u):
    """A time of a line's opening, from 0 to 1, drawn in proportion to its transmission; increasing with u."""
    raise NotImplementedError


@sample_curve.register(type(None))
def _(curve, u):
    return u


@sample_curve.register(Curve)
def _(curve, u):
    segment = _segment(curve.cumulative, u)
    a, b = curve.density[segment], curve.density[segment + 1]
    width = curve.time[segment + 1] - curve.time[segment]
    rest = u - curve.cumulative[segment]

    # Solve a x + (b - a) x^2 / (2 width) = rest in the form that does not cancel; Press et al. 2007, sec. 5.6.
    root = math.sqrt(max(0.0, a * a + 2.0 * (b - a) / width * rest))
    if a + root == 0.0:
        return curve.time[segment]
    return curve.time[segment] + min(width, 2.0 * rest / (a + root))


@kernel
def _segment(values, value):
    """The last segment of increasing values that begins at most at `value`, and has a width."""
    low, high = 0, len(values) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if values[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@generic
def curve_density(curve, time):
    """The density of `sample_curve` at a time from 0 to 1; 0 outside."""
    raise NotImplementedError


@curve_density.register(type(None))
def _(curve, time):
    return 1.0 if 0.0 <= time <= 1.0 else 0.0


@curve_density.register(Curve)
def _(curve, time):
    if not 0.0 <= time <= 1.0:
        return 0.0
    segment = _segment(curve.time, time)
    share = (time - curve.time[segment]) / (curve.time[segment + 1] - curve.time[segment])
    return curve.density[segment] + share * (curve.density[segment + 1] - curve.density[segment])


@generic
def line_at(scan, x, y):
    """When the line of film position (x, y) begins to open, and for how long it is open, as fractions of the whole."""
    raise NotImplementedError


@line_at.register(type(None))
def _(scan, x, y):
    return 0.0, 1.0


@line_at.register(Scan)
def _(scan, x, y):
    place = max(0.0, min(scan.lines, x if scan.across else y))
    if scan.backwards:
        place = scan.lines - place
    if scan.whole:
        place = min(math.floor(place), scan.lines - 1.0)
    return scan.delay * place / scan.lines, scan.width


@kernel
def _rounded(time):
    """The time that a ray of Embree has, so that it and the hit that is solved in float64 are of the same time."""
    return np.float64(np.float32(max(0.0, min(1.0, time))))


@generic
def draw_time(pulses, shutter, x, y, u):
    """A time for film position (x, y), as a fraction of the shutter's whole, and its weight.

    The weight is the density of the line's transmission over that of drawing: 1 where there are no flashes.
    """
    raise NotImplementedError


@draw_time.register(type(None))
def _(pulses, shutter, x, y, u):
    begin, width = line_at(shutter.scan, x, y)
    return _rounded(begin + width * sample_curve(shutter.curve, u)), 1.0


@draw_time.register(Pulses)
def _(pulses, shutter, x, y, u):
    """Half of the times are of the pulses that the line sees, each as often as any other: the one-sample model.

    References: Veach 1997, sec. 9.2.4 (with the balance heuristic, the weight is the integrand's density over that of
    the mixture, here at most 2).
    """
    begin, width = line_at(shutter.scan, x, y)
    seen = 0
    for pulse in range(len(pulses.begin)):
        if min(pulses.end[pulse], begin + width) >= max(pulses.begin[pulse], begin):
            seen += 1
    # Of a line that is open for no longer than two times are apart, all times are one, whatever shines.
    if seen == 0 or width <= TICK:
        return _rounded(begin + width * sample_curve(shutter.curve, u)), 1.0

    # Draw from a pulse, or from the curve.
    if u < _PULSED:
        place = u / _PULSED * seen
        wanted = min(int(place), seen - 1)
        time, passed = 0.0, 0
        for pulse in range(len(pulses.begin)):
            first, last = max(pulses.begin[pulse], begin), min(pulses.end[pulse], begin + width)
            if last >= first:
                if passed == wanted:
                    time = first + (place - wanted) * (last - first)
                passed += 1
    else:
        time = begin + width * sample_curve(shutter.curve, (u - _PULSED) / (1.0 - _PULSED))
    time = _rounded(time)

    # Weigh it by all ways in which it might have been drawn.
    wanted_density = curve_density(shutter.curve, max(0.0, min(1.0, (time - begin) / width))) / width
    if wanted_density == 0.0:
        return time, 0.0
    drawn = (1.0 - _PULSED) * wanted_density
    for pulse in range(len(pulses.begin)):
        first, last = max(pulses.begin[pulse], begin), min(pulses.end[pulse], begin + width)
        if last >= first and pulses.begin[pulse] <= time <= pulses.end[pulse]:
            drawn += _PULSED / (seen * max(last - first, TICK))
    return time, wanted_density / drawn
