"""Adaptive sampling: the shares of tiles, the stop criteria, and no bias."""

import math

import numpy as np
import pytest

from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.halves import ErrorEstimator
from raytracer.core.error_estimate.metric import error_weights
from raytracer.rendering import adaptive_sampling, session, statistics, tile_scheduler
from raytracer.rendering.adaptive_sampling import allocate_samples, pilot_seed, sample_goals
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import prepare_scene, render, render_prepared
from raytracer.util.errors import InputError
from tests.rendering import halves as room
from tests.rendering.halves import HALVES
from tests.small_scenes import scene


def halves(text=HALVES, **settings):
    return room.halves(text, **{"width": 64, "height": 32, "spp": 64, **settings})


# ---- Shares


def shares(errors, cost):
    return allocate_samples(errors.ravel(), cost.ravel(), 8, np.full(errors.size, 256))[0].reshape(errors.shape)


def test_shares_are_those_of_the_least_error():
    # For sum p v / n at a given sum p c n, Lagrange's multiplier gives n in proportion to sqrt(v / c).
    errors = np.full((6, 8), 1.0)
    errors[:, 4:] = 16.0
    found = shares(errors, np.where(errors == 16.0, 4.0, 1.0))
    # Far from the edge, where smoothing changes nothing: sqrt(16 / 4) = 2.
    np.testing.assert_allclose(found[:, -1] / found[:, 0], 2.0)
    assert np.average(found) == pytest.approx(1.0)


def test_what_a_pilot_missed_still_gets_samples():
    errors = np.zeros((8, 8))
    errors[0, 0] = 1.0
    found = shares(errors, np.ones((8, 8)))
    # Neighbours of noise are suspected of an eighth of the noise around them; others get a sixteenth of the mean.
    assert found[0, 1] / found[0, 0] == pytest.approx(math.sqrt(2.0 / 9.0 / 8.0))
    assert found[1, 1] / found[0, 0] == pytest.approx(math.sqrt(1.0 / 9.0 / 8.0))
    assert 0.04 < found.min() == found[7, 7] < found[1, 1]
    # Without any noise all are alike.
    np.testing.assert_array_equal(shares(np.zeros((8, 8)), np.ones((8, 8))), 1.0)


def test_goals_are_whole_packets_and_never_fall():
    counts = np.array([16, 64, 512, 8])
    found = sample_goals(100.0, np.array([0.1, 1.02, 2.0, 50.0]), counts, 1000)
    assert found.tolist() == [16, 104, 512, 1000]
    assert np.all(found[:3] % PACKET == 0)


def test_pilots_have_seeds_that_no_picture_has():
    seeds = {pilot_seed(seed, number) for seed in (0, 1, 2**32 - 1) for number in range(1, 20)}
    assert len(seeds) == 57
    assert 2**32 <= min(seeds) < max(seeds) < 2**63


# ---- Ends


@pytest.mark.parametrize("noise", [0.1, 0.05, 0.025])
def test_it_stops_at_the_error_that_was_asked_for(noise):
    found = render(halves(), noise=noise, threads=2)
    assert found.complete
    # A round is not shorter than a twentieth of what there is.
    assert 0.85 * noise < found.stats.error["relative"] <= noise
    assert found.stats.error["target"] == found.image.settings["noise"] == noise


def test_samples_are_the_most_that_a_pixel_gets():
    found = render(halves(), noise=0.001, spp=100, threads=2)
    assert not found.complete
    assert not found.interrupted
    assert found.fewest_samples == found.image.samples == 100
    assert found.stats.error["relative"] > 0.001
    # With as many samples as that, the picture is that of a plain render.
    np.testing.assert_array_equal(found.image.radiance, render(halves(), spp=100).image.radiance)


def test_a_picture_without_noise_takes_few_samples():
    text = "camera: {type: pinhole}\nenvironment: {type: constant, radiance: 0.5}\nobjects:"
    found = render(scene(text, lit=True, width=40), noise=0.001)
    assert found.complete
    assert found.image.samples == 32
    assert found.stats.error["relative"] == 0.0


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("noise", (0.0, -0.1, 1.0, math.nan, math.inf), "noise must lie between 0 and 1"),
        ("time_limit", (0.0, -1.0, math.nan, math.inf), "a time limit must be greater than 0"),
    ],
)
def test_what_cannot_be_asked_for(name, values, said):
    for value in values:
        with pytest.raises(InputError, match=said):
            render(halves(), **{name: value})


@pytest.mark.parametrize("moment", ["while samples are taken", "while errors are looked at", "while the end is tried"])
def test_an_interrupt_leaves_a_picture(monkeypatch, moment):
    # In the latter two no thread works.
    estimate = ErrorEstimator.estimate

    def interrupted(*given):
        monkeypatch.setattr(ErrorEstimator, "estimate", estimate)
        raise KeyboardInterrupt

    settings, fewest = {"noise": 0.001, "threads": 2}, {8, 32}
    if moment == "while samples are taken":
        settings["progress"] = lambda progress: interrupted() if progress.done >= 64 * 32 * 32 else None
        fewest = range(8, 10**6)
    elif moment == "while errors are looked at":
        monkeypatch.setattr(ErrorEstimator, "estimate", interrupted)
        fewest = {32}
    else:
        settings |= {"time_limit": 60.0, "dry_run_save": interrupted}
        fewest = {8}
    found = render(halves(), **settings)
    assert found.interrupted
    assert not found.complete
    assert found.fewest_samples in fewest
    assert found.image.radiance.any()


def test_light_of_any_strength_has_its_error():
    # A power of two changes no digit of a picture, and its error is relative.
    plain = render(halves(), noise=0.1, threads=2)
    bright = HALVES.replace("radiance: 0.1", f"radiance: {0.1 * 2.0**90!r}")
    bright = bright.replace("radiance: 80", f"radiance: {80 * 2.0**90!r}")
    found = render(halves(bright), noise=0.1, threads=2)
    np.testing.assert_array_equal(found.image.radiance, plain.image.radiance * 2.0**90)
    assert found.complete
    assert found.stats.error["relative"] == pytest.approx(plain.stats.error["relative"], rel=1e-5)


class Clock:
    """A clock that only goes while samples are taken: `cost` seconds for one of a pixel, by the row that it is in."""

    def __init__(self, patch, cost):
        self.seconds = 100.0
        for module in (adaptive_sampling, session, statistics, tile_scheduler):
            patch.setattr(module, "now", lambda: self.seconds)
        trace = tile_scheduler.render_tile

        def render_tile(*arguments):
            left, top, right, bottom, begin, end = arguments[3:]
            self.seconds += (right - left) * (end - begin) * sum(map(cost, range(top, bottom)))
            return trace(*arguments)

        patch.setattr(tile_scheduler, "render_tile", render_tile)
        patch.setattr(adaptive_sampling, "render_tile", render_tile)


@pytest.mark.parametrize("spp", [None, 1_000_000])
@pytest.mark.parametrize("limit", [0.5, 2.0])
def test_time_is_used_up_and_not_exceeded(monkeypatch, spp, limit):
    clock = Clock(monkeypatch, lambda y: 1e-6 if y < 16 else 4e-6)
    begin = clock.seconds

    def save(image):
        clock.seconds += 0.05

    # It took 0.1 s to load, and takes 0.05 s to save, which is tried out once.
    prepared = prepare_scene(halves(), RenderOptions(time_limit=limit, spp=spp, threads=1), load_seconds=0.1)
    found = render_prepared(prepared, dry_run_save=save)
    save(found.image)
    assert 0.95 * limit < clock.seconds - begin + 0.1 <= limit
    # Samples went where the noise is, or all tiles are alike, in turns.
    assert found.complete == (spp is None)
    if spp is not None:
        assert found.image.samples - found.fewest_samples <= 2 * 256


def test_a_limit_that_is_too_short_leaves_a_whole_picture(monkeypatch):
    Clock(monkeypatch, lambda y: 1.0)
    found = render(halves(), time_limit=0.1, threads=1)
    assert found.fewest_samples == found.image.samples == tile_scheduler.FIRST_PASS
    assert found.stats.error == {}


# ---- What it is worth, and that it is right


def squared_error(runs):
    """Return the squared error of a render of this kind, from the differences between some."""
    pictures = np.array([run.image.radiance for run in runs])
    return np.mean(error_weights(pictures.mean(axis=0)) * pictures.var(axis=0, ddof=1))


@pytest.mark.parametrize(
    ("width", "spp", "noise", "ratio"),
    [(64, 256, 0.0247, 0.75), pytest.param(96, 512, 0.0175, 0.7, marks=pytest.mark.slow)],
)
def test_half_of_a_picture_is_hard(width, spp, noise, ratio):
    # The same error takes at most 0.7 times the rays of a uniform render; the pilot weighs more in a small one.
    spec = halves(width=width, height=width // 2)
    uniform, focused = (
        [render(spec, seed=seed, **how) for seed in range(4)] for how in ({"spp": spp}, {"noise": noise})
    )
    rays = [np.mean([run.stats.rays for run in runs]) for runs in (uniform, focused)]
    assert rays[1] * squared_error(focused) <= ratio * rays[0] * squared_error(uniform)
    # And the error is what was asked for.
    assert math.sqrt(squared_error(focused)) == pytest.approx(noise, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("sampler", "noise"), [("independent", 0.03), ("sobol", 0.02)])
def test_there_is_no_bias(sampler, noise):
    # Means over 64 seeds against a render without any decision, tile by tile and in all; channels are alike here.
    spec = halves(sampler=sampler, width=32)
    runs = [render(spec, noise=noise, seed=seed) for seed in range(64)]
    assert all(run.stats.pilot_samples > 0 for run in runs)
    plain = render(spec, spp=16384, seed=99).image

    def by_tile(picture):
        return picture[..., 0].reshape(*picture.shape[:-3], 2, 16, 2, 16).sum(axis=(-3, -1))

    sums = np.array([by_tile(run.image.radiance) for run in runs])
    difference = sums.mean(axis=0) - by_tile(plain.radiance)
    variance = sums.var(axis=0, ddof=1) / 64 + by_tile(plain.variance)
    in_all = sums.sum(axis=(1, 2)).var(ddof=1) / 64 + plain.variance[..., 0].sum()
    # One of four normal numbers is beyond 3.5 in 0.2 % of cases; tiles without noise differ by rounding.
    assert np.all(np.abs(difference) < 3.5 * np.sqrt(variance) + 1e-6 * by_tile(plain.radiance))
    assert abs(difference.sum()) < 3.0 * math.sqrt(in_all)
    # That would show if it were a thousandth.
    assert math.sqrt(in_all) < 1e-3 * plain.radiance[..., 0].sum()
