"""Overrides of a checked scene: as those of a file, and no more work than they ask for."""

import pytest

import raytracer as rt
from raytracer.scene.load import build
from raytracer.scene.overrides import apply_overrides
from raytracer.util.errors import InputError

SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}
film: {width: 8, height: 6}
materials:
  grey: {type: lambertian, albedo: 0.5}
  gold: {type: metal, albedo: [1, 0.8, 0.3]}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: grey}
  - {type: sphere, center: [2, 0, 0], radius: 1, material: {type: emitter, radiance: 3}}
"""


@pytest.mark.parametrize(
    "overrides",
    [
        {"camera.vfov": "0.5 rad"},
        {"camera": {"type": "orthographic", "height": 2}},
        {"camera.type": "thin_lens", "camera.aperture": "3 mm"},
        {"render.spp": 3, "render.sampler": "independent"},
        {"objects.ball.radius": 2, "objects[1].material.radiance": [1, 2, 3]},
        {"objects": []},
        {"objects[0].material": {"type": "metal"}, "materials.grey.albedo": 0.25},
        {"materials.blue": {"type": "lambertian", "albedo": [0, 0, 1]}, "objects[1].material": "blue"},
        {"environment.type": "sky", "environment.turbidity": 5},
        {"film.filter": {"type": "gaussian", "sigma": 0.4}},
        {},
    ],
    ids=lambda overrides: " ".join(overrides) or "none",
)
def test_it_is_as_if_the_file_had_been_loaded_with_them(overrides):
    assert apply_overrides(build(SCENE, "a.yaml"), overrides) == build(SCENE, "a.yaml", overrides)


def test_what_is_not_touched_is_what_it_was():
    scene = build(SCENE, "a.yaml")
    seen = apply_overrides(scene, {"camera.vfov": 20, "render.spp": 4})
    assert seen.objects is scene.objects
    assert seen.materials is scene.materials
    assert seen.film is scene.film
    grown = apply_overrides(scene, {"objects.ball.radius": 2})
    assert grown.objects[0].radius == 2.0
    assert grown.objects[1] is scene.objects[1]
    assert scene.objects[0].radius == 1.0
    assert apply_overrides(scene, {"materials.gold.fuzz": 0.1}).materials["grey"] is scene.materials["grey"]


def test_one_override_sees_what_another_did():
    scene = apply_overrides(build(SCENE, "a.yaml"), {"camera.vfov": 20})
    scene = apply_overrides(scene, {"film.width": 5})
    assert (scene.camera.vfov, scene.film.width) == (20.0, 5)


def test_a_scene_that_was_changed_in_code_keeps_the_change():
    scene = build(SCENE, "a.yaml")
    changed = scene.model_copy(update={"film": scene.film.model_copy(update={"width": 3})})
    assert apply_overrides(changed, {"film.height": 2}).film.width == 3


@pytest.mark.parametrize(
    ("overrides", "sentence"),
    [
        ({"camera.vfov": 400}, "-D camera.vfov=400: camera.vfov: must be less than 180, got 400"),
        ({"camera.vfv": 4}, "-D camera.vfv=4: camera.vfv: unknown key 'vfv' of pinhole; did you mean 'vfov'?"),
        ({"objects[5].radius": 4}, "-D objects[5].radius=4: there is no item 5; the list has 2"),
        ({"camera.vfov.x": 4}, "-D camera.vfov.x=4: 'x' is not below 40, which is neither a list nor a mapping"),
        # What is wrong stands in the file, because of an override elsewhere.
        (
            {"materials": {"gray": {"type": "metal"}}},
            "a.yaml:7: objects[0].material: unknown material 'grey'; did you mean 'gray'?",
        ),
        ({"camera.diameter": -1}, "-D camera.diameter=-1: camera.diameter: must be at least 0, got -1"),
    ],
)
def test_mistakes_are_told_as_those_of_a_file_are(overrides, sentence):
    with pytest.raises(InputError) as caught:
        apply_overrides(build(SCENE, "a.yaml"), overrides)
    assert str(caught.value) == sentence


def test_scenes_made_in_code_have_no_lines_to_tell():
    scene = rt.Scene(camera=rt.camera.pinhole(), film=rt.Film(width=4, height=3))
    assert scene.replace({"film.width": 7}).film.width == 7
    with pytest.raises(InputError) as caught:
        scene.replace({"film.width": 0})
    assert str(caught.value) == "-D film.width=0: film.width: must be at least 1, got 0"
    with pytest.raises(InputError) as caught:
        scene.replace({"medium": "water"})
    assert str(caught.value) == "-D medium=water: medium: unknown medium 'water'; there are no media"


def test_a_file_that_is_not_there_is_told_where_it_is_named():
    with pytest.raises(InputError, match=r"-D environment=\{.*: environment\.file: there is no file 'sky\.png' in "):
        apply_overrides(build(SCENE, "a.yaml"), {"environment": {"type": "image", "file": "sky.png"}})
