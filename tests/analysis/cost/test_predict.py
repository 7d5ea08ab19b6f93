"""Predictions from replicates of a picture whose noise and times are known."""

import math

import numpy as np
import pytest

from raytracer.analysis.cost import predict as predicting
from raytracer.analysis.cost.measure_scene import RayCount, Replicates
from raytracer.analysis.cost.predict import PictureCost, predict
from raytracer.analysis.cost.study_options import StudySettings
from raytracer.analysis.cost.tile_sample import choose_tiles
from raytracer.core.error_estimate.metric import error_weights, mse_by_tile
from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import TILE_SIZE

# Tiles of which only 8 x 8 pixels lie within the film, since noise takes time to draw.
EDGE = 8
WINDOWS = [
    Window(x, y, x + EDGE, y + EDGE)
    for y in range(0, 8 * TILE_SIZE, TILE_SIZE)
    for x in range(0, 16 * TILE_SIZE, TILE_SIZE)
]
PIXELS = len(WINDOWS) * EDGE**2

# Noise and time by tile, as different as those of a lamp and a sky.
LEVEL = np.random.default_rng(11).lognormal(0.0, 1.0, len(WINDOWS))
LEVEL /= LEVEL.mean()


def replicates(sample, rng, *, drift=0.0):
    """Of a picture of even brightness 1 with MSE = 0.2 / N (1 + 0.01), and 1e-6 s of a thread for a sample of LEVEL."""
    place = {window: number for number, window in enumerate(WINDOWS)}
    level = LEVEL[[place[window] for window in sample.windows]]
    deviation = np.sqrt(level[sample.owner])[:, None]
    means = {
        n: 1.0 + math.sqrt(0.2 * 1.01 / n) * deviation * rng.standard_normal((4, len(sample.owner), 3))
        for n in (16, 64, 256)
    }
    rays = EDGE**2 * np.tile(level, (4, 1))
    return Replicates(sample, means, 1e-6 * rays * np.exp(drift * rng.standard_normal((4, 1))), rays, 0, 1.0)


KNOWN, UNKNOWN = RayCount(PIXELS, 0.0), RayCount(math.nan, math.nan)


def predicted(sample, seed, *, drift=0.0, rays=KNOWN, budget=None):
    measured = replicates(sample, np.random.default_rng(seed), drift=drift)
    picture = PictureCost(PIXELS, rays, 2, 0.5)
    return predict(measured, picture, StudySettings(threads=2, seed=seed, budget=budget), 1.0)


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    monkeypatch.setattr(predicting, "_RESAMPLES", 200)


@pytest.mark.parametrize("count", [30, len(WINDOWS)])
def test_intervals_hold_the_truth_as_often_as_they_say(count):
    held_error, held_seconds, widths = 0, 0, []
    for seed in range(40):
        rng = np.random.default_rng(seed + 1000)
        # The pilot knows the noise of each tile but roughly.
        rough = 0.5 / len(WINDOWS) + 0.5 * LEVEL * rng.lognormal(0.0, 0.3, len(WINDOWS)) / len(WINDOWS)
        prediction = predicted(choose_tiles(WINDOWS, count, rng, rough), seed, drift=0.02)
        error = prediction.points[-1].error
        held_error += error.low <= math.sqrt(0.2 / 256) <= error.high
        # 0.2 / N = 1e-4.
        truth = 0.5 + 2000 * PIXELS * 1e-6 / 2
        held_seconds += prediction.target_seconds.low <= truth <= prediction.target_seconds.high
        widths.append((error.high - error.low) / error.value)
    # 38 of 40 are expected; 33 or fewer have a chance of 1 %.
    assert held_error >= 34
    assert held_seconds >= 34
    # Where all tiles are known, what they differ in is no reason for doubt.
    assert np.median(widths) < (0.03 if count == len(WINDOWS) else 0.35)


def test_seconds_come_from_rays_where_these_are_known():
    sample = choose_tiles(WINDOWS, 40, np.random.default_rng(3))
    truth = PIXELS * 1e-6 / 2
    by_rays, by_pixels = (predicted(sample, 3, rays=rays).per_sample for rays in (KNOWN, UNKNOWN))
    # Time is in proportion to rays here, so nothing is uncertain.
    assert by_rays.value == pytest.approx(truth)
    assert by_rays.high - by_rays.low < 1e-6 * truth
    assert by_pixels.low < truth < by_pixels.high
    assert by_pixels.high - by_pixels.low > 0.1 * truth


def test_seconds_are_as_uncertain_as_the_rays_of_the_picture():
    sample = choose_tiles(WINDOWS, 40, np.random.default_rng(3))
    sure, doubtful = (predicted(sample, 3, rays=RayCount(PIXELS, error * PIXELS)) for error in (0.0, 0.01))
    assert doubtful.per_sample.high == pytest.approx(doubtful.per_sample.value * math.exp(0.0195996))
    assert doubtful.per_sample.low == pytest.approx(doubtful.per_sample.value * math.exp(-0.0195996))
    # What every render takes is certain, and samples to the target are uncertain besides.
    above = [
        math.log((found.target_seconds.high - 0.5) / (found.target_seconds.value - 0.5)) for found in (sure, doubtful)
    ]
    assert above[1] == pytest.approx(math.hypot(above[0], 0.0195996))


def test_replicates_that_differ_in_time_make_times_uncertain():
    sample = choose_tiles(WINDOWS, len(WINDOWS), np.random.default_rng(4))
    steady, shaken = (predicted(sample, 4, drift=drift) for drift in (0.0, 0.2))
    assert steady.per_sample.high / steady.per_sample.low < 1.001
    # Student's t for four replicates, of the mean of the logarithms of their times.
    logs = np.log(replicates(sample, np.random.default_rng(4), drift=0.2).busy.sum(axis=1))
    half = 3.182 * logs.std(ddof=1) / 2.0
    assert math.log(shaken.per_sample.high / shaken.per_sample.low) == pytest.approx(2.0 * half, rel=1e-3)
    # Errors are none the less certain for that.
    assert shaken.points == tuple(
        point._replace(seconds=shaken.points[i].seconds) for i, point in enumerate(steady.points)
    )


def test_plain_guess_goes_by_the_last_point():
    prediction = predicted(choose_tiles(WINDOWS, len(WINDOWS), np.random.default_rng(5)), 5, budget=10.5)
    assert prediction.plain_spp == pytest.approx(256 * (prediction.points[-1].error.value / 0.01) ** 2)
    assert prediction.plain_seconds == pytest.approx(0.5 + prediction.plain_spp * prediction.per_sample.value)
    assert prediction.halving == pytest.approx(1.0)
    # A budget buys samples after what every render takes.
    assert prediction.budget_spp == pytest.approx(10.0 / prediction.per_sample.value)


def test_what_is_bright_or_dark_by_chance_does_not_mislead():
    # A light that one sample in 100 finds: the MSE of N samples is (1 - p) / (p N), 62 % at 256.
    sample = choose_tiles(WINDOWS, 40, np.random.default_rng(6))
    rng, p, pixels = np.random.default_rng(7), 0.01, len(sample.owner)
    found, means, before = np.zeros((4, pixels, 3)), {}, 0
    for n in (16, 32, 64, 128, 256):
        found += rng.binomial(n - before, p, size=found.shape)
        means[n], before = found / (p * n), n
    measured = Replicates(sample, means, np.ones((4, 40)), np.ones((4, 40)), 0, 1.0)
    prediction = predict(measured, PictureCost(PIXELS, UNKNOWN, 2, 0.0), StudySettings(threads=2, seed=0), 1.0)
    for point in prediction.points:
        truth = math.sqrt((1.0 - p) / p / point.spp / 1.01)
        assert point.error.value == pytest.approx(truth, rel=0.03)
    # With the mean of all as it is, what is dark by chance would count for too much.
    own = error_weights(means[256].mean(axis=0), 1.0)
    assert mse_by_tile(means[256], own, sample.owner).mean * 1.01 > 1.08 * (1.0 - p) / p / 256
