"""Parse strings that stand for many values of a key.

| text | values |
|---|---|
| `1.4,2,2.8` | those; each as on any command line: `50 mm`, `ball`, `[1, 0, 0]` |
| `2:10:5` | from 2 to 10 in 5 equal steps of difference, both ends included |
| `1:100:5:log` | from 1 to 100, each the same multiple of the one before |
| `1.4..22` | stops of exposure, each with half or twice the light of the one before; `1.4..22/2` halves, `/3` thirds |

A list may hold ranges too: `1:4:4,inf`.

Stops are exact: apertures are powers of the square root of 2, times powers of 2, speeds 100 times these.  Lenses and
dials have rounded numbers, which stand for the exact ones: in `1.4..22` the value of 1.4 is 1.41421,
and in `1/1000..1/30` that of 1/1000 s is 1/1024 s.  In a list, which is no range, 1.4 is 1.4.
"""

import difflib
import math
import re
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from raytracer.analysis.sweep.exposure_stops import STOP_SCALES, stops
from raytracer.analysis.sweep.results import Axis
from raytracer.scene.overrides import as_yaml
from raytracer.schema.units import Dimension, parse_quantity
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import abbreviate, format_value

# Similarity, by difflib's ratio, of a key and its misspelling: `f_nmber` has 0.93, `radius` and `radiance` have 0.71.
_SLIP = 0.85

# Most values of one key: far more than anybody looks at, and few enough for any machine.
_MOST_VALUES = 100_000

# Most characters of a range: parsing takes time in proportion to their square.
_LONGEST_RANGE = 200

# Decimals that logarithmic steps are rounded to, so that 10 is 10 and not 9.999999999999998.
_LOG_DIGITS = 15

# Digits at which a label stops being short, and that the shortest label of a rounded number has.
_LABEL_WIDTH, _LABEL_DIGITS = 7, 4

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_END = re.compile(rf"({_NUMBER})(?:\s*/\s*({_NUMBER}))?\s*([^\W\d_/:.]+(?:/[^\W\d_]+)?|°(?:/s)?)?")
_STARTS_AS_NUMBER = re.compile(r"\s*[-+]?(?:\.?[0-9]|\.?inf\b)")
_PART = re.compile(r"(.*?)\s*/\s*([0-9]+)\s*")

# Dimensions whose units the ends of a range may have, and the base unit of each.
_DIMENSIONS: tuple[Dimension, ...] = ("length", "angle", "time", "speed", "rate", "frequency", "temperature")
_BASE_UNITS = ("m", "deg", "s", "m/s", "deg/s", "Hz", "K")


class _Value(NamedTuple):
    """A value and its label, which is empty for a number that has none of its own."""

    value: Any
    label: str


class ParsedValues(NamedTuple):
    """Values of a key.

    fixed : True if it is one value alone, which is no axis but the same for all points.
    """

    axis: Axis
    fixed: bool


# ---- Keys and their values


def parse_value_text(key: str, text: str, source: str) -> ParsedValues:
    """Parse a text to the values that it stands for.

    source : origin of the text in messages, such as an option of the command line.

    Raises
    ------
    ValueError : the text is wrong; the message continues `source: `.
    SceneError : a value is not YAML.
    """
    items = _split(text)
    values: list[_Value] = []
    is_range = False
    for item in items:
        if not item.strip() and len(items) > 1:
            raise ValueError("has an empty value between its commas")
        in_range = _range(key, item.strip())
        is_range |= in_range is not None
        values += [_plain(item.strip(), source)] if in_range is None else in_range
        if len(values) > _MOST_VALUES:
            raise ValueError(f"has more than {_MOST_VALUES} values")
    return ParsedValues(_axis(key, values), len(items) == 1 and not is_range)


def parse_value(key: str, given: Any, source: str) -> ParsedValues:
    """Parse a Python value, or one of YAML: a text as `parse_value_text` does, or a list of values.

    Raises
    ------
    ValueError : a wrong text, an empty list, or a value twice; the message continues `source: `.
    SceneError : a value is not YAML.
    """
    if isinstance(given, str):
        return parse_value_text(key, given, source)
    if hasattr(given, "tolist"):
        given = given.tolist()
    if isinstance(given, Sequence | range):
        if len(given) == 0:
            raise ValueError("has no values")
        if len(given) > _MOST_VALUES:
            raise ValueError(f"has more than {_MOST_VALUES} values")
        return ParsedValues(_axis(key, [_Value(value, _own_label(value)) for value in given]), fixed=False)
    return single_value(key, given)


def single_value(key: str, value: Any) -> ParsedValues:
    """Make one value, whatever it is, which is the same for all points."""
    return ParsedValues(_axis(key, [_Value(value, _own_label(value))]), fixed=True)


def _split(text: str) -> list[str]:
    """Split a text at those of its commas that are not within brackets or quotes."""
    items, depth, quote, begin, is_blank = [], 0, "", 0, True
    for i, character in enumerate(text):
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'" and is_blank:
            quote = character
        elif character in "[{":
            depth += 1
        elif character in "]}":
            depth -= 1
        elif character == "," and depth <= 0:
            items.append(text[begin:i])
            begin, is_blank = i + 1, True
            continue
        is_blank = is_blank and character.isspace()
    return [*items, text[begin:]]


def _plain(text: str, source: str) -> _Value:
    """Parse a value that is not a range."""
    root = parse(text, "", option=source)
    value = None if root is None else root.plain()
    return _Value(value, _own_label(value) or text)


def _own_label(value: Any) -> str:
    """Make the label of a value that has none; empty for numbers, whose labels `_axis` makes."""
    return "" if _is_number(value) else as_yaml(value)


def _axis(key: str, values: Sequence[_Value]) -> Axis:
    """Make an axis of values, with labels that differ.

    Raises
    ------
    ValueError : a value is there twice.
    """
    seen: dict[str, str] = {}
    for number, (value, label) in enumerate(values):
        same = repr(float(value)) if _is_number(value) else as_yaml(value)
        if same in seen:
            raise ValueError(f"has the value {abbreviate(label or as_yaml(value))} twice")
        seen[same] = label or str(number)
    own = [value for value, label in values if not label]
    numbers = iter(_labels(own))
    labels = [abbreviate(label) if label else next(numbers) for _, label in values]
    times = Counter(labels)
    if len(times) < len(labels):
        labels = [label if times[label] == 1 else f"{label} #{i + 1}" for i, label in enumerate(labels)]
    return Axis(key, tuple(value for value, _ in values), tuple(labels))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _labels(values: Sequence[Any]) -> list[str]:
    """Make short strings of numbers, or of numbers with units, that differ as the numbers do."""
    whole = [_shortest(value) for value in values]
    if all(len(text) <= _LABEL_WIDTH for text in whole):
        return whole
    for digits in range(_LABEL_DIGITS, 17):
        rounded = [
            text if len(text) <= _LABEL_WIDTH else _shortest(float(f"{value:.{digits}g}"))
            for text, value in zip(whole, values, strict=True)
        ]
        if len(set(rounded)) == len(rounded):
            return rounded
    return whole


def _shortest(value: float) -> str:
    return repr(value).removesuffix(".0")


# ---- Ranges


class _End(NamedTuple):
    """An end of a range: a number, exactly as written, and its unit, which may be empty."""

    number: Fraction
    unit: str


def _range(key: str, item: str) -> list[_Value] | None:
    """Parse a range to its values; None if the item is not a range."""
    if not _STARTS_AS_NUMBER.match(item) or (".." not in item and ":" not in item):
        return None
    if len(item) > _LONGEST_RANGE:
        raise ValueError(f"is a range of {len(item)} characters; none needs more than {_LONGEST_RANGE}")
    try:
        if ".." in item:
            start, _, stop = item.partition("..")
            return _stops(key, start, stop)
        return _steps(item.split(":"))
    except OverflowError:
        raise ValueError("is a range whose ends are too large, or too far apart") from None


def _end(text: str) -> _End:
    match = _END.fullmatch(text.strip())
    numerator, denominator = (None, None) if match is None else (_exact(match[1]), _exact(match[2] or "1"))
    if match is None or numerator is None or denominator is None:
        raise ValueError(
            f"is a range whose end {format_value(text.strip())} is no finite number (such as 2, 1/125 or 50 mm)"
        )
    if denominator == 0:
        raise ValueError(f"divides by zero in {format_value(text.strip())}")
    return _End(numerator / denominator, match[3] or "")


def _exact(text: str) -> Fraction | None:
    """Parse a number exactly; None for one that float64 cannot hold, 0 for one that is 0 there."""
    # Asked first, since an exponent of a billion takes a billion digits.
    number = float(text)
    if not math.isfinite(number):
        return None
    return Fraction(text) if number else Fraction(0)


def _same_unit(start: _End, stop: _End) -> tuple[_End, _End]:
    """Convert both ends to one unit: that of one of them stands for both; units that differ become the base unit."""
    if start.unit == stop.unit:
        return start, stop
    if not start.unit or not stop.unit:
        unit = start.unit or stop.unit
        return _End(start.number, unit), _End(stop.number, unit)
    for dimension, unit in zip(_DIMENSIONS, _BASE_UNITS, strict=True):
        try:
            numbers = [parse_quantity(f"{float(end.number)!r} {end.unit}", dimension) for end in (start, stop)]
        except ValueError:
            continue
        return _End(Fraction(repr(numbers[0])), unit), _End(Fraction(repr(numbers[1])), unit)
    raise ValueError(
        f"has ends in {format_value(start.unit)} and {format_value(stop.unit)}, which are no units of one kind"
    )


def _steps(words: Sequence[str]) -> list[_Value]:
    """Compute the values of start:stop:count, or start:stop:count:log."""
    if len(words) < 3:
        raise ValueError("is a range without a count: start:stop:count, such as 2:10:5")
    is_log = len(words) == 4 and words[3].strip() == "log"
    if len(words) > 3 and not is_log:
        raise ValueError(
            f"ends in {format_value(':'.join(words[3:]))}; only 'log' may follow the count, as in 1:100:5:log"
        )
    start, stop = _same_unit(_end(words[0]), _end(words[1]))
    if not re.fullmatch(r"\s*\+?[0-9]+\s*", words[2]):
        raise ValueError(f"has the count {format_value(words[2].strip())}; it must be an integer")
    count = int(words[2])
    if count < 1:
        raise ValueError("is an empty range: its count must be at least 1")
    if count > _MOST_VALUES:
        raise ValueError(f"has more than {_MOST_VALUES} values")
    if count == 1 and start != stop:
        raise ValueError("has different ends but a count of 1: one value cannot be both")
    if count > 1 and start == stop:
        raise ValueError(f"has equal ends, so its {count} values are one")
    if is_log and start.number * stop.number <= 0:
        raise ValueError("is logarithmic, so both of its ends must be greater than 0, or both less")
    parts = [Fraction(i, max(count - 1, 1)) for i in range(count)]
    if not is_log:
        # In exact arithmetic, so that 0.1:0.7:7 has 0.3, not 0.30000000000000004.
        return _with_unit([float(start.number + (stop.number - start.number) * part) for part in parts], start.unit)
    first, ratio = float(start.number), float(stop.number / start.number)
    if ratio == 0.0:
        raise OverflowError
    return _with_unit([float(f"{first * ratio ** float(part):.{_LOG_DIGITS}g}") for part in parts], start.unit)


def _with_unit(numbers: Sequence[float], unit: str) -> list[_Value]:
    """Make values of numbers: integers where possible, and strings where they have a unit."""
    whole = [int(number) if number.is_integer() and abs(number) < 2.0**53 else number for number in numbers]
    if not unit:
        return [_Value(number, "") for number in whole]
    labels = _labels(whole)
    return [_Value(f"{number!r} {unit}", f"{label} {unit}") for number, label in zip(whole, labels, strict=True)]


# ---- Stops


def _stops(key: str, start_text: str, stop_text: str) -> list[_Value]:
    """Compute the values of start..stop, start..stop/2 or start..stop/3."""
    if stop_text.startswith("."):
        raise ValueError("has three dots; a range of stops has two, as in 1.4..22")
    own = key.rpartition(".")[2]
    scale = STOP_SCALES.get(own)
    if scale is None:
        # A slip of the finger alone: a radius is no radiance.
        if meant := difflib.get_close_matches(own, STOP_SCALES, n=1, cutoff=_SLIP):
            raise ValueError(f"asks for stops, which are not known of {own!r}; did you mean {meant[0]!r}?")
        raise ValueError(
            f"asks for stops, which are known of {', '.join(STOP_SCALES)} alone; for others there are "
            "start:stop:count and start:stop:count:log"
        )
    stop_text, parts = _parts(stop_text)
    start, stop = _same_unit(_end(start_text), _end(stop_text))
    if start.number <= 0 or stop.number <= 0:
        raise ValueError("is a range of stops, so both of its ends must be greater than 0")
    if start == stop:
        raise ValueError("is an empty range: its ends are equal")

    # Marks are engraved in the unit that plain numbers are in.
    if start.unit and start.unit != scale.unit:
        scale = scale._replace(base=1.0, unit="", marks={})
    unit = start.unit or scale.unit
    series = stops(scale, float(start.number), float(stop.number), parts)
    named = _with_unit(series.values, unit)
    values = _with_unit(series.values, "") if unit == scale.unit else named
    labels = [f"{mark} {unit}".strip() if mark else own.label for mark, own in zip(series.marks, named, strict=True)]
    return [_Value(value, label) for (value, _), label in zip(values, labels, strict=True)]


def _parts(stop: str) -> tuple[str, int]:
    """Split the end of a range of stops from the number of parts that each stop is divided into.

    `22/3` is 22 in thirds; `1/3`, one over something, is a fraction as shutters have them.
    """
    match = _PART.fullmatch(stop)
    if match is None or match[1].strip() in ("1", "+1"):
        return stop, 1
    return match[1], int(match[2])
