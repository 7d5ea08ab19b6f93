"""Loading: places of errors, overrides, names, relative files, and the speed of checking by count of passes."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from raytracer.scene.load import build, load
from raytracer.scene.overrides import parse_overrides
from raytracer.schema.yaml_nodes import path_text
from raytracer.util.errors import InputError, SceneError

SCENE = """\
camera:
  type: pinhole
  look_from: [0, 0, 4]
  vfov: 40
film: {width: 8, height: 6}
materials:
  grey: {type: lambertian, albedo: 0.5}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: grey}
  - type: sphere
    center: [3, 0, 0]
    radius: 20 mm
    material: {type: metal, albedo: [0.5, 0.6, 0.7], fuzz: 1/4}
"""


def scene(text=SCENE, **overrides):
    return build(text, "scene.yaml", overrides)


def complaint(text, overrides=None):
    with pytest.raises(SceneError) as caught:
        build(text, "scene.yaml", overrides)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_values_arrive_in_their_units():
    result = scene()
    assert (result.film.width, result.film.height) == (8, 6)
    small = result.objects[1]
    assert small.radius == 0.02
    assert small.material.fuzz == 0.25
    assert result.objects[0].material == "grey"


def test_defaults():
    result = scene()
    assert result.render.model_dump() == {
        "spp": 64,
        "max_depth": 50,
        "sampler": "sobol",
        "accuracy": "exact",
        "seed": 0,
        "rr_depth": 5,
        "light_sampling": "mis",
        "clamp": None,
    }
    assert result.environment is None
    assert result.film.filter.type == "box"


def test_a_filter_is_a_name_or_a_mapping():
    named = scene(SCENE.replace("height: 6", "height: 6, filter: box"))
    written = scene(SCENE.replace("height: 6", "height: 6, filter: {type: box}"))
    assert named.film == written.film == scene().film


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("vfov", "vfv", "scene.yaml:4: camera.vfv: unknown key 'vfv' of pinhole; did you mean 'vfov'?"),
        ("vfov: 40", "vfov: 180", "scene.yaml:4: camera.vfov: must be less than 180, got 180"),
        ("vfov: 40", "vfov: 40 mm", "scene.yaml:4: camera.vfov: must be an angle in degrees"),
        ("look_from: [0, 0, 4]", "look_from: [0, 4]", "scene.yaml:3: camera.look_from: must be a point"),
        ("[0, 0, 4]", "[0, 0, -1]", "scene.yaml:1: camera: look_from and look_at are the same point"),
        ("pinhole", "pinhol", "scene.yaml:2: camera.type: unknown type of camera 'pinhol'; did you mean 'pinhole'?"),
        ("  type: pinhole\n", "", "scene.yaml:1: camera: needs a type, one of"),
        ("width: 8, ", "", "scene.yaml:5: film.width: is missing"),
        ("width: 8", "width: 0", "scene.yaml:5: film.width: must be at least 1, got 0"),
        ("width: 8", "width: 8.5", "scene.yaml:5: film.width: must be an integer, got 8.5"),
        ("width: 8, height: 6", "width: 65536, height: 65536", "film: is too large: 65536 x 65536 is 4,294,967,296 p"),
        ("height: 6", "height: 6, filter: bx", "scene.yaml:5: film.filter: unknown type of filter 'bx'"),
        ("albedo: 0.5", "albedo: [0.5, 1.5, 0]", "scene.yaml:7: materials.grey.albedo[1]: must be at most 1, got 1.5"),
        ("material: grey", "material: gray", "scene.yaml:9: objects[0].material: unknown material 'gray'; did you"),
        ("radius: 20 mm", "radius: 20 mmm", "scene.yaml:12: objects[1].radius: has the unknown unit 'mmm'"),
        ("fuzz: 1/4", "fuz: 1/4", "scene.yaml:13: objects[1].material.fuz: unknown key 'fuz' of metal; did you"),
        ("  - type: sphere", "  - type: sphere\n    name: ball", "scene.yaml:11: objects[1].name: 'ball' is already"),
        ("  grey:", '  "": {type: lambertian}\n  grey:', "scene.yaml:7: materials.: must be a name, got ''"),
        ("materials:", "materials: 3\nm:", "scene.yaml:6: materials: must be a mapping, got 3"),
        ("objects:", "objects:\n  3\no:", "scene.yaml:8: objects: must be a list, got 3"),
    ],
)
def test_an_error_names_line_key_and_remedy(old, new, expected):
    assert old in SCENE
    assert expected in complaint(SCENE.replace(old, new))


def test_of_several_errors_the_first_in_the_document_is_told():
    text = SCENE.replace("vfov: 40", "vfov: -1").replace("radius: 1", "radius: x") + "rendr: {}\n"
    assert complaint(text).startswith("scene.yaml:4: camera.vfov")
    assert complaint(text.replace("vfov: -1", "vfov: 1")).startswith("scene.yaml:9: objects[0].radius")


def test_a_misspelt_key_is_told_before_the_key_it_stands_for_is_missed():
    assert "unknown key 'widht' of film; did you mean 'width'?" in complaint(SCENE.replace("width", "widht"))


def test_an_error_in_an_alias_names_the_line_where_it_is_written():
    text = SCENE.replace("grey: {type: lambertian, albedo: 0.5}", "grey: &g {type: lambertian, albedo: 5}\n  more: *g")
    assert complaint(text).startswith("scene.yaml:7: materials.grey.albedo")


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "~\n"])
def test_an_empty_scene_is_told(text):
    assert complaint(text) == "scene.yaml: is empty; a scene needs at least camera and film"


def test_a_scene_that_is_a_list_is_told():
    assert complaint("- 1\n").startswith("scene.yaml:1: must be a mapping (camera, film")


# ---- Overrides


def test_overrides_replace_values_by_path():
    overrides = {
        "camera.vfov": "0.5 rad",
        "objects[1].radius": 2,
        "objects.ball.radius": 3,
        "render.spp": 7,
        "film.width": 9,
    }
    result = scene(**overrides)
    assert result.camera.vfov == pytest.approx(math.degrees(0.5))
    assert [item.radius for item in result.objects] == [3.0, 2.0]
    assert (result.render.spp, result.film.width) == (7, 9)


def test_an_override_from_python_may_be_an_array():
    overrides = {"camera.look_from": np.array([0.0, 1.0, 4.0]), "render.spp": np.int64(7)}
    result = scene(**overrides)
    assert result.camera.look_from == (0.0, 1.0, 4.0)
    assert result.render.spp == 7


def test_an_override_can_stand_for_what_is_missing():
    assert scene(SCENE.replace("width: 8, ", ""), **{"film.width": 5}).film.width == 5


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ({"camera.vfov": 200}, "-D camera.vfov=200: camera.vfov: must be less than 180, got 200"),
        ({"camera.vfv": 20}, "-D camera.vfv=20: camera.vfv: unknown key 'vfv' of pinhole; did you mean 'vfov'?"),
        ({"camra.vfov": 20}, "-D camra.vfov=20: camra: unknown key 'camra' of scene; did you mean 'camera'?"),
        (
            {"objects.bal.radius": 2},
            "-D objects.bal.radius=2: there is no item of the name 'bal'; did you mean 'ball'?",
        ),
        ({"objects[7].radius": 2}, "-D objects[7].radius=2: there is no item 7; the list has 2"),
        ({"film.width.x": 2}, "-D film.width.x=2: 'x' is not below 8, which is neither a list nor a mapping"),
        ({"camera.look_from": [0, 0]}, "-D camera.look_from=[0, 0]: camera.look_from: must be a point of three"),
        (
            {"objects.ball.material": {"type": "metl"}},
            "-D objects.ball.material={type: metl}: objects[0].material.type",
        ),
        ({"camera.look_from": None}, "-D camera.look_from=null: camera.look_from: must be a point of three"),
    ],
)
def test_an_error_of_an_override_names_the_option(overrides, expected):
    assert complaint(SCENE, overrides).startswith(expected)


def test_override_options_are_yaml():
    assert parse_overrides(["a.b=1e-3", "c=[1, x]", "d=50 mm", "e=", "f=a=b"]) == {
        "a.b": 0.001,
        "c": [1, "x"],
        "d": "50 mm",
        "e": None,
        "f": "a=b",
    }


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["camera.vfov"], "must be key.path=value"),
        (["=3"], "is not a path"),
        (["a..b=3"], "is not a path"),
        (["a=1", "a=2"], "a is given twice"),
        (["a=[1"], "-D a=[1: not valid YAML"),
        (["a=!!python/object:x 1"], "is refused"),
    ],
)
def test_a_wrong_override_option_is_told(options, words):
    with pytest.raises(InputError) as caught:
        parse_overrides(options)
    assert words in str(caught.value)


# ---- Files


def test_files_are_relative_to_the_scene(tmp_path):
    (tmp_path / "rock.ply").write_bytes(b"ply")
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE + "  - {type: mesh, file: rock.ply}\n")
    result = load(path)
    assert result.base == tmp_path
    error = result.error("has no triangles", "objects", 2, "file")
    assert str(error) == f"{path}:14: objects[2].file: has no triangles"
    (tmp_path / "rock.ply").unlink()
    with pytest.raises(SceneError, match=r"scene.yaml:14: objects\[2\].file: there is no file 'rock.ply' in"):
        load(path)
    (tmp_path / "rock.ply").mkdir()
    with pytest.raises(SceneError, match=r"'rock.ply' is a folder"):
        load(path)


def test_the_scenes_of_the_repository_are_valid():
    found = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))
    assert found
    for path in found:
        # Others name files that `make scenes` makes.
        if "generated/" not in path.read_text():
            assert load(path).objects


# ---- Whatever comes


TEXTS = st.text(max_size=6) | st.sampled_from(["grey", "sphere", "1 mm", "inf", "1/0", "{", "- ", "*a", "&a ", "<<: "])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | TEXTS,
    lambda below: st.lists(below, max_size=4) | st.dictionaries(TEXTS, below, max_size=3),
    max_leaves=8,
)


def paths(value, path=()):
    below = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found = [path_text(path)] if path else []
    return found + [deeper for key, item in below for deeper in paths(item, (*path, key))]


EVERYWHERE = """
camera: {type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], up: [0, 1, 0], vfov: 40, aperture: 1}
film: {width: 8, height: 6, filter: {type: box}}
render: {spp: 1, max_depth: 2, sampler: sobol, accuracy: exact, seed: 0, rr_depth: 2}
environment: {type: gradient, horizon: 1, zenith: [1, 1, 1]}
materials: {grey: {type: lambertian, albedo: 0.5}, glass: {type: dielectric, ior: 1.5}}
objects:
- {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: grey}
- {type: quad, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 1, 0]], material: {type: metal, albedo: 0.5, fuzz: 0.1}}
- type: triangle
  vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
  transform: {matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
- {type: box, min: [0, 0, 0], max: [1, 1, 1], transform: [{rotate: {axis: [0, 1, 0], angle: 3}}]}
- {type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 1, transform: [{scale: 2}, {translate: [0, 0, 1]}]}
"""
JARGON = re.compile(r"Input should|valid |validat|\[type=|Value error|\bNone\b|\bdict\b|\btuple\b|pydantic|Error")


def one_sentence_or_a_scene(text, overrides=None):
    try:
        build(text, "scene.yaml", overrides)
    except SceneError as error:
        refusal = error
    else:
        return
    assert str(refusal).isprintable()
    assert str(refusal).startswith(("scene.yaml:", "-D "))
    # What was given is quoted, so it may say anything.
    own = re.sub(r"'[^']*'|\"[^\"]*\"", "", refusal.message).replace("not valid YAML", "")
    assert not JARGON.search(own), own


@given(path=st.sampled_from(paths(yaml.safe_load(EVERYWHERE))), value=VALUES)
def test_any_value_anywhere_is_taken_or_refused_in_one_sentence(path, value):
    one_sentence_or_a_scene(EVERYWHERE, {path: value})


@given(start=st.integers(0, len(EVERYWHERE)), length=st.integers(0, 9), new=TEXTS)
def test_any_damage_to_the_text_is_survived_or_refused_in_one_sentence(start, length, new):
    one_sentence_or_a_scene(EVERYWHERE[:start] + new + EVERYWHERE[start + length :])
