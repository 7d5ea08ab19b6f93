"""Prescriptions of Zemax, `.zmx`: sequential lenses that are symmetric about their axis.

A file is lines of a keyword and its values; those of a surface stand under `SURF`, indented:

    SURF 1
      TYPE STANDARD
      CURV 0.045426474
      DISZ 3.258956
      GLAS SK16
      DIAM 9.5

Read are the types STANDARD and EVENASPH, CURV, CONI, PARM, DISZ, GLAS with a name or a model glass, DIAM, CLAP and
STOP; of the lens NAME, UNIT, MODE, ENPD, FNUM, FTYP and the fields.  Whatever else
changes the lens, such as mirrors, tilts, or surfaces of other types, is refused.  A surface between air and air that is
not the stop has no effect, and is left out.

References: Zemax OpticStudio user's manual, "The Surface Type" and "The System Explorer".
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raytracer.optics.glass import CATALOGUE, closest_glass_name, parse_glass
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.importers.draft import Choices, Draft, Glasses, rounded, shape
from raytracer.schema.validation_errors import error_sentence
from raytracer.util.errors import format_value

_UNITS = {"MM": 1.0, "CM": 10.0, "METER": 1000.0, "M": 1000.0, "IN": 25.4}
_TYPES = ("STANDARD", "EVENASPH")
_UNSUPPORTED = {
    "COORDBRK": "a coordinate break, which tilts or shifts what follows",
    "NONSEQCO": "a non-sequential part",
    "PARAXIAL": "an ideal lens without thickness",
    "TOROIDAL": "a toroidal surface",
    "BICONICX": "a biconic surface",
    "ODDASPHE": "an odd asphere",
    "XASPHERE": "an extended asphere",
    "DGRATING": "a grating",
    "BINARY_2": "a diffractive surface",
    "GRINSUR1": "a gradient index",
}
_MODEL = "___BLANK"

# Field types by `FTYP`: angles, and heights of the image.
_ANGLES, _HEIGHTS = (0,), (2, 3)

# A thickness from which on Zemax itself takes it for infinite.
_INFINITE = 1e10


@dataclass
class _Surface:
    line: int
    type: str = "STANDARD"
    curvature: float = 0.0
    thickness: float = 0.0
    conic: float = 0.0
    radius: float = 0.0
    clear: float = 0.0
    is_stop: bool = False
    glass: tuple[str, ...] = ()
    glass_line: int = 0
    terms: dict[int, float] = field(default_factory=dict)


@dataclass
class _System:
    name: str = ""
    unit: float = 1.0
    f_number: float = 0.0
    pupil: float = 0.0
    field_type: int = 0
    fields: list[float] = field(default_factory=list)
    surfaces: list[_Surface] = field(default_factory=list)


def draft(text: str, file: str, choices: Choices) -> Draft:
    """Read the lens of a file.

    Raises
    ------
    SceneError : the text is no such prescription, or has what is not supported; it names the line.
    """
    result = Draft(file)
    system = _System()
    for line, written in enumerate(text.splitlines(), start=1):
        words = written.split()
        if words:
            _read(result, system, line, words, written)
    if len(system.surfaces) < 3:
        result.refuse(f"holds {len(system.surfaces)} surfaces: a lens needs one between the object and the image")
    _convert(result, system, choices.glasses)
    _add_numbers(result, system)
    return result


def _number(result: Draft, line: int, words: Sequence[str], place: int = 1) -> float:
    """Parse a number behind a line's keyword; it may be infinite."""
    word = words[place] if place < len(words) else ""
    if word.upper().lstrip("+-").startswith("INF"):
        return math.inf
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if math.isnan(number):
        result.refuse(f"{words[0]} must have a number, got {format_value(word)}", line)
    return number


def _finite(result: Draft, line: int, words: Sequence[str], place: int = 1) -> float:
    """Parse a finite number behind a line's keyword."""
    number = _number(result, line, words, place)
    if math.isinf(number):
        result.refuse(f"{words[0]} must be finite", line)
    return number


def _read(result: Draft, system: _System, line: int, words: list[str], written: str) -> None:
    """Read a line."""
    keyword = words[0].upper()
    if keyword == "SURF":
        system.surfaces.append(_Surface(line))
    elif system.surfaces and written[:1].isspace():
        _read_surface(result, system.surfaces[-1], line, keyword, words)
    else:
        _read_system(result, system, line, keyword, words)


def _read_system(result: Draft, system: _System, line: int, keyword: str, words: list[str]) -> None:
    """Read a line of the lens as a whole."""
    if keyword == "NAME":
        system.name = " ".join(words[1:])
    elif keyword == "MODE" and words[1:2] and words[1].upper() != "SEQ":
        result.refuse("is a non-sequential system: only sequential lenses are read", line)
    elif keyword == "UNIT":
        unit = words[1].upper() if len(words) > 1 else ""
        if unit not in _UNITS:
            result.refuse(
                f"has lengths in the unknown unit {format_value(unit)}; known units: {', '.join(_UNITS)}", line
            )
        system.unit = _UNITS[unit]
    elif keyword == "FNUM":
        system.f_number = _finite(result, line, words)
    elif keyword == "ENPD":
        system.pupil = _finite(result, line, words)
    elif keyword == "FTYP":
        system.field_type = int(_finite(result, line, words))
    elif keyword in ("XFLN", "YFLN"):
        system.fields += (_finite(result, line, words, place) for place in range(1, len(words)))


def _read_surface(result: Draft, surface: _Surface, line: int, keyword: str, words: list[str]) -> None:
    """Read a line of a surface."""
    if keyword == "TYPE":
        surface.type = words[1].upper() if len(words) > 1 else ""
        if surface.type not in _TYPES:
            what = _UNSUPPORTED.get(surface.type, f"a surface of the type {format_value(surface.type)}")
            result.refuse(f"has {what}: surfaces of the types {' and '.join(_TYPES)} are read", line)
    elif keyword == "CURV":
        surface.curvature = _finite(result, line, words)
    elif keyword == "DISZ":
        surface.thickness = _number(result, line, words)
    elif keyword == "CONI":
        surface.conic = _finite(result, line, words)
    elif keyword == "DIAM":
        surface.radius = _finite(result, line, words)
    elif keyword == "CLAP":
        surface.clear = _finite(result, line, words, 2)
    elif keyword == "STOP":
        surface.is_stop = True
    elif keyword == "PARM":
        surface.terms[int(_finite(result, line, words))] = _finite(result, line, words, 2)
    elif keyword == "GLAS":
        surface.glass, surface.glass_line = tuple(words[1:]), line


def _material(result: Draft, surface: _Surface, glasses: Glasses) -> Any:
    """Convert a surface's GLAS to a value of `material`; None for air."""
    if not surface.glass:
        return None
    name, line = surface.glass[0], surface.glass_line
    if name.upper() == "MIRROR":
        result.refuse("has a mirror: only lenses, which light goes through, are read", line)
    if name in glasses:
        return glasses[name]
    if name == _MODEL or (len(surface.glass) > 1 and surface.glass[1] == "1"):
        index, abbe = (_finite(result, line, ("GLAS", *surface.glass), place) for place in (4, 5))
        return {"index": index, "abbe": abbe} if abbe > 0.0 else index
    return _catalogued(result, name, line)


def _catalogued(result: Draft, name: str, line: int) -> str:
    """Find the name of a glass in the catalogue: glass made since without lead or arsenic has an N before it."""
    by_upper = {known.upper(): known for known in CATALOGUE}
    known_name = by_upper.get(name.upper()) or by_upper.get(f"N-{name.upper()}")
    if known_name is None:
        close = closest_glass_name(name)
        hint = f"; the nearest name is {close!r}" if close else ""
        result.refuse(
            f"names the glass {format_value(name)}, which is not in the catalogue{hint}: give its index and Abbe "
            f"number by "
            f"--glass {name}=1.62/36.4, or its name there by --glass {name}={close or 'N-BK7'}",
            line,
        )
    return known_name


def _convert(result: Draft, system: _System, glasses: Glasses) -> None:
    """Convert the surfaces between the object and the image to millimetres, without those that have no effect."""
    unit = system.unit
    before: Any = None
    for surface in system.surfaces[1:-1]:
        material = _material(result, surface, glasses)
        thickness = rounded(unit * surface.thickness)
        if not abs(thickness) < _INFINITE:
            result.refuse("has no finite thickness (DISZ)", surface.line)
        flat = surface.curvature == 0.0 and not any(surface.terms.values())
        plain = flat and material is None and before is None
        if plain and not surface.is_stop and surface.clear == 0.0:
            _lengthen(result, thickness)
        else:
            kind: dict[str, Any] = {"type": "stop"} if plain and surface.is_stop else _shape(result, surface, unit)
            if surface.is_stop and not plain:
                kind["stop"] = True
            filled = {} if material is None or kind["type"] == "stop" else {"material": material}
            aperture = rounded(2.0 * unit * (surface.clear or surface.radius))
            if aperture <= 0.0:
                result.refuse("has no diameter (DIAM)", surface.line)
            result.surfaces.append((surface.line, {**kind, "thickness": thickness, **filled, "aperture": aperture}))
        before = material
    if not result.surfaces:
        result.refuse("holds no glass")
    for line, row in result.surfaces[:-1]:
        if row["thickness"] < 0.0:
            result.refuse(f"goes back by {-row['thickness']:g} mm to the next surface, which must be behind it", line)
    result.surfaces[-1][1]["thickness"] = max(0.0, result.surfaces[-1][1]["thickness"])


def _lengthen(result: Draft, thickness: float) -> None:
    """Add the thickness of a surface that is left out to the one before it, if there is one."""
    if result.surfaces:
        row = result.surfaces[-1][1]
        row["thickness"] = rounded(row["thickness"] + thickness)


def _shape(result: Draft, surface: _Surface, unit: float) -> dict[str, Any]:
    """Make the keys of a surface's shape, in millimetres."""
    terms = [surface.terms.get(number, 0.0) for number in range(1, 9)] if surface.type == "EVENASPH" else [0.0]
    if terms[0] != 0.0:
        result.refuse(
            "has an asphere with a term in the square of the height (PARM 1), which is not supported", surface.line
        )
    coefficients = [rounded(term / unit ** (2 * power - 1)) for power, term in enumerate(terms[1:], start=2)]
    return shape(surface.curvature / unit, surface.conic, coefficients)


def _add_numbers(result: Draft, system: _System) -> None:
    """Set the name, the f-number and the image circle of the lens."""
    result.values = {"name": system.name or Path(result.file).stem}
    try:
        focal_length = abs(cardinal_points(result.spec().lens().packed()).focal_length)
    except ValueError:
        return
    f_number = system.f_number or (focal_length / (system.unit * system.pupil) if system.pupil > 0.0 else 0.0)
    if f_number > 0.0:
        result.values["f_number"] = float(f"{f_number:.4g}")
    furthest = max(map(abs, system.fields), default=0.0)
    circle = 0.0
    if system.field_type in _ANGLES and furthest < 90.0:
        circle = 2.0 * focal_length * math.tan(math.radians(furthest))
    elif system.field_type in _HEIGHTS:
        circle = 2.0 * system.unit * furthest
    if circle > 0.0:
        result.values["image_circle"] = float(f"{circle:.4g}")


def parse_glasses(definitions: Sequence[str]) -> dict[str, Any]:
    """Parse options such as `--glass SK16=1.62041/60.3` or `--glass K7=N-BK7`, by the name of the glass.

    Raises
    ------
    ValueError : an option is of another form.
    """
    glasses: dict[str, Any] = {}
    for definition in definitions:
        name, equals, text = definition.partition("=")
        index, slash, abbe = text.partition("/")
        if not equals or not name.strip() or not text.strip():
            raise ValueError(
                f"must be NAME=INDEX/ABBE or NAME=GLASS, such as SK16=1.62041/60.3, got {format_value(definition)}"
            )
        value: Any = text.strip()
        if slash:
            try:
                value = {"index": float(index), "abbe": float(abbe)}
            except ValueError:
                raise ValueError(f"must have two numbers, such as 1.62041/60.3, got {format_value(text)}") from None
        try:
            parse_glass(value)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise ValueError(f"{first['loc'][0]} {error_sentence(first)}") from None
        glasses[name.strip()] = value
    return glasses
