"""`rt cost` as a user meets it: what it refuses, what goes where, and how it ends."""

import csv
import io
import json
import os
from dataclasses import replace

import pytest

from raytracer.analysis.cost import study as studies
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


@pytest.fixture(autouse=True)
def _scene(here):
    scene_of(here, 96, 64)


def test_a_table_goes_to_stdout_and_nothing_else(world, rt):
    output = rt("cost scene.yaml --variants 'defocus, max_depth=2' --budget '1 min'")
    for words in ("repeat of the", "defocus", "max_depth=2", "60 s"):
        assert words in output.out
    assert output.err == ""


def test_json_is_json_of_the_scene_that_was_asked_for_in_units(world, rt):
    def refuse(constant):
        raise ValueError(constant)

    printed = rt("cost scene.yaml --no-arms --json --target 1/50 --budget '0.5 min' --seed 5 -D film.width=32").out
    found = json.loads(printed, parse_constant=refuse)
    assert (found["scene"], found["width"], found["machine"]["seed"]) == ("scene.yaml", 32, 5)
    assert (found["prediction"]["target"], found["prediction"]["budget"]) == (0.02, 30.0)
    assert found["arms"] == []


def test_a_folder_gets_the_report(world, here, rt):
    said = rt("cost scene.yaml --arms defocus -o report").err
    assert f"report{os.sep}cost.html" in said
    assert {"cost.html", "cost.csv", "cost.json"} <= {path.name for path in (here / "report").iterdir()}
    rows = list(csv.reader(io.StringIO((here / "report" / "cost.csv").read_text(encoding="utf-8"))))
    assert {"A/A", "defocus"} <= {row[0] for row in rows}


def test_interrupted_it_reports_what_there_is(world, rt):
    rt("cost scene.yaml --arms defocus --quiet")
    world.interrupt_after, world.calls = len(world.calls) - 4, []
    output = rt("cost scene.yaml --arms defocus", status=130)
    assert "interrupted after 7 of 9 rounds" in " ".join(output.out.split())
    assert "defocus" in output.out
    # Too early for anything.
    world.interrupt_after, world.calls = 3, []
    output = rt("cost scene.yaml --arms defocus", status=130)
    assert output == ("", "nothing is known before the prediction is there\nrt: interrupted\n")


def test_a_target_that_no_float_can_square_is_out_of_reach(world, rt):
    said = " ".join(rt("cost scene.yaml --no-arms --target 1e-155% --budget '1e308 s'").out.split())
    assert "never" in said
    assert "the target takes more samples per pixel than a render can have" in said
    assert "the budget has time for more samples per pixel than a render can have" in said
