"""What two images are compared in, and when that is good enough."""

import json
import math

import numpy as np
import pytest

from raytracer.analysis import compare as comparison
from raytracer.analysis.compare import compare, encode
from raytracer.film.image import Image
from raytracer.film.image_file import save
from raytracer.util import srgb
from raytracer.util.errors import InputError

SHAPE = (24, 32, 3)
QUICK = ("mae", "mse", "psnr")


def render(seed, gain=1.0, spp=64, **settings):
    rng = np.random.default_rng(seed)
    scene = gain * np.linspace(0.2, 0.9, 32)[:, None] * np.array([1.0, 0.7, 0.4]) * np.ones(SHAPE)
    variance = (0.5 * scene) ** 2 / spp
    noise = rng.standard_normal((*SHAPE[:2], 1))
    return Image(scene + np.sqrt(variance) * noise, variance, spp, {"sampler": "independent"} | settings)


def test_two_renders_of_a_scene_pass_and_another_one_fails(tmp_path):
    for name, image in (("a", render(1)), ("b", render(2)), ("c", render(3, gain=1.05))):
        save(image, tmp_path / f"{name}.exr")
    same = compare(tmp_path / "a.exr", tmp_path / "b.exr", metrics=QUICK)
    assert same.passed is True
    assert same.failures == ()
    # Errors of 768 pixels with common noise in their channels: 5 % is their standard deviation, and this is four.
    assert same.metrics["mse"] == pytest.approx(same.noise_mse, rel=0.2)
    other = compare(tmp_path / "c.exr", tmp_path / "b.exr", metrics=QUICK)
    assert other.passed is False
    assert other.failures == (f"z-test failed: {other.verdict.reason}",)
    assert other.a == str(tmp_path / "c.exr")
    # A denoised file is not tested, even if it has a variance.
    save(render(1, denoised="oidn"), tmp_path / "d.exr")
    assert "was denoised" in compare(tmp_path / "d.exr", render(2), metrics=QUICK).untested


def test_files_arrays_and_images_are_one(tmp_path):
    a, b = render(1), render(2)
    expected = compare(a, b, metrics=QUICK).metrics
    for name, image in (("a", a), ("b", b)):
        for suffix in (".npy", ".exr", ".hdr"):
            save(image, tmp_path / f"{name}{suffix}")
    assert compare(a.radiance, b.radiance, metrics=QUICK).metrics == expected
    assert compare(tmp_path / "a.npy", str(tmp_path / "b.npy"), metrics=QUICK).metrics == expected
    assert compare(tmp_path / "a.exr", b, metrics=QUICK).metrics == pytest.approx(expected, rel=1e-4)
    assert compare(tmp_path / "a.hdr", tmp_path / "b.hdr", metrics=QUICK).metrics == pytest.approx(expected, rel=0.05)


def test_a_render_equals_the_display_image_that_it_was_saved_as(tmp_path):
    curved = Image(render(1).radiance, tone_curve=lambda values: values / (1 + values))
    for image in (render(1), curved):
        save(image, tmp_path / "a.png")
        found = compare(image, tmp_path / "a.png", metrics=QUICK)
        assert found.metrics["mae"] == 0.0
        assert set(found.domains.values()) == {"display"}
    assert compare(curved.display(), tmp_path / "a.png", metrics=QUICK).metrics["mae"] == 0.0


def test_bounds_decide_when_there_are_any():
    a, b = render(3, gain=1.05), render(2)
    mae = compare(a, b, metrics=["mae"]).metrics["mae"]
    # The z-test fails here, and is not asked for.
    assert compare(a, b, metrics=QUICK, fail_above={"MAE": 1.01 * mae}).passed is True
    found = compare(a, b, metrics=QUICK, fail_above={"mae": 0.99 * mae}, fail_below={"psnr": 60})
    assert found.passed is False
    assert [failure.split(",")[1][:6] for failure in found.failures] == [" above", " below"]
    assert compare(a, b, metrics=QUICK, fail_above={"mae": 1.0}, test=True).passed is False
    assert compare(a, b, metrics=QUICK, test=False).passed is None
    # A bound is measured, even if it was not among those asked for, and holds for the value itself.
    assert "mse" in compare(a, b, metrics=["mae"], fail_above={"mse": 1.0}).metrics
    a, b = np.full(SHAPE, 0.75), np.full(SHAPE, 0.5)
    for bound, passes in ((0.25, True), (0.2499, False)):
        assert compare(a, b, metrics=["mae"], fail_above={"mae": bound}).passed is passes
    assert compare(a, a, metrics=["psnr"], fail_below={"psnr": math.inf}).passed is True


METERED = {"metering": "average", "exposure_gain": 2.0}
BALANCED = {"white_balance": "auto", "white_balance_gains": "0.5,1.0,2.0"}


@pytest.mark.parametrize(
    ("own", "others"),
    [
        (METERED | {"exposure_gain": 2.1}, METERED),
        (BALANCED | {"white_balance_gains": "0.525,1.05,2.1"}, BALANCED),
        (METERED | BALANCED | {"exposure_gain": 2.1}, METERED | BALANCED),
    ],
)
def test_gains_that_are_measured_do_not_fail_by_their_own_noise(own, others, tmp_path):
    # All is brighter by 5 %, since the gain is.
    images = {"a": render(1, gain=1.05, **own), "b": render(2, **others)}
    for name, image in images.items():
        save(image, tmp_path / f"{name}.exr")
    for pair in (images.values(), [tmp_path / f"{name}.exr" for name in images]):
        found = compare(*pair, metrics=["mae"])
        assert found.passed is True
        assert "judged at the gains that `auto`" in found.text()
        assert "its light times 0.952381\n" in found.text()
    # It is not the gain.
    assert compare(render(1, gain=1.05, **others), images["b"], metrics=["mae"]).passed is False


def test_alpha_is_the_significance_level():
    a, b = render(3, gain=1.008), render(2)
    verdict = compare(a, b, metrics=QUICK).verdict
    # Eight tests share it.
    least = 8 * min(verdict.p_values().values())
    assert compare(a, b, metrics=QUICK, alpha=0.99 * least).passed is True
    assert compare(a, b, metrics=QUICK, alpha=1.01 * least).passed is False


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (Image(render(1).radiance), "B has no variance"),
        (Image(render(1).radiance, np.full(SHAPE, np.inf)), "two samples in every pixel"),
        (Image(render(1).radiance, settings={"denoised": "oidn"}), "B was denoised"),
    ],
)
def test_why_there_is_no_test_is_told(image, reason):
    found = compare(render(1), image, metrics=QUICK)
    assert found.verdict is None
    assert found.passed is None
    assert reason in found.untested
    assert f"no z-test: {found.untested}" in found.text()
    with pytest.raises(InputError, match=reason):
        compare(render(1), image, metrics=QUICK, test=True)


def test_pixels_that_are_not_finite_are_counted_named_and_left_out():
    a, b = np.full(SHAPE, 0.75), np.full(SHAPE, 0.5)
    a[5, 7, 1], a[6, 1], b[5, 7], b[20, 3, 2] = np.nan, np.inf, np.nan, -np.inf
    found = compare(a, b, metrics=["mae", "relmse"])
    assert found.metrics["mae"] == pytest.approx(0.25)
    assert found.metrics["relmse"] == pytest.approx(0.0625 / 0.26)
    assert found.not_finite == (2, 2, (7, 5))
    assert "2 pixels of A and 2 pixels of B, the first at x = 7, y = 5" in found.text()
    assert found.passed is None
    assert compare(a, b, metrics=["mae"], fail_above={"mae": 1}).passed is False
    broken = render(1)
    broken.radiance[3, 4] = np.nan
    found = compare(broken, render(2), metrics=QUICK)
    assert found.failures == ("not finite: 1 pixel of A, the first at x = 4, y = 3",)


def test_of_no_finite_pixel_nothing_is_known():
    a, b = np.full(SHAPE, np.nan), np.full(SHAPE, 0.5)
    found = compare(a, b, metrics=[*QUICK, "ssim", "flip"])
    assert all(np.isnan(value) for value in found.metrics.values())
    assert compare(a, b, fail_below={"ssim": 0.1}, metrics=["ssim"]).failures[0].startswith("SSIM is nan")
    assert compare(a, a, fail_above={"mae": 1e9}, metrics=["mae"]).passed is False


@pytest.mark.parametrize("height", [24, 200])
def test_what_float64_cannot_hold_is_infinite(height):
    """In one band of rows, and in several, whose sums may be finite where their sum is not."""
    a, b = np.full((height, 32, 3), 1.7e308), np.full((height, 32, 3), -1.7e308)
    found = compare(a, b, metrics=["mae", "mse", "rmse", "relmse"])
    assert [found.metrics[name] for name in ("mae", "mse", "rmse")] == [np.inf] * 3
    assert compare(a / 1e150, 0.0 * b, metrics=["mse"]).metrics["mse"] == np.inf
    image = Image(a, np.ones_like(a), 16)
    assert compare(image, Image(b, np.ones_like(b), 16), metrics=["mae"]).passed is False
    for kind in ("signed", "absolute", "relative"):
        encode(found, kind)


def test_large_images_are_not_measured_by_flip_unless_it_is_asked_for(monkeypatch):
    monkeypatch.setattr("raytracer.analysis.compare.image_comparison._FLIP_UNASKED", 2 * 24 * 32 - 1)
    a, b = (image.radiance for image in (render(1), render(2)))
    found = compare(a, b)
    assert "flip" not in found.metrics
    assert "2 exposures" in found.unmeasured["flip"]
    assert "flip" in compare(a, b, metrics=["flip"]).metrics
    assert "flip" in compare(a, b, fail_above={"flip": 1}).metrics
    # A display image is one exposure.
    assert "flip" in compare((255 * a).astype(np.uint8), (255 * b).astype(np.uint8)).metrics


def test_images_are_compared_in_what_they_hold(tmp_path):
    for name, byte in (("a", 20), ("b", 10)):
        save(Image(np.full(SHAPE, srgb.decode(byte / 255))), tmp_path / f"{name}.png")
    display = compare(tmp_path / "a.png", tmp_path / "b.png")
    assert display.metrics["mae"] == pytest.approx(10 / 255)
    assert display.metrics["psnr"] == pytest.approx(20 * math.log10(25.5))
    assert set(display.domains.values()) == {"display"}
    assert (display.passed, display.verdict) == (None, None)
    light = compare(np.full(SHAPE, 0.5), np.full(SHAPE, 2.0))
    assert light.metrics["mae"] == pytest.approx(1.5)
    # A display shows 2 as 1.
    assert light.metrics["psnr"] == pytest.approx(-20 * math.log10(1 - srgb.encode(0.5)))
    linear = {"mae", "mse", "rmse", "relmse", "mrse", "flip"}
    assert {name for name, domain in light.domains.items() if domain == "linear"} == linear
    assert set(light.metrics) - linear == {"psnr", "ssim"}


@pytest.mark.parametrize(
    "own",
    [
        {"exposure_gain": 2.1},
        {"white_balance_gains": "0.525,1.05,2.1"},
        # A compensation is asked for.
        METERED | {"exposure_gain": 2.1, "exposure_compensation": math.log2(1.05)},
        METERED | {"exposure_gain": "much"},
        BALANCED | {"white_balance_gains": "0.525,1.05"},
    ],
)
def test_gains_that_were_asked_for_or_are_not_known_are_not_undone(own):
    found = compare(render(1, gain=1.05, **own), render(2, **METERED, **BALANCED), metrics=["mae"])
    assert found.passed is False
    assert not any("gains" in note for note in found.notes)


SMALL, TALL = np.full((4, 5, 3), 0.5), np.ones((5, 4, 3))


@pytest.mark.parametrize(
    ("a", "b", "settings", "words"),
    [
        (SMALL, TALL, {}, "differ in size: 5 x 4 and 4 x 5 pixels"),
        (np.ones((4, 5)), SMALL, {}, r"A: an image has the shape .* got float64 \(4, 5\)"),
        ("nowhere.png", SMALL, {}, "no such file"),
        (SMALL, SMALL, {"metrics": ["relmsd"]}, "unknown metric 'relmsd': did you mean 'relmse'"),
        (SMALL, SMALL, {"metrics": ["ssim"]}, "11 x 11"),
        (SMALL, SMALL, {"fail_above": {"ssim": 0.9}}, "SSIM is better when it is larger, so it fails below its bound"),
        (SMALL, SMALL, {"fail_below": {"mae": 0.9}}, "MAE is better when it is smaller, so it fails above"),
        (SMALL, SMALL, {"fail_above": {"mae": math.nan}}, "must be a number"),
    ],
)
def test_what_is_wrong_is_said(a, b, settings, words):
    with pytest.raises(InputError, match=words):
        compare(a, b, **settings)
    assert "11 x 11" in compare(SMALL, SMALL).unmeasured["ssim"]


@pytest.fixture
def folders(tmp_path):
    """Two folders: one pair alike, one apart, one broken, one within, one only here and one only there."""
    for folder in "ab":
        (tmp_path / folder / "in").mkdir(parents=True)
        save(render(1), tmp_path / folder / "same.png")
        save(render(1 if folder == "a" else 2), tmp_path / folder / "in" / "noise.exr")
        save(render(1, gain=1.0 if folder == "a" else 0.5), tmp_path / folder / "apart.png")
        save(render(1), tmp_path / folder / f"only_{folder}.png")
        (tmp_path / folder / ".before").mkdir()
        for name in ("notes.txt", f".before/{folder}.png", f"._{folder}.png"):
            (tmp_path / folder / name).write_bytes(b"no image")
    (tmp_path / "a" / "broken.png").write_bytes(b"\x89PNG")
    save(render(1), tmp_path / "b" / "broken.png")
    return tmp_path / "a", tmp_path / "b"


def test_folders_are_compared_by_name(folders):
    done = []

    def note(pair, number, of):
        # Pixels are there meanwhile, and let go of.
        assert pair.comparison is None or pair.comparison.pictures is not None
        done.append((pair.name, number, of))

    checks = comparison.PassCriteria(above={"mae": 0.01}, test=False)
    found = comparison.compare_folders(*folders, metrics=("mae",), checks=checks, done=note)
    names = ["apart.png", "broken.png", "in/noise.exr", "same.png"]
    assert done == [(name, number, 4) for number, name in enumerate(names, start=1)]
    assert [pair.passed for pair in found.pairs] == [False, False, False, True]
    assert (found.only_a, found.only_b) == (("only_a.png",), ("only_b.png",))
    assert found.passed is False
    assert "broken, or no .png image" in found.pairs[1].error
    assert "FAIL: 5 of 6 images" in found.text()
    data = json.loads(json.dumps(found.json(), allow_nan=False))
    assert [pair["passed"] for pair in data["pairs"]] == [False, False, False, True]
    assert data["only_in_a"] == ["only_a.png"]
    assert all(pair.comparison is None or pair.comparison.pictures is None for pair in found.pairs)
    with pytest.raises(InputError, match="released"):
        comparison.encode(found.pairs[0].comparison, "signed")


def test_folders_that_are_alike_pass_or_were_asked_nothing(folders, tmp_path):
    a, b = folders
    (a / "broken.png").unlink()
    asked = comparison.compare_folders(a, a, metrics=("mae",), checks=comparison.PassCriteria(above={"mae": 0.0}))
    assert asked.passed is True
    assert asked.text().endswith("PASS\n")
    (a / "in" / "noise.exr").unlink()
    assert comparison.compare_folders(a, a, metrics=("mae",)).passed is None
    (tmp_path / "empty").mkdir()
    for first, second, words in (
        (a, tmp_path / "none", "no such folder"),
        (a / "same.png", b, "is not a folder"),
        (a, tmp_path / "empty", "no image has the same name in both folders"),
    ):
        with pytest.raises(InputError, match=words):
            comparison.compare_folders(first, second)


def test_json_holds_everything_and_no_number_that_it_cannot():
    a = render(1)
    found = compare(a, a, names=("first", "second"))
    data = json.loads(json.dumps(found.json(), allow_nan=False))
    assert data["a"] == "first"
    assert data["metrics"]["psnr"] == {"value": "inf", "domain": "display"}
    assert data["metrics"]["mae"] == {"value": 0.0, "domain": "linear"}
    assert data["passed"] is True
    assert data["z_test"]["passed"] is True
    assert data["not_finite"] == {"a": 0, "b": 0, "first": None}


def test_an_exr_file_of_one_channel_is_grey(tmp_path):
    import OpenEXR

    grey = np.linspace(0, 1, 20, dtype=np.float32).reshape(4, 5)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": grey}).write(str(tmp_path / "a.exr"))
    found = compare(tmp_path / "a.exr", np.repeat(grey[..., None], 3, axis=2), metrics=["mae"])
    assert found.metrics["mae"] == 0.0
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"depth": grey}).write(str(tmp_path / "b.exr"))
    with pytest.raises(InputError, match="neither channels R, G and B nor Y"):
        compare(tmp_path / "b.exr", tmp_path / "a.exr")
