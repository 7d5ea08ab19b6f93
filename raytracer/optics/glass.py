"""Glass and other clear materials: their index of refraction by wavelength.

In a lens file, or as the `ior` of a material:

    1.5168                                    # the same for all wavelengths
    N-BK7                                     # a glass of the catalogue
    {index: 1.5168, abbe: 64.17}              # at the d line, and the Abbe number V = (n_d - 1) / (n_F - n_C)
    {cauchy: [1.5046, 0.0042]}                # n = A + B / l^2 + C / l^4, with l in micrometres
    {sellmeier: {b: [1.03961212, 0.231792344, 1.01046945], c: [0.00600069867, 0.0200179144, 103.560653]}}

Wavelengths are nanometres, in air.  A formula is for visible light: from 360 to 830 nm it must give an index that
glass can have, and from 300 to 2500 nm it must have no pole.

References: Born, Wolf 1999, "Principles of Optics", 7th ed., sec. 2.3.4; Sellmeier 1871; Cauchy 1836.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import GetCoreSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.schema.fields import Check, Quantity
from raytracer.schema.spec import field_error
from raytracer.schema.units import parse_quantity, quantity_pattern
from raytracer.util.errors import format_value, suggest_name

LINE_D = 587.5618
"""The yellow line of helium (nm), at which a single index of glass is given."""

LINE_F = 486.1327
"""The blue line of hydrogen (nm)."""

LINE_C = 656.2725
"""The red line of hydrogen (nm)."""

_VISIBLE_NM = np.arange(360.0, 831.0)
_POLE_FREE = (0.3, 2.5)

MAX_INDEX = 5.0
"""No clear material has a greater index: that of germanium, in the infrared, is 4."""


class Glass(NamedTuple):
    """A clear material: n^2 = base + sum of b l^2 / (l^2 - c), or n = base + sum of a_k / l^2k; l in micrometres.

    name : in messages and reports.
    base : the constant term.
    b, c : of Sellmeier's formula, c in square micrometres; empty for Cauchy's.
    a : of Cauchy's formula, a_k in micrometres^2k; empty for Sellmeier's.
    source_values : n_d and V_d, if it was given by them; else empty.
    """

    name: str
    base: float
    b: tuple[float, ...] = ()
    c: tuple[float, ...] = ()
    a: tuple[float, ...] = ()
    source_values: tuple[float, ...] = ()

    def disperses(self) -> bool:
        """Return True if the index depends on the wavelength."""
        return any(self.b) or any(self.a)

    def ior(self, wavelength: ArrayLike = LINE_D) -> NDArray[np.float64]:
        """Compute the index of refraction at wavelengths (nm), of their shape."""
        square = (1e-3 * np.asarray(wavelength, np.float64)) ** 2
        if self.b:
            terms = sum((b * square / (square - c) for b, c in zip(self.b, self.c, strict=True)), np.zeros_like(square))
            return np.asarray(np.sqrt(self.base + terms))
        terms = sum((a / square**power for power, a in enumerate(self.a, start=1)), np.zeros_like(square))
        return np.asarray(self.base + terms)

    def abbe(self) -> float:
        """Compute the Abbe number V_d; infinite without dispersion."""
        d, f, c = (float(self.ior(line)) for line in (LINE_D, LINE_F, LINE_C))
        return (d - 1.0) / (f - c) if f != c else math.inf

    def to_plain(self) -> Any:
        """Convert to the value of a file: a number, a name or a mapping."""
        if self.disperses() and CATALOGUE.get(self.name) == self:
            return self.name
        if self.source_values:
            return dict(zip(("index", "abbe"), self.source_values, strict=True))
        if self.b:
            return {"sellmeier": {"b": list(self.b), "c": list(self.c)}}
        return {"cauchy": [self.base, *self.a]} if self.a else self.base


AIR = Glass("air", 1.0)


def constant_index_glass(ior: float) -> Glass:
    """Make a glass with the same index for all wavelengths."""
    return AIR if ior == 1.0 else Glass(f"{ior:g}", ior)


def glass_from_abbe(index: float, abbe: float) -> Glass:
    """Make a glass by Cauchy's formula with two terms, through n_d and V_d."""
    d, f, c = (1e-3 * line for line in (LINE_D, LINE_F, LINE_C))
    b = (index - 1.0) / abbe / (f**-2 - c**-2)
    return Glass(f"{index:g}/{abbe:g}", index - b / d**2, a=(b,), source_values=(index, abbe))


# Schott's optical glass, by the constants of its data sheets of 2017, Zemax catalogue 2017-01-20b.
_SCHOTT = (
    Glass("N-FK51A", 1.0, (0.971247817, 0.216901417, 0.904651666), (0.00472301995, 0.0153575612, 168.68133)),
    Glass("N-FK5", 1.0, (0.844309338, 0.344147824, 0.910790213), (0.00475111955, 0.0149814849, 97.8600293)),
    Glass("N-PK51", 1.0, (1.15610775, 0.153229344, 0.785618966), (0.00585597402, 0.0194072416, 140.537046)),
    Glass("N-PK52A", 1.0, (1.029607, 0.1880506, 0.736488165), (0.00516800155, 0.0166658798, 138.964129)),
    Glass("N-BK7", 1.0, (1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)),
    Glass("K10", 1.0, (1.15687082, 0.0642625444, 0.872376139), (0.00809424251, 0.0386051284, 104.74773)),
    Glass("N-K5", 1.0, (1.08511833, 0.199562005, 0.930511663), (0.00661099503, 0.024110866, 111.982777)),
    Glass("N-ZK7", 1.0, (1.07715032, 0.168079109, 0.851889892), (0.00676601657, 0.0230642817, 89.0498778)),
    Glass("N-BAK1", 1.0, (1.12365662, 0.309276848, 0.881511957), (0.00644742752, 0.0222284402, 107.297751)),
    Glass("N-BAK4", 1.0, (1.28834642, 0.132817724, 0.945395373), (0.00779980626, 0.0315631177, 105.965875)),
    Glass("N-SK4", 1.0, (1.32993741, 0.228542996, 0.988465211), (0.00716874107, 0.0246455892, 100.886364)),
    Glass("N-SK5", 1.0, (0.991463823, 0.495982121, 0.987393925), (0.00522730467, 0.0172733646, 98.3594579)),
    Glass("N-SK16", 1.0, (1.34317774, 0.241144399, 0.994317969), (0.00704687339, 0.0229005, 92.7508526)),
    Glass("N-SSK5", 1.0, (1.59222659, 0.103520774, 1.05174016), (0.00920284626, 0.0423530072, 106.927374)),
    Glass("N-SSK8", 1.0, (1.44857867, 0.117965926, 1.06937528), (0.00869310149, 0.0421566593, 111.300666)),
    Glass("N-BAF10", 1.0, (1.5851495, 0.143559385, 1.08521269), (0.00926681282, 0.0424489805, 105.613573)),
    Glass("N-LAK8", 1.0, (1.33183167, 0.546623206, 1.19084015), (0.00620023871, 0.0216465439, 82.5827736)),
    Glass("N-LAK9", 1.0, (1.46231905, 0.344399589, 1.15508372), (0.00724270156, 0.0243353131, 85.4686868)),
    Glass("N-LAF2", 1.0, (1.80984227, 0.15729555, 1.0930037), (0.0101711622, 0.0442431765, 100.687748)),
    Glass("N-LAF34", 1.0, (1.75836958, 0.313537785, 1.18925231), (0.00872810026, 0.0293020832, 85.1780644)),
    Glass("N-LASF44", 1.0, (1.78897105, 0.38675867, 1.30506243), (0.00872506277, 0.0308085023, 92.7743824)),
    Glass("N-KZFS4", 1.0, (1.35055424, 0.197575506, 1.09962992), (0.0087628207, 0.0371767201, 90.3866994)),
    Glass("LLF1", 1.0, (1.21640125, 0.13366454, 0.883399468), (0.00857807248, 0.0420143003, 107.59306)),
    Glass("LF5", 1.0, (1.28035628, 0.163505973, 0.893930112), (0.00929854416, 0.0449135769, 110.493685)),
    Glass("F2", 1.0, (1.34533359, 0.209073176, 0.937357162), (0.00997743871, 0.0470450767, 111.886764)),
    Glass("N-F2", 1.0, (1.39757037, 0.159201403, 1.2686543), (0.00995906143, 0.0546931752, 119.248346)),
    Glass("F5", 1.0, (1.3104463, 0.19603426, 0.96612977), (0.00958633048, 0.0457627627, 115.011883)),
    Glass("N-BASF2", 1.0, (1.53652081, 0.156971102, 1.30196815), (0.0108435729, 0.0562278762, 131.3397)),
    Glass("SF2", 1.0, (1.40301821, 0.231767504, 0.939056586), (0.0105795466, 0.0493226978, 112.405955)),
    Glass("SF5", 1.0, (1.46141885, 0.247713019, 0.949995832), (0.0111826126, 0.0508594669, 112.041888)),
    Glass("N-SF5", 1.0, (1.52481889, 0.187085527, 1.42729015), (0.011254756, 0.0588995392, 129.141675)),
    Glass("N-SF15", 1.0, (1.57055634, 0.218987094, 1.50824017), (0.0116507014, 0.0597856897, 132.709339)),
    Glass("SF1", 1.0, (1.55912923, 0.284246288, 0.968842926), (0.0121481001, 0.0534549042, 112.174809)),
    Glass("SF10", 1.0, (1.61625977, 0.259229334, 1.07762317), (0.0127534559, 0.0581983954, 116.60768)),
    Glass("N-SF10", 1.0, (1.62153902, 0.256287842, 1.64447552), (0.0122241457, 0.0595736775, 147.468793)),
    Glass("SF4", 1.0, (1.61957826, 0.339493189, 1.02566931), (0.0125502104, 0.0544559822, 117.652222)),
    Glass("SF11", 1.0, (1.73848403, 0.311168974, 1.17490871), (0.0136068604, 0.0615960463, 121.922711)),
    Glass("N-SF11", 1.0, (1.73759695, 0.313747346, 1.89878101), (0.013188707, 0.0623068142, 155.23629)),
    Glass("SF6", 1.0, (1.72448482, 0.390104889, 1.04572858), (0.0134871947, 0.0569318095, 118.557185)),
    Glass("N-SF6", 1.0, (1.77931763, 0.338149866, 2.08734474), (0.0133714182, 0.0617533621, 174.01759)),
    Glass("SF57", 1.0, (1.81651371, 0.428893641, 1.07186278), (0.0143704198, 0.0592801172, 121.419942)),
    Glass("N-SF66", 1.0, (2.0245976, 0.470187196, 2.59970433), (0.0147053225, 0.0692998276, 161.817601)),
)

# Fused silica: Malitson 1965, JOSA 55(10).  Calcium fluoride: Malitson 1963, Applied Optics 2(11).  Sapphire, its
# ordinary ray: Malitson, Dodge 1972, JOSA 62(11).  Diamond: Peter 1923, Zeitschrift fuer Physik 15(1).  Water at 20
# degrees: Daimon, Masumura 2007, Applied Optics 46(18).
_MEASURED = (
    Glass("fused silica", 1.0, (0.6961663, 0.4079426, 0.8974794), (0.0684043**2, 0.1162414**2, 9.896161**2)),
    Glass("CaF2", 1.0, (0.5675888, 0.4710914, 3.8484723), (0.050263605**2, 0.1003909**2, 34.649040**2)),
    Glass("sapphire", 1.0, (1.4313493, 0.65054713, 5.3414021), (0.0726631**2, 0.1193242**2, 18.028251**2)),
    Glass("diamond", 1.0, (0.3306, 4.3356), (0.1750**2, 0.1060**2)),
    Glass(
        "water",
        1.0,
        (0.5684027565, 0.1726177391, 0.02086189578, 0.1130748688),
        (0.005101829712, 0.01821153936, 0.02620722293, 10.69792721),
    ),
)

# Index and Abbe number of plastics for lenses: Baeumer (ed.) 2010, "Handbook of Plastic Optics", 2nd ed., ch. 1 and 5.
_PLASTICS = {
    "PMMA": (1.4918, 57.4),
    "polystyrene": (1.5905, 30.9),
    "polycarbonate": (1.5855, 29.9),
    "COP": (1.5312, 56.0),
}

CATALOGUE: Mapping[str, Glass] = {
    **{glass.name: glass for glass in (*_SCHOTT, *_MEASURED)},
    **{name: glass_from_abbe(*values)._replace(name=name) for name, values in _PLASTICS.items()},
    "air": AIR,
}
"""Common glasses, crystals, plastics and water by name; Schott's glasses by the names of its data sheets."""


# ---- Glasses in files

_FORMS = {
    "index": "{index: 1.5168, abbe: 64.17}",
    "cauchy": "{cauchy: [1.5046, 0.0042]}",
    "sellmeier": "{sellmeier: {b: [...], c: [...]}}",
}

_INDEX = Quantity(low=0.0, low_open=True, high=MAX_INDEX)
_ABBE = Quantity(low=5.0, high=200.0)
_COEFFICIENT = Quantity()
_MAX_TERMS = 8


def parse_glass(value: Any) -> Glass:
    """Parse the glass of a scene or a lens file: a number, a name or a mapping.

    Raises
    ------
    ValueError : it is not valid; for an unknown name the message suggests the nearest one.
    """
    if isinstance(value, Glass):
        return value
    if isinstance(value, Mapping):
        return _check_visible_index(_parse_mapping(value))
    if isinstance(value, str) and not _is_number(value):
        if value not in CATALOGUE:
            close = suggest_name(value, CATALOGUE, "glasses")
            raise ValueError(f"unknown glass {format_value(value)}; {close} (any can be given by {_FORMS['index']})")
        return CATALOGUE[value]
    return constant_index_glass(_INDEX(value))


def _is_number(text: str) -> bool:
    try:
        parse_quantity(text, "number")
    except ValueError:
        return any(character.isdigit() for character in text[:1])
    return True


def _parse_mapping(value: Mapping[Any, Any]) -> Glass:
    keys = set(value)
    if keys <= {"index", "abbe"} and keys:
        index, abbe = (_item(value, key, check) for key, check in (("index", _INDEX), ("abbe", _ABBE)))
        return glass_from_abbe(index, abbe)
    if keys == {"cauchy"}:
        base, *a = _numbers(value["cauchy"], ("cauchy",))
        return Glass(f"Cauchy {base:g}", base, a=tuple(a)) if any(a) else constant_index_glass(base)
    if keys == {"sellmeier"}:
        terms = value["sellmeier"]
        if not isinstance(terms, Mapping) or set(terms) != {"b", "c"}:
            field_error("sellmeier", "must hold b and c: {b: [...], c: [...]}")
        b, c = (_numbers(terms[key], ("sellmeier", key)) for key in ("b", "c"))
        if len(b) != len(c):
            field_error("sellmeier", f"must hold as many b as c, got {len(b)} and {len(c)}")
        for number, pole in enumerate(c):
            if b[number] != 0.0 and _POLE_FREE[0] ** 2 <= pole <= _POLE_FREE[1] ** 2:
                wave = 1e3 * math.sqrt(pole)
                field_error(
                    ("sellmeier", "c", number), f"puts a pole at {wave:.4g} nm: from 300 to 2500 nm there must be none"
                )
        return Glass("Sellmeier", 1.0, tuple(b), tuple(c))
    known = " or ".join(_FORMS.values())
    raise ValueError(f"must be {known}, got a mapping of {', '.join(map(str, value)) or 'nothing'}")


def _item(value: Mapping[Any, Any], key: str, check: Quantity) -> float:
    if key not in value:
        field_error(key, f"is missing: a glass is given by {_FORMS['index']}")
    try:
        return check(value[key])
    except ValueError as error:
        field_error(key, str(error))


def _numbers(value: Any, path: tuple[str, ...]) -> list[float]:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= _MAX_TERMS:
        field_error(path, f"must be a list of 1 to {_MAX_TERMS} numbers, got {format_value(value)}")
    numbers = []
    for number, item in enumerate(value):
        try:
            numbers.append(_COEFFICIENT(item))
        except ValueError as error:
            field_error((*path, number), str(error))
    return numbers


def _check_visible_index(glass: Glass) -> Glass:
    """Return the glass, if its index is possible for all visible light."""
    with np.errstate(all="ignore"):
        ior = glass.ior(_VISIBLE_NM)
    wrong = ~((ior >= 1.0) & (ior <= MAX_INDEX))
    if wrong.any():
        first = int(np.argmax(wrong))
        raise ValueError(
            f"gives the index {ior[first]:.4g} at {_VISIBLE_NM[first]:g} nm: from 360 to 830 nm it must be between "
            f"1 and {MAX_INDEX:g}"
        )
    return glass


@dataclass(frozen=True)
class GlassCheck(Check):
    """Annotation of a field that holds a `Glass`: a number, a name of the catalogue, or a mapping."""

    def __call__(self, value: Any) -> Glass:
        """Parse a glass.

        Raises
        ------
        ValueError : it is not valid.
        """
        return parse_glass(value)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self, serialization=core_schema.plain_serializer_function_ser_schema(lambda glass: glass.to_plain())
        )

    def json_schema(self) -> JsonSchemaValue:
        """Describe a number, a name, or one of the mappings."""
        number: JsonSchemaValue = {"type": "number", "exclusiveMinimum": 0, "maximum": MAX_INDEX}
        abbe: JsonSchemaValue = {"type": "number", "minimum": 5, "maximum": 200}
        numbers = {"type": "array", "items": {"type": "number"}, "minItems": 1, "maxItems": _MAX_TERMS}
        terms = _closed_schema(
            b=(numbers, "strengths b of the terms b l^2 / (l^2 - c)"),
            c=(numbers, "constants c of the terms (um^2), as many"),
        )
        mappings = [
            _closed_schema(
                index=(number, "index at the d line, 587.6 nm"),
                abbe=(abbe, "Abbe number V_d; n = A + B / l^2 then goes through both"),
            ),
            _closed_schema(cauchy=(numbers, "A, B, C ... of n = A + B / l^2 + C / l^4 + ..., l in um")),
            _closed_schema(sellmeier=(terms, "n^2 = 1 + the sum of b l^2 / (l^2 - c), l in um")),
        ]
        text = {"type": "string", "pattern": quantity_pattern("number")}
        return {"anyOf": [number, {"enum": list(CATALOGUE)}, text, *mappings]}


def _closed_schema(**keys: tuple[JsonSchemaValue, str]) -> JsonSchemaValue:
    """Describe a mapping of these keys, each with its schema and description, and no others."""
    properties = {key: {**schema, "description": description} for key, (schema, description) in keys.items()}
    return {"type": "object", "properties": properties, "required": list(keys), "additionalProperties": False}


IndexField: TypeAlias = Annotated[Glass, GlassCheck()]
"""An index of refraction, which may depend on the wavelength."""
