"""Lens files: what they say, and every mistake as one sentence with file, line and key."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from raytracer.cli.base.app import main
from raytracer.optics.glass import AIR, CATALOGUE, constant_index_glass
from raytracer.optics.lens_system.importers import as_yaml
from raytracer.optics.lens_system.lens import Element, Focus, Lens
from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.scene.assets import LOADERS
from raytracer.scene.assets.lenses import read_lens, read_prescription
from raytracer.scene.json_schema import lens_schema
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import SceneError
from tests.optics.lens_system.test_shipped_lenses import every_lens

LENS = """\
name: test
source: nobody
focal_length: 5 cm
focus: {moves: group, first: 2, last: 3}
surfaces:
  - {type: conic, radius: 40, conic: -1.5, thickness: 4, material: N-BK7, aperture: 20}
  - {type: asphere, conic: 2, coefficients: [1e-5, -2e-8], thickness: 1, aperture: 18, coating: mgf2}
  - {type: stop, thickness: 2, aperture: 10}
  - {type: cylindrical, axis: y, radius: -60, thickness: 3, material: {index: 1.62, abbe: 36.4}, aperture: 16}
  - {type: flat, thickness: 2, material: 1.5, aperture: 16}
  - type: spherical
    radius: -70
    aperture: 16
    coating: {type: mgf2, wavelength: 480}
"""


def written(folder, text):
    path = folder / "lens.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def complaint(folder, text):
    with pytest.raises(SceneError) as caught:
        read_lens(written(folder, text))
    told = str(caught.value)
    assert "\n" not in told
    assert told.startswith(str(folder / "lens.yaml"))
    return told.removeprefix(str(folder / "lens.yaml"))


def test_what_a_file_says_is_what_the_lens_is(tmp_path):
    lens = LOADERS["lens"](written(tmp_path, LENS))
    assert (lens.name, lens.source, lens.focal_length, lens.f_number) == ("test", "nobody", 50.0, None)
    assert lens.focus == Focus("group", 2, 3)
    conic, asphere, stop, cylinder, flat, sphere = lens.elements
    assert (conic.kind, conic.curvature, conic.conic, conic.thickness, conic.radius) == ("conic", 1 / 40, -1.5, 4, 10)
    assert conic.glass is CATALOGUE["N-BK7"]
    assert (asphere.kind, asphere.curvature, asphere.conic) == ("asphere", 0.0, 2.0)
    assert asphere.coefficients == (1e-5, -2e-8)
    assert asphere.glass is AIR
    assert (stop.kind, stop.is_stop, stop.radius, stop.glass) == ("stop", True, 5.0, AIR)
    assert (cylinder.kind, cylinder.axis, cylinder.curvature) == ("cylindrical", "y", -1 / 60)
    assert (float(cylinder.glass.ior()), cylinder.glass.abbe()) == pytest.approx((1.62, 36.4))
    assert (flat.kind, flat.curvature, flat.glass) == ("flat", 0.0, constant_index_glass(1.5))
    assert (sphere.kind, sphere.curvature, sphere.thickness, sphere.glass) == ("spherical", -1 / 70, 0.0, AIR)
    coatings = [element.coating and element.coating.wavelength for element in lens.elements]
    assert coatings == [None, 550.0, None, None, None, 480.0]
    assert lens.disperses()


@pytest.mark.parametrize(("second", "wavelength"), [("mgf2", 550.0), ("none", None)])
def test_a_coating_of_the_lens_is_on_all_surfaces_between_glass_and_air_but_those_that_are_bare(
    second, wavelength, tmp_path
):
    text = LENS.replace("name: test", "name: test\ncoating: {type: mgf2, wavelength: 600}")
    lens = read_lens(written(tmp_path, text.replace("coating: mgf2", f"coating: {second}")))
    coatings = [element.coating and element.coating.wavelength for element in lens.elements]
    assert coatings == [600.0, wavelength, None, 600.0, None, 480.0]


def test_the_rim_of_glass_may_be_the_stop(tmp_path):
    text = LENS.replace("  - {type: stop, thickness: 2, aperture: 10}\n", "").replace(
        "radius: -70", "radius: -70\n    stop: true"
    )
    assert [element.is_stop for element in read_lens(written(tmp_path, text)).elements] == [False] * 4 + [True]


def test_a_stop_in_glass_is_in_that_glass(tmp_path):
    text = """\
name: in glass
surfaces:
  - {type: spherical, radius: 30, thickness: 4, material: N-BK7, aperture: 10}
  - {type: stop, thickness: 4, aperture: 8}
  - {type: spherical, radius: -30, aperture: 10}
"""
    lens = read_lens(written(tmp_path, text))
    assert lens.elements[1].glass is CATALOGUE["N-BK7"]


def test_the_whole_lens_moves_by_default(tmp_path):
    text = LENS.replace("focus: {moves: group, first: 2, last: 3}\n", "")
    assert read_lens(written(tmp_path, text)).focus.moves == "all"
    assert (
        read_lens(written(tmp_path, LENS.replace("{moves: group, first: 2, last: 3}", "sensor"))).focus.moves
        == "sensor"
    )


MISTAKES = [
    ("radius: 40", "radius: 0", ":6: surfaces[0].radius: must be neither zero nor infinite, got 0: flat glass is"),
    ("radius: 40", "radius: inf", ":6: surfaces[0].radius: must be neither zero nor infinite"),
    ("radius: 40, ", "", ":6: surfaces[0].radius: is missing"),
    ("radius: 40", "raduis: 40", ":6: surfaces[0].raduis: unknown key 'raduis' of conic; did you mean 'radius'?"),
    ("conic: -1.5, ", "", ":6: surfaces[0].conic: is missing"),
    ("conic: 2, coefficients: [1e-5, -2e-8]", "conic: 2", ":7: surfaces[1].coefficients: is missing"),
    ("[1e-5, -2e-8]", "[]", ":7: surfaces[1].coefficients: must hold at least 1 values"),
    ("[1e-5, -2e-8]", "[a]", ":7: surfaces[1].coefficients[0]: must be a number"),
    ("thickness: 4", "thickness: -4", ":6: surfaces[0].thickness: must be at least 0, got -4"),
    ("thickness: 4, ", "", ":6: surfaces[0].thickness: is missing: only the last surface needs none"),
    ("N-BK7", "N-BK6", ":6: surfaces[0].material: unknown glass 'N-BK6'; did you mean 'N-BK7'?"),
    ("abbe: 36.4", "abbe: -3", ":9: surfaces[3].material.abbe: must be at least 5, got -3"),
    ("material: 1.5", "material: 0", ":10: surfaces[4].material: must be greater than 0, got 0"),
    ("aperture: 20", "aperture: 0", ":6: surfaces[0].aperture: must be greater than 0"),
    ("radius: -70", "radius: -7", ":13: surfaces[5].aperture: must be at most 14 mm, as wide as its surface"),
    ("axis: y", "axis: z", ":9: surfaces[3].axis: must be one of x, y, got 'z'"),
    ("axis: y, ", "", ":9: surfaces[3].axis: is missing"),
    ("type: flat", "type: flaat", ":10: surfaces[4].type: unknown type of surface 'flaat'; did you mean 'flat'?"),
    ("type: flat, ", "", ":10: surfaces[4]: needs a type, one of spherical, flat, stop, conic, asphere, cylindrical"),
    ("{type: stop, thickness: 2, aperture: 10}", "7", ":8: surfaces[2]: must be a mapping with a type"),
    ("type: flat, thickness: 2, material: 1.5", "type: stop, thickness: 2", ":10: surfaces[4].type: is a second stop"),
    ("material: N-BK7", "stop: true, material: N-BK7", ":8: surfaces[2].type: is a second stop"),
    ("coating: mgf2", "coating: gold", ":7: surfaces[1].coating: must be one of mgf2, none, got 'gold'"),
    ("wavelength: 480", "wavelength: 0.48", ":14: surfaces[5].coating.wavelength: must be at least 300"),
    ("material: 1.5, aperture: 16", "material: 1.5, aperture: 16, coating: mgf2", "[4].coating: only a surface"),
    ("    coating: {type: mgf2, wavelength: 480}", "    material: 1.7", ":14: surfaces[5].material: must be air"),
    ("first: 2, last: 3", "first: 3, last: 2", ":4: focus.last: must be at least 3, the first surface, got 2"),
    ("first: 2, last: 3", "first: 2, last: 9", ":4: focus.last: there is no surface 9: the lens has 6"),
    ("first: 2, last: 3", "first: 2", ":4: focus.last: is missing: a group has a first and a last surface"),
    ("moves: group, ", "moves: all, ", ":4: focus.first: goes with moves: group"),
    ("moves: group, first: 2, last: 3", "moves: grop", ":4: focus.moves: must be one of all, sensor, group"),
    ("name: test\n", "", ":1: name: is missing"),
    ("focal_length: 5 cm", "focal_length: 0", ":3: focal_length: must not be zero"),
    ("source: nobody", "sauce: nobody", ":2: sauce: unknown key 'sauce' of lens; did you mean 'source'?"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "expected"), MISTAKES, ids=[mistake[1][:30] or mistake[0] for mistake in MISTAKES]
)
def test_a_mistake_is_told_with_line_and_key(tmp_path, old, new, expected):
    assert old in LENS
    assert expected in complaint(tmp_path, LENS.replace(old, new, 1))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ": is empty; a lens needs at least name and surfaces"),
        ("[1, 2]", ":1: must be a mapping (name, "),
        ("name: a\nsurfaces: []\n", ":2: surfaces: must hold at least 1 values, got 0"),
        (
            "name: a\nsurfaces:\n  - {type: spherical, radius: 30 s, aperture: 2}\n",
            ":3: surfaces[0].radius: must be a length",
        ),
        ("name: a\nsurfaces: 3\n", ":2: surfaces: must be a list, got 3"),
        ("name: a\nname: b\n", ":2: the key 'name' is given twice"),
        ("name: [\n", "not valid YAML"),
        ("\0", ": is a binary file, not a lens in YAML"),
    ],
)
def test_what_is_no_lens_file(tmp_path, text, expected):
    assert expected in complaint(tmp_path, text)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(SceneError, match="no such file"):
        read_lens(tmp_path / "none.yaml")
    with pytest.raises(SceneError, match="is a folder, not a lens file"):
        read_lens(tmp_path)


def outcome(path):
    try:
        return read_lens(path)
    except SceneError as error:
        return str(error)


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_a_lens_or_a_sentence(data, tmp_path_factory):
    text = LENS
    for _ in range(data.draw(st.integers(1, 3))):
        place, cut = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 6))
        added = data.draw(st.text("0123456789-.:,{}[]e \nabx'\"#&*", max_size=3))
        text = text[:place] + added + text[place + cut :]
    found = outcome(written(tmp_path_factory.getbasetemp(), text))
    if isinstance(found, str):
        assert "\n" not in found
    else:
        assert all(0.0 < element.radius < math.inf for element in found.elements)


@every_lens
def test_a_lens_is_written_as_it_was_read(tmp_path, path):
    spec = read_prescription(path)
    again = read_prescription(written(tmp_path, as_yaml(spec)))
    assert again == spec
    assert again.lens() == spec.lens()


@pytest.fixture(scope="module")
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(lens_schema())
    assert json.loads(json.dumps(lens_schema(), allow_nan=False)) == lens_schema()
    return jsonschema.Draft202012Validator(lens_schema())


def test_the_command_prints_the_schema(capsys):
    assert main(["schema", "--lens"]) == 0
    assert json.loads(capsys.readouterr().out) == lens_schema()


@every_lens
def test_the_shipped_lenses_conform_to_the_schema(validator, path):
    root = parse(path.read_text(encoding="utf-8"), str(path))
    validator.validate(root.plain())


@pytest.mark.parametrize(
    ("old", "new", "valid"),
    [
        ("", "", True),
        ("radius: 40", "radius: 4 cm", True),
        ("focus: {moves: group, first: 2, last: 3}", "focus: sensor", True),
        ("material: N-BK7", "material: {sellmeier: {b: [1.03], c: [0.006]}}", True),
        ("material: N-BK7", "material: {cauchy: [1.5, 0.004]}", True),
        ("material: N-BK7", "material: nothing", False),
        ("material: N-BK7", "material: {index: 1.5}", False),
        ("radius: 40", "radius: 0", False),
        ("aperture: 20", "aperture: -20", False),
        ("type: flat", "type: flaat", False),
        ("type: flat, ", "", False),
        ("axis: y", "axis: z", False),
        ("coating: mgf2", "coating: gold", False),
        ("name: test\n", "", False),
    ],
)
def test_schema_and_check_are_of_one_mind(tmp_path, validator, old, new, valid):
    text = LENS.replace(old, new, 1)
    root = parse(text, "lens.yaml")
    assert validator.is_valid(root.plain()) == valid
    if valid:
        assert isinstance(read_prescription(written(tmp_path, text)), LensSpec)
    else:
        complaint(tmp_path, text)


def test_surfaces_that_go_through_each_other_are_found():
    # Two spheres of 50 mm that face each other: the gap at the height h is t - 2 (R - sqrt(R^2 - h^2)).
    def lens(thickness):
        front = Element(curvature=1.0 / 50.0, thickness=thickness, glass=constant_index_glass(1.5), radius=10.0)
        return Lens("biconvex", (front, Element(curvature=-1.0 / 50.0, thickness=0.0, glass=AIR, radius=10.0)))

    least = 2.0 * (50.0 - math.sqrt(50.0**2 - 10.0**2))
    assert lens(least + 0.01).crossings() == []
    assert lens(least - 0.05).crossings() == [(1, 2)]
