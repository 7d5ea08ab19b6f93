"""`rt render` and `rt explain` from the command line."""

import contextlib
import json
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from raytracer.cli.base import outputs
from raytracer.cli.base.render_report import summarize
from raytracer.core.compiler.compile_progress import CompileProgress
from raytracer.core.error_estimate.fireflies import find_fireflies
from raytracer.film import Image, load, load_layers
from raytracer.rendering import diagnostics
from raytracer.rendering.diagnostics import SamplePacket
from raytracer.rendering.options import OPTIONS
from raytracer.rendering.progress import FIRST_COMPILATION, CompileBar
from raytracer.rendering.session import Rendered
from raytracer.rendering.statistics import Stats
from raytracer.report.wording import format_percent

SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
film: {width: 24, height: 16}
render: {spp: 16, max_depth: 5}
environment: {type: constant, radiance: 0.5}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
"""

SHOW = CompileBar.show


@pytest.fixture
def scene(here):
    path = here / "ball.yaml"
    path.write_text(SCENE)
    return path


def test_the_default_output_is_named_for_the_scene_and_quiet_says_nothing(scene, rt, monkeypatch):
    @contextlib.contextmanager
    def compiling(report):
        report(CompileProgress(1, 2, 0.5))
        yield

    monkeypatch.setattr("raytracer.core.compiler.compile_progress.watch_compilation", compiling)
    monkeypatch.setattr(CompileBar, "show", SHOW)
    out, err = rt("render ball.yaml")
    assert load("outputs/ball.png").shape == (16, 24, 3)
    assert out == ""
    first, second = err.splitlines()
    assert first == FIRST_COMPILATION
    assert second.startswith("outputs/ball.png: 24 x 16, 16 spp in ")
    assert rt("render ball.yaml -q") == ("", "")


def test_every_output_holds_the_same_picture_and_a_crop_is_a_part_of_it(scene, rt):
    rt("render ball.yaml -q -o a.npy -o a.exr -o a.hdr -o a.png --seed 7 --spp 4")
    exact = np.load("a.npy")
    # float32; a shared exponent with 8 bits of mantissa below the largest channel; 8 bits of sRGB, slope <= 2.4.
    np.testing.assert_allclose(load("a.exr"), exact, rtol=2.0**-23)
    assert np.all(np.abs(load("a.hdr") - exact) <= exact.max(axis=2, keepdims=True) * 2.0**-8)
    np.testing.assert_allclose(load("a.png"), np.clip(exact, 0.0, 1.0), atol=2.4 / 255 / 2)
    layers, settings = load_layers("a.exr")
    assert (settings["seed"], settings["spp"]) == ("7", "4")
    assert "variance" in layers
    rt("render ball.yaml -q -o part.npy --crop 5,3,21,14 --seed 7 --spp 4")
    np.testing.assert_array_equal(np.load("part.npy"), exact[3:14, 5:21])


def test_overrides_reach_the_render(scene, rt):
    rt("render ball.yaml -q -o a.npy -D film.width=8 -D render.max_depth=1")
    image = np.load("a.npy")
    assert image.shape == (16, 8, 3)
    # One segment sees the environment, and no light that the ball reflects.
    assert image[8, 4, 0] == 0.0
    assert image[0, 0, 0] == 0.5
    rt("render ball.yaml -q -o a.npy --preview -D film.width=960 -D film.height=640 -D render.max_depth=1")
    assert np.load("a.npy").shape == (320, 480, 3)


def test_help_lists_the_options_in_the_order_of_their_record(rt):
    text = " ".join(rt("render --help").out.split())
    places = [text.find(" ".join(option.help.split())) for option in OPTIONS.values()]
    assert sorted({-1, *places}) == [-1, *places]


def test_stats(scene, rt):
    rt("render ball.yaml -q --stats stats.json --threads 2")
    stats = json.loads(Path("stats.json").read_text())
    assert set(stats["seconds"]) == {"load", "pack", "build", "compile", "render", "develop", "total"}
    assert stats["samples"] == 24 * 16 * 16
    assert stats["rays"] >= stats["samples"]
    assert (stats["nan_samples"], stats["threads"]) == (0, 2)
    assert "environment" in stats["effects"]
    assert "defocus" not in stats["effects"]
    assert stats["peak_rss_bytes"] > 2**20
    assert stats["version"]


def test_a_time_limit_leaves_a_whole_picture(scene, rt):
    assert "rt: out of time; a.npy has " in rt("render ball.yaml -o a.npy --spp 1000000 --time-limit 0.5s").err
    image = np.load("a.npy")
    # Every tile has had its first pass: outside the ball the environment is seen without noise.
    assert image[0, 0, 0] == 0.5
    assert image[8, 12, 0] > 0.1


def test_a_time_limit_alone_is_what_was_asked_for_and_no_room_to_practise_is_no_failure(scene, rt, monkeypatch):
    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(outputs.tempfile, "mkdtemp", full)
    # Of the scene's 16 samples a pixel nothing is said then.
    assert "out of time" not in rt("render ball.yaml -o a.npy --time-limit 1s --stats a.json").err
    assert json.loads(Path("a.json").read_text())["spp"]["most"] > 16
    assert np.load("a.npy").any()
    # No command takes a millisecond.
    assert re.fullmatch(
        r"rt: [\d.]+ s for a time limit of 0\.001 s: \w+ing took [\d.]+ s; every pixel gets at least 8 samples\n",
        rt("render ball.yaml -o a.npy --time-limit 1ms -q").err,
    )
    assert np.load("a.npy").any()


SUMMARY = re.compile(
    r"a\.(npy|exr): 24 x 16, (?P<spp>.+) spp in [\d.]+ s \([\d.e+]+ M samples/s, [\d.e+]+ M rays/s\), "
    r"(?P<whole>[\d.]+) s in all, (?P<error>relative error .+), (?P<finite>.+ finite)\n"
)


def test_the_summary_says_what_is_known(scene, rt):
    found = SUMMARY.fullmatch(rt("render ball.yaml -o a.npy --spp 64 --stats a.json").err)
    assert found is not None
    assert found["spp"] == "64"
    assert found["finite"] == "all samples finite"
    assert float(found["whole"]) > 0.0
    # In percent, the numbers of the file.
    stats = json.loads(Path("a.json").read_text())
    value, low, high = map(float, re.findall(r"\d+\.\d+", found["error"]))
    keys = ("relative", "low", "high")
    np.testing.assert_allclose([value, low, high], [100.0 * stats["error"][key] for key in keys], rtol=0.01)
    assert low < value < high
    # Two halves of 8 samples are the fewest that tell anything.
    assert "relative error unknown from fewer than 16 spp" in rt("render ball.yaml -o a.npy --spp 8").err


def test_noise_is_what_the_picture_ends_with(scene, rt):
    command = "render ball.yaml -D film.width=48 -o a.exr --aov samples --stats a.json --noise 0.02%"
    assert re.search(r"48 x 16, [\d.]+ \(\d+ to \d+\) spp in", rt(command).err)
    stats = json.loads(Path("a.json").read_text())
    assert stats["error"]["relative"] <= stats["error"]["target"] == 0.0002
    layers, settings = load_layers("a.exr")
    counts = layers["samples"]
    assert (counts.min(), counts.max()) == (stats["spp"]["fewest"], stats["spp"]["most"])
    assert counts.mean() == pytest.approx(stats["spp"]["mean"])
    assert stats["samples"] == counts.sum()
    assert float(settings["relative_error"]) == stats["error"]["relative"]
    assert (settings["noise"], settings["spp_most"]) == ("0.0002", str(int(counts.max())))
    # What --spp allows is too little for a tenth of that.
    said = rt("render ball.yaml -o a.npy --noise 0.00002 --spp 64 -q").err
    assert said == "rt: 64 samples per pixel do not bring a.npy to a relative error of 0.002 %\n"


def test_ctrl_c_writes_what_is_there(scene, monkeypatch, rt):
    # The first report of progress comes while the workers are at work; the signal is the one that Ctrl-C sends.
    monkeypatch.setattr(
        "raytracer.rendering.progress.SampleBar.show", lambda bar, progress: signal.raise_signal(signal.SIGINT)
    )
    err = rt("render ball.yaml -o a.npy --spp 100000000", status=130).err
    assert re.search(r"interrupted; a\.npy has \d+( to \d+)? of 100000000 samples per pixel", err)
    assert err.count("interrupted") == 1
    # What goes on is the same command line, with one word more.
    assert "; this goes on: rt render ball.yaml -o a.npy --spp 100000000 --resume\n" in err
    assert np.load("a.npy").shape == (16, 24, 3)
    assert sorted(path.name for path in scene.parent.iterdir()) == ["a.npy", "a.npy.checkpoint", "ball.yaml"]


def test_fireflies_are_told_with_what_helps(scene, monkeypatch, rt):
    # As if one of 64 samples in the middle of the ball had met a lamp.
    def struck(mean, m2, count):
        mean, m2 = mean.copy(), m2.copy()
        mean[8, 12] += 100.0
        m2[8, 12] += 6400.0**2 * 63.0 / 64.0
        return find_fireflies(mean, m2, count)

    monkeypatch.setattr(diagnostics, "find_fireflies", struck)
    said = rt("render ball.yaml -o a.npy --spp 64 -q --seed 3 --stats a.json").err
    found = json.loads(Path("a.json").read_text())["fireflies"]
    assert (found["pixels"], found["brightest"]) == (1, [12, 8])
    # A sample of 64 that adds a quarter of what is around, at most 0.5.
    assert found["clamp"] == pytest.approx(64.0 * 0.25 * 0.45, rel=0.2)
    assert said == (
        "rt: 1 pixel is a firefly: one sample makes it far brighter than what is around, by "
        f"{format_percent(found['light'])} of the picture's light; more samples even that out, and -D "
        f"render.clamp={found['clamp']:g} would cut it off; this shows it: "
        f"rt render ball.yaml --spp 64 --seed 3 --pixel 12,8 --sample {found['sample']} --debug\n"
    )
    # It is looked for among all samples of the pixel, of which an aim for an error takes more than the scene says.
    asked = []

    def taken(scene, scratch, x, y, taken):
        asked.append(taken)
        return iter([SamplePacket(0, np.eye(40, 3, -37), np.ones(40))])

    monkeypatch.setattr(diagnostics, "replay_samples", taken)
    rt("render ball.yaml -o a.npy --noise 50% -D render.spp=8 -q --stats a.json")
    assert json.loads(Path("a.json").read_text())["fireflies"]["sample"] == 37
    assert min(asked) >= 32


@pytest.mark.parametrize(
    ("fewest", "error", "interrupted", "said"),
    [
        (8, {}, False, "relative error unknown from fewer than 16 spp"),
        (64, {}, False, "relative error unknown, as values are beyond all bounds"),
        (64, {}, True, "relative error unknown"),
        (64, {"relative": 0.0123, "low": 0.012, "high": 0.0126}, False, "relative error 1.23 % (1.20 .. 1.26)"),
    ],
)
def test_the_summary_says_why_no_error_is_known(fewest, error, interrupted, said):
    spp = {"fewest": fewest, "mean": float(fewest), "most": fewest}
    stats = Stats(seconds={"render": 1.0}, spp=spp, error=error)
    made = Rendered(Image(np.ones((2, 3, 3))), stats, True, interrupted, fewest, None)
    assert f", {said}, all samples finite" in summarize(made, "a.npy", 2.5)


# Black as it is, the ball fills the crop.
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--noise 1% --spp 8", "rt: 8 samples per pixel tell too little of the error of a.npy: it takes 16\n"),
        (
            "--noise 1% --crop 10,6,14,10 -D objects.0.material.albedo=0",
            "rt: a.npy is black, so its relative error says nothing\n",
        ),
    ],
)
def test_why_an_error_is_not_known(scene, rt, words, sentence):
    assert rt(f"render ball.yaml -o a.npy -q {words}").err.endswith(sentence)


def test_explain_names_every_effect_with_its_reason(scene, rt):
    explained = json.loads(rt("explain ball.yaml --json").out)
    effects = explained["effects"]
    active = {name for name, effect in effects.items() if effect["active"]}
    assert active == {"environment", "material.lambertian", "shape.sphere"}
    assert {"defocus", "light_sampling", "material.dielectric"} <= set(effects)
    assert all(effect["why"] for effect in effects.values())
    assert explained["camera"]["vfov_deg"] == 40.0


def test_explain_follows_overrides(scene, rt):
    text = rt("explain", "ball.yaml", "--all", "-D", "objects.0.material={type: emitter, radiance: 1}").out
    simulated, _, left_out = text.partition("Left out")
    assert "material.emitter" in simulated
    # The only object emits, so there is nothing that a light could light.
    assert "light_sampling" in left_out
    short = rt("explain ball.yaml").out
    assert short.startswith("Camera: pinhole\n")
    assert re.search(r"\n  and \d\d effects left out: --all lists them, each with a reason\n", short)
    assert "Left out" not in short
    lens = "camera={type: thin_lens, look_from: [0, 0, 10], look_at: [0, 0, 0], vfov: 20, defocus_angle: 0.6}"
    camera = json.loads(rt("explain", "ball.yaml", "-D", lens, "-D", "film.height=675", "--json").out)["camera"]
    # A = 2 F tan(delta / 2) = 0.104720 m; the blur at infinity is A / F on the plane at distance 1: 20.044 px.
    assert camera["aperture_diameter_mm"] == pytest.approx(104.720, abs=1e-3)
    assert camera["blur_at_infinity_px"] == pytest.approx(20.044, abs=1e-3)
    assert camera["focus_distance_m"] == 10.0


def test_aovs_are_layers_of_the_exr_file(scene, rt, refused):
    # With those that denoising takes, whose kernel is shared.
    rt("render ball.yaml -q -o a.exr -o a.png --aov object_id --aov albedo,normal,coverage")
    layers, settings = load_layers("a.exr")
    assert set(layers) == {"radiance", "variance", "object_id", "albedo", "normal", "coverage"}
    assert json.loads(settings["object_id_names"]) == {"1": "objects[0]"}
    assert load("a.png").shape == (16, 24, 3)
    # Only .exr holds layers, whatever is written besides.
    for files in ("", "-o a.png", "-o a.npy -o a.hdr"):
        sentence = refused(f"render ball.yaml {files} --aov depth")
        assert sentence == "rt: --aov depth: only .exr and .lf files hold layers: add -o NAME.exr\n"


def test_denoising_marks_the_file_or_says_what_it_lacks(scene, rt, refused, monkeypatch):
    pytest.importorskip("pyoidn")
    rt("render ball.yaml -q --denoise -o a.exr --spp 4 --aov object_id")
    layers, settings = load_layers("a.exr")
    assert set(layers) == {"radiance", "noisy", "object_id"}
    assert "biased" in settings["denoised"]
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    sentence = refused("render ball.yaml --denoise -o a.png")
    assert sentence.startswith("rt: denoising needs Open Image Denoise")
    assert sentence.endswith(": pip install 'raytracer[denoise]'\n")
