"""`rt reference` and `rt check`, from a scene file to a verdict."""

import json
import re

import numpy as np
import pytest

from raytracer.analysis.regression import check
from raytracer.analysis.regression.reference_file import load_reference
from tests.analysis.regression.made_up import SCENE, MadeUp


@pytest.fixture
def renders(monkeypatch):
    return MadeUp().install(monkeypatch)


def test_a_reference_knows_how_it_was_rendered_and_is_rendered_anew_so(here, renders, rt):
    (here / "scenes").mkdir()
    (here / "scenes" / "ball.yaml").write_text(SCENE, encoding="utf-8")
    arguments = "-o tests/kept -D camera.vfov=30 --name near --width 24 --spp 500 --seed 3"
    rt(f"reference scenes/ball.yaml {arguments}")
    path = here / "tests" / "kept" / "near.npz"
    before = load_reference(path)
    assert before.recipe.scene == "../../scenes/ball.yaml"
    film = {"film.width": 24, "film.height": 16}
    assert before.recipe.overrides == {"camera.vfov": 30, **film, "render.sampler": "independent"}
    assert (before.recipe.spp, before.recipe.seed) == (500, 3)

    renders.change = lambda picture: 1.1 * picture
    assert "; what it replaces: the mean of" in rt("reference tests/kept/near.npz").err
    after = load_reference(path)
    assert after.recipe == before.recipe
    np.testing.assert_allclose(after.mean, 1.1 * before.mean, rtol=1e-6)


@pytest.fixture
def referenced(here, renders, rt):
    """Scenes with their references."""
    for name in ("ball", "cube"):
        (here / f"{name}.yaml").write_text(SCENE, encoding="utf-8")
    assert rt("reference ball.yaml cube.yaml --quiet").err == ""


def test_every_reference_gets_its_line_and_the_worst_is_the_status(referenced, here, renders, rt):
    ball, cube = rt("check references cube ball").out.splitlines()
    passed = r"ball: passed: no difference beyond .* \(\d+ spp, which find \d+\.\d+ % more or less light, and .* px\)"
    assert re.match(passed, ball)
    assert cube.startswith("cube: passed")
    assert not (here / "outputs").exists()

    renders.change = lambda picture: 1.1 * picture
    (here / "cube.yaml").unlink()
    rt("check references cube", status=2)
    assert not (here / "outputs").exists()
    captured = rt("check references --json", status=2)
    found = {item["name"]: item for item in json.loads(captured.out)}
    assert {name: item["verdict"] for name, item in found.items()} == {"ball": "failed", "cube": "error"}
    assert found["cube"]["reason"] == "cube.yaml: no such file; did you mean ball.yaml?"
    assert found["ball"]["p"]["means"] < 1e-10
    assert "outputs/check.html shows what has failed" in captured.err


def test_a_page_is_written_where_it_is_asked_for(referenced, here, rt):
    assert rt("check references --report a/b.html --quiet") == ("", "rt: a/b.html shows the pictures\n")
    assert (here / "a" / "b.html").read_bytes().startswith(b"<!doctype html>")


def test_ctrl_c_tells_what_was_not_checked(referenced, renders, rt, monkeypatch):
    def until_the_second(*given, **settings):
        renders.interrupted = len(renders.calls) == 3
        return renders(*given, **settings)

    monkeypatch.setattr(check, "render", until_the_second)
    captured = rt("check references", status=130)
    assert captured.out.startswith("ball: passed")
    assert "rt: interrupted; 1 of 2 were not checked" in captured.err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("nowhere", "nowhere: no such folder"),
        (".", ". has no references: rt reference SCENE -o . renders one"),
        ("references bal", "references has no reference 'bal': did you mean 'ball'?"),
        ("references --seed 12345", "was rendered with the seed 12345 itself; a check takes another one"),
        ("references --spp 8", "a check takes at least 16 samples per pixel"),
        ("references --alpha 0.9", "--alpha"),
        ("references --report ball.yaml/a.html", "ball.yaml is not a folder"),
    ],
)
def test_what_cannot_be_checked_at_all(arguments, sentence, referenced, refused):
    assert sentence in refused(f"check {arguments}")
