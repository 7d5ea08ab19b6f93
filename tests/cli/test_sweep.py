"""`rt sweep` from the command line."""

import json
from pathlib import Path

import pytest

from raytracer.analysis.sweep import prepare_points, run
from tests.analysis.sweep.test_plan import SCENE
from tests.analysis.sweep.test_run import BALL, Bench


@pytest.fixture(autouse=True)
def _scenes(here):
    Path("ball.yaml").write_text(BALL)
    Path("lens.yaml").write_text(SCENE)


@pytest.fixture
def bench(monkeypatch):
    made = Bench()
    monkeypatch.setattr(prepare_points, "prepare_scene", made.ready)
    monkeypatch.setattr(run, "render_prepared", lambda prepared, **keys: prepared.render(**keys))
    return made


_LENS = "sweep lens.yaml -D camera.f_number=1.4..2.8 -D camera.focus_distance=2,5"


def test_a_sweep_and_the_same_again(rt):
    command = "sweep ball.yaml -D camera.vfov=30:50:3 --threads 2 -D film.width=12"
    assert rt(command) == ("", f"{Path('outputs/ball_sweep/index.html')}: 3 pictures (3 camera.vfov)\n")
    pictures = {path.name for path in Path("outputs/ball_sweep").glob("vfov*.png")}
    assert pictures == {f"vfov={v}.png" for v in (30, 40, 50)}
    told = rt(f"{command} --json")
    assert told.err.endswith("(3 camera.vfov), 3 of them before\n")
    points = json.loads(told.out)["points"]
    assert [point["values"] for point in points] == [{"camera.vfov": vfov} for vfov in (30, 40, 50)]
    assert [point["camera"]["vfov_deg"] for point in points] == pytest.approx([30.0, 40.0, 50.0])


def test_a_failed_point_is_an_exit_status(bench, rt):
    lines = rt("sweep lens.yaml -D camera.f_number=-1,2,4 -D camera.focus_distance=2", status=1).err.splitlines()
    assert lines[0].startswith("rt: f_number=-1 failed: -D camera.f_number=-1: camera.f_number: must be greater than 0")
    assert "2 pictures" in lines[1]
    assert lines[2].startswith("rt: 1 of 3 points failed")


def test_an_interrupt_is_an_exit_status(bench, rt):
    def interrupt(camera):
        if getattr(camera, "f_number", None) == 2.0:
            raise KeyboardInterrupt

    bench.behave = interrupt
    assert rt(_LENS, status=130).err == "rt: interrupted; 2 of 6 points done; the same command goes on\n"
    bench.behave = None
    assert rt(f"{_LENS} --quiet").err == ""


def test_pairs_formats_folder_and_animation(bench, rt):
    pairs = "-D camera.f_number=2,4 -D camera.focus_distance=2,5 --zip"
    rt(f"sweep lens.yaml {pairs} -o out --format exr,jpg --animate gif,webp --animate png --fps 2")
    stems = ("f_number=2_focus_distance=2", "f_number=4_focus_distance=5")
    pictures = {f"{stem}.{suffix}" for stem in stems for suffix in ("jpg", "exr")}
    assert pictures | {"sweep.gif", "sweep.webp", "sweep.png"} <= {path.name for path in Path("out").iterdir()}
    assert not list(Path("out").glob("f_number*.png"))


def test_options_reach_the_points(bench, rt):
    options = "--spp 3 --seed 5 --threads 2 --crop 0,0,2,2 --noise 2% --time-limit 3s --format exr --aov depth,normal"
    rt(f"{_LENS} {options} --aov albedo --strict --max-memory 2GB")
    numbers = {"spp": 3, "seed": 5, "threads": 2, "noise": 0.02, "time_limit": 3.0, "max_memory": 2 * 10**9}
    others = {"crop": (0, 0, 2, 2), "aovs": ("depth", "normal", "albedo"), "strict": True}
    assert (numbers | others).items() <= bench.settings[0].items()


def test_a_file_of_a_sweep_names_the_folder(bench, rt):
    lesson = "scene: lens.yaml\ndefine: {camera.focus_distance: 2}\nsweep: {camera.f_number: 2..4}\n"
    Path("lesson.yaml").write_text(lesson)
    rt("sweep lesson.yaml")
    assert len(list(Path("outputs/lesson_sweep").glob("f_number=*.png"))) == 3


def test_a_dry_run_tells_points_and_what_is_wrong_with_them(rt):
    lines = rt(f"{_LENS} --dry-run").out.splitlines()
    assert len(lines) == 6
    assert lines[1] == ("f_number=1.4_focus_distance=5  camera.f_number=1.4142135623730951  camera.focus_distance=5")
    told = rt("sweep lens.yaml -D camera.f_number=2,-2 --dry-run", status=1)
    assert len(told.out.splitlines()) == 2
    assert "rt: f_number=-2 would fail: -D camera.f_number=-2: camera.f_number: must be greater than 0" in told.err
    assert told.err.endswith("rt: 1 of 2 points would fail\n")
    assert not Path("outputs").exists()
