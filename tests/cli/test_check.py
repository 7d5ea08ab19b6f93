"""`rt reference` and `rt check`, from a scene file to a verdict."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from raytracer.analysis.regression import check
from raytracer.analysis.regression.reference_file import load_reference
from raytracer.rendering.render import render
from tests.analysis.regression.made_up import SCENE, MadeUp
from tests.small_scenes import scene_text

LIT = scene_text(
    """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: [0.8, 0.5, 0.3]}}
  - {type: quad, corner: [-2, -1.2, -3], edges: [[4, 0, 0], [0, 2, 2]], material: {type: lambertian, albedo: 0.5}}
""",
    width=48,
    height=40,
)


@pytest.fixture
def renders(monkeypatch):
    return MadeUp().install(monkeypatch)


def one_tile(picture):
    picture = picture.copy()
    picture[16:32, 16:32] *= 0.95
    return picture


FAULTS = {
    "1 % brighter": lambda picture: 1.01 * picture,
    "shifted by a pixel": lambda picture: np.roll(picture, 1, axis=0),
    "two channels swapped": lambda picture: picture[..., [0, 2, 1]],
    "one wrong tile": one_tile,
}


def test_planted_faults_are_found(here, monkeypatch, rt):
    (here / "ball.yaml").write_text(LIT, encoding="utf-8")
    rt("reference ball.yaml --threads 2 --spp 2048")
    assert re.match(
        r"ball: passed: no difference beyond .* \(256 spp, which find 0\.\d+ % more or less light, and .* px\)",
        rt("check references --threads 2").out,
    )
    assert not (here / "outputs").exists()

    # As a program would render it that is wrong.
    for number, change in enumerate(FAULTS.values()):

        def wrong(*given, change=change, **settings):
            rendered = render(*given, **settings)
            image = replace(
                rendered.image, radiance=change(rendered.image.radiance), variance=change(rendered.image.variance)
            )
            return rendered._replace(image=image)

        monkeypatch.setattr(check, "render", wrong)
        found = rt(f"check references --threads 2 --seed {number}", status=1).out
        assert found.startswith("ball: FAILED: ")
        assert (here / "outputs" / "check.html").exists()


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
    lines = rt("check references cube ball").out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["ball", "cube"]

    renders.change = lambda picture: 1.1 * picture
    (here / "cube.yaml").unlink()
    rt("check references cube", status=2)
    assert not (here / "outputs").exists()
    captured = rt("check references --json", status=2)
    found = {item["name"]: item for item in json.loads(captured.out)}
    assert {name: item["verdict"] for name, item in found.items()} == {"ball": "failed", "cube": "error"}
    assert found["cube"]["reason"] == "cube.yaml: no such file"
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
