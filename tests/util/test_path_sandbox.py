"""Which files a scene may name: those of its folder, and where else somebody allows it; and only what is a file."""

import json
import os
import sys

import pytest

from raytracer.analysis.sweep.plan import make_plan
from raytracer.cli.base.app import main
from raytracer.scene.load import build_plain, load
from raytracer.util.errors import InputError, SceneError
from raytracer.util.path_sandbox import ENVIRONMENT_VARIABLE, ROOT_MARKER, make_sandbox

SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}
film: {width: 8, height: 6}
objects:
  - type: mesh
    name: thing
    file: %s
"""
LINE = 6
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows lets few users make links, and has no named pipes")


@pytest.fixture
def home(tmp_path):
    """A folder of a scene beside one that it has no business in."""
    for folder in ("home", "home/meshes", "secret"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "tri.obj").write_text(TRIANGLE)
    return tmp_path / "home"


def scene(home, name):
    path = home / "scene.yaml"
    path.write_text(SCENE % json.dumps(name))
    return path


# ---- What is out of reach


@pytest.mark.parametrize(
    "name", ["tri.obj", "meshes/tri.obj", "meshes/../tri.obj", "./meshes//tri.obj", "../home/tri.obj"]
)
def test_a_scene_may_name_what_lies_in_its_folder(home, name):
    load(scene(home, name))
    load(scene(home, str(home / name)))


@pytest.mark.parametrize("name", ["../secret/tri.obj", "../secret/none.obj", "meshes/../../secret/tri.obj"])
def test_a_scene_may_not_name_what_lies_elsewhere_be_it_there_or_not(home, name):
    for written in (name, str(home / name)):
        path = scene(home, written)
        with pytest.raises(InputError) as refused:
            load(path)
        sentence = str(refused.value)
        assert sentence.startswith(f"{path}:{LINE}: objects[0].file: '")
        assert f"leads out of {home}" in sentence
        assert "--allow-files" in sentence
        assert ROOT_MARKER in sentence


def test_what_a_refusal_says_does_not_tell_whether_the_file_is_there(home):
    sentences = []
    for name in ("../secret/tri.obj", "../secret/nix.obj"):
        with pytest.raises(InputError) as refused:
            load(scene(home, name))
        sentences.append(str(refused.value).replace(name, ""))
    assert sentences[0] == sentences[1]


@posix
def test_a_link_is_where_it_leads(home):
    (home / "out.obj").symlink_to(home.parent / "secret" / "tri.obj")
    (home / "far").symlink_to(home.parent / "secret")
    (home / "near.obj").symlink_to(home / "meshes" / "tri.obj")
    load(scene(home, "near.obj"))
    # Behind a link, .. is what is above where the link leads: here the scene's folder again.
    load(scene(home, "far/../home/tri.obj"))
    for name in ("out.obj", "far/tri.obj"):
        with pytest.raises(InputError, match="leads out of"):
            load(scene(home, name))


@posix
def test_a_scene_whose_folder_is_a_link_names_what_lies_beside_it(home):
    (home.parent / "link").symlink_to(home)
    scene(home, "meshes/tri.obj")
    load(home.parent / "link" / "scene.yaml")


@posix
def test_a_loop_of_links_is_one_sentence(home):
    (home / "a.obj").symlink_to(home / "b.obj")
    (home / "b.obj").symlink_to(home / "a.obj")
    with pytest.raises(InputError, match=rf"scene\.yaml:{LINE}: objects\[0\]\.file: 'a\.obj' cannot be read: .*links"):
        load(scene(home, "a.obj"))


@posix
def test_pipes_and_devices_are_no_files_to_read(home):
    # A test that opened one would wait for ever.
    os.mkfifo(home / "pipe.obj")
    (home / "zero.obj").symlink_to("/dev/zero")
    with pytest.raises(InputError, match=r"'pipe\.obj' is no regular file"):
        load(scene(home, "pipe.obj"))
    with pytest.raises(InputError, match=r"'zero\.obj' is no regular file"):
        load(scene(home, "zero.obj"), allow_files=["/dev"])
    with pytest.raises(InputError, match="no regular file"):
        load(scene(home, "tri.obj"), {"objects.thing.file": "pipe.obj"})


@pytest.mark.parametrize("name", ["a\0b.obj", "x" * 300 + ".obj", "tri.obj/more.obj", "\x1b[31m.obj"])
def test_names_that_no_file_can_have_are_refused_in_one_sentence(home, name):
    with pytest.raises(InputError) as refused:
        load(scene(home, name))
    assert str(refused.value).isprintable()


# ---- Who may allow it

OUT = "../secret/tri.obj"


def _by_argument(home, monkeypatch):
    load(scene(home, OUT), allow_files=[home.parent / "secret"])
    load(scene(home, OUT), allow_files=home.parent)


def _by_variable(home, monkeypatch):
    monkeypatch.setenv(ENVIRONMENT_VARIABLE, os.pathsep.join(["", str(home / "meshes"), str(home.parent / "secret")]))
    load(scene(home, OUT))


def _by_marker(home, monkeypatch):
    (home.parent / ROOT_MARKER).touch()
    load(scene(home, OUT))


def _by_override(home, monkeypatch):
    loaded = load(scene(home, "tri.obj"), {"objects[0].file": OUT})
    # What was asked for once stays so, wherever else the scene is changed.
    assert loaded.replace({"objects.thing.name": "other"}).objects[0].name == "other"
    load(scene(home, "tri.obj")).replace({"objects": [{"type": "mesh", "file": OUT}]})


def _by_code(home, monkeypatch):
    camera = {"type": "pinhole", "look_from": [0, 0, 4], "vfov": 40}
    values = {"camera": camera, "film": {"width": 8, "height": 6}, "objects": [{"type": "mesh", "file": OUT}]}
    build_plain(values, home)


def _by_option(home, monkeypatch):
    path = str(scene(home, OUT))
    assert main(["validate", path]) == 2
    assert main(["validate", "--allow-files", str(home), "--allow-files", str(home.parent / "secret"), path]) == 0


@pytest.mark.parametrize("way", [_by_argument, _by_variable, _by_marker, _by_override, _by_code, _by_option])
def test_whoever_runs_the_program_may_allow_it(home, monkeypatch, way):
    with pytest.raises(InputError, match="leads out of"):
        load(scene(home, OUT))
    way(home, monkeypatch)


def test_the_nearest_marker_counts(home):
    (home.parent / ROOT_MARKER).touch()
    (home / ROOT_MARKER).touch()
    with pytest.raises(InputError, match="leads out of"):
        load(scene(home, OUT))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away")
def test_a_marker_that_somebody_else_has_left_does_not_count(home):
    (home.parent / ROOT_MARKER).touch()
    os.chown(home.parent / ROOT_MARKER, 12345, 12345)
    with pytest.raises(InputError, match="leads out of"):
        load(scene(home, OUT))


def test_every_command_that_loads_scenes_takes_the_option():
    import typer.main

    from raytracer.cli.base.app import application

    commands = typer.main.get_command(application()).commands
    found = {name: command for name, command in commands.items() if name != "lightfield"}
    found["lightfield render"] = commands["lightfield"].commands["render"]
    takes = {name for name, command in found.items() if any("--allow-files" in one.opts for one in command.params)}
    loads = {name for name, command in found.items() if any("--define" in one.opts for one in command.params)}
    assert takes == loads | {"validate", "check"}


# ---- Files that name files


def _gltf(path, uri):
    header = {"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 36}]}
    path.write_text(json.dumps(header))


@pytest.mark.parametrize("uri", ["../../secret/data.bin", "%2e%2e/%2e%2e/secret/data.bin", "../../secret/none.bin"])
def test_a_mesh_may_name_what_its_scene_may(home, uri):
    (home.parent / "secret" / "data.bin").write_bytes(b"\0" * 36)
    (home / "data.bin").write_bytes(b"\0" * 36)
    _gltf(home / "meshes" / "box.gltf", uri)
    with pytest.raises(InputError, match=rf":{LINE}: objects\[0\]\.file: 'meshes/box\.gltf' names a file that it may"):
        load(scene(home, "meshes/box.gltf"))
    load(scene(home, "meshes/box.gltf"), allow_files=[home.parent])
    _gltf(home / "meshes" / "box.gltf", "../data.bin")
    load(scene(home, "meshes/box.gltf"))


def test_who_asks_for_a_mesh_does_not_ask_for_what_it_names(home):
    (home.parent / "secret" / "data.bin").write_bytes(b"\0" * 36)
    _gltf(home.parent / "secret" / "box.gltf", "data.bin")
    overrides = {"objects[0].file": str(home.parent / "secret" / "box.gltf")}
    load(scene(home, "tri.obj"), overrides)
    _gltf(home.parent / "secret" / "box.gltf", "../home/tri.obj")
    with pytest.raises(InputError, match="names a file that it may not"):
        load(scene(home, "tri.obj"), overrides)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("scene: ../home/scene.yaml\nsweep: {camera.vfov: [1, 2]}\n", "scene"),
        ("scene: scene.yaml\nsweep: {objects.thing.file: [tri.obj, ../secret/tri.obj]}\n", "sweep.objects.thing.file"),
        ("scene: scene.yaml\nsweep: {objects.thing.file: 'tri.obj,../secret/tri.obj'}\n", "sweep.objects.thing.file"),
        ("scene: scene.yaml\ndefine: {objects.thing: {file: /etc/passwd}}\nsweep: {camera.vfov: [1, 2]}\n", "define."),
    ],
)
def test_a_file_of_a_sweep_has_the_reach_of_its_folder(home, text, key):
    scene(home, "tri.obj")
    (home.parent / "secret" / "scene.yaml").write_text((home / "scene.yaml").read_text())
    path = (home.parent / "secret" if key == "scene" else home) / "sweep.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"sweep\.yaml:\d: .*leads out of") as refused:
        make_plan(path, {})
    assert f": {key}" in str(refused.value)


def test_values_of_a_sweep_that_are_asked_for_may_name_any_file(home):
    plan = make_plan(scene(home, "tri.obj"), {"objects.thing.file": f"tri.obj,{OUT}"})
    assert plan.spec.replace({"objects.thing.file": OUT}).objects[0].file == OUT


@posix
def test_a_scene_that_is_a_pipe_is_not_waited_for_unless_it_is_named_as_one(home):
    os.mkfifo(home / "pipe.yaml")
    with pytest.raises(SceneError, match=r"pipe\.yaml: cannot be read: is no regular file"):
        load(home / "pipe.yaml")
    reading, writing = os.pipe()
    os.write(writing, b"camera: 1\n")
    os.close(writing)
    with pytest.raises(SceneError, match="camera: must be a mapping"):
        load(f"/dev/fd/{reading}")
    os.close(reading)


@posix
def test_a_sweep_of_a_pipe_does_not_wait_for_it(home):
    os.mkfifo(home / "pipe.yaml")
    (home / "sweep.yaml").write_text("scene: pipe.yaml\nsweep: {camera.vfov: [1, 2]}\n")
    with pytest.raises(InputError, match=r"sweep\.yaml:1: scene: 'pipe\.yaml' is no regular file"):
        make_plan(home / "sweep.yaml", {})


def test_reach_holds_names_that_no_system_has(tmp_path):
    # They cannot be opened, so nothing is given away; that they are not there is said later.
    assert make_sandbox(tmp_path).allows("a\0b")
    assert not make_sandbox(tmp_path).allows("..")
