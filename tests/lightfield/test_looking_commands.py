"""`rt lightfield views`, `epi`, `move`, `depth`, `all-in-focus`: what they write, and what they say."""

import json

import numpy as np
import PIL.Image
import pytest

from raytracer.cli.base.app import main
from raytracer.film import image_file
from raytracer.film.formats import pfm
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField, Rays
from raytracer.lightfield.depth.depth_map import Depth
from tests.lightfield.analytic import Surface, light_field, views, waves


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("field") / "wall.lf"
    surfaces = [Surface(2.5, waves(0, 0.1), tilt=(0.4, 0.0))]
    lf.write(path, light_field(views(3, 5, spacing=0.03, width=40, height=30), surfaces))
    return path


def run(*arguments):
    return main(["lightfield", *map(str, arguments)])


def test_one_view_is_told_of(tmp_path, capsys):
    whole = light_field(views(1, 1, width=8, height=6), [Surface(2.5, waves(0, 0.1))])
    one = LightField(whole.radiance, whole.views, rays=Rays(np.zeros((1, 4)), np.ones((1, 3)), np.ones(1)))
    lf.write(tmp_path / "one.lf", one)
    assert run("info", tmp_path / "one.lf", "--check") == 0
    told = capsys.readouterr().out
    assert "refocusable     by the rays, at any distance" in told
    assert told.endswith("all of it was read, and is whole\n")
    assert run("move", tmp_path / "one.lf", "-o", tmp_path / "a.gif") == 2
    assert "one.lf: a path needs at least two views" in capsys.readouterr().err


def test_no_command_is_told_in_one_line(capsys):
    assert run() == 2
    assert capsys.readouterr().err == "rt: Missing command (see 'rt lightfield --help')\n"


def test_views(file, tmp_path, capsys):
    assert run("views", file, "-o", tmp_path / "m.png", "-q") == 0
    with PIL.Image.open(tmp_path / "m.png") as montage:
        assert montage.size == (5 * 42 - 2, 3 * 32 - 2)
    assert run("views", file, "--view", "1,3", "-o", tmp_path / "v.npy", "-q") == 0
    assert run("views", file, "--at", "3cm,0", "-o", tmp_path / "a.npy", "-q") == 0
    assert np.array_equal(np.load(tmp_path / "v.npy"), np.load(tmp_path / "a.npy"))
    assert run("views", file, "--all", "-o", tmp_path / "all", "-q") == 0
    assert len(list((tmp_path / "all").glob("view_?_?.png"))) == 15
    assert run("views", file, "--all", "-o", tmp_path / "all.png", "-q") == 2
    assert "all.png: --all writes a file for each view, and -o names their folder" in capsys.readouterr().err
    assert run("views", file, "--all", "--format", "exr", "-o", tmp_path / "all", "-q") == 0
    assert len(list((tmp_path / "all").glob("view_?_?.exr"))) == 15
    assert run("views", file, "--view", "1,2", "--scale", "2", "-o", tmp_path / "f.npy", "-q") == 0
    assert np.load(tmp_path / "f.npy").shape == (60, 80, 3)


def test_depth(file, tmp_path, capsys):
    names = [tmp_path / f"d{suffix}" for suffix in (".png", ".exr", ".npy", ".pfm")]
    outputs = [part for name in names for part in ("-o", name)]
    assert run("depth", file, *outputs, "--confidence", tmp_path / "c.npy", "--json", "-q") == 0
    told = json.loads(capsys.readouterr().out)
    depth = np.load(names[2])
    layers, _ = image_file.load_layers(names[1])
    assert np.array_equal(layers["depth"], depth.astype(np.float32))
    assert np.array_equal(pfm.decode(names[3].read_bytes()), depth.astype(np.float32))
    assert told["view"] == [1, 2]
    assert told["near_m"] < told["median_m"] < told["far_m"]
    with lf.open(file) as field:
        exact = np.asarray(field.layers["depth"][1, 2])
    assert told["median_m"] == pytest.approx(np.median(exact), rel=0.02)


def test_a_pixel_that_is_sure_and_wrong_does_not_stretch_what_is_told(file, tmp_path, monkeypatch, capsys):
    inverse = np.linspace(0.5, 1.0, 1200).reshape(30, 40)
    inverse[15, 20] = 100.0
    monkeypatch.setattr(
        "raytracer.lightfield.depth.depth_map.depth_map", lambda *_, **__: Depth(inverse, np.ones((30, 40)), 1, 2)
    )
    assert run("depth", file, "-o", tmp_path / "d.png", "--json", "-q") == 0
    told = json.loads(capsys.readouterr().out)
    assert [told["near_m"], told["far_m"]] == pytest.approx([1.0, 2.0], rel=0.02)
    with PIL.Image.open(tmp_path / "d.png") as picture:
        assert len(picture.getcolors(4096)) > 200


def test_slices_paths_and_sharp_pictures(file, tmp_path):
    assert run("epi", file, "-o", tmp_path / "e.png", "-q") == 0
    assert run("epi", file, "--vertical", "--line", "7", "-o", tmp_path / "e.npy", "-q") == 0
    assert np.load(tmp_path / "e.npy").shape == (3, 30, 3)
    assert run("move", file, "--frames", "6", "-o", tmp_path / "m.gif", "-q") == 0
    with PIL.Image.open(tmp_path / "m.gif") as animation:
        assert animation.n_frames == 6
    assert run("all-in-focus", file, "-o", tmp_path / "s.npy", "-q") == 0
    with lf.open(file) as field:
        sharp, view = np.load(tmp_path / "s.npy"), field.view(1, 2)
    assert ((sharp - view) ** 2).sum() < 0.03**2 * (view**2).sum()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("views", "nothing.lf", "-o", "a.png"), "nothing.lf: no such file"),
        (("views", "FILE", "-o", "a.txt"), "unknown suffix '.txt'"),
        (("views", "FILE", "--view", "1,9", "-o", "a.png"), "wall.lf: no view 1,9"),
        (("views", "FILE", "--width", "4", "-o", "a.png"), "wall.lf: a picture 4 pixels wide has no room"),
        (("views", "FILE", "--at", "61mm,0", "-o", "a.png"), "--at 61mm,0: is outside the views, which are from -0.06"),
        (("views", "FILE", "--all", "--format", "bmp", "-o", "a"), "--format bmp: must be one of png"),
        (("views", "FILE", "--view", "1", "-o", "a.png"), "--view 1: must be a row and a column"),
        (("views", "FILE", "--at", "3", "-o", "a.png"), "--at 3: must be two lengths"),
        (("views", "FILE", "--view", "0,0", "--all", "-o", "a.png"), "give one of them"),
        (("views", "FILE", "--depth", "-o", "a.png"), "give --at too"),
        (("epi", "FILE", "--line", "30", "-o", "a.png"), "no row 30 of pixels"),
        (("epi", "FILE", "--vertical", "--views", "5", "-o", "a.png"), "no column 5 of views"),
        (("move", "FILE", "--path", "spiral", "-o", "a.gif"), "--path spiral: must be one of circle"),
        (("move", "FILE", "--radius", "1m", "-o", "a.gif"), "does not fit"),
        (("move", "FILE", "-o", "a.png"), "unknown suffix '.png'"),
        (("depth", "FILE", "--method", "guess"), "--method guess: must be one of focus"),
        (("depth", "FILE", "--near", "-2"), "--near -2"),
        (("depth", "FILE", "--near", "3", "--far", "2"), "near must be less than far"),
    ],
)
def test_wrong_wishes_in_one_sentence(arguments, told, file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(*(str(file) if argument == "FILE" else argument for argument in arguments)) == 2
    message = capsys.readouterr().err
    assert told in message
    assert message.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
