"""Parse numbers with units: `50 mm`, `1/125 s`, `20 deg`.

World lengths come out in metres, optic lengths in millimetres, wavelengths in nanometres, angles in degrees, times in
seconds, speeds in metres a second, angular rates in degrees a second, frequencies in hertz, temperatures in kelvins.
The fields of scene files that have a unit are in `fields.py`.
"""

import math
import re
from typing import Literal, NamedTuple, TypeAlias

from raytracer.util.errors import format_value, suggest_name

METRES_PER_MILLIMETRE = 1e-3

Dimension: TypeAlias = Literal[
    "length", "optic", "wavelength", "angle", "time", "speed", "rate", "frequency", "temperature", "number"
]


class _Dimension(NamedTuple):
    noun: str
    unit: str
    """Unit of plain numbers, and of every result."""
    example: str
    units: dict[str, tuple[float, float]]
    """Factor and divisor to `unit`: both are exact where the ratio is not."""


_LENGTHS = {
    "nm": (1.0, 1e9),
    "um": (1.0, 1e6),
    "µm": (1.0, 1e6),
    "μm": (1.0, 1e6),
    "mm": (1.0, 1e3),
    "cm": (1.0, 1e2),
    "m": (1.0, 1.0),
    "km": (1e3, 1.0),
    "in": (127.0, 5e3),
    "ft": (381.0, 1250.0),
}
_ANGLES = {
    "deg": (1.0, 1.0),
    "°": (1.0, 1.0),
    "rad": (180.0, math.pi),
    "mrad": (0.18, math.pi),
    "arcmin": (1.0, 60.0),
    "arcsec": (1.0, 3600.0),
    "turn": (360.0, 1.0),
}
_TIMES = {
    "ns": (1.0, 1e9),
    "us": (1.0, 1e6),
    "µs": (1.0, 1e6),
    "μs": (1.0, 1e6),
    "ms": (1.0, 1e3),
    "s": (1.0, 1.0),
    "min": (60.0, 1.0),
    "h": (3600.0, 1.0),
}

_SPEEDS = {f"{unit}/s": _LENGTHS[unit] for unit in ("mm", "cm", "m", "km")}
_SPEEDS |= {"km/h": (1.0, 3.6), "ft/s": _LENGTHS["ft"], "mph": (1397.0, 3125.0)}
_RATES = {f"{unit}/s": _ANGLES[unit] for unit in ("deg", "°", "rad", "turn")} | {"rpm": (6.0, 1.0)}
_FREQUENCIES = {"Hz": (1.0, 1.0), "kHz": (1e3, 1.0)}

_DIMENSIONS: dict[str, _Dimension] = {
    "length": _Dimension("length", "metres", "2, 50 mm or 30cm", _LENGTHS),
    "optic": _Dimension(
        "length", "millimetres", "50, 50 mm or 5cm", {u: (1e3 * f, d) for u, (f, d) in _LENGTHS.items()}
    ),
    "wavelength": _Dimension(
        "wavelength", "nanometres", "550, 550 nm or 0.55um", {u: (1e9 * f, d) for u, (f, d) in _LENGTHS.items()}
    ),
    "angle": _Dimension("angle", "degrees", "20, 20 deg or 0.3 rad", _ANGLES),
    "time": _Dimension("time", "seconds", "0.5, 1/125 s or 8 ms", _TIMES),
    "speed": _Dimension("speed", "metres per second", "2, 30 km/h or 5 cm/s", _SPEEDS),
    "rate": _Dimension("angular rate", "degrees per second", "90, 20 turn/s or 300 rpm", _RATES),
    "frequency": _Dimension("frequency", "hertz", "10, 10 Hz or 0.5 Hz", _FREQUENCIES),
    "temperature": _Dimension("temperature", "kelvins", "3200 or 3200 K", {"K": (1.0, 1.0)}),
    "number": _Dimension("number", "", "2, 0.5 or 1/3", {}),
}

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"

_LONGEST = 200
"""Longest text of a number with its unit: the regular expression may take time in proportion to its square."""

_QUANTITY = re.compile(rf"\s*({_NUMBER}|[-+]?\.?inf)\s*(?:/\s*({_NUMBER})\s*)?((?:[^\W\d_]+|°)(?:/[^\W\d_]+)?)?\s*")


def unit_of(dimension: Dimension) -> str:
    """Return the unit of plain numbers of `dimension`, in the plural; empty for a pure number."""
    return _DIMENSIONS[dimension].unit


def quantity_pattern(dimension: Dimension) -> str:
    """Return an ECMA-262 regular expression of the strings that `parse_quantity` takes, for JSON Schema."""
    units = "|".join(_DIMENSIONS[dimension].units)
    number = _NUMBER.replace("?:", "")
    return rf"^\s*({number}|[-+]?\.?inf)\s*(/\s*{number}\s*)?" + (rf"({units})?\s*$" if units else r"\s*$")


def parse_quantity(value: float | str, dimension: Dimension) -> float:
    """Convert a number, or a string of a number or fraction and perhaps a unit, to the unit of its dimension.

    Raises
    ------
    ValueError: it is no number, or NaN, or has a unit that is unknown or of another dimension; the message is a
        predicate that continues "key: ".
    """
    if isinstance(value, bool) or not isinstance(value, float | int | str):
        raise ValueError(f"must be {_wanted(dimension)}, got {format_value(value)}")  # noqa: TRY004
    result = _parse_text(value, dimension) if isinstance(value, str) else _to_float(value)
    if math.isnan(result):
        raise ValueError("must be a number, got nan")
    return result


def parse_percentage(text: str) -> float:
    """Parse a relative error, `1%` or `0.01`, to a fraction.

    Raises
    ------
    ValueError: it is no number, or not between 0 and 1; the message is a predicate that continues "key: ".
    """
    is_percent = text.strip().endswith("%")
    number = text.strip().removesuffix("%")
    try:
        share = parse_quantity(number, "number") / (100.0 if is_percent else 1.0)
    except ValueError:
        raise ValueError("must be a relative error such as 1% or 0.01") from None
    if not 0.0 < share < 1.0:
        hint = f"; did you mean {number}%?" if 1.0 <= share < 100.0 and not is_percent else ""
        raise ValueError(f"must be greater than 0 and less than 100%{hint}")
    return share


_BYTES = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}


def parse_bytes(text: str) -> int:
    """Parse an amount of memory, `2GB`, `500 MB` or `1.5 GiB`, to bytes.

    Raises
    ------
    ValueError: it is none, or not above 0; the message is a predicate that continues "key: ".
    """
    match = re.fullmatch(rf"\s*({_NUMBER})\s*([A-Za-z]+)\s*", text[:_LONGEST])
    units = {unit.lower(): size for unit, size in _BYTES.items()}
    if match is None or match[2].lower() not in units:
        raise ValueError(f"must be an amount of memory such as 2GB or 500 MB; units are {', '.join(_BYTES)}")
    size = float(match[1]) * units[match[2].lower()]
    if math.isinf(size):
        raise ValueError("must be a finite amount of memory")
    if size < 1.0:
        raise ValueError("must be greater than 0")
    return int(size)


def parse_duration(text: str) -> float:
    """Parse a finite time above 0, `30s` or `5 min`, to seconds.

    Raises
    ------
    ValueError: it is none; the message is a predicate that continues "key: ".
    """
    seconds = parse_quantity(text, "time")
    if not 0.0 < seconds < math.inf:
        raise ValueError("must be a time greater than 0" if seconds <= 0.0 else "must be a finite time")
    return seconds


def _wanted(dimension: Dimension) -> str:
    kind = _DIMENSIONS[dimension]
    article = "an" if kind.noun[0] in "aeiou" else "a"
    unit = f" in {kind.unit}" if kind.unit else ""
    return f"{article} {kind.noun}{unit} (such as {kind.example})"


def _to_float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"is too large a number ({len(str(abs(value)))} digits)") from None


def _parse_text(text: str, dimension: Dimension) -> float:
    match = _QUANTITY.fullmatch(text) if len(text) <= _LONGEST else None
    if not match:
        raise ValueError(f"must be {_wanted(dimension)}, got {format_value(text)}{_hint(text)}")
    numerator, denominator, unit = match.groups()

    # Read the number or fraction.
    result = float(numerator.replace(".inf", "inf"))
    if denominator is not None:
        if float(denominator) == 0.0:
            raise ValueError(f"divides by zero in {format_value(text)}")
        result /= float(denominator)
    if unit is None:
        return result

    # Bring it to the unit of its dimension.
    if unit not in _DIMENSIONS[dimension].units:
        raise ValueError(_wrong_unit(unit, dimension))
    factor, divisor = _DIMENSIONS[dimension].units[unit]
    return result * factor / divisor


_WRITTEN_OTHERWISE = {
    re.compile(rf"\s*[fF]\s*/\s*({_NUMBER})\s*"): "; an f-number is written `f_number: {}`",
    re.compile(rf"\s*({_NUMBER})\s*%\s*"): "; a share is written as a number, {}/100",
    re.compile(r"\s*([-+]?[0-9]+,[0-9]+)\s*"): "; the decimal point is a point, not a comma",
}


def _hint(text: str) -> str:
    """Tell how to write what is written as photographers or other languages do; empty for anything else."""
    found = ((pattern.fullmatch(text[:_LONGEST]), words) for pattern, words in _WRITTEN_OTHERWISE.items())
    return next((words.format(match[1]) for match, words in found if match), "")


def _wrong_unit(unit: str, dimension: Dimension) -> str:
    kind = _DIMENSIONS[dimension]
    other = next((d.noun for d in _DIMENSIONS.values() if unit in d.units), None)
    if not kind.units:
        return f"must be a plain number without a unit, got the unit {unit!r}"
    known = ", ".join(kind.units)
    if other:
        return f"must be {_wanted(dimension)}, but {unit!r} is a unit of {other}; known units: {known}"
    hint = suggest_name(unit, kind.units, "units")
    listed = "" if hint.startswith("known") else f" (known units: {known})"
    return f"has the unknown unit {unit!r}; {hint}{listed}"
