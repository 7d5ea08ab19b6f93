"""Adaptive sampling: the shares of tiles, the stop criteria, and no bias."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from raytracer.core.embree import PACKET
from raytracer.core.error_estimate.halves import ErrorEstimator
from raytracer.core.error_estimate.metric import error_weights
from raytracer.film.image import Image
from raytracer.rendering import adaptive_sampling, session, statistics, tile_scheduler
from raytracer.rendering.adaptive_sampling import allocate_samples, pilot_seed, sample_goals
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import prepare_scene, render, render_prepared
from raytracer.rendering.session import Rendered
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError
from tests.small_scenes import scene

# The left half is a wall under an even sky, without any noise.  The right one looks into a room, where a lamp behind a
# screen lights walls that light each other.
HALVES = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 0.1}
objects:
  - {type: quad, corner: [-3, -3, 0], edges: [[3, 0, 0], [0, 6, 0]], material: {type: lambertian, albedo: 0.8}}
  - {type: quad, corner: [0, -3, -1.5], edges: [[4, 0, 0], [0, 6, 0]], material: {type: lambertian, albedo: 0.8}}
  - {type: quad, corner: [0, -3, -1.5], edges: [[0, 6, 0], [0, 0, 1.5]], material: {type: lambertian, albedo: 0.8}}
  - {type: quad, corner: [1.2, 0.1, -0.4], edges: [[1, 0, 0], [0, 1, 0]], material: {type: lambertian, albedo: 0.5}}
  - {type: sphere, center: [1.7, 0.6, -0.7], radius: 0.1, material: {type: emitter, radiance: 80}}
  - {type: sphere, center: [0.8, -0.4, -0.7], radius: 0.3, material: {type: lambertian, albedo: 0.8}}
"""


def halves(**settings: Any) -> SceneSpec:
    return scene(HALVES, **{"width": 64, "height": 32, "spp": 64, "max_depth": 4, **settings})


# ---- Shares


def test_shares_are_those_of_the_least_error() -> None:
    # For sum p v / n at a given sum p c n, Lagrange's multiplier gives n in proportion to sqrt(v / c).
    errors = np.full((6, 8), 1.0)
    errors[:, 4:] = 16.0
    cost = np.where(errors == 16.0, 4.0, 1.0)
    pixels = np.full(48, 256)
    found = allocate_samples(errors.ravel(), cost.ravel(), 8, pixels)[0].reshape(6, 8)
    # Far from the edge, where smoothing changes nothing: sqrt(16 / 4) = 2.
    np.testing.assert_allclose(found[:, -1] / found[:, 0], 2.0)
    assert np.average(found) == pytest.approx(1.0)


def test_what_a_pilot_missed_still_gets_samples() -> None:
    errors = np.zeros((8, 8))
    errors[0, 0] = 1.0
    found = allocate_samples(errors.ravel(), np.ones(64), 8, np.full(64, 256))[0].reshape(8, 8)
    # Neighbours of noise are suspected of an eighth of the noise around them; others get a sixteenth of the mean.
    assert found[0, 1] / found[0, 0] == pytest.approx(math.sqrt(2.0 / 9.0 / 8.0))
    assert found[1, 1] / found[0, 0] == pytest.approx(math.sqrt(1.0 / 9.0 / 8.0))
    assert found.min() == found[7, 7] < found[1, 1]
    assert found.min() > 0.04
    # Without any noise all are alike.
    np.testing.assert_array_equal(allocate_samples(np.zeros(64), np.ones(64), 8, np.full(64, 256))[0], 1.0)


def test_goals_are_whole_packets_and_never_fall() -> None:
    counts = np.array([16, 64, 512, 8])
    found = sample_goals(100.0, np.array([0.1, 1.02, 2.0, 50.0]), counts, 1000)
    assert found.tolist() == [16, 104, 512, 1000]
    assert np.all(found[:3] % PACKET == 0)


def test_pilots_have_seeds_that_no_picture_has() -> None:
    seeds = {pilot_seed(seed, number) for seed in (0, 1, 2**32 - 1) for number in range(1, 20)}
    assert len(seeds) == 57
    assert min(seeds) >= 2**32
    assert max(seeds) < 2**63


# ---- Ends


def test_it_stops_at_the_error_that_was_asked_for() -> None:
    for noise in (0.1, 0.05, 0.025):
        found = render(halves(), noise=noise, threads=2)
        assert found.complete
        # A round is not shorter than a twentieth of what there is.
        assert 0.85 * noise < found.stats.error["relative"] <= noise
        assert found.stats.error["target"] == noise
        assert found.image.settings["noise"] == noise


def test_samples_are_the_most_that_a_pixel_gets() -> None:
    found = render(halves(), noise=0.001, spp=100, threads=2)
    assert not found.complete
    assert not found.interrupted
    assert found.fewest_samples == found.image.samples == 100
    assert found.stats.error["relative"] > 0.001
    # With as many samples as that, the picture is that of a plain render.
    np.testing.assert_array_equal(found.image.radiance, render(halves(), spp=100).image.radiance)


def test_a_picture_without_noise_takes_few_samples() -> None:
    spec = scene("camera: {type: pinhole}\nenvironment: {type: constant, radiance: 0.5}\nobjects:", width=40)
    found = render(spec, noise=0.001)
    assert found.complete
    assert found.image.samples == 32
    assert found.stats.error["relative"] == 0.0


@pytest.mark.parametrize("noise", [0.0, -0.1, 1.0, math.nan, math.inf])
def test_errors_that_cannot_be_asked_for(noise: float) -> None:
    with pytest.raises(InputError, match="noise must lie between 0 and 1"):
        render(halves(), noise=noise)


@pytest.mark.parametrize("limit", [0.0, -1.0, math.nan, math.inf])
def test_times_that_cannot_be_asked_for(limit: float) -> None:
    with pytest.raises(InputError, match="a time limit must be greater than 0"):
        render(halves(), time_limit=limit)


def test_an_interrupt_leaves_a_picture() -> None:
    def interrupt(progress: Progress) -> None:
        if progress.done >= 64 * 32 * 32:
            raise KeyboardInterrupt

    found = render(halves(), noise=1e-4, threads=2, progress=interrupt)
    assert found.interrupted
    assert not found.complete
    assert found.fewest_samples >= 8
    assert found.image.radiance.any()


@pytest.mark.parametrize("time_limit", [None, 60.0])
def test_an_interrupt_between_rounds_leaves_a_picture(
    monkeypatch: pytest.MonkeyPatch, time_limit: float | None
) -> None:
    # While errors are looked at, and, under a time limit, while the end is tried out: no thread works then.
    estimate = ErrorEstimator.estimate

    def interrupted(estimator: ErrorEstimator, counts: Any) -> Any:
        monkeypatch.setattr(ErrorEstimator, "estimate", estimate)
        raise KeyboardInterrupt

    def dry_run_save(image: Image) -> None:
        raise KeyboardInterrupt

    if time_limit is None:
        monkeypatch.setattr(ErrorEstimator, "estimate", interrupted)
    found = render(halves(), noise=0.001, time_limit=time_limit, dry_run_save=dry_run_save, threads=2)
    assert found.interrupted
    assert not found.complete
    assert found.fewest_samples == (32 if time_limit is None else 8)
    assert found.image.radiance.any()


def test_light_of_any_strength_has_its_error() -> None:
    # A power of two changes no digit of a picture, and its error is relative.
    plain = render(halves(), noise=0.1, threads=2)
    bright = HALVES.replace("radiance: 0.1", f"radiance: {0.1 * 2.0**90!r}")
    bright = bright.replace("radiance: 80", f"radiance: {80 * 2.0**90!r}")
    found = render(scene(bright, width=64, height=32, max_depth=4), noise=0.1, threads=2)
    np.testing.assert_array_equal(found.image.radiance, plain.image.radiance * 2.0**90)
    assert found.complete
    assert found.stats.error["relative"] == pytest.approx(plain.stats.error["relative"], rel=1e-5)


class Clock:
    """A clock that only goes while samples are taken: `cost` seconds for one of a pixel, by the row that it is in."""

    def __init__(self, patch: pytest.MonkeyPatch, cost: Callable[[int], float]) -> None:
        self.seconds = 100.0
        for module in (adaptive_sampling, session, statistics, tile_scheduler):
            patch.setattr(module, "now", lambda: self.seconds)
        trace = tile_scheduler.render_tile

        def render_tile(*arguments: Any) -> int:
            left, top, right, bottom, begin, end = arguments[3:]
            self.seconds += (right - left) * (end - begin) * sum(map(cost, range(top, bottom)))
            return int(trace(*arguments))

        patch.setattr(tile_scheduler, "render_tile", render_tile)
        patch.setattr(adaptive_sampling, "render_tile", render_tile)


@pytest.mark.parametrize("spp", [None, 1_000_000])
@pytest.mark.parametrize("limit", [0.5, 3.0, 10.0])
def test_time_is_used_up_and_not_exceeded(monkeypatch: pytest.MonkeyPatch, spp: int | None, limit: float) -> None:
    clock = Clock(monkeypatch, lambda y: 1e-6 if y < 16 else 4e-6)
    begin = clock.seconds

    def save(image: Image) -> None:
        clock.seconds += 0.05

    # It took 0.1 s to load, and takes 0.05 s to save, which is tried out once.
    prepared = prepare_scene(halves(), RenderOptions(time_limit=limit, spp=spp, threads=1), load_seconds=0.1)
    found = render_prepared(prepared, dry_run_save=save)
    save(found.image)
    taken = clock.seconds - begin + 0.1
    assert 0.95 * limit < taken <= limit
    # Samples went where the noise is, or all tiles are alike, in turns.
    assert found.complete == (spp is None)
    if spp is not None:
        assert found.image.samples - found.fewest_samples <= 2 * 256


def test_a_limit_that_is_too_short_leaves_a_whole_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch, lambda y: 1.0)
    found = render(halves(), time_limit=0.1, threads=1)
    assert found.fewest_samples == found.image.samples == tile_scheduler.FIRST_PASS
    assert found.stats.error == {}


# ---- What it is worth, and that it is right


def squared_error(runs: list[Rendered]) -> float:
    """Return the squared error of a render of this kind, from the differences between some."""
    pictures = np.array([run.image.radiance for run in runs])
    mean = pictures.mean(axis=0)
    return float(np.mean(error_weights(mean) * pictures.var(axis=0, ddof=1)))


@pytest.mark.parametrize(
    ("width", "spp", "noise", "ratio"),
    [(64, 256, 0.0247, 0.75), pytest.param(96, 512, 0.0175, 0.7, marks=pytest.mark.slow)],
)
def test_half_of_a_picture_is_hard(width: int, spp: int, noise: float, ratio: float) -> None:
    # The same error takes at most 0.7 times the rays of a uniform render; the pilot weighs more in a small one.
    uniform = [render(halves(width=width, height=width // 2), spp=spp, seed=seed) for seed in range(4)]
    focused = [render(halves(width=width, height=width // 2), noise=noise, seed=seed) for seed in range(4)]
    rays = [np.mean([run.stats.rays for run in runs]) for runs in (uniform, focused)]
    assert rays[1] * squared_error(focused) <= ratio * rays[0] * squared_error(uniform)
    # And the error is what was asked for.
    assert math.sqrt(squared_error(focused)) == pytest.approx(noise, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("sampler", "noise"), [("independent", 0.03), ("sobol", 0.02)])
def test_there_is_no_bias(sampler: str, noise: float) -> None:
    # Means over 64 seeds against a render without any decision, tile by tile and in all; channels are alike here.
    runs = [render(halves(sampler=sampler, width=32), noise=noise, seed=seed) for seed in range(64)]
    assert all(run.stats.pilot_samples > 0 for run in runs)
    plain = render(halves(sampler=sampler, width=32), spp=16384, seed=99).image
    assert plain.variance is not None

    def by_tile(picture: Any) -> Any:
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
