"""Sizes, several scenes, standard input and output, and what programs read of `rt render`."""

import io
import json
import sys
from pathlib import Path

import pytest

from raytracer.cli.base.options import GivenOptions, Sizing
from raytracer.cli.base.render_report import DebugCommand
from raytracer.film.image_file import load
from raytracer.rendering.options import OPTIONS
from raytracer.rendering.progress import Progress, ProgressLines
from tests.cli.test_render import SCENE as BALL

SCENE = BALL.replace("spp: 16", "spp: 4")


@pytest.fixture
def scenes(here):
    for name in ("a", "b"):
        (here / f"{name}.yaml").write_text(SCENE)
    return here


@pytest.mark.parametrize(
    ("words", "shape"),
    [("--size 30x40", (40, 30, 3)), ("--scale 50%", (8, 12, 3)), ("--scale 1.5 -D film.width=2", (24, 3, 3))],
)
def test_sizes_are_the_films_and_the_camera_stays(words, shape, scenes, rt):
    rt(f"render a.yaml -q -o a.npy {words}")
    picture = load("a.npy")
    assert picture.shape == shape
    # The ball has a half-angle of asin(1/4), of 20 degrees: it leaves the corners free at any size.
    assert (picture[0, 0] == 0.5).all()


def test_the_command_that_shows_a_sample_has_the_size_of_its_picture():
    given = GivenOptions(dict.fromkeys(OPTIONS))
    line = DebugCommand("a.yaml", [], Sizing((30, 40)), False, given).line((1, 2))
    assert line == "rt render a.yaml --size 30x40 --pixel 1,2 --debug"
    assert "--scale 0.5 " in DebugCommand("a.yaml", [], Sizing(None, 0.5), False, given).line((1, 2))


def test_several_scenes_go_to_a_folder_and_what_is_there_stays(scenes, rt):
    rt("render a.yaml b.yaml -q -o out/ --format npy --json")
    assert sorted(path.name for path in Path("out").iterdir()) == ["a.npy", "b.npy"]
    Path("out/a.npy").write_bytes(b"mine")
    Path("out/b.npy").unlink()
    said = rt("render a.yaml b.yaml -o out --format npy --no-clobber").err.splitlines()
    assert said[0] == "rt: out/a.npy is there already, and stays as it is"
    assert said[1].startswith("out/b.npy: 24 x 16, 4 spp")
    assert (Path("out/a.npy").read_bytes(), len(said)) == (b"mine", 2)
    assert rt("render a.yaml -q -o out/a.npy --no-clobber") == ("", "")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("a.yaml b.yaml -o a.png", "a.yaml and b.yaml would both be written to a.png; a folder, FOLDER/, takes many"),
        ("a.yaml a.yaml", "a.yaml is given twice"),
        ("a.yaml b.yaml --stats s.json", "--stats is for one scene, and here are 2"),
        ("a.yaml b.yaml --pixel 1,1 --debug", "--debug is for one scene, and here are 2"),
        ("a.yaml -o a.png --format exr", "--format exr: a.png names the format itself"),
        ("a.yaml --size 640", "--size 640: must be width and height in pixels, such as 640x360"),
        ("a.yaml --scale 50", "--scale 50: must be below 20; did you mean 50%?"),
        ("a.yaml --scale half", "--scale half: must be a share of the scene's own size, such as 50% or 0.5"),
        ("a.yaml --scale 1 --size 2x2", "--size and --scale exclude each other"),
        ("a.yaml --json -o -", "--json and -o - are both for standard output; --stats FILE.json takes the statistics"),
        ("a.yaml --resume --no-clobber", "--resume and --no-clobber exclude each other"),
        ("a.yaml -q -v", "--quiet and --verbose exclude each other"),
    ],
)
def test_what_does_not_go_together_is_refused(words, sentence, scenes, refused):
    assert refused(f"render {words}") == f"rt: {sentence}\n"


def test_a_scene_comes_from_standard_input_and_its_picture_goes_to_standard_output(here, monkeypatch, capsysbinary):
    from raytracer.cli.base.app import main

    def run(words, status, text=SCENE):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        assert main(words.split()) == status
        return capsysbinary.readouterr()

    piped = run("render - -q -o -", 0).out
    assert run("render - -q", 0) == (b"", b"")
    assert Path("outputs/stdin.png").read_bytes()[:8] == piped[:8] == b"\x89PNG\r\n\x1a\n"
    assert run("render - -q -o - --format exr", 0).out[:4] == bytes([0x76, 0x2F, 0x31, 0x01])
    assert run("render - -q -o - --time-limit 1s --spp 2", 0).out[:8] == piped[:8]
    wrong = run("render - -o -", 2, SCENE.replace("vfov", "vfv"))
    assert (wrong.out, wrong.err[:36]) == (b"", b"rt: standard input:1: camera.vfv: un")
    assert [path.name for path in here.iterdir()] == ["outputs"]


def test_a_terminal_is_not_sent_a_picture(scenes, refused, monkeypatch):
    monkeypatch.setattr("raytracer.util.atomic_write.sys.stdout.isatty", lambda: True, raising=False)
    assert "standard output is a terminal" in refused("render a.yaml -o -")


def test_programs_read_statistics_and_progress(scenes, rt):
    out, err = rt("render a.yaml -q --json --progress json --stats s.json")
    assert json.loads(out) == json.loads(Path("s.json").read_text())
    lines = [json.loads(line) for line in err.splitlines()]
    last = lines[-1]
    assert {"scene", "phase", "done", "total", "seconds", "eta"} == set(last)
    assert (last["scene"], last["phase"], last["done"], last["total"]) == ("a.yaml", "render", 1536, 1536)
    assert last["eta"] == 0.0


def test_of_progress_the_first_and_the_last_line_are_printed(capsys):
    with ProgressLines("render", "a.yaml") as lines:
        for done in (10, 20, 30):
            lines.show(Progress(done, 40, 2.0, resumed=5))
    first, last = (json.loads(line) for line in capsys.readouterr().err.splitlines())
    assert (first["done"], first["eta"]) == (10, 12.0)
    assert (last["done"], last["eta"]) == (30, 0.8)


def test_verbose_tells_phases_kernels_and_effects(scenes, rt):
    _, phases, machine, effects = rt("render a.yaml -v --threads 2").err.splitlines()
    assert all(f"{name} " in phases for name in ("load", "pack", "build", "compile", "render", "develop"))
    assert "; 2 threads; " in machine
    assert effects.startswith("effects: environment, ")
