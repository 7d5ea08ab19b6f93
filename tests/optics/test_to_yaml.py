"""Checked scenes written back: what is read again is the same, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import BaseModel

import raytracer as rt
from raytracer.optics.to_yaml import spec_to_plain, to_yaml
from raytracer.scene.load import build, build_plain, load
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError
from tests.repository import SCENES, need_files_of
from tests.scene.test_python_api import SCENE as BALL

SCENE = """\
camera:
  {type: thin_lens, look_from: [0, 1, 20 mm], vfov: 0.5 rad, f_number: 2, focal_length: 50 mm, focus_distance: inf,
   sensor: full_frame, shutter: 1/125 s, exposure: auto}
film: {width: 8, height: 6, filter: mitchell, white_balance: [0.5, 1, 2], tone_curve: filmic}
textures: {squares: {type: checker, even: 0.1, odd: 1/3}}
materials:
  bumpy: {type: lambertian, albedo: squares, bump: squares}
  both: {type: mixture, materials: [bumpy, {type: metal, bump: null}], weight: {type: noise}}
groups: {pair: [{type: quad, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 1, 0]], material: both}]}
objects:
  - {type: instance, of: pair, placements: [[{scale: 2}], {matrix: [[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 1e-9],
     [0, 0, 0, 1]]}]}
  - {type: sphere, name: ball, center: [0, 0, 0], radius: -1, material: {type: cutout, material: bumpy},
     motion: {keyframes: [{time: 0, transform: []}, {time: 8 ms, transform: [{translate: [0, 1, 0]}]}]}}
"""
SCENE = SCENE.replace("vfov: 0.5 rad, ", "")


def said_by(value):
    """All that a scene holds, with the types of its parts and the keys that were set."""
    if isinstance(value, BaseModel):
        return type(value), value.model_fields_set, said_by(dict(value))
    if isinstance(value, dict):
        return {key: said_by(item) for key, item in value.items()}
    return tuple(map(said_by, value)) if isinstance(value, tuple) else value


def again(scene):
    """The scene, out of YAML."""
    return build(to_yaml(spec_to_plain(scene)), "again.yaml", base=scene.base)


def test_every_way_to_write_a_value_comes_back():
    scene = build(SCENE, "scene.yaml")
    assert said_by(again(scene)) == said_by(scene)
    assert said_by(build_plain(spec_to_plain(scene), scene.base)) == said_by(scene)


def test_keys_that_were_not_set_are_left_out_and_keys_set_to_nothing_are_not():
    told = spec_to_plain(build(SCENE, "scene.yaml"))
    assert "render" not in told
    assert told["materials"]["both"]["materials"][1] == {"type": "metal", "bump": None}
    assert told["film"]["filter"] == {"type": "mitchell"}
    assert told["camera"]["shutter"] == 1 / 125
    assert told["objects"][1]["motion"]["keyframes"][0]["transform"] == []


LARGE = ("bouncing", "next_week")


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in LARGE else [])
        for path in sorted(SCENES.rglob("*.yaml"))
        if path.parent.name != "lenses"
    ],
)
def test_scenes_of_the_repository_come_back(path):
    need_files_of(path.stem)
    scene = load(path)
    assert said_by(again(scene)) == said_by(scene)


def test_what_was_changed_after_loading_is_what_is_written():
    scene = build(SCENE, "scene.yaml", {"film.width": 12})
    changed = scene.model_copy(update={"film": scene.film.model_copy(update={"height": 7})})
    assert spec_to_plain(changed)["film"] == {**spec_to_plain(scene)["film"], "width": 12, "height": 7}


def same_pictures(scene):
    before, after = (rt.render(one, threads=1).radiance for one in (scene, again(scene)))
    np.testing.assert_array_equal(after, before)


def test_a_scene_that_came_back_has_the_same_picture():
    same_pictures(build(BALL, "ball.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell", "instances", "studio"])
def test_shipped_scenes_that_came_back_have_the_same_pictures(name):
    need_files_of(name)
    same_pictures(load(SCENES / f"{name}.yaml", {"film.width": 16, "film.height": 12, "render.spp": 2}))


# Control characters are refused, for names are printed.
_CHARACTERS = st.characters(exclude_categories=("Cs", "Cc"), include_characters="\n\t")
TEXTS = st.text(_CHARACTERS) | st.sampled_from(
    ["inf", ".inf", "1e3", "0o17", "0x1f", "1_000", "12:30", "yes", "~", "null", "true", "- a", "#1", "a: b", " a ", ""]
)
VALUES = st.recursive(
    TEXTS | st.booleans() | st.none() | st.integers() | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=12,
)


@given(st.dictionaries(TEXTS, VALUES, min_size=1, max_size=5))
@example({"a": [1.0, -0.0, 1e22, 5e-324, math.inf, -math.inf, 2.0**53, 0.1]})
def test_plain_values_come_out_of_yaml_as_they_went_in(values):
    root = parse(to_yaml(values), "values.yaml")
    found = root.plain()
    # Whole numbers are numbers to a scene, whether they have a point or not.
    assert found == values
    assert [str(float(x)) for x in _numbers(found)] == [str(float(x)) for x in _numbers(values)]


def _numbers(value):
    if isinstance(value, dict | list):
        return [x for item in (value.values() if isinstance(value, dict) else value) for x in _numbers(item)]
    return [value] if isinstance(value, float) or (type(value) is int and abs(value) < 2**53) else []


def test_equal_is_what_says_the_same_and_names_the_same_files(tmp_path):
    text = SCENE.replace("radius: -1", "radius: 1.0")
    assert build(SCENE, "a.yaml") == build(SCENE.replace("20 mm", "0.02"), "b.yaml")
    assert build(SCENE, "a.yaml") != build(text, "a.yaml")
    assert build(SCENE, "a.yaml") != "a scene"
    lit = SCENE + "environment: {type: image, file: sky.png}\n"
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "sky.png").touch()
    one, two = (build(lit, "a.yaml", base=tmp_path / folder) for folder in ("one", "two"))
    assert one != two
    assert one == build(
        lit.replace("sky.png", str(tmp_path / "one" / "sky.png")),
        "a.yaml",
        base=tmp_path / "two",
        allow_files=[tmp_path],
    )


def test_a_saved_scene_is_loaded_as_it_was_wherever_it_is_saved(tmp_path):
    home, other = tmp_path / "home", tmp_path / "other" / "place"
    (home / "data").mkdir(parents=True)
    other.mkdir(parents=True)
    (home / "data" / "sky.png").touch()
    (home / "scene.yaml").write_text(SCENE + "environment: {type: image, file: data/../data/sky.png}\n")
    scene = load(home / "scene.yaml")
    scene.save(home / "copy.yaml")
    scene.save(other / "copy.yml")
    assert "file: data/../data/sky.png" in (home / "copy.yaml").read_text()
    assert "file: ../../home/data/../data/sky.png" in (other / "copy.yml").read_text()
    for saved in (load(home / "copy.yaml"), load(other / "copy.yml", allow_files=[home])):
        assert saved == scene
        assert saved.camera == scene.camera


def test_a_folder_that_is_a_link_does_not_lead_names_astray(tmp_path):
    (tmp_path / "real" / "deep").mkdir(parents=True)
    (tmp_path / "real" / "deep" / "sky.png").touch()
    (tmp_path / "link").symlink_to(tmp_path / "real" / "deep")
    (tmp_path / "link" / "a.yaml").write_text(SCENE + "environment: {type: image, file: sky.png}\n")
    (tmp_path / "there").symlink_to(tmp_path / "real")
    load(tmp_path / "link" / "a.yaml").save(tmp_path / "there" / "b.yaml")
    assert load(tmp_path / "there" / "b.yaml").environment is not None


def test_a_scene_is_saved_as_yaml_or_not_at_all(tmp_path):
    scene = build(SCENE, "scene.yaml")
    with pytest.raises(InputError, match=r"picture\.png: a scene file ends in \.yaml or \.yml"):
        scene.save(tmp_path / "picture.png")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(InputError, match=r"folder\.yaml"):
        scene.save(tmp_path / "folder.yaml")
    assert [path.name for path in tmp_path.rglob("*")] == ["folder.yaml"]


def test_a_scene_says_what_it_is_in_a_line():
    scene = build(SCENE, "scene.yaml")
    assert repr(scene) == str(scene) == "<rt.Scene scene.yaml: thin_lens, 8 x 6 pixels, 2 objects>"
    assert isinstance(scene, rt.Scene)
