"""Checks find what has changed, pass what has not, and say what they could have found."""

import dataclasses
import math
import re

import numpy as np
import pytest

from raytracer.analysis.regression import render_reference
from raytracer.analysis.regression.check import (
    CheckOptions,
    check_reference,
    detectable_change,
    find_references,
    samples_to_detect,
)
from raytracer.analysis.regression.reference_file import Recipe, Reference, load_reference, save_reference
from raytracer.scene.load import load
from raytracer.util.errors import InputError
from tests.analysis.regression.made_up import HEIGHT, SCENE, WIDTH, MadeUp, keep, reference


@pytest.fixture
def renders(monkeypatch):
    return MadeUp().install(monkeypatch)


@pytest.fixture
def path(renders, tmp_path):
    return reference(tmp_path)


@pytest.fixture
def scene(tmp_path):
    scene = tmp_path / "ball.yaml"
    scene.write_text(SCENE, encoding="utf-8")
    return scene


def flat(value, variance, spp=4096):
    shape = (8, 12, 3)
    recipe = Recipe("a.yaml", {}, spp, 1, "0", {})
    return Reference(np.full(shape, value), np.full(shape, variance), recipe)


# ---- What is found


def wrong_tile(picture):
    picture = picture.copy()
    picture[8:16, 24:32] *= 0.97
    return picture


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda picture: 1.01 * picture, "the mean of"),
        (lambda picture: 0.99 * picture, "the mean of"),
        (lambda picture: np.roll(picture, 1, axis=1), "in the tile|in the pixel"),
        (lambda picture: picture[..., ::-1], "the mean of (red|blue)"),
        (wrong_tile, "the mean of|in the tile at x = 24, y = 8"),
    ],
    ids=["brighter", "darker", "shifted by a pixel", "two channels swapped", "one wrong tile"],
)
def test_a_planted_fault_fails_and_is_named(change, reason, renders, path):
    renders.change = change
    for seed in range(5):
        result = check_reference(path, CheckOptions(seed=seed))
        assert not result.passed
        assert not result.error
        assert re.search(reason, result.reason), result.reason
    farthest = np.abs(result.verdict.tile_z).max(axis=2)
    assert change is not wrong_tile or np.unravel_index(np.argmax(farthest), farthest.shape) == (1, 3)


def test_of_two_hundred_other_seeds_hardly_one_fails(renders, scene, tmp_path):
    found = render_reference.prepare_reference_scene(scene, tmp_path, {}, 24)
    path = keep(tmp_path / "ball.npz", found)
    assert sum(not check_reference(path, CheckOptions(spp=256, seed=i), scene=found).passed for i in range(200)) <= 2


# ---- What can be found


def test_what_a_check_finds_is_what_its_normal_law_says():
    # 96 pixels of variance 4e-4 / 4096 each in the reference, and 16 times that in the check: the deviation of the
    # difference of the means is sqrt(17 * 4e-4 / 4096 / 96).  As many of it as the test of the means needs, which noise
    # exceeds in one of three channels with a probability of 1e-3 / 8, and another 2.3263 that leave 1 % undetected.
    kept = flat(0.5, 4e-4 / 4096)
    deviation = math.sqrt(17 * 4e-4 / 4096 / 96)
    needed = detectable_change(kept, 256, 1e-3) * 0.5 / deviation - 2.3263
    assert 1.0 - (1.0 - math.erfc(needed / math.sqrt(2.0))) ** 3 == pytest.approx(1e-3 / 8, rel=1e-3)


def test_a_shift_that_means_do_not_show_is_found_and_what_would_be_is_said(renders, path):
    passed = check_reference(path)
    assert "more or less light, and " in passed.sentence()
    assert re.search(r"in a tile of 16 px \(half of the tiles\), a shift over 0\.0\d+ px", passed.sentence())
    assert passed.json()["would_have_found"]["shift"] < 0.1
    renders.change = lambda picture: 0.9 * picture + 0.1 * np.roll(picture, 1, axis=1)
    moved = check_reference(path)
    assert not moved.passed
    assert any("the whole is shifted to the right by 0." in finding for finding in moved.json()["findings"])


def test_samples_are_as_many_as_the_change_takes():
    kept = flat(0.5, 0.25 / 4096)
    spp = samples_to_detect(kept, 0.03)
    assert 256 < spp < 4096
    assert detectable_change(kept, spp) <= 0.03 < detectable_change(kept, spp - 1)
    # Without noise a few do; where the reference's own noise hides the change, as many as it has are the most.
    assert (samples_to_detect(flat(0.5, 0.0)), detectable_change(flat(0.5, 0.0), 256)) == (256, 0.0)
    assert samples_to_detect(flat(0.5, 1.0)) == 4096
    assert detectable_change(flat(0.5, 1.0), 4096) > 0.01
    assert (samples_to_detect(flat(0.0, 0.0)), detectable_change(flat(0.0, 0.0), 256)) == (4096, math.inf)


def test_what_a_check_is_to_find_it_finds_nearly_always(monkeypatch, tmp_path):
    # So noisy that 256 samples do not do.
    renders = MadeUp(sigma=0.9).install(monkeypatch)
    path = reference(tmp_path, width=24)
    kept = load_reference(path)
    spp = samples_to_detect(kept)
    assert 400 < spp < 4096
    # Of 100 with 1 % each, but for the reference's own noise, which is the same in all.
    for part, seeds, fewest, most in ((1.0, 100, 0, 10), (0.2, 25, 13, 25)):
        renders.change = lambda picture, part=part: (1.0 + part * detectable_change(kept, spp)) * picture
        missed = sum(check_reference(path, CheckOptions(seed=seed)).passed for seed in range(seeds))
        assert fewest <= missed <= most


# ---- How it is rendered


def test_it_is_rendered_as_the_reference_was_with_other_random_numbers(renders, tmp_path):
    path = reference(tmp_path, width=24)
    result = check_reference(path)
    assert [(call["spp"], call["seed"]) for call in renders.calls] == [(4096, 12345), (256, 12346)]
    for call in renders.calls:
        assert (call["spec"].film.width, call["spec"].film.height) == (24, 16)
        assert call["spec"].render.sampler == "independent"
    assert (result.passed, result.changes, result.spp, result.seed) == (True, (), 256, 12346)
    # The seed behind the last is the first.
    kept = load_reference(path)
    save_reference(path, kept.mean, kept.variance, kept.recipe._replace(seed=2**32 - 1))
    assert check_reference(path).seed == 0


def test_what_is_asked_for_without_sense_is_refused(path, tmp_path):
    for options, words in (
        (CheckOptions(seed=12345), "was rendered with the seed 12345 itself"),
        (CheckOptions(spp=15), "at least 16 samples per pixel"),
    ):
        with pytest.raises(InputError, match=words):
            check_reference(path, options)
    with pytest.raises(InputError, match="at least 16 samples per pixel"):
        reference(tmp_path, spp=15)


def test_an_interrupt_ends_it(renders, path, tmp_path):
    renders.interrupted = True
    with pytest.raises(KeyboardInterrupt):
        check_reference(path)
    with pytest.raises(KeyboardInterrupt):
        reference(tmp_path, "other")
    assert [item.name for item in path.parent.iterdir()] == ["ball.npz"]


def test_samples_that_are_not_finite_fail_unless_the_reference_had_some(renders, path, tmp_path):
    renders.nan_samples = 2
    result = check_reference(path)
    assert not result.passed
    assert result.reason == "2 samples are not finite, as none of the reference is"
    assert check_reference(reference(tmp_path, "other")).passed


METERED = {"metering": "average", "exposure_gain": 2.0}
BALANCED = {"white_balance_gains": "0.5,1.0,2.0"}


@pytest.mark.parametrize(
    ("key", "image", "gains", "higher"),
    [
        ("camera.exposure", METERED, (2.0, 2.0, 2.0), METERED | {"exposure_gain": 2.1}),
        ("film.white_balance", BALANCED, (0.5, 1.0, 2.0), {"white_balance_gains": "0.525,1.05,2.1"}),
    ],
)
def test_gains_that_are_measured_do_not_fail_by_their_own_noise(key, image, gains, higher, renders, scene, tmp_path):
    path = tmp_path / "ball.npz"
    renders.settings = image
    keep(path, render_reference.prepare_reference_scene(scene, tmp_path, {key: "auto"}, None))
    assert load_reference(path).recipe.gains == gains
    # All is brighter by 5 %, since the gain is.
    renders.change, renders.settings = lambda picture: 1.05 * picture, higher
    first = check_reference(path)
    assert first.passed
    # Brought to the gains of the reference, it is as noisy: variance goes with the square of light.
    renders.change, renders.settings = lambda picture: picture, image
    second = check_reference(path)
    np.testing.assert_allclose(first.image.variance, second.image.variance)
    # It is not the gain.
    renders.change = lambda picture: 1.05 * picture
    assert not check_reference(path).passed


# ---- What is wrong


def test_what_has_changed_is_named(renders, path, scene):
    # Only how it is written.
    scene.write_text("# A ball.\n" + SCENE.replace("radius: 1,", "radius:   1.0,"), encoding="utf-8")
    assert check_reference(path).changes == ()
    scene.write_text(SCENE.replace("albedo: 0.5", "albedo: 0.4"), encoding="utf-8")
    renders.change = lambda picture: 0.9 * picture
    result = check_reference(path)
    assert result.changes == ("the scene",)
    assert result.sentence().endswith("; the scene has changed since the reference was rendered")


def test_a_file_of_the_scene_that_has_changed_is_named(renders, scene):
    mesh, path = scene.with_name("mesh.obj"), scene.with_name("ball.npz")
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene.write_text(SCENE + "  - {type: mesh, file: mesh.obj, material: {type: lambertian}}\n", encoding="utf-8")
    keep(path, render_reference.prepare_reference_scene(scene, scene.parent))
    assert check_reference(path).changes == ()
    mesh.write_text(mesh.read_text().replace("1 0 0", "2 0 0"))
    assert check_reference(path).changes == ("mesh.obj",)


def test_what_cannot_be_checked_says_why(path, scene):
    def why():
        result = check_reference(path)
        assert result.error
        return result.reason

    scene.write_text(SCENE.replace(f"width: {WIDTH}", "width: 40"), encoding="utf-8")
    assert f"has 40 x {HEIGHT} pixels, and the reference {WIDTH} x {HEIGHT}" in why()
    scene.write_text(SCENE.replace("pinhole", "pinhloe"), encoding="utf-8")
    assert "did you mean 'pinhole'" in why()
    scene.unlink()
    assert why() == f"{scene}: no such file"
    assert check_reference(path).sentence() == f"ball: cannot be checked: {scene}: no such file"
    path.write_bytes(b"text")
    assert "broken, or not a reference image" in why()
    path.unlink()
    assert "no such file" in why()


def test_a_scene_that_is_built_in_code_is_checked_by_code_alone(renders, scene):
    folder, path = scene.parent, scene.with_name("ball.npz")
    found = render_reference.prepare_reference_scene(load(scene), folder, {"camera.vfov": 30}, 24)
    assert (found.spec.film.width, found.spec.camera.vfov) == (24, 30)
    keep(path, found)
    assert check_reference(path, scene=found).passed
    result = check_reference(path)
    assert result.outcome == "skipped"
    assert result.sentence() == "ball: left out: its scene is built by a test, which checks it"
    with pytest.raises(InputError, match="built by a test"):
        render_reference.load_recipe_scene(load_reference(path).recipe, folder)


def test_the_noise_behind_a_mosaic_is_not_known(renders, path, monkeypatch):
    def without_variance(*args, **settings):
        rendered = renders(*args, **settings)
        rendered.image = dataclasses.replace(rendered.image, variance=None)
        return rendered

    monkeypatch.setattr("raytracer.analysis.regression.check.render", without_variance)
    result = check_reference(path)
    assert result.error
    assert "Bayer mosaic is not known" in result.reason


# ---- References to be rendered


def test_a_picture_is_made_small_and_never_larger(scene):
    folder = scene.parent
    prepare = render_reference.prepare_reference_scene
    assert prepare(scene, folder).overrides == {"render.sampler": "independent"}
    small = prepare(scene, folder / "a" / "b", {"camera.vfov": 30}, 10)
    size = {"film.width": 10, "film.height": 7}
    assert small.overrides == {"render.sampler": "independent", "camera.vfov": 30, **size}
    assert small.scene == "../../ball.yaml"
    (folder / "linked").symlink_to(folder, target_is_directory=True)
    assert prepare(folder / "linked" / "ball.yaml", folder).scene == "linked/ball.yaml"
    scene.write_text(SCENE.replace(f"width: {WIDTH}", "width: 200"), encoding="utf-8")
    with pytest.raises(InputError, match="200 pixels wide is too large to be kept with the sources: at most 128"):
        prepare(scene, folder, width=None)


def test_references_are_found_by_name(renders, tmp_path):
    for name in ("cube", "ball"):
        reference(tmp_path, name)
    folder = tmp_path / "references"
    assert [path.name for path in find_references(folder)] == ["ball.npz", "cube.npz"]
    assert [path.name for path in find_references(folder, ["cube"])] == ["cube.npz"]
    with pytest.raises(InputError, match="is no folder"):
        find_references(folder / "ball.npz")
