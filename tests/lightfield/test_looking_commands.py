"""`rt lightfield views`, `epi`, `move`, `depth`, `all-in-focus`, `refocus`: what they write, and what they say."""

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
from raytracer.lightfield.refocusing.refocus import refocus
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
    errors = ["--error", tmp_path / "e.npy"]
    assert run("depth", file, *outputs, "--confidence", tmp_path / "c.npy", *errors, "--truth", "--json", "-q") == 0
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
    error, confidence = np.load(tmp_path / "e.npy"), np.load(tmp_path / "c.npy")
    assert np.array_equal(layers["error"], error.astype(np.float32))
    assert told["error_m"] == pytest.approx(np.median(error[confidence >= 0.5]), rel=0.02)
    disparity = np.abs(1.0 / depth - 1.0 / exact)[1:-1, 1:-1] * 0.03 / (2.0 * np.tan(np.radians(15.0)) / 30)
    assert told["truth"]["bad_0.03"] == pytest.approx((disparity > 0.03).mean())
    assert told["truth"]["mse_x100"] == pytest.approx(100.0 * (disparity**2).mean())
    assert told["truth"]["curved_degrees"] is None


def test_a_depth_without_truth_or_metres(file, tmp_path, capsys):
    with lf.open(file) as field:
        plain = LightField(np.asarray(field.radiance[:]), field.views, settings={"units": "views"})
    lf.write(tmp_path / "plain.lf", plain)
    assert run("depth", tmp_path / "plain.lf", "--truth") == 2
    assert capsys.readouterr().err.startswith(f"rt: {tmp_path / 'plain.lf'}: --truth needs a light field in metres")
    assert run("depth", tmp_path / "plain.lf", "--error", tmp_path / "e.png", "--json", "-q") == 0
    told = json.loads(capsys.readouterr().out)
    assert 0.0 < told["error_px"] < 0.1
    with PIL.Image.open(tmp_path / "e.png") as picture:
        assert len(picture.getcolors(4096)) > 50
    assert run("depth", file, "--truth") == 0
    out = capsys.readouterr().out
    assert "half of these have a standard error of at most" in out
    assert "against the layer depth: mean squared error x 100:" in out
    assert "median angle between normals on planes:" in out


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


def refocused(capsys, *arguments):
    """Refocus, and return what is told in JSON."""
    assert run("refocus", *arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_a_photograph_is_written_as_python_makes_it(file, tmp_path, capsys):
    path = tmp_path / "a.npy"
    refocused(capsys, file, "--distance", "160cm", "--aperture", "75mm", "--tilt", "0.2 rad", "-o", path)
    with lf.open(file) as field:
        expected = refocus(field, 1.6, aperture=0.075, tilt=float(np.degrees(0.2))).radiance
    np.testing.assert_allclose(image_file.load(path), expected, rtol=1e-12)


def test_a_stack_is_an_animation_or_a_picture_each(file, tmp_path, capsys):
    told = refocused(
        capsys, file, "-d", "1:4:3:inverse", "-d", "inf", "-o", tmp_path / "a.gif", "-o", tmp_path / "a.npy"
    )
    assert told["distances_m"] == [1.0, pytest.approx(1.6), 4.0, None]
    # There and back again, without the ends twice.
    with PIL.Image.open(tmp_path / "a.gif") as animation:
        assert getattr(animation, "n_frames", 1) == 6
    files = [tmp_path / f"a_{number}.npy" for number in range(1, 5)]
    assert told["files"] == [str(tmp_path / "a.gif"), *map(str, files)]
    with lf.open(file) as field:
        for path, distance in zip(files, (1.0, 1.6, 4.0, np.inf), strict=True):
            np.testing.assert_allclose(image_file.load(path), refocus(field, distance).radiance, rtol=1e-10)


def test_equal_steps_of_distance_and_slopes(file, tmp_path, capsys):
    told = refocused(capsys, file, "-d", "1:2:3,5", "-o", tmp_path / "a.webp")
    assert told["distances_m"] == [1.0, 1.5, 2.0, 5.0]
    told = refocused(capsys, file, "--slope", "0:1:2", "--method", "fourier", "-o", tmp_path / "b.webp")
    pixel = 2.0 * np.tan(np.radians(15.0)) / 30
    assert told["distances_m"] == pytest.approx([2.0, 1.0 / (0.5 + pixel / 0.03)])


def test_without_metres_it_tells_slopes(tmp_path, capsys):
    field = LightField(np.ones((3, 3, 6, 8, 3)), views(3, 3, width=8, height=6), settings={"units": "views"})
    lf.write(tmp_path / "a.lf", field)
    told = refocused(capsys, tmp_path / "a.lf", "--slope", "-0.5:1:3", "-o", tmp_path / "b.gif")
    assert set(told) == {"slopes_px", "files"}
    np.testing.assert_allclose(told["slopes_px"], [-0.5, 0.25, 1.0], atol=1e-12)


def test_rays_that_leave_pixels_black_are_told_of(tmp_path, capsys):
    rays = Rays(np.zeros((1, 4)), np.ones((1, 3)), np.ones(1))
    single = LightField(np.zeros((1, 1, 18, 24, 3)), views(1, 1, width=24, height=18), rays=rays)
    lf.write(tmp_path / "rays.lf", single)
    assert run("refocus", tmp_path / "rays.lf", "--method", "rays", "-o", tmp_path / "a.png") == 0
    assert "no ray comes to 99.8 % of the pixels" in capsys.readouterr().err


def test_a_plane_beyond_the_range_is_told_of(file, tmp_path, capsys):
    assert run("refocus", file, "-d", "0.2", "-o", tmp_path / "a.png") == 0
    err = capsys.readouterr().err
    assert "0.2 m is beyond" in err
    assert "edges out of focus come apart" in err


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
        (("views", "FILE", "--depth", "-o", "a.png"), "--depth says how a view between others is made: give --at too"),
        (("views", "FILE", "--distance", "2", "-o", "a.png"), "give --at or --from too"),
        (("epi", "FILE", "--line", "30", "-o", "a.png"), "no row 30 of pixels"),
        (("epi", "FILE", "--vertical", "--views", "5", "-o", "a.png"), "no column 5 of views"),
        (("move", "FILE", "--path", "spiral", "-o", "a.gif"), "--path spiral: must be one of circle"),
        (("move", "FILE", "--radius", "1m", "-o", "a.gif"), "does not fit"),
        (("move", "FILE", "-o", "a.png"), "unknown suffix '.png'"),
        (("depth", "FILE", "--method", "guess"), "--method guess: must be one of focus"),
        (("depth", "FILE", "--near", "-2"), "--near -2"),
        (("depth", "FILE", "--near", "3", "--far", "2"), "near must be less than far"),
        (("refocus", "FILE", "-d", "2", "--alpha", "1", "-o", "a.png"), "give one of them"),
        (("refocus", "FILE", "-d", "2 kg", "-o", "a.png"), "--distance 2 kg"),
        (("refocus", "FILE", "-d", "1:4", "-o", "a.gif"), "START:STOP:COUNT"),
        (("refocus", "FILE", "-d", "1:inf:4", "-o", "a.gif"), "1:inf:4:inverse"),
        (("refocus", "FILE", "-d", "0:4:4:inverse", "-o", "a.gif"), "greater than 0"),
        (("refocus", "FILE", "-d", "1:4:1", "-o", "a.gif"), "from 2 to 10000 planes"),
        (("refocus", "FILE", "-d", "2", "-o", "a.gif"), "needs several distances"),
        (("refocus", "FILE", "-d", "2", "-o", "a.lf"), "unknown suffix '.lf' for a photograph"),
        (("refocus", "FILE", "-d", "2", "--center", "1", "-o", "a.png"), "two lengths"),
        (
            ("refocus", "FILE", "-d", "2", "--crop", "0,0,50,10", "-o", "a.png"),
            "wall.lf: crop 0,0,50,10 must lie",
        ),
        (
            ("refocus", "FILE", "-d", "2", "--f-number", "4", "-o", "a.png"),
            "wall.lf: an f-number needs the focal",
        ),
        (("view", "FILE", "-o", "cards.png"), "unknown suffix '.png' for a page"),
        (("view", "FILE", "--size", "lots"), "--size lots: must be a number of bytes"),
        (("view", "FILE", "--size", "10kB"), "at least 1MB"),
        (("view", "FILE", "--exposure", "bright"), "--exposure bright: must be a number of stops"),
    ],
)
def test_wrong_wishes_in_one_sentence(arguments, told, file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(*(str(file) if argument == "FILE" else argument for argument in arguments)) == 2
    message = capsys.readouterr().err
    assert told in message
    assert message.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
