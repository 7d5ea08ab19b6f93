"""`rt new`: scenes to begin with."""

from pathlib import Path

import pytest

from raytracer.film.image_file import load as load_image
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.scene.warnings import find_warnings

KINDS = {"thin_lens": "thin_lens", "pinhole": "pinhole", "lens": "lens", "lightfield": "camera_array"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_of_each_kind_is_valid_without_a_warning_and_each_key_is_told_of(kind, here, rt):
    rt(f"new {kind} sub/first.yaml -q")
    spec = load("sub/first.yaml")
    assert spec.camera.type == KINDS[kind]
    assert not find_warnings(pack(spec))
    text = Path("sub/first.yaml").read_text()
    camera = text.partition("camera:\n")[2].partition("film:")[0].splitlines()
    untold = [line.split(":")[0].strip() for line in camera if "#" not in line]
    # The comment of the lens is below it, and rows and columns tell what they are.
    assert untold == {"lens": ["lens"], "lightfield": ["rows", "columns"]}.get(kind, [])
    assert "rt render sub/first.yaml" in text
    assert max(map(len, text.splitlines())) <= 120


def test_nothing_is_overwritten(here, rt, refused):
    assert rt("new").err == "wrote scene.yaml\n"
    assert refused("new pinhole") == "rt: scene.yaml: is there already, and is not overwritten; name another file\n"
    Path("a-lens.yaml").touch()
    assert "a-lens.yaml: is there already" in refused("new lens a.yaml")
    assert "did you mean a.png.yaml?" in refused("new lens a.png")
    assert "did you mean 'rt new thin_lens b.yaml'?" in refused("new b.yaml")
    assert "'fisheye' is not one of" in refused("new fisheye")


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind == "thin_lens" else pytest.mark.slow) for kind in KINDS]
)
def test_it_renders_as_it_is_to_a_picture_that_is_exposed_well(kind, here, rt):
    rt(f"new {kind} first.yaml -q")
    assert rt("render first.yaml -q -o a.npy --scale 20% --spp 16").err == ""
    picture = load_image("a.npy")
    assert picture.shape == ((80, 120, 3) if kind == "lightfield" else (64, 96, 3))
    assert 0.06 < picture.mean() < 0.3
    # The ball of clay is red, and the sky is not.
    assert (picture[..., 0] > 2.0 * picture[..., 2]).mean() > 0.01
