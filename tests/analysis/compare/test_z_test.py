"""The image test must pass honest pairs of renders, whatever their noise, and fail planted faults."""

import math
import re

import numpy as np
import pytest

from raytracer.analysis import compare
from raytracer.util.errors import InputError

HEIGHT, WIDTH = 45, 64


@pytest.fixture(scope="module")
def scene():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    grey = (0.5 + 0.3 * np.sin(x / 5) * np.cos(y / 7)) * (1 + 0.3 * np.sign(np.sin(2.1 * x) * np.sin(1.7 * y)))
    return grey[..., None] * [1.0, 0.7, 0.4]


# Samples of mean 1, as (rng, shape) -> array: normal noise and the kinds that path tracers make.
NOISES = {
    "normal": lambda rng, shape: 1 + 0.5 * rng.standard_normal(shape),
    "log-normal": lambda rng, shape: rng.lognormal(-0.5, 1.0, shape),
    "fireflies": lambda rng, shape: 0.5 + 50 * (rng.random(shape) < 0.01),
    "infinite third moment": lambda rng, shape: 1.2 * rng.pareto(2.2, shape),
    "shadow": lambda rng, shape: (rng.random(shape) < 0.4) / 0.4,
}


def render(rng, scene, noise, spp):
    samples = NOISES[noise](rng, (spp, *scene.shape[:2], 1))
    mean, variance = samples.mean(axis=0), samples.var(axis=0, ddof=1) / spp
    return scene * mean, scene**2 * variance


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("spp", [(16, 16), (64, 64), (16, 256)])
def test_honest_pairs_pass(noise, spp, scene):
    rng = np.random.default_rng(1)
    verdicts = [
        compare.z_test(*render(rng, scene, noise, spp[0]), *render(rng, scene, noise, spp[1])) for _ in range(8)
    ]
    assert [v.reason for v in verdicts if not v.passed] == []


def quick_render(rng, scene, sigma=0.5, spp=64):
    """A render with normal noise of `sigma` a sample, by its sufficient statistics."""
    variance = (sigma * scene) ** 2 / spp
    grey = rng.standard_normal((*scene.shape[:2], 1))
    chi2 = rng.chisquare(spp - 1, (*scene.shape[:2], 1)) / (spp - 1)
    return scene + np.sqrt(variance) * grey, variance * chi2


def test_honest_pairs_have_the_distributions_that_are_claimed(scene):
    rng, scene = np.random.default_rng(2), scene[:16, :24]
    variance = (0.5 * scene) ** 2 / 64
    verdicts = []
    for _ in range(400):
        # Channels of their own noise, as the correction for three tests assumes.
        a, b = (scene + np.sqrt(variance) * rng.standard_normal(scene.shape) for _ in "ab")
        chi2, other = (rng.chisquare(63, (*scene.shape[:2], 1)) / 63 for _ in "ab")
        verdicts.append(compare.z_test(a, chi2 * variance, b, other * variance))
    # One in a thousand is allowed to fail: more than 3 of 400 have odds of 1 in 1,300.
    assert sum(not verdict.passed for verdict in verdicts) <= 3
    # Means of 400: their error is 0.05, and that of the standard deviation 0.035; four of them each.
    z = np.array([verdict.mean_z for verdict in verdicts])
    assert np.abs(z.mean(axis=0)).max() < 0.2
    assert np.abs(z.std(axis=0) - 1).max() < 0.14
    # Binomial: 40 expected, standard deviation 6.
    assert 16 < sum(verdict.mean_p < 0.1 for verdict in verdicts) < 64


def test_the_level_is_shared_by_all_tests(scene):
    # Of a z that a single test at the level would not let pass, and one that none of eight does.
    rng = np.random.default_rng(6)
    variance = np.full_like(scene, 1e-3)
    a, b = (scene + math.sqrt(1e-3) * rng.standard_normal(scene.shape) for _ in "ab")
    a -= (a - b).mean(axis=(0, 1))
    for z, passes in ((3.75, True), (4.5, False)):
        verdict = compare.z_test(a + z * math.sqrt(2e-3 / (HEIGHT * WIDTH)), variance, b, variance)
        assert verdict.mean_p < 1e-3
        assert verdict.passed is passes, verdict.reason


def changed(image, where=np.s_[16:24, 40:48], factor=1.15):
    image = image.copy()
    image[where] *= factor
    return image


WRONG_PIXEL = r"in the tile at x = 24, y = 16|in the pixel at x = 30, y = 20"
FAULTS = {
    "1 % brighter": (lambda image: image * 1.01, 0.2, "the mean of"),
    "shifted by a pixel": (lambda image: np.roll(image, 1, axis=1), 0.5, "in the tile|in the pixel"),
    "channels swapped": (lambda image: image[..., ::-1], 0.5, r"the mean of (red|blue) differs: .* \([-+][\d.]+%\)"),
    "one wrong tile": (changed, 0.5, r"in the tile at x = 40, y = 16"),
    "one wrong pixel": (lambda image: changed(image, (20, 30), 2), 0.3, WRONG_PIXEL),
    "upside down": (lambda image: image[::-1], 0.5, "in the tile|in the pixel"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_fail_and_are_named(fault, scene):
    change, sigma, reason = FAULTS[fault]
    rng = np.random.default_rng(5)
    for _ in range(10):
        verdict = compare.z_test(*quick_render(rng, change(scene), sigma), *quick_render(rng, scene, sigma))
        assert not verdict.passed
        assert re.search(reason, verdict.reason), verdict.reason


def with_a_firefly(image, variance, where=(2, 3), value=100.0):
    """The render with one sample so bright that it is all that its pixel's mean and variance tell."""
    image, variance = image.copy(), variance.copy()
    image[where] += value
    variance[where] += value**2
    return image, variance


@pytest.mark.parametrize("who", ["reference", "render"])
def test_one_rare_bright_sample_hides_nothing_elsewhere(who, scene):
    rng = np.random.default_rng(11)
    for change, passes in ((lambda image: image, True), (changed, False)):
        a, b = quick_render(rng, change(scene), 0.3), quick_render(rng, scene, 0.3)
        pair = (a, with_a_firefly(*b)) if who == "reference" else (with_a_firefly(*a), b)
        verdict = compare.z_test(*pair[0], *pair[1])
        assert verdict.passed is passes, verdict.reason
        assert passes or "in the tile at x = 40, y = 16" in verdict.reason


def test_samples_that_are_known_tell_the_noise_where_most_tiles_do_not(scene):
    # Rare samples decide two of three tiles: of their median ratio, 1e-7, every difference is noise.
    rng = np.random.default_rng(12)
    small = scene[:8, :24]
    a, var_a = quick_render(rng, small, 0.1)
    b, var_b = with_a_firefly(*with_a_firefly(*quick_render(rng, small, 0.1)), where=(2, 11))
    a[6, 20] *= 2.0
    assert np.abs(compare.z_test(a, var_a, b, var_b).pixel_z[:, 16:]).max() < 0.1
    known = np.abs(compare.z_test(a, var_a, b, var_b, ratio=1.0).pixel_z)
    assert known[6, 20].max() > 10.0
    known[6, 20] = 0.0
    assert known.max() < 5.0


def test_pixels_that_are_too_far_off_are_not_hidden_by_equal_means(scene):
    # Neighbours are moved by three standard deviations in turns up and down, which keeps the means.
    rng = np.random.default_rng(7)
    a, var_a = quick_render(rng, scene)
    b, var_b = quick_render(rng, scene)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    checkers = np.where((x + y) % 2 == 0, 1.0, -1.0)[..., None]
    verdict = compare.z_test(a + 3 * checkers * np.sqrt(var_a), var_a, b, var_b)
    assert not verdict.passed
    assert verdict.exceeding.min() > 0.2
    assert verdict.exceeding_p < 1e-10


def test_a_pixel_without_noise_must_be_equal_to_rounding(scene):
    assert compare.z_test(scene, None, scene * (1 + 5e-7), None).passed
    other = scene.copy()
    other[7, 9, 1] *= 1 + 5e-6
    verdict = compare.z_test(other, None, scene, None)
    assert not verdict.passed
    assert "green differs in the pixel at x = 9, y = 7" in verdict.reason
    assert np.isinf(verdict.pixel_z[7, 9, 1])
    # An exact image against a noisy one.
    rng = np.random.default_rng(8)
    assert compare.z_test(*quick_render(rng, scene), scene, None).passed
    assert not compare.z_test(*quick_render(rng, scene * 1.05), scene, None).passed


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_fails(value, scene):
    a, variance = quick_render(np.random.default_rng(9), scene)
    broken = a.copy()
    broken[3, 4] = value
    for first, second in ((broken, a), (a, broken), (broken, broken)):
        verdict = compare.z_test(first, variance, second, variance)
        assert not verdict.passed
        assert "not finite" in verdict.reason


def test_z_has_the_sign_and_size_that_it_is_defined_by():
    # One tile: all means are those of the pixels, with var_a + var_b = 0.25 each.
    shape = (8, 8, 3)
    a, b = np.full(shape, 1.5), np.full(shape, 1.0)
    a[..., 1] = 1.0
    verdict = compare.z_test(b, np.full(shape, 0.125), a, np.full(shape, 0.125))
    np.testing.assert_allclose(verdict.pixel_z[0, 0], [-1, 0, -1], rtol=1e-5)
    np.testing.assert_allclose(verdict.tile_z[0, 0], [-8, 0, -8], rtol=1e-5)
    np.testing.assert_allclose(verdict.mean_z, [-8, 0, -8], rtol=1e-5)
    # Two-sided, the least of 192 and of 3.
    assert verdict.pixel_p == pytest.approx(1 - (1 - math.erfc(1 / math.sqrt(2))) ** 192, rel=1e-4)
    assert verdict.mean_p == pytest.approx(3 * math.erfc(8 / math.sqrt(2)), rel=1e-3)


def test_every_part_of_a_tall_image_is_compared_alike():
    # More than a band of rows, and tiles of three rows below; where a pixel's variance is less than its tile's mean,
    # which is 0.2 of either image, that counts.
    shape = (131, 16, 3)
    variance = np.where(np.arange(16)[:, None] % 2 == 0, 0.1, 0.3) * np.ones(shape)
    a, b = np.full(shape, 1.5), np.full(shape, 1.0)
    verdict = compare.z_test(a, variance, b, variance)
    np.testing.assert_allclose(verdict.pixel_z, 0.5 / np.sqrt(np.maximum(2 * variance, 0.4)), rtol=1e-5)
    cells = np.array([64.0] * 16 + [24.0])[:, None, None]
    np.testing.assert_allclose(verdict.tile_z, 0.5 / np.sqrt(0.4 / cells) * np.ones((17, 2, 3)), rtol=1e-5)
    np.testing.assert_allclose(verdict.mean_z, 0.5 / np.sqrt(0.4 / (131 * 16)), rtol=1e-5)
    assert verdict.exceeding.tolist() == [0.0, 0.0, 0.0]


def test_what_cannot_be_compared():
    a = np.ones((4, 5, 3))
    for variance, b, words in (
        (a, np.ones((5, 4, 3)), "differ in size: 5 x 4 and 4 x 5 pixels"),
        (np.full_like(a, np.inf), a, "two samples"),
        (np.ones((4, 5, 1)), a, "variance of the shape"),
    ):
        with pytest.raises(InputError, match=words):
            compare.z_test(a, variance, b, b)


def test_a_bias_fails_once_the_noise_of_the_mean_permits(scene):
    # 1 % of the mean is k standard deviations at spp samples; beyond 3.7 + 3 of them it is found 999 times of 1000.
    rng = np.random.default_rng(6)
    for spp in (4, 16, 64, 256, 1024, 4096):
        a, var_a = quick_render(rng, scene * 1.01, spp=spp)
        b, var_b = quick_render(rng, scene, spp=spp)
        k = (0.01 * scene.mean(axis=(0, 1)) / np.sqrt((var_a + var_b).sum(axis=(0, 1)) / (HEIGHT * WIDTH) ** 2)).max()
        verdict = compare.z_test(a, var_a, b, var_b)
        assert not verdict.passed or k < 6.7
        assert verdict.mean_z.max() == pytest.approx(k, abs=4)
