"""The JSON Schema: valid by its dialect, and of one mind with the checks."""

import contextlib
import json
from pathlib import Path

import pytest

from raytracer.scene.json_schema import scene_schema
from raytracer.scene.load import build
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import SceneError

jsonschema = pytest.importorskip("jsonschema")

SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}
film: {width: 8, height: 6, filter: box}
materials: {grey: {type: lambertian, albedo: 0.5}}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: grey}]
"""


@pytest.fixture(scope="module")
def validator():
    return jsonschema.Draft202012Validator(scene_schema())


def test_it_is_a_schema_in_plain_json():
    jsonschema.Draft202012Validator.check_schema(scene_schema())
    assert json.loads(json.dumps(scene_schema(), allow_nan=False)) == scene_schema()


def first_of_each(objects):
    """Those that have other keys than all before them: a schema hardly tells the others apart."""
    return list(
        {json.dumps([(key, type(item[key]).__name__) for key in item]): item for item in objects[::-1]}.values()
    )


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_scenes_of_the_repository_conform(validator, every):
    for path in sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml")):
        root = parse(path.read_text(encoding="utf-8"), str(path))
        assert root is not None
        plain = root.plain()
        validator.validate(plain if every else {**plain, "objects": first_of_each(plain["objects"])})


@pytest.mark.parametrize(
    ("old", "new", "valid"),
    [
        ("", "", True),
        ("[0, 0, 4]", "[0, 20 mm, 4]", True),
        ("material: grey", "material: {type: metal, albedo: 0.5}", True),
        ("radius: 1", "radius: 1, transform: [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}]", True),
        ("materials:", "lights: [{type: sun, direction: [0, -1, 0], irradiance: 3, angle: 1}]\nmaterials:", True),
        ("materials:", "environment: {type: sky, turbidity: 4, sun: true}\nmaterials:", True),
        ("vfov: 40", "vfv: 40", False),
        ("vfov: 40", "vfov: 180", False),
        ("vfov: 40", "vfov: 0.5 rad", True),
        ("vfov: 40", "vfov: 40 mm", False),
        ("albedo: 0.5", "albedo: [0.1, 1/2, 0.3]", True),
        ("filter: box", "filter: bx", False),
        ("type: pinhole, ", "", False),
        ("width: 8", "width: 0", False),
        ("material: grey", "material: {type: metl}", False),
        ("albedo: 0.5", "albedo: [0.1, 0.2]", False),
        ("radius: 1", "radius: 1, transform: [{scale: 0}]", False),
        ("materials:", "lights: [{type: sun, direction: [0, -1, 0], irradiance: 3, angle: 181}]\nmaterials:", False),
        ("materials:", "lights: [{type: sun, direction: [0, -1, 0]}]\nmaterials:", False),
    ],
)
def test_it_agrees_with_the_checks(validator, old, new, valid):
    text = SCENE.replace(old, new)
    root = parse(text, "f")
    assert root is not None
    assert validator.is_valid(root.plain()) is valid
    with contextlib.nullcontext() if valid else pytest.raises(SceneError):
        build(text, "f")


def test_descriptions_tell_units_and_a_default_is_what_a_file_could_have():
    definitions = scene_schema()["$defs"]
    assert "degrees" in definitions["Pinhole"]["properties"]["vfov"]["description"]
    assert "metres" in definitions["Sphere"]["properties"]["center"]["description"]
    assert definitions["Dielectric"]["properties"]["ior"]["default"] == 1.5


def test_defaults_are_values_that_the_schema_takes(validator):
    found = 0
    for definition in scene_schema()["$defs"].values():
        for key, node in definition.get("properties", {}).items():
            if "default" in node:
                found += 1
                part = validator.evolve(schema={**node, "$defs": scene_schema()["$defs"]})
                assert part.is_valid(node["default"]), key
    assert found > 100
