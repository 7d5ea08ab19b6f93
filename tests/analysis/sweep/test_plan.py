"""Files of sweeps, and what is the same for all points."""

import pytest

from raytracer.analysis.sweep.plan import make_plan, parse_definitions
from raytracer.scene.load import load
from raytracer.util.errors import InputError, SceneError

SCENE = """\
camera: {type: thin_lens, look_from: [0, 0, 5], look_at: [0, 0, 0], sensor: full_frame, focal_length: 50 mm}
film: {width: 8, height: 6}
environment: {type: constant, radiance: 1}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def _sweep(scene, text):
    path = scene.parent / "sweep.yaml"
    path.write_text(text)
    return path


def test_single_values_are_the_same_for_all_points(scene):
    for given in (scene, load(scene)):
        plan = make_plan(given, {"camera.f_number": "2,4", "film.width": "16", "film.height": 12})
        assert [(axis.key, axis.values) for axis in plan.axes] == [("camera.f_number", (2, 4))]
        assert (plan.spec.film.width, plan.spec.film.height) == (16, 12)


def test_a_file_of_a_sweep(scene):
    path = _sweep(
        scene,
        """\
scene: scene.yaml
define: {film.width: 16, camera.look_at: [0, 1, 0]}
sweep:
  camera.f_number: 1.4..4
  camera.focus_distance: [4, 1/2 m, inf]
zip: false
""",
    )
    plan = make_plan(path, {})
    assert plan.spec.film.width == 16
    assert plan.spec.camera.look_at == (0.0, 1.0, 0.0)
    assert [axis.labels for axis in plan.axes] == [("1.4", "2", "2.8", "4"), ("4", "1/2 m", "inf")]
    assert plan.name == str(scene)
    assert not plan.zipped


def test_options_stand_in_place_of_what_the_file_says(scene):
    path = _sweep(scene, "{scene: scene.yaml, sweep: {camera.f_number: '1.4,2'}, zip: true}")
    plan = make_plan(path, {"camera.f_number": "8,11", "camera.focus_distance": "1,2"})
    assert [axis.values for axis in plan.axes] == [(8, 11), (1, 2)]
    assert plan.zipped


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("scene: scene.yaml\nsweep:\n  camera.f_number: 2:10\n", r"sweep\.yaml:3: sweep\.camera\.f_number: .* count"),
        ("scene: scene.yaml\nsweep: {camera.f_number: []}\n", r"sweep\.yaml:2: sweep\.camera\.f_number: has no values"),
        ("scene: scene.yaml\nsweep:\n  a: [1, 2]\nzp: true\n", r"sweep\.yaml:4: zp: .* did you mean 'zip'"),
        ("scene: scene.yaml\nsweep: [1]\n", r"sweep\.yaml:2: sweep: must be a mapping"),
        ("sweep: {a: [1, 2]}\n", r"sweep\.yaml:1: scene: is missing"),
        ("sweep: {a: [1, 2]}\nscene: none.yaml\n", r"sweep\.yaml:2: scene: there is no file 'none.yaml'"),
        ("scene: scene.yaml\nsweep:\n  a..b: [1, 2]\n", r"sweep\.yaml:3: sweep\.a\.\.b: .* is not a path"),
        (
            "scene: scene.yaml\ndefine: {a: 1}\nsweep: {a: [1, 2]}\n",
            r"sweep\.yaml:3: sweep\.a: 'a' is under define too",
        ),
        ("scene: scene.yaml\ndefine: {film.with: 1}\nsweep: {film.height: [1, 2]}\n", r"did you mean 'width'"),
    ],
)
def test_errors_name_file_and_line(scene, text, says):
    with pytest.raises(SceneError, match=says):
        make_plan(_sweep(scene, text), {})


@pytest.mark.parametrize("section", ["sweep", "define"])
def test_a_file_of_thousands_of_keys_is_refused_at_once(scene, section):
    keys = ", ".join(f"camera.k{i}: 1" for i in range(20_000))
    other = "define" if section == "sweep" else "sweep"
    path = _sweep(scene, f"scene: scene.yaml\n{section}: {{{keys}}}\n{other}: {{camera.f_number: [2, 4]}}\n")
    with pytest.raises(SceneError, match=rf"sweep\.yaml:2: {section}: must hold at most 1000 values"):
        make_plan(path, {})


def test_a_scene_that_needs_a_key_may_get_it_from_an_axis(scene):
    scene.write_text(SCENE.replace("width: 8, ", ""))
    with pytest.raises(SceneError, match=r"film\.width: is missing"):
        load(scene)
    assert make_plan(scene, {"film.width": "8,16"}).spec.film.width == 8


def test_options_that_are_none(scene):
    for definitions, says in ((["camera.vfov"], "must be key.path=values"), (["a=1,2", "a=3"], "a is given twice")):
        with pytest.raises(InputError, match=says):
            parse_definitions(definitions)
    with pytest.raises(InputError, match=r"^-D camera.f_number=2:10: is a range without a count"):
        make_plan(scene, {"camera.f_number": "2:10"})
    with pytest.raises(InputError, match=r"^-D camera..f_number=2,3: 'camera..f_number' is not a path"):
        make_plan(scene, {"camera..f_number": "2,3"})
