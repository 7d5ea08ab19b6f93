"""Format numbers, intervals, units and plurals, the same everywhere.

All but lengths in millimetres and below is ASCII, for all terminals.
"""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raytracer.core.error_estimate.intervals import Interval

UNKNOWN = "unknown"

# Units of time, their lengths in seconds, and from how many seconds on they are too short.
_UNITS = (
    ("ms", 1e-3, 0.9995),
    ("s", 1.0, 120.0),
    ("min", 60.0, 7200.0),
    ("h", 3600.0, 172800.0),
    ("days", 86400.0, math.inf),
)

# A longer time, in seconds, is no time that anybody waits for.
_YEAR = 365.25 * 86400.0

# Below the one, and compact ones from the other on, numbers have an exponent.
_PLAIN_FROM, _PLAIN_BELOW = 1e-4, 1e7

# Half a nanometre, in millimetres: less is shown as 0.
_LEAST = 5e-7


def _decimals(value: float, digits: int) -> int:
    """Count the decimals that show as many significant digits."""
    if value == 0.0 or not math.isfinite(value):
        return 0
    return max(0, digits - 1 - math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}")))))


def format_number(value: float) -> str:
    """Write a number with three significant digits: 0.0123, 1.23, 12,300; "unknown" for nan."""
    if math.isnan(value):
        return UNKNOWN
    if value != 0.0 and math.isfinite(value) and not _PLAIN_FROM <= abs(value) < 1e12:
        return f"{value:.2e}"
    rounded = float(f"{value:.2e}")
    return f"{rounded:,.{_decimals(rounded, 3)}f}"


def _three(interval: "Interval", scale: float) -> tuple[str, str, str]:
    """Write a value and its ends with the same decimals: three digits of the value, at most four of the ends."""
    values = [x * scale for x in interval]
    decimals = min(_decimals(values[0], 3), _decimals(max((abs(x) for x in values), default=0.0), 4))
    if any(x != 0.0 and not _PLAIN_FROM <= abs(x) < 1e9 for x in values) or decimals == 0:
        value, low, high = (format_number(x) for x in values)
    else:
        value, low, high = (f"{x:,.{decimals}f}" for x in values)
    return value, low, high


def format_interval(interval: "Interval", scale: float = 1.0, unit: str = "") -> str:
    """Write a number with its interval, both times `scale`: "0.839 (0.821 .. 0.857)", "1.23 % (1.20 .. 1.26)"."""
    if math.isnan(interval.value):
        return UNKNOWN
    if math.isnan(interval.low) or math.isnan(interval.high) or interval.low == interval.high:
        return format_number(interval.value * scale) + unit
    value, low, high = _three(interval, scale)
    return f"{value}{unit} ({low} .. {high})"


def format_percent(value: float) -> str:
    """Write a fraction in percent: "1.23 %"."""
    return UNKNOWN if math.isnan(value) else f"{format_number(100.0 * value)} %"


def format_percent_interval(interval: "Interval") -> str:
    """Write a fraction with its interval in percent: "1.23 % (1.20 .. 1.26)"."""
    return format_interval(interval, 100.0, " %")


def format_given_percent(value: float) -> str:
    """Write a fraction that a user gave, with no more digits than it has: "1 %"."""
    return f"{100.0 * value:g} %"


def _unit(seconds: float) -> tuple[str, float]:
    """Choose the unit that suits a time; returns it and its length in seconds."""
    size = abs(seconds)
    return next((unit for unit in _UNITS if size < unit[2]), _UNITS[-1])[:2]


def format_duration(seconds: float) -> str:
    """Write a time with the unit that suits it: "71.3 ms", "12.3 s", "7.48 min", "over a year", "never" for inf."""
    if math.isnan(seconds):
        return UNKNOWN
    if math.isinf(seconds):
        return "never" if seconds > 0.0 else UNKNOWN
    if seconds > _YEAR:
        return "over a year"
    unit, length = _unit(seconds)
    return f"{format_number(seconds / length)} {unit}" if seconds else "0 s"


def format_given_duration(seconds: float) -> str:
    """Write a time that a user gave, with no more digits than it has: "60 s"."""
    return f"{seconds:g} s" if 1.0 <= seconds < 120.0 else format_duration(seconds)


def format_duration_interval(interval: "Interval") -> str:
    """Write a time with its interval, all in one unit: "61.2 s (58.0 .. 65.1)"."""
    if not math.isfinite(interval.value) or interval.value > _YEAR:
        return format_duration(interval.value)
    unit, length = _unit(interval.value)
    return format_interval(interval, 1.0 / length, f" {unit}")


def compact_number(value: float) -> str:
    """Write a number with at most four digits, without an exponent where that is not longer."""
    if math.isinf(value):
        return "infinity"
    if value != 0.0 and not _PLAIN_FROM <= abs(value) < _PLAIN_BELOW:
        return f"{value:.3e}"
    from decimal import Decimal

    return f"{Decimal(f'{value:.4g}').normalize():f}"


def exposure_time(seconds: float) -> str:
    """Write a time as photographers do if it is short: "1/125 s"."""
    if 1.0 / _PLAIN_BELOW < seconds < 0.5 and math.isclose(1.0 / seconds, round(1.0 / seconds)):
        return f"1/{round(1.0 / seconds)} s"
    return f"{compact_number(seconds)} s"


def megabytes(size: float) -> str:
    """Write a number of bytes: "12.3 MB"."""
    return f"{size / 1e6:.3g} MB"


def plural(number: int, noun: str) -> str:
    """Put a noun into the plural, unless it is of one thing."""
    return noun if number == 1 else f"{noun}s"


def count(number: int, noun: str) -> str:
    """Write a number of things: "1 point", "12 points"."""
    return f"{number} {plural(number, noun)}"


# ---- Lengths and angles


def millimetres(value: float, digits: int = 6) -> str:
    """Write a length in millimetres; `infinite` and `none` in words."""
    if math.isnan(value):
        return "none"
    if math.isinf(value):
        return "infinite"
    return f"{_to_nanometre(value, digits)} mm"


def _to_nanometre(value: float, digits: int) -> str:
    """Round to significant digits, but not below a nanometre."""
    if value == 0.0 or abs(value) < _LEAST:
        return "0"
    decimals = max(0, min(6, digits - 1 - math.floor(math.log10(abs(value)))))
    return f"{value:.{decimals}f}".replace("-", "−")


def micrometres(value: float) -> str:
    """Write a length (um) in micrometres, or in millimetres from one on."""
    if math.isnan(value):
        return "none"
    return f"{significant(value, 3)} µm" if abs(value) < 1000.0 else f"{significant(0.001 * value, 3)} mm"


def degrees(value: float) -> str:
    """Write an angle."""
    return "none" if math.isnan(value) else f"{value:.2f}°"


def relative(value: float) -> str:
    """Write a relative difference."""
    if math.isnan(value):
        return ""
    return "0" if value == 0.0 else f"{value:.1e}".replace("-", "−")


def significant(value: float, digits: int = 4) -> str:
    """Write a number in significant digits."""
    # Adding 0 takes the sign from a zero.
    return "none" if math.isnan(value) else f"{value + 0.0:.{digits}g}".replace("-", "−")


def metres(millimetre: float) -> str:
    """Write a distance in the scene (mm) in metres."""
    if math.isinf(millimetre):
        return "infinity"
    return f"{millimetre / 1000.0:.6g} m"
