"""Which files a scene may name: those of its folder, and where else somebody allows it; and only what is a file."""

import json
import os
import sys

import pytest
import typer.main

from raytracer.analysis.sweep.plan import make_plan
from raytracer.cli.base.app import application, main
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
OUT = "../secret/tri.obj"

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows lets few users make links, and has no named pipes")


@pytest.fixture
def home(tmp_path):
    """A folder of a scene beside one that it has no business in."""
    for folder in ("home", "home/meshes", "secret"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "tri.obj").write_text(TRIANGLE)
        (tmp_path / folder / "data.bin").write_bytes(b"\0" * 36)
    return tmp_path / "home"


def scene(home, name):
    path = home / "scene.yaml"
    path.write_text(SCENE % json.dumps(name))
    return path


def refused(home, name, *overrides, **settings):
    with pytest.raises(InputError) as caught:
        load(scene(home, name), *overrides, **settings)
    assert str(caught.value).isprintable()
    return str(caught.value)


# ---- What is out of reach


@pytest.mark.parametrize(
    "name", ["tri.obj", "meshes/tri.obj", "meshes/../tri.obj", "./meshes//tri.obj", "../home/tri.obj"]
)
def test_a_scene_may_name_what_lies_in_its_folder(home, name):
    load(scene(home, name))
    load(scene(home, str(home / name)))


@pytest.mark.parametrize("name", [OUT, "../secret/nix.obj", "meshes/../../secret/tri.obj"])
def test_a_scene_may_not_name_what_lies_elsewhere_be_it_there_or_not(home, name):
    for written in (name, str(home / name)):
        sentence = refused(home, written)
        assert sentence.startswith(f"{home / 'scene.yaml'}:{LINE}: objects[0].file: '")
        for words in (f"leads out of {home}", "--allow-files", ROOT_MARKER):
            assert words in sentence
    # It is not told whether the file is there.
    assert refused(home, OUT).replace(OUT, name) == refused(home, name)


@posix
def test_a_link_is_where_it_leads(home):
    (home / "out.obj").symlink_to(home.parent / "secret" / "tri.obj")
    (home / "far").symlink_to(home.parent / "secret")
    (home / "near.obj").symlink_to(home / "meshes" / "tri.obj")
    (home.parent / "link").symlink_to(home)
    load(scene(home, "near.obj"))
    load(home.parent / "link" / "scene.yaml")
    # Behind a link, .. is what is above where the link leads: here the scene's folder again.
    load(scene(home, "far/../home/tri.obj"))
    assert "leads out of" in refused(home, "out.obj")
    assert "leads out of" in refused(home, "far/tri.obj")


@posix
def test_loops_pipes_and_devices_are_no_files_to_read(home):
    # A test that opened one would wait for ever.
    (home / "a.obj").symlink_to(home / "b.obj")
    (home / "b.obj").symlink_to(home / "a.obj")
    os.mkfifo(home / "pipe.obj")
    (home / "zero.obj").symlink_to("/dev/zero")
    loop = refused(home, "a.obj")
    assert f"scene.yaml:{LINE}: objects[0].file: 'a.obj' cannot be read: " in loop
    assert "links" in loop
    assert "'pipe.obj' is no regular file" in refused(home, "pipe.obj")
    assert "'zero.obj' is no regular file" in refused(home, "zero.obj", allow_files=["/dev"])
    assert "is no regular file" in refused(home, "tri.obj", {"objects.thing.file": "pipe.obj"})


@pytest.mark.parametrize("name", ["a\0b.obj", "x" * 300 + ".obj", "tri.obj/more.obj", "\x1b[31m.obj"])
def test_names_that_no_file_can_have_are_refused_in_one_sentence(home, name):
    refused(home, name)


# ---- Who may allow it


def _by_argument(home, monkeypatch):
    load(scene(home, OUT), allow_files=[home.parent / "secret"])
    load(scene(home, OUT), allow_files=home.parent)


def _by_variable(home, monkeypatch):
    monkeypatch.setenv(ENVIRONMENT_VARIABLE, os.pathsep.join(["", str(home / "meshes"), str(home.parent / "secret")]))
    load(scene(home, OUT))


def _by_marker(home, monkeypatch):
    (home.parent / ROOT_MARKER).touch()
    load(scene(home, OUT))
    # The nearest counts.
    (home / ROOT_MARKER).touch()
    assert "leads out of" in refused(home, OUT)


def _by_override(home, monkeypatch):
    loaded = load(scene(home, "tri.obj"), {"objects[0].file": OUT})
    # What was asked for once stays so, wherever else the scene is changed.
    assert loaded.replace({"objects.thing.name": "other"}).objects[0].name == "other"
    load(scene(home, "tri.obj")).replace({"objects": [{"type": "mesh", "file": OUT}]})


def _by_code(home, monkeypatch):
    camera = {"type": "pinhole", "look_from": [0, 0, 4], "vfov": 40}
    build_plain({"camera": camera, "film": {"width": 8, "height": 6}, "objects": [{"type": "mesh", "file": OUT}]}, home)


def _by_option(home, monkeypatch):
    path = str(scene(home, OUT))
    assert main(["validate", path]) == 2
    assert main(["validate", "--allow-files", str(home), "--allow-files", str(home.parent / "secret"), path]) == 0


def _by_a_sweep(home, monkeypatch):
    plan = make_plan(scene(home, "tri.obj"), {"objects.thing.file": f"tri.obj,{OUT}"})
    assert plan.spec.replace({"objects.thing.file": OUT}).objects[0].file == OUT


@pytest.mark.parametrize(
    "way", [_by_argument, _by_variable, _by_marker, _by_override, _by_code, _by_option, _by_a_sweep]
)
def test_whoever_runs_the_program_may_allow_it(home, monkeypatch, way):
    assert "leads out of" in refused(home, OUT)
    way(home, monkeypatch)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away")
def test_a_marker_that_somebody_else_has_left_does_not_count(home):
    (home.parent / ROOT_MARKER).touch()
    os.chown(home.parent / ROOT_MARKER, 12345, 12345)
    assert "leads out of" in refused(home, OUT)


def test_every_command_that_loads_scenes_takes_the_option():
    commands = typer.main.get_command(application()).commands
    found = {name: command for name, command in commands.items() if name != "lightfield"}
    found["lightfield render"] = commands["lightfield"].commands["render"]
    takes = {name for name, command in found.items() if any("--allow-files" in one.opts for one in command.params)}
    loads = {name for name, command in found.items() if any("--define" in one.opts for one in command.params)}
    assert takes == loads | {"validate", "check"}


# ---- Files that name files


def gltf(path, uri):
    path.write_text(json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 36}]}))


@pytest.mark.parametrize("uri", ["../../secret/data.bin", "%2e%2e/%2e%2e/secret/data.bin", "../../secret/none.bin"])
def test_a_mesh_may_name_what_its_scene_may(home, uri):
    gltf(home / "meshes" / "box.gltf", uri)
    sentence = refused(home, "meshes/box.gltf")
    assert f":{LINE}: objects[0].file: 'meshes/box.gltf' names a file that it may" in sentence
    load(scene(home, "meshes/box.gltf"), allow_files=[home.parent])
    gltf(home / "meshes" / "box.gltf", "../data.bin")
    load(scene(home, "meshes/box.gltf"))


def test_who_asks_for_a_mesh_does_not_ask_for_what_it_names(home):
    overrides = {"objects[0].file": str(home.parent / "secret" / "box.gltf")}
    gltf(home.parent / "secret" / "box.gltf", "data.bin")
    load(scene(home, "tri.obj"), overrides)
    gltf(home.parent / "secret" / "box.gltf", "../home/tri.obj")
    assert "names a file that it may not" in refused(home, "tri.obj", overrides)


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
    with pytest.raises(InputError, match=r"sweep\.yaml:\d: .*leads out of") as caught:
        make_plan(path, {})
    assert f": {key}" in str(caught.value)


@posix
def test_a_scene_that_is_a_pipe_is_not_waited_for_unless_it_is_named_as_one(home):
    os.mkfifo(home / "pipe.yaml")
    with pytest.raises(SceneError, match=r"pipe\.yaml: cannot be read: is no regular file"):
        load(home / "pipe.yaml")
    (home / "sweep.yaml").write_text("scene: pipe.yaml\nsweep: {camera.vfov: [1, 2]}\n")
    with pytest.raises(InputError, match=r"sweep\.yaml:1: scene: 'pipe\.yaml' is no regular file"):
        make_plan(home / "sweep.yaml", {})
    reading, writing = os.pipe()
    os.write(writing, b"camera: 1\n")
    os.close(writing)
    with pytest.raises(SceneError, match="camera: must be a mapping"):
        load(f"/dev/fd/{reading}")
    os.close(reading)


def test_reach_holds_names_that_no_system_has(tmp_path):
    # They cannot be opened, so nothing is given away; that they are not there is said later.
    assert make_sandbox(tmp_path).allows("a\0b")
    assert not make_sandbox(tmp_path).allows("..")
