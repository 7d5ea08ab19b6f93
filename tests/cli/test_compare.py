"""`rt compare`: what it prints and writes, and when it fails."""

import json
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from raytracer.film.image import Image
from raytracer.film.image_file import save

SHAPE = (16, 20, 3)
PLAIN = "--metric=mae,psnr"


@pytest.fixture
def images(here):
    """a and b: renders of one scene; c: of a brighter one; small: of another size."""
    for seed, (name, gain) in enumerate({"a": 1.0, "b": 1.0, "c": 1.1}.items()):
        noise = np.random.default_rng(seed).standard_normal((*SHAPE[:2], 1))
        image = Image(gain * (np.full(SHAPE, 0.5) + 0.01 * noise), np.full(SHAPE, 1e-4), 64)
        save(image, f"{name}.exr")
        save(image, f"{name}.png")
    save(Image(np.ones((4, 5, 3))), "small.exr")


def test_a_verdict_by_the_variances_and_without_any(images, rt):
    out = rt(f"compare a.exr b.exr {PLAIN}").out
    assert "a.exr against b.exr: 20 x 16 pixels, linear light" in out
    assert "  MAE    0.01" in out
    assert out.endswith("PASS\n")
    assert "FAIL: z-test failed: the mean of" in rt(f"compare c.exr b.exr {PLAIN}", status=1).out
    for words in ("c.exr b.exr --no-test", "c.png b.png"):
        assert "PASS" not in rt(f"compare {words} {PLAIN}").out


def test_bounds(images, rt):
    out = rt(f"compare c.png b.png {PLAIN} --fail-above mae=0.5 --fail-below psnr=10").out
    assert out.endswith("PASS\n")
    out = rt(f"compare c.png b.png {PLAIN} --fail-above MAE=0.5 --fail-below PSNR=99", status=1).out
    assert "FAIL: PSNR is 2" in out
    rt("compare c.exr b.exr --fail-above mae=0.5 --metric mae")
    rt("compare c.exr b.exr --fail-above mae=0.5 --metric mae --test", status=1)


def test_json_is_all_of_the_output(images, rt):
    found = json.loads(rt("compare a.png a.png --metric psnr --metric mae --json").out)
    assert found["metrics"]["psnr"] == {"value": "inf", "domain": "display"}
    assert list(found["metrics"]) == ["mae", "psnr"]


def test_pictures_are_written(images, rt):
    wanted = "--difference=d.png --difference=w.html --difference=z=out/z.png --difference=side-by-side=s.png"
    err = rt(f"compare a.exr b.exr {PLAIN} {wanted}").err
    for file in ("d.png", "w.html", "out/z.png", "s.png"):
        assert f"wrote {file}" in err
    # Two images with gaps, and a legend that is wider than the third.
    for file, width in (("d.png", 240), ("s.png", 2 * 28 + 240)):
        with PIL.Image.open(file) as picture:
            assert picture.size[0] == width
    assert Path("w.html").read_text().startswith("<!doctype html>")


def test_folders(images, rt):
    for folder, name in (("before", "b"), ("after", "a")):
        Path(folder).mkdir()
        for suffix in (".png", ".exr"):
            Path(f"{name}{suffix}").rename(Path(folder) / f"view{suffix}")
    pictures = "--difference diffs --difference all.html"
    out = rt(f"compare after before {PLAIN} --fail-above=mae=0.1 {pictures}").out
    assert "after against before" in out
    assert out.count("pass") == 2
    assert sorted(path.name for path in Path("diffs").iterdir()) == ["view.exr.png", "view.png.png"]
    assert "view.exr" in Path("all.html").read_text()
    Path("c.png").rename("after/more.png")
    assert json.loads(rt(f"compare after before {PLAIN} --json", status=1).out)["only_in_a"] == ["more.png"]
