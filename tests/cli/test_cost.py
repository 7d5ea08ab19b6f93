"""`rt cost` as a user meets it: what it refuses, what goes where, and how it ends."""

import csv
import io
import json
from dataclasses import replace

import pytest

from raytracer.analysis.cost import study as studies
from raytracer.cli.base.app import main
from tests.analysis.cost.made_up import World, scene_of


@pytest.fixture
def world(monkeypatch):
    """A world that commands measure in place of the machine."""
    made_up = World()
    real = studies.study

    def study(spec, options, **others):
        return real(spec, replace(options, threads=2), **{**others, "bench": made_up.bench()})

    monkeypatch.setattr(studies, "study", study)
    return made_up


@pytest.fixture
def scene(tmp_path):
    scene_of(tmp_path, 96, 64)
    return str(tmp_path / "scene.yaml")


def test_a_table_goes_to_stdout_and_nothing_else(world, scene, capsys):
    assert main(["cost", scene, "--variants", "defocus, max_depth=2", "--budget", "1 min"]) == 0
    output = capsys.readouterr()
    for words in ("repeat of the", "defocus", "max_depth=2", "60 s"):
        assert words in output.out
    assert output.err == ""


def test_json_is_json(world, scene, capsys):
    assert main(["cost", scene, "--no-variants", "--json", "--target", "2%", "--seed", "5"]) == 0

    def refuse(constant):
        raise ValueError(constant)

    found = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert found["scene"] == scene
    assert found["prediction"]["target"] == 0.02
    assert found["machine"]["seed"] == 5
    assert found["arms"] == []


def test_a_folder_gets_the_report(world, scene, tmp_path, capsys):
    folder = tmp_path / "report"
    assert main(["cost", scene, "--arms", "defocus", "-o", str(folder)]) == 0
    assert {"cost.html", "cost.csv", "cost.json"} <= {path.name for path in folder.iterdir()}
    rows = list(csv.reader(io.StringIO((folder / "cost.csv").read_text(encoding="utf-8"))))
    assert {"A/A", "defocus"} <= {row[0] for row in rows}
    assert str(folder / "cost.html") in capsys.readouterr().err


def test_overrides_reach_the_scene(world, scene, capsys):
    assert main(["cost", scene, "--no-arms", "--json", "-D", "film.width=32"]) == 0
    assert json.loads(capsys.readouterr().out)["width"] == 32


def test_interrupted_it_reports_what_there_is(world, scene, capsys):
    assert main(["cost", scene, "--arms", "defocus", "--quiet"]) == 0
    capsys.readouterr()
    world.interrupt_after, world.calls = len(world.calls) - 4, []
    assert main(["cost", scene, "--arms", "defocus"]) == 130
    output = capsys.readouterr()
    assert "interrupted after 7 of 9 rounds" in " ".join(output.out.split())
    assert "defocus" in output.out
    # Too early for anything.
    world.interrupt_after, world.calls = 3, []
    assert main(["cost", scene, "--arms", "defocus"]) == 130
    assert capsys.readouterr() == ("", "nothing is known before the prediction is there\nrt: interrupted\n")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--target 0", "--target 0: must be greater than 0 and less than 100%"),
        ("--target 200%", "--target 200%: must be greater than 0 and less than 100%"),
        ("--target -1%", "--target -1%: must be greater than 0"),
        ("--target nan", "--target nan: must be a relative error such as 1% or 0.01"),
        ("--target inf", "--target inf: must be greater than 0 and less than 100%"),
        ("--target abc", "--target abc: must be a relative error such as 1% or 0.01"),
        ("--target 1%x", "--target 1%x: must be a relative error such as 1% or 0.01"),
        ("--target 1s", "--target 1s: must be a relative error such as 1% or 0.01"),
        ("--budget 0", "--budget 0: must be a time greater than 0"),
        ("--budget inf", "--budget inf: must be a finite time"),
        ("--budget -1s", "--budget -1s: must be a time greater than 0"),
        ("--budget 3m", "--budget 3m: "),
        ("--rounds 8", "rounds 8: must be at least 9"),
        ("--rounds 1001", "rounds 1001: must be at most 1000, since the pictures of all are kept"),
        ("--tiles 0", "tiles 0: must be at least 16"),
        ("--tiles 15", "tiles 15: must be at least 16"),
        ("--variants ,", "--variants ,: a name is empty"),
        ("--variants defocus,", "--variants defocus,: a name is empty"),
        ("--arms defocsu", "did you mean 'defocus'?"),
        ("--arms defocus --no-arms", "--variants and --no-variants exclude each other"),
        ("--no-arms -D film.widht=3", "did you mean 'width'?"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(world, scene, options, words, capsys):
    assert main(["cost", scene, *options.split()]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("rt: ")
    assert output.err.count("\n") == 1
    assert words in output.err
    assert world.calls == []


def test_errors_and_times_have_units(world, scene, capsys):
    assert main(["cost", scene, "--no-arms", "--json", "--target", "1/50", "--budget", "0.5 min"]) == 0
    found = json.loads(capsys.readouterr().out)["prediction"]
    assert (found["target"], found["budget"]) == (0.02, 30.0)


def test_a_target_that_no_float_can_square_is_out_of_reach(world, scene, capsys):
    for target in ("1e-155%", "1e-200"):
        assert main(["cost", scene, "--arms", "defocus", "--target", target, "--budget", "1e308 s"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "never" in said
        assert "the target takes more samples per pixel than a render can have" in said
        assert "the budget has time for more samples per pixel than a render can have" in said
