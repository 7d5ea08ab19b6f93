"""`rt compare`: what it prints and writes, and when it fails."""

import json
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from raytracer.cli.base.app import main
from raytracer.film.image import Image
from raytracer.film.image_file import save

SHAPE = (16, 20, 3)
PLAIN = "--metric=mae,psnr"


@pytest.fixture
def images(tmp_path, monkeypatch):
    """a and b: renders of one scene; c: of a brighter one; small: of another size."""
    monkeypatch.chdir(tmp_path)
    for seed, (name, gain) in enumerate({"a": 1.0, "b": 1.0, "c": 1.1}.items()):
        noise = np.random.default_rng(seed).standard_normal((*SHAPE[:2], 1))
        image = Image(gain * (np.full(SHAPE, 0.5) + 0.01 * noise), np.full(SHAPE, 1e-4), 64)
        save(image, f"{name}.exr")
        save(image, f"{name}.png")
    save(Image(np.ones((4, 5, 3))), "small.exr")
    return tmp_path


def test_a_verdict_by_the_variances_and_without_any(images, capsys):
    assert main(["compare", "a.exr", "b.exr", PLAIN]) == 0
    out = capsys.readouterr().out
    assert "a.exr against b.exr: 20 x 16 pixels, linear light" in out
    assert "  MAE    0.01" in out
    assert out.endswith("PASS\n")
    assert main(["compare", "c.exr", "b.exr", PLAIN]) == 1
    assert "FAIL: z-test failed: the mean of" in capsys.readouterr().out
    assert main(["compare", "c.exr", "b.exr", PLAIN, "--no-test"]) == 0
    assert main(["compare", "c.png", "b.png", PLAIN]) == 0
    assert "PASS" not in capsys.readouterr().out


def test_bounds(images, capsys):
    assert main(["compare", "c.png", "b.png", PLAIN, "--fail-above", "mae=0.5", "--fail-below", "psnr=10"]) == 0
    assert capsys.readouterr().out.endswith("PASS\n")
    assert main(["compare", "c.png", "b.png", PLAIN, "--fail-above", "MAE=0.5", "--fail-below", "PSNR=99"]) == 1
    assert "FAIL: PSNR is 2" in capsys.readouterr().out
    assert main(["compare", "c.exr", "b.exr", "--fail-above", "mae=0.5", "--metric", "mae"]) == 0
    assert main(["compare", "c.exr", "b.exr", "--fail-above", "mae=0.5", "--metric", "mae", "--test"]) == 1


def test_json_is_all_of_the_output(images, capsys):
    assert main(["compare", "a.png", "a.png", "--metric", "psnr", "--metric", "mae", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["metrics"]["psnr"] == {"value": "inf", "domain": "display"}
    assert list(found["metrics"]) == ["mae", "psnr"]


def test_pictures_are_written(images, capsys):
    wanted = {"signed": "d.png", "z": "out/z.png", "side-by-side": "s.png", "wipe": "w.html"}
    options = [f"--difference={kind}={file}" for kind, file in wanted.items() if kind not in ("signed", "wipe")]
    assert main(["compare", "a.exr", "b.exr", PLAIN, "--difference=d.png", "--difference=w.html", *options]) == 0
    err = capsys.readouterr().err
    for file in wanted.values():
        assert f"wrote {file}" in err
    # Two images with gaps, and a legend that is wider than the third.
    for file, width in (("d.png", 240), ("s.png", 2 * 28 + 240)):
        with PIL.Image.open(file) as picture:
            assert picture.size[0] == width
    assert Path("w.html").read_text().startswith("<!doctype html>")


def test_folders(images, capsys):
    for folder, name in (("before", "b"), ("after", "a")):
        Path(folder).mkdir()
        for suffix in (".png", ".exr"):
            Path(f"{name}{suffix}").rename(Path(folder) / f"view{suffix}")
    pictures = ["--difference", "diffs", "--difference", "all.html"]
    assert main(["compare", "after", "before", PLAIN, "--fail-above=mae=0.1", *pictures]) == 0
    out = capsys.readouterr().out
    assert "after against before" in out
    assert out.count("pass") == 2
    assert sorted(path.name for path in Path("diffs").iterdir()) == ["view.exr.png", "view.png.png"]
    assert "view.exr" in Path("all.html").read_text()
    Path("c.png").rename("after/more.png")
    assert main(["compare", "after", "before", PLAIN, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["only_in_a"] == ["more.png"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["a.exr", "small.exr"], "a.exr, small.exr: the images differ in size: 20 x 16 and 5 x 4 pixels"),
        (["a.exr", "none.exr"], "none.exr: no such file"),
        (["none", "."], "none: no such folder"),
        (["a.exr", "."], ". is a folder, and a.exr is not"),
        (["a.exr", "b.exr", "--fail-above", "flip"], "--fail-above flip: must be METRIC=NUMBER"),
        (["a.exr", "b.exr", "--fail-above", "flip=low"], "--fail-above flip=low: must be METRIC=NUMBER"),
        (["a.exr", "b.exr", "--fail-above", "psnr=30"], "PSNR is better when it is larger"),
        (["a.exr", "b.exr", "--fail-above", "rsme=1"], "unknown metric 'rsme': did you mean 'rmse'"),
        (["a.exr", "b.exr", "--metric", "mae,"], "unknown metric ''"),
        (["a.png", "b.png", "--test"], "the z-test takes the variances of both images: a.png holds display values"),
        (["a.exr", "b.exr", "--alpha", "2"], "alpha must lie between 0 and 1"),
        (["a.exr", "b.exr", "--difference", "d.jpg"], "d.jpg: pictures of differences are written as .png"),
        (["a.exr", "b.exr", "--difference", "sgn=d.png"], "unknown kind of picture 'sgn'"),
        (["a.exr", "b.exr", "--difference", "z=d.html"], "only the kind wipe is a page"),
        (["a.exr", "b.exr", "--difference", "wipe=d.png"], "is written to a file .html"),
        (["a.exr", "b.exr", "--difference", "z="], "names no file"),
        (
            ["a.png", "b.png", PLAIN, "--difference", "z=d.png"],
            "no picture of z, since there was no z-test: a.png holds display values",
        ),
        (["a.exr", "b.exr", "--difference", "a.png/d.png"], "is not a folder"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(arguments, sentence, images, capsys):
    before = sorted(path.name for path in images.iterdir())
    assert main(["compare", *arguments]) == 2
    err = capsys.readouterr().err
    assert sentence in err
    assert err.count("\n") == 1
    assert sorted(path.name for path in images.iterdir()) == before
