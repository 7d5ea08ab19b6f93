"""Glass: published indices and Abbe numbers, the formulas, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from raytracer.optics.glass import (
    AIR,
    CATALOGUE,
    LINE_D,
    LINE_F,
    MAX_INDEX,
    IndexField,
    constant_index_glass,
    glass_from_abbe,
    parse_glass,
)
from raytracer.schema.validation_errors import error_sentence

SEEN = np.arange(360.0, 831.0)

# n_d and V_d of Schott's data sheets.
SCHOTT = """
N-FK51A 1.48656 84.47 | N-FK5 1.48749 70.41 | N-PK51 1.52855 76.98 | N-PK52A 1.49700 81.61 | N-BK7 1.51680 64.17 |
K10 1.50137 56.41 | N-K5 1.52249 59.48 | N-ZK7 1.50847 61.19 | N-BAK1 1.57250 57.55 | N-BAK4 1.56883 55.98 |
N-SK4 1.61272 58.63 | N-SK5 1.58913 61.27 | N-SK16 1.62041 60.32 | N-SSK5 1.65844 50.88 | N-SSK8 1.61773 49.83 |
N-BAF10 1.67003 47.11 | N-LAK8 1.71300 53.83 | N-LAK9 1.69100 54.71 | N-LAF2 1.74397 44.85 | N-LAF34 1.77250 49.62 |
N-LASF44 1.80420 46.50 | N-KZFS4 1.61336 44.49 | LLF1 1.54814 45.75 | LF5 1.58144 40.85 | F2 1.62004 36.37 |
N-F2 1.62005 36.43 | F5 1.60342 38.03 | N-BASF2 1.66446 36.00 | SF2 1.64769 33.85 | SF5 1.67270 32.21 |
N-SF5 1.67271 32.25 | N-SF15 1.69892 30.20 | SF1 1.71736 29.51 | SF10 1.72825 28.41 | N-SF10 1.72828 28.53 |
SF4 1.75520 27.58 | SF11 1.78472 25.76 | N-SF11 1.78472 25.68 | SF6 1.80518 25.43 | N-SF6 1.80518 25.36 |
SF57 1.84666 23.83 | N-SF66 1.92286 20.88
"""

# Measured indices by wavelength (nm): Malitson 1965 and 1963; N-BK7's data sheet, lines g and t.
MEASURED = [
    ("fused silica", 404.656, 1.46962),
    ("fused silica", 546.074, 1.46008),
    ("fused silica", 706.519, 1.45515),
    ("CaF2", 589.3, 1.43381),
    ("N-BK7", 435.8343, 1.52668),
    ("N-BK7", 1013.98, 1.50731),
]


FIELD = TypeAdapter(IndexField)


def complaint(value):
    with pytest.raises(ValidationError) as caught:
        FIELD.validate_python(value)
    first = caught.value.errors(include_url=False)[0]
    text = ": ".join([*map(str, first["loc"]), error_sentence(first)])
    assert "\n" not in text
    return text


@pytest.mark.parametrize("row", SCHOTT.split("|"), ids=lambda row: row.split()[0])
def test_the_catalogue_has_the_published_index_and_abbe_number(row):
    name, index, abbe = row.split()
    assert float(CATALOGUE[name].ior(LINE_D)) == pytest.approx(float(index), abs=1e-5)
    assert CATALOGUE[name].abbe() == pytest.approx(float(abbe), abs=0.0051)


@pytest.mark.parametrize(("name", "wavelength", "index"), MEASURED)
def test_indices_as_they_were_measured(name, wavelength, index):
    assert float(CATALOGUE[name].ior(wavelength)) == pytest.approx(index, abs=1.1e-5)


def test_crystals_and_water():
    # What handbooks give for them: diamond's fire is n(430.8) - n(686.7) = 0.044 with n_D = 2.417; water's n_D at 20
    # degrees is 1.3330, and the ordinary ray of sapphire has 1.768.
    diamond = CATALOGUE["diamond"]
    assert float(diamond.ior(430.8) - diamond.ior(686.7)) == pytest.approx(0.044, abs=5e-4)
    for name, index in (("diamond", 2.417), ("water", 1.333), ("sapphire", 1.768)):
        assert float(CATALOGUE[name].ior(589.3)) == pytest.approx(index, abs=5e-4)


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name != "air"])
def test_dispersion_is_normal_and_finite_from_300_to_2500_nm(name):
    glass = CATALOGUE[name]
    assert glass.disperses()
    assert glass.name == name
    assert (np.diff(glass.ior(SEEN)) < 0.0).all()
    assert np.isfinite(glass.ior(np.arange(300.0, 2501.0))).all()


@given(st.floats(1.3, 2.5), st.floats(15.0, 100.0))
def test_an_index_and_an_abbe_number_are_met(index, abbe):
    glass = glass_from_abbe(index, abbe)
    assert float(glass.ior(LINE_D)) == pytest.approx(index, rel=1e-14)
    assert glass.abbe() == pytest.approx(abbe, rel=1e-9)


def test_cauchys_formula():
    glass = parse_glass({"cauchy": [1.5, 0.004, 1e-4]})
    micrometres = np.array([0.4, 0.5, 0.7])
    np.testing.assert_allclose(
        glass.ior(1e3 * micrometres), 1.5 + 0.004 / micrometres**2 + 1e-4 / micrometres**4, rtol=1e-15
    )


def test_sellmeiers_formula():
    glass = parse_glass({"sellmeier": {"b": [1.2, 0.9], "c": [0.01, 100]}})
    square = (1e-3 * LINE_F) ** 2
    expected = math.sqrt(1.0 + 1.2 * square / (square - 0.01) + 0.9 * square / (square - 100.0))
    assert float(glass.ior(LINE_F)) == pytest.approx(expected, rel=1e-15)


@given(st.floats(1e-3, MAX_INDEX))
def test_a_number_is_the_same_for_all_wavelengths_to_the_last_bit(ior):
    glass = parse_glass(ior)
    assert not glass.disperses()
    assert glass.abbe() == math.inf
    assert (glass.ior(SEEN) == ior).all()
    assert glass == constant_index_glass(ior)
    assert len({glass, constant_index_glass(ior)}) == 1


def test_ways_to_write_a_glass():
    assert parse_glass(1) is AIR
    assert parse_glass("3/2") == constant_index_glass(1.5)
    assert parse_glass("N-BK7") is CATALOGUE["N-BK7"]
    assert parse_glass({"index": 1.6, "abbe": "120/2"}) == glass_from_abbe(1.6, 60.0)
    assert parse_glass({"cauchy": [1.5]}) == constant_index_glass(1.5)


FORMULAS = (
    {"index": 1.62, "abbe": 36.4},
    {"cauchy": [1.5, 0.004]},
    {"sellmeier": {"b": [1.2, 0.9], "c": [0.01, 100.0]}},
)


@pytest.mark.parametrize("value", [1.0, 1.5, "N-SF10", "PMMA", *FORMULAS])
def test_a_glass_is_written_as_it_was_read(value):
    assert parse_glass(value).to_plain() == value
    assert parse_glass(parse_glass(value).to_plain()) == parse_glass(value)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("N-BK8", "unknown glass 'N-BK8'; did you mean 'N-BK7'?"),
        ("n-sf10", "did you mean 'N-SF10'?"),
        ("qqq", "unknown glass 'qqq'; known glasses: N-FK51A, "),
        ("1.5 mm", "must be a plain number without a unit"),
        (0, "must be greater than 0, got 0"),
        (6, "must be at most 5, got 6"),
        (True, "must be a number"),
        (math.nan, "must be a number, got nan"),
        ({}, "got a mapping of nothing"),
        ({"index": 1.5}, "abbe: is missing"),
        ({"abbe": 50}, "index: is missing"),
        ({"index": 1.5, "abbe": 0}, "abbe: must be at least 5, got 0"),
        ({"index": 1.5, "v": 50}, "must be {index: 1.5168, abbe: 64.17} or"),
        ({"cauchy": 1.5}, "cauchy: must be a list of 1 to 8 numbers, got 1.5"),
        ({"cauchy": []}, "cauchy: must be a list"),
        ({"cauchy": [0.2, 0.1]}, "gives the index 0.9716 at 360 nm"),
        ({"cauchy": [1.5, "b"]}, "cauchy: 1: must be a number"),
        ({"cauchy": [1.5, 1]}, "gives the index 9.216 at 360 nm: from 360 to 830 nm it must be between 1 and 5"),
        ({"sellmeier": [1, 2]}, "sellmeier: must hold b and c"),
        ({"sellmeier": {"b": [1, 2], "c": [0.01]}}, "sellmeier: must hold as many b as c, got 2 and 1"),
        ({"sellmeier": {"b": [1], "c": [0.25]}}, "sellmeier: c: 0: puts a pole at 500 nm"),
        ({"sellmeier": {"b": [1, 1], "c": [0.01, 4]}}, "sellmeier: c: 1: puts a pole at 2000 nm"),
        ({"sellmeier": {"b": [-3], "c": [0.01]}}, "gives the index nan at 360 nm"),
    ],
)
def test_what_is_no_glass(value, expected):
    assert expected in complaint(value)


anything = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=6) | st.sampled_from(["N-BK7", "1.5", "F2"]),
    lambda below: (
        st.lists(below, max_size=4)
        | st.dictionaries(st.sampled_from(["index", "abbe", "cauchy", "sellmeier", "b", "c"]), below, max_size=3)
    ),
    max_leaves=8,
)


def outcome(value):
    try:
        return FIELD.validate_python(value)
    except ValidationError as error:
        return error_sentence(error.errors(include_url=False)[0])


@given(anything)
def test_anything_is_a_glass_that_can_be_seen_through_or_an_error(value):
    found = outcome(value)
    if isinstance(found, str):
        assert "\n" not in found
        return
    ior = found.ior(SEEN)
    assert ((ior > 0.0) & (ior <= MAX_INDEX)).all()
    assert parse_glass(found.to_plain()).ior(LINE_D) == found.ior(LINE_D)
