"""Loading: places of errors, overrides, names, relative files, and the speed of checking by count of passes."""

import math
import re

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
    first, small = scene().objects
    assert (first.material, small.radius, small.material.fuzz) == ("grey", 0.02, 0.25)


def test_a_filter_is_a_name_or_a_mapping():
    filters = ("", ", filter: box", ", filter: {type: box}")
    named = [scene(SCENE.replace("height: 6", f"height: 6{written}")).film for written in filters]
    assert named[0] == named[1] == named[2]


def test_defaults():
    result = scene()
    sampling = {"spp": 64, "sampler": "sobol", "accuracy": "exact", "seed": 0, "clamp": None}
    paths = {"max_depth": 50, "rr_depth": 5, "light_sampling": "mis"}
    assert result.render.model_dump() == sampling | paths
    assert result.environment is None
    assert result.film.filter.type == "box"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("  type: pinhole\n", "", "scene.yaml:1: camera: needs a type, one of"),
        ("width", "widht", "scene.yaml:5: film.widht: unknown key 'widht' of film; did you mean 'width'?"),
        ("albedo: 0.5", "albedo: [0.5, 1.5, 0]", "scene.yaml:7: materials.grey.albedo[1]: must be at most 1, got 1.5"),
        ("radius: 20 mm", "radius: 20 mmm", "scene.yaml:12: objects[1].radius: has the unknown unit 'mmm'"),
        ("fuzz: 1/4", "fuz: 1/4", "scene.yaml:13: objects[1].material.fuz: unknown key 'fuz' of metal; did you"),
        ("materials:", "materials: 3\nm:", "scene.yaml:6: materials: must be a mapping, got 3"),
        ("objects:", "objects:\n  3\no:", "scene.yaml:8: objects: must be a list, got 3"),
        (SCENE, "- 1\n", "scene.yaml:1: must be a mapping (camera, film"),
        (SCENE, "", "scene.yaml: is empty; a scene needs at least camera and film"),
        (SCENE, "~\n", "scene.yaml: is empty; a scene needs at least camera and film"),
        # Of several errors the first in the document.
        (
            SCENE,
            SCENE.replace("vfov: 40", "vfov: -1").replace("s: 1", "s: x") + "rendr: {}",
            "scene.yaml:4: camera.vfov",
        ),
        (SCENE, SCENE.replace("s: 1", "s: x") + "rendr: {}", "scene.yaml:9: objects[0].radius"),
    ],
)
def test_an_error_names_line_key_and_remedy(old, new, expected):
    assert complaint(SCENE.replace(old, new)).startswith(expected)


def test_an_error_in_an_alias_names_the_line_where_it_is_written():
    text = SCENE.replace("grey: {type: lambertian, albedo: 0.5}", "grey: &g {type: lambertian, albedo: 5}\n  more: *g")
    assert complaint(text).startswith("scene.yaml:7: materials.grey.albedo")


# ---- Overrides


def test_overrides_replace_values_by_path_and_stand_for_what_is_missing():
    result = scene(
        SCENE.replace("width: 8, ", ""),
        **{
            "camera.vfov": "0.5 rad",
            "camera.look_from": np.array([0.0, 1.0, 4.0]),
            "objects[1].radius": 2,
            "objects.ball.radius": 3,
            "render.spp": np.int64(7),
            "film.width": 9,
        },
    )
    assert result.camera.vfov == pytest.approx(math.degrees(0.5))
    assert result.camera.look_from == (0.0, 1.0, 4.0)
    assert [item.radius for item in result.objects] == [3.0, 2.0]
    assert (result.render.spp, result.film.width) == (7, 9)


def test_override_options_are_yaml():
    found = parse_overrides(["a.b=1e-3", "c=[1, x]", "d=50 mm", "e=", "f=a=b"])
    assert found == {"a.b": 0.001, "c": [1, "x"], "d": "50 mm", "e": None, "f": "a=b"}
    with pytest.raises(InputError, match="is refused"):
        parse_overrides(["a=!!python/object:x 1"])


# ---- Files


def test_files_are_relative_to_the_scene(tmp_path):
    (tmp_path / "rock.ply").write_bytes(b"ply")
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE + "  - {type: mesh, file: rock.ply}\n")
    result = load(path)
    assert result.base == tmp_path
    error = result.error("has no triangles", "objects", 2, "file")
    assert str(error) == f"{path}:14: objects[2].file: has no triangles"


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


def test_all_that_is_wrong_is_told_at_once(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "camera: {type: pinhole, fov: 30, look_from: [1, 2]}\nfilm: {width: 0, heigth: 30}\nobjects:\n"
        "  - {type: sphere, center: [0, 0], radius: big}\n  - {type: sphere, center: [0, 1, 2], radius: 1}\n"
        "  - {type: cube}\n"
    )
    with pytest.raises(SceneError) as caught:
        load(path)
    told = [(one.line, one.key) for one in (caught.value, *caught.value.others)]
    assert told[0][0] == 1
    assert set(told) == {
        (1, "camera.fov"), (1, "camera.look_from"), (2, "film.width"), (2, "film.heigth"),
        (4, "objects[0].center"), (4, "objects[0].radius"), (6, "objects[2].type"),
    }  # fmt: skip
