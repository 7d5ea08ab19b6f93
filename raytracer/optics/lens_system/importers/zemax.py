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
from typing import Any, NamedTuple, NoReturn

from pydantic import ValidationError

from raytracer.optics.glass import CATALOGUE, parse_glass
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.importers.draft import Choices, Draft, Glasses, rounded, shape
from raytracer.schema.validation_errors import error_sentence
from raytracer.util.errors import closest_name, format_value

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

# Finite numbers of the lens and of a surface, by keyword: what they are, and their place behind it.
_SYSTEM_NUMBERS = {"FNUM": "f_number", "ENPD": "pupil", "FTYP": "field_type"}
_SURFACE_NUMBERS = {"CURV": ("curvature", 1), "CONI": ("conic", 1), "DIAM": ("radius", 1), "CLAP": ("clear", 2)}


class _Line(NamedTuple):
    """A line of a file: its number, and its words."""

    result: Draft
    number: int
    words: tuple[str, ...]

    def word(self, place: int) -> str:
        """Return a word behind the keyword, from 1; empty where there is none."""
        return self.words[place] if place < len(self.words) else ""

    def value(self, place: int = 1, *, may_be_infinite: bool = False) -> float:
        """Parse a number behind the keyword."""
        word = self.word(place)
        try:
            value = math.inf if word.upper().lstrip("+-").startswith("INF") else float(word)
        except ValueError:
            value = math.nan
        if math.isnan(value):
            self.refuse(f"{self.words[0]} must have a number, got {format_value(word)}")
        if math.isinf(value) and not may_be_infinite:
            self.refuse(f"{self.words[0]} must be finite")
        return value

    def refuse(self, message: str) -> NoReturn:
        """Raise an error about this line."""
        self.result.refuse(message, self.number)


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
    glass: _Line | None = None
    terms: dict[int, float] = field(default_factory=dict)


@dataclass
class _System:
    name: str = ""
    unit: float = 1.0
    f_number: float = 0.0
    pupil: float = 0.0
    field_type: float = 0.0
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
    for number, written in enumerate(text.splitlines(), start=1):
        line = _Line(result, number, tuple(written.split()))
        if line.word(0).upper() == "SURF":
            system.surfaces.append(_Surface(number))
        elif system.surfaces and written[:1].isspace():
            _read_surface(system.surfaces[-1], line)
        else:
            _read_system(system, line)
    if len(system.surfaces) < 3:
        result.refuse(f"holds {len(system.surfaces)} surfaces: a lens needs one between the object and the image")
    _convert(result, system, choices.glasses)
    _add_numbers(result, system)
    return result


def _read_system(system: _System, line: _Line) -> None:
    """Read a line of the lens as a whole."""
    keyword = line.word(0).upper()
    if keyword in _SYSTEM_NUMBERS:
        setattr(system, _SYSTEM_NUMBERS[keyword], line.value())
    elif keyword == "NAME":
        system.name = " ".join(line.words[1:])
    elif keyword == "MODE" and line.word(1).upper() not in ("", "SEQ"):
        line.refuse("is a non-sequential system: only sequential lenses are read")
    elif keyword == "UNIT":
        unit = line.word(1).upper()
        if unit not in _UNITS:
            line.refuse(f"has lengths in the unknown unit {format_value(unit)}; known units: {', '.join(_UNITS)}")
        system.unit = _UNITS[unit]
    elif keyword in ("XFLN", "YFLN"):
        system.fields += (line.value(place) for place in range(1, len(line.words)))


def _read_surface(surface: _Surface, line: _Line) -> None:
    """Read a line of a surface."""
    keyword = line.word(0).upper()
    if keyword in _SURFACE_NUMBERS:
        name, place = _SURFACE_NUMBERS[keyword]
        setattr(surface, name, line.value(place))
    elif keyword == "TYPE":
        surface.type = line.word(1).upper()
        if surface.type not in _TYPES:
            what = _UNSUPPORTED.get(surface.type, f"a surface of the type {format_value(surface.type)}")
            line.refuse(f"has {what}: surfaces of the types {' and '.join(_TYPES)} are read")
    elif keyword == "DISZ":
        surface.thickness = line.value(may_be_infinite=True)
    elif keyword == "STOP":
        surface.is_stop = True
    elif keyword == "PARM":
        surface.terms[int(line.value())] = line.value(2)
    elif keyword == "GLAS":
        surface.glass = line


def _material(surface: _Surface, glasses: Glasses) -> Any:
    """Convert a surface's GLAS to a value of `material`; None for air."""
    line = surface.glass
    if line is None or not line.word(1):
        return None
    name = line.word(1)
    if name.upper() == "MIRROR":
        line.refuse("has a mirror: only lenses, which light goes through, are read")
    if name in glasses:
        return glasses[name]
    if name == _MODEL or line.word(2) == "1":
        index, abbe = line.value(4), line.value(5)
        return {"index": index, "abbe": abbe} if abbe > 0.0 else index
    # Glass made since without lead or arsenic has an N before its name.
    by_upper = {known.upper(): known for known in CATALOGUE}
    known_name = by_upper.get(name.upper()) or by_upper.get(f"N-{name.upper()}")
    if known_name is None:
        close = closest_name(name, CATALOGUE)
        hint = f"; the nearest name is {close!r}" if close else ""
        line.refuse(
            f"names the glass {format_value(name)}, which is not in the catalogue{hint}: give its index and Abbe "
            f"number by --glass {name}=1.62/36.4, or its name there by --glass {name}={close or 'N-BK7'}"
        )
    return known_name


def _convert(result: Draft, system: _System, glasses: Glasses) -> None:
    """Convert the surfaces between the object and the image to millimetres, without those that have no effect."""
    unit = system.unit
    before: Any = None
    for surface in system.surfaces[1:-1]:
        material = _material(surface, glasses)
        thickness = rounded(unit * surface.thickness)
        if not abs(thickness) < _INFINITE:
            result.refuse("has no finite thickness (DISZ)", surface.line)
        flat = surface.curvature == 0.0 and not any(surface.terms.values())
        plain = flat and material is None and before is None
        if plain and not surface.is_stop and surface.clear == 0.0:
            if result.surfaces:
                row = result.surfaces[-1][1]
                row["thickness"] = rounded(row["thickness"] + thickness)
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
