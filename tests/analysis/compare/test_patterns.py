"""Projections on brightness, shift and blur must know the noise of any sampler, and say what they would have found."""

import itertools
import json
import math
import re

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.ndimage import shift as shifted

from raytracer.analysis.compare import compare, patterns, z_test
from raytracer.analysis.compare.image_pair import make_image_pair
from raytracer.analysis.compare.patterns import PATTERNS, POWER, find_structure, symmetric_tail
from raytracer.film.image import Image

HEIGHT, WIDTH = 45, 64


def smooth_scene(height=HEIGHT, width=WIDTH):
    rng = np.random.default_rng(0)
    grey = gaussian_filter(rng.standard_normal((height, width)), 2.5, mode="mirror")
    return (1.0 + 0.3 * grey / grey.std())[..., None] * [1.0, 0.7, 0.4]


SCENE = smooth_scene()


def render(rng, scene, sigma=0.3, told=1.0):
    """A render of 64 samples; its variance is `told` times that of its noise, as those of stratified samples are."""
    variance = (sigma * scene) ** 2 / 64
    spread = rng.chisquare(63, (*scene.shape[:2], 1)) / 63
    return scene + np.sqrt(variance) * rng.standard_normal((*scene.shape[:2], 1)), told * variance * spread


def test_the_tail_of_sums_with_random_signs_is_bounded():
    rng = np.random.default_rng(1)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=12)))
    for terms in (np.ones(12), np.array([1.0, 1.0, *np.zeros(10)]), *rng.pareto(1.5, (20, 12))):
        z = np.abs(signs @ terms) / np.linalg.norm(terms)
        for least in (0.5, 1.0, math.sqrt(2.0), 2.0, 3.0):
            assert np.mean(z >= least * (1.0 - 1e-12)) <= symmetric_tail(least) * (1.0 + 1e-12)
    # Two equal terms reach sqrt 2 half of the time: no smaller factor would do.
    assert symmetric_tail(math.sqrt(2.0)) == pytest.approx(0.5)


@pytest.mark.parametrize("told", [1.0, 3.0], ids=["independent", "stratified"])
def test_scores_of_like_images_have_the_variance_1_whatever_their_variances_tell(told):
    rng = np.random.default_rng(2)
    verdicts = [z_test(*render(rng, SCENE, told=told), *render(rng, SCENE, told=told), alike=True) for _ in range(60)]
    assert sum(not verdict.passed for verdict in verdicts) == 0
    # 60 values of about five independent patterns: the mean square is 1 with an error of 0.08.
    assert np.mean([verdict.pattern_z**2 for verdict in verdicts]) == pytest.approx(1.0, abs=0.35)
    assert np.mean([verdict.pattern_tile_z**2 for verdict in verdicts]) == pytest.approx(1.0, abs=0.1)
    assert np.mean([verdict.neighbour_z**2 for verdict in verdicts]) == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("sigma", [(2.0, 0.5), (0.5, 2.0)])
def test_of_unlike_images_the_noisier_one_is_not_the_sharper(sigma):
    # Their variances tell three times and once their noise, as those of sobol and independent samples may.
    rng = np.random.default_rng(3)
    for _ in range(10):
        verdict = z_test(*render(rng, SCENE, sigma[0]), *render(rng, SCENE, sigma[1], told=3.0))
        assert verdict.passed, verdict.reason
        assert np.abs(verdict.pattern_z).max() < 4.0


CHANGES = {
    "brightness_green": (lambda scene: 1.02 * scene, 0.02),
    "shift_x": (lambda scene: shifted(scene, (0, 0.25, 0), mode="mirror"), 0.25),
    "shift_y": (lambda scene: shifted(scene, (-0.25, 0, 0), mode="mirror"), -0.25),
    "blur_1px": (lambda scene: gaussian_filter(scene, (0.7, 0.7, 0), mode="mirror"), 0.49),
}


@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("name", CHANGES)
def test_the_amount_of_a_change_is_estimated(name, alike):
    change, amount = CHANGES[name]
    rng = np.random.default_rng(4)
    a, b = render(rng, change(SCENE), 0.02), render(rng, SCENE, 0.02)
    found = find_structure(make_image_pair(*a, *b), 1.0, alike=alike, tile=16)
    # Slopes and curvature by differences of pixels are too small where details are narrow: sigma is 2.5 px.
    assert found.whole.amounts()[PATTERNS.index(name)] == pytest.approx(amount, rel=0.2)
    assert not z_test(*a, *b, alike=alike).passed


def test_what_hides_in_the_variances_of_stratified_samples_is_found():
    rng = np.random.default_rng(5)
    change, _ = CHANGES["shift_x"]
    a, b = render(rng, change(SCENE), 1.0, told=6.0), render(rng, SCENE, 1.0, told=6.0)
    verdict = z_test(*a, *b, alike=True)
    before = min(verdict.mean_p, verdict.tile_p, verdict.pixel_p, verdict.exceeding_p)
    assert before > 0.1
    assert verdict.pattern_p < 1e-4
    amount = re.fullmatch(r"the whole is shifted to the right by ([.\d]+) px, z = [.\d]+", verdict.reason)
    assert float(amount[1]) == pytest.approx(0.25, abs=0.1)


def test_more_noise_than_is_told_and_order_among_neighbours_are_found():
    rng = np.random.default_rng(6)
    noisier = z_test(*render(rng, SCENE, told=0.8), *render(rng, SCENE, told=0.8), alike=True)
    assert noisier.squares_ratio == pytest.approx(1.25, rel=0.1)
    assert noisier.squares_p < 1e-4
    # Waves of a standard deviation, 16 px long, which neither lie along slopes nor change the mean.
    a, variance = render(rng, SCENE)
    waves = np.sin(np.pi * np.arange(WIDTH) / 8.0)[:, None] * 0.3 * SCENE / 8.0
    verdict = z_test(a + waves, variance, *render(rng, SCENE), alike=True)
    assert verdict.neighbour_p < 1e-4
    assert verdict.neighbour_z[0].min() > 5.0


@pytest.mark.parametrize("what", ["brightness", "shift"])
def test_what_would_have_been_found_is_found_nine_times_of_ten(what):
    rng = np.random.default_rng(7)
    limits = z_test(*render(rng, SCENE, 1.0), *render(rng, SCENE, 1.0), alike=True).limits
    changes = {
        "brightness": lambda part: (1.0 + part * limits.brightness) * SCENE,
        "shift": lambda part: shifted(SCENE, (0, part * limits.shift, 0), mode="mirror"),
    }
    found = {}
    for part in (0.3, 1.0):
        changed = changes[what](part)
        pairs = [(render(rng, changed, 1.0), render(rng, SCENE, 1.0)) for _ in range(40)]
        found[part] = sum(z_test(*a, *b, alike=True).pattern_p < 1e-3 / 8 for a, b in pairs)
    # Binomial: 36 of 40 with a standard deviation of 1.9; slopes by differences tell a shift too large by a tenth.
    assert POWER == 0.9
    assert found[1.0] >= 29
    assert found[0.3] <= 8


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 3), (17, 1)])
@pytest.mark.parametrize("alike", [True, False])
def test_the_smallest_pictures_are_judged(shape, alike):
    rng = np.random.default_rng(9)
    scene = np.ones((*shape, 3))
    verdict = z_test(*render(rng, scene), *render(rng, scene), alike=alike)
    assert verdict.passed, verdict.reason
    assert np.isfinite(verdict.pattern_tile_z).all()


def compared(**settings):
    """Compare two honest renders of a quarter of the noise that their variances tell."""
    rng = np.random.default_rng(11)
    images = [Image(*render(rng, SCENE, told=4.0), 64, {"sampler": "sobol", **settings}) for _ in "ab"]
    return compare(*images, metrics=["mae"])


def test_a_pass_says_what_would_have_been_found():
    found = compared(spp=64)
    assert found.passed is True
    assert found.notes[0].startswith("would have found, 9 times of 10: brightness over 0.")
    assert "in a tile of 16 px (half of the tiles), a shift over 0." in found.notes[0]
    assert found.notes[0] in found.text()
    told = json.loads(json.dumps(found.json(), allow_nan=False))["z_test"]
    assert told["would_have_found"]["shift"] == pytest.approx(found.verdict.limits.shift)
    assert told["p"].keys() == {"mean", "tile", "pixel", "exceeding", "pattern", "pattern_tile", "neighbour", "squares"}
    # Where the noise is taken from the variances, it takes twice as much.
    assert compared().verdict.limits.brightness > 1.5 * found.verdict.limits.brightness


def test_bands_of_rows_are_one_picture(monkeypatch):
    rng = np.random.default_rng(8)
    scene = smooth_scene(150, 20)
    pair = make_image_pair(*render(rng, scene), *render(rng, scene))
    several = find_structure(pair, 1.0, alike=True, tile=16)
    monkeypatch.setattr(patterns, "ROWS", 1024)
    one = find_structure(pair, 1.0, alike=True, tile=16)
    for first, second in ((several.whole, one.whole), (several.tiles, one.tiles)):
        for values, expected in zip(first, second, strict=True):
            np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(several.neighbour_z, one.neighbour_z, rtol=1e-9)
    assert several.squares_z == pytest.approx(one.squares_z)


def test_a_sky_without_noise_hides_nothing_below_it():
    rng = np.random.default_rng(10)
    b, variance = render(rng, SCENE)
    a, _ = render(rng, CHANGES["shift_x"][0](SCENE))
    for values in (a, b, variance):
        values[:30] = 1.0 if values is not variance else 0.0
    verdict = z_test(a, variance, b, variance, alike=True)
    assert "shifted to the right" in " ".join(verdict.findings)


def test_the_hint_at_other_samples_is_given_where_it_is_true():
    assert "0.2" in compared(spp=64).notes[1]
    assert "found with `render.sampler: independent`" in compared(spp=64).notes[1]
    assert "with the same sampler and `--spp` in both" in compared().notes[1]
    assert len(compared(spp=64, sampler="independent").notes) == 1
