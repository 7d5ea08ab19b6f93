"""What a study, a render with a noise target and a render's own error claim, held against what is known by other means.

No clock is read: a ray takes as long as `RAY` says, so that a study measures the same on any machine.
"""

import math
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from raytracer.analysis.cost import study as steps
from raytracer.analysis.cost.bench import Bench
from raytracer.analysis.cost.study import study
from raytracer.analysis.cost.study_options import StudyOptions
from raytracer.analysis.cost.variants import REPEAT, Variant
from raytracer.core.error_estimate.metric import error_weights, mse_by_tile
from raytracer.film.window import Window
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.render import render
from raytracer.rendering.tile_renderer import render_tiles
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.scene.load import build, load
from tests.small_scenes import scene

SCENES = Path(__file__).parents[3] / "scenes"

RAY = 1e-5
"""Seconds that a ray takes, on one thread; so slow that a minute of measuring is little work."""

REFERENCE = 65536
"""Samples of a picture that others are compared with."""

SEEDS = 40
HELD = 34
"""An interval of 95 % holds the truth in 34 to 40 of 40: fewer have odds of 1 in 300."""

# A floor in the light of the sky: one bounce, and nothing but smooth integrands.  It shares its kernels with the cover,
# whose kinds of materials lie below it.
FLOOR = """
camera: {{type: thin_lens, look_from: [0, 3, 4], look_at: [0, 0, 0], vfov: 30, focus_distance: 5, defocus_angle: 0.1}}
film: {{width: {size}, height: {size}}}
render: {{sampler: {sampler}, max_depth: 2}}
environment: {{type: gradient, horizon: [1, 0.9, 0.8], zenith: [0.2, 0.4, 0.9]}}
{more}
objects:
  - {{type: sphere, center: [0, -1000, 0], radius: 1000, material: {{type: lambertian, albedo: {albedo}}}}}
  - {{type: sphere, center: [0, -80, 0], radius: 1, material: {{type: metal}}}}
  - {{type: sphere, center: [0, -90, 0], radius: 1, material: {{type: dielectric}}{medium}}}
"""


def floor(albedo=0.5, sampler="sobol", size=48, more="", medium=""):
    return build(FLOOR.format(albedo=albedo, sampler=sampler, size=size, more=more, medium=medium), "floor.yaml")


def bench(ray=RAY, slower=lambda prepared: 1.0):
    """Pictures as they are, and times by the number of rays."""

    def rendered(prepared, windows, spp, seed, threads, keep=()):
        patch = render_tiles(prepared, windows, spp, seed, 2, keep)
        busy = ray * slower(prepared) * patch.rays
        return patch._replace(busy=busy, seconds=float(busy.sum()) / threads)

    return Bench(compile_scene, rendered, lambda prepared, picture: 0.0)


def planted(monkeypatch, other_spec):
    """Make a scene the variant that the next study has, besides two controls."""
    control = Variant(REPEAT, "control", "the scene itself", same_mean=True)
    again = Variant("again", "setting", "the scene itself, packed anew", needs_repacking=True)
    other = Variant("planted", "setting", "another scene", spec_variant=lambda _: other_spec, needs_repacking=True)
    monkeypatch.setattr(steps, "make_variants", lambda spec, packed: [control, again, other])


def variant_of(found, name):
    return next(variant for variant in found.variants if variant.name == name)


def hold(intervals, truth):
    """Tell if so many of the intervals of all seeds hold the truth."""
    return sum(interval.low <= truth <= interval.high for interval in intervals) >= HELD


class Truth(NamedTuple):
    """A picture of many samples, and the weights of errors against it."""

    picture: Any
    weight: Any
    spp: int

    def squared_error(self, picture, spp):
        """Of a picture of `spp` samples, with other random numbers.

        The truth's own error is in the difference: as much as falls as 1 / spp from one to the other.
        """
        return float(np.mean(self.weight * (picture - self.picture) ** 2)) * self.spp / (self.spp + spp)


def truth_of(spec, spp=REFERENCE):
    picture = render(spec, spp=spp, seed=4_000_000_000).image.radiance
    return Truth(picture, error_weights(picture), spp)


def small(name, width, height):
    return load(SCENES / f"{name}.yaml", {"film.width": width, "film.height": height})


@cache
def truth_of_small(name, width, height):
    return truth_of(small(name, width, height))


# ---- Slopes


def slope(spec, levels=(16, 64, 256), replicates=16):
    """By how much the logarithm of the error falls for each of the samples."""
    prepared = compile_scene(spec)
    windows = split_into_tiles(Window(0, 0, spec.film.width, spec.film.height))
    patches = [render_tiles(prepared, windows, levels[-1], seed, 2, levels) for seed in range(replicates)]
    inside = patches[0].count > 0
    means = {n: np.stack([patch.levels[n][inside] for patch in patches]) for n in levels}
    weight = error_weights(means[levels[-1]].mean(axis=0))
    owner = np.nonzero(inside)[0]
    mse = [mse_by_tile(means[n], weight, owner).mean for n in levels]
    return -float(np.polyfit(np.log(levels), 0.5 * np.log(mse), 1)[0])


def test_independent_samples_have_a_slope_of_a_half_and_sobol_points_a_steeper_one_where_it_is_smooth():
    assert slope(floor(sampler="independent", size=16)) == pytest.approx(0.5, abs=0.05)
    assert slope(floor(sampler="sobol", size=16)) > 0.65


@pytest.mark.slow
def test_slopes_on_the_cover():
    cover = small("cover", 60, 34)
    independent = cover.model_copy(update={"render": cover.render.model_copy(update={"sampler": "independent"})})
    assert slope(independent) == pytest.approx(0.5, abs=0.05)
    assert slope(cover) > slope(independent) + 0.01


# ---- Biases


def test_a_planted_bias_is_found_with_its_size_and_equal_variants_have_none(monkeypatch):
    planted(monkeypatch, floor(albedo=0.51))
    found = study(floor(), StudyOptions(seed=3, tiles=9), bench=bench(4.0 * RAY))

    # The floor is all that is seen, and its radiance is in proportion to its albedo.
    picture = render(floor(), spp=256, seed=5).image.radiance
    size = 0.02 * math.sqrt(float(np.mean(error_weights(picture) * picture**2)))
    brighter = variant_of(found, "planted")
    assert brighter.bias_resolved
    assert brighter.bias.low <= size <= brighter.bias.high
    assert brighter.bias.value == pytest.approx(size, rel=0.02)
    # All tiles are measured with common random numbers, so nothing is uncertain but the last digits.
    assert brighter.brightness == pytest.approx((0.02, 0.02, 0.02), rel=1e-9)
    assert brighter.target_spp is None
    assert not brighter.time_differs

    for name in (REPEAT, "again"):
        same = variant_of(found, name)
        assert not same.time_differs
        assert not same.noise_differs
        assert not same.bias_resolved
        assert same.target_spp is not None


@pytest.mark.slow
def test_equal_variants_have_no_bias_over_many_seeds_and_a_planted_one_has_its_size(monkeypatch):
    spec = small("cornell", 48, 48)
    walls = {name: spec.materials[name] for name in ("red", "white", "green")}
    walls = {
        name: wall.model_copy(update={"albedo": tuple(1.02 * value for value in wall.albedo)})
        for name, wall in walls.items()
    }
    brighter = spec.model_copy(update={"materials": {**spec.materials, **walls}})
    planted(monkeypatch, brighter)
    # With the same random numbers, of which the noise falls out of the difference.
    first, second = truth_of(spec, 8192), truth_of(brighter, 8192)
    size = math.sqrt(float(np.mean(first.weight * (first.picture - second.picture) ** 2)))

    found = [study(spec, StudyOptions(seed=seed, tiles=9), bench=bench(RAY / 4)) for seed in range(SEEDS)]
    false = sum(variant_of(one, REPEAT).bias_resolved for one in found)
    variants = [variant_of(one, "planted") for one in found]
    assert false <= SEEDS - HELD
    assert all(variant.bias_resolved for variant in variants)
    assert hold([variant.bias for variant in variants], size)


# ---- Effects that only take time


@pytest.mark.slow
def test_a_medium_that_no_ray_enters_shows_its_time_and_no_bias():
    spec = floor(size=32, more="media: {mist: {type: homogeneous, scattering: 0.5}}", medium=", medium: mist")
    slow = bench(slower=lambda prepared: 1.0 if prepared.scene.media is None else 1.3)

    without = variant_of(study(spec, StudyOptions(seed=1, variants=["media"]), bench=slow), "media")
    assert without.time_differs
    assert without.time == pytest.approx((1.0 / 1.3,) * 3)
    assert not without.noise_differs
    assert not without.bias_resolved
    assert without.bias.high < 0.001


# ---- Predictions and intervals

STUDIED = (("cover", 64, 36), ("cornell", 48, 48))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "width", "height"), STUDIED)
def test_intervals_of_a_study_hold_the_truth(name, width, height):
    spec, truth = small(name, width, height), truth_of_small(name, width, height)
    found = [study(spec, StudyOptions(seed=seed, variants=[]), bench=bench()).prediction for seed in range(SEEDS)]

    # The error of a run of so many samples: the mean over renders, which tells it far better than one study does.
    spp = found[0].points[-1].spp
    mse = mean_squared_error(spec, truth, spp, SEEDS)
    assert hold([one.points[-1].error for one in found], math.sqrt(mse))

    # The samples that are needed, by renders with about as many; of only four, the mean is uncertain by 4 %.
    needed = samples_needed(spec, truth, 0.01, float(np.median([one.target_spp.value for one in found])), 24)
    assert hold([one.target_spp for one in found], needed)


@pytest.mark.slow
def test_intervals_from_some_of_the_tiles_hold_the_truth_of_all():
    spec = small("cover", 192, 108)
    found = [
        study(spec, StudyOptions(seed=seed, variants=[], tiles=21), bench=bench()).prediction for seed in range(SEEDS)
    ]
    # All of them, with as many samples at least.
    whole = study(spec, StudyOptions(seed=SEEDS, variants=[], tiles=84), bench=bench(RAY / 16)).prediction
    truths = {point.spp: point.error.value for point in whole.points}
    for i, point in enumerate(found[0].points):
        assert hold([one.points[i].error for one in found], truths[point.spp])
    assert hold([one.target_spp for one in found], whole.target_spp.value)
    # All tiles of the whole are measured, so that its rays are known; each takes a sixteenth of the time.
    assert hold([one.per_sample for one in found], 16.0 * whole.per_sample.value)


def mean_squared_error(spec, truth, spp, runs=4):
    """Of unbroken runs."""
    pictures = [render(spec, spp=spp, seed=500 + run).image.radiance for run in range(runs)]
    return float(np.mean([truth.squared_error(picture, spp) for picture in pictures]))


def samples_needed(spec, truth, target, guess, runs=4):
    """Samples per pixel that reach a relative error, from unbroken runs of about as many."""
    spp = max(8, round(guess))
    return spp * mean_squared_error(spec, truth, spp, runs) / target**2


@pytest.mark.slow
def test_samples_to_a_target_are_foretold():
    off = {}
    for name, width, height, target in (
        ("cover", 64, 36, 0.01),
        ("cornell", 48, 48, 0.01),
        ("million", 32, 32, 0.01),
        ("lecture/aperture", 48, 32, 0.01),
        ("lecture/bokeh", 48, 32, 0.03),
    ):
        spec = small(name, width, height)
        foretold = study(
            spec, StudyOptions(seed=1, target=target, variants=[]), bench=bench()
        ).prediction.target_spp.value
        off[name] = foretold / samples_needed(spec, truth_of(spec, 32768), target, foretold) - 1.0
    assert sum(abs(error) <= 0.2 for error in off.values()) >= 4, off


# ---- What a render says of its own error


@pytest.mark.slow
@pytest.mark.parametrize(("name", "width", "height"), STUDIED)
@pytest.mark.parametrize("target", [{"spp": 64}, {"spp": 200}, {"noise": 0.05}])
def test_a_render_knows_its_error(name, width, height, target):
    spec, truth = small(name, width, height), truth_of_small(name, width, height)
    held = 0
    for seed in range(SEEDS):
        found = render(spec, seed=seed, **target)
        error = math.sqrt(truth.squared_error(found.image.radiance, found.stats.spp["mean"]))
        held += found.stats.error["low"] <= error <= found.stats.error["high"]
    assert held >= HELD


# ---- Samples where the error is

# Left a plain wall, which takes about as many rays as what is right: glass, a mirror and a lamp.
HALVES = """
camera: {type: pinhole, look_from: [0, 1, 5], look_at: [0, 1, 0], vfov: 30}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1]}
objects:
  - {type: quad, corner: [-8, -4, -1], edges: [[16, 0, 0], [0, 12, 0]], material: {type: lambertian}}
  - {type: quad, corner: [0.1, -4, -1], edges: [[0, 12, 0], [0, 0, 2]], material: {type: lambertian, albedo: 0.1}}
  - {type: sphere, center: [1, 0.5, 0], radius: 0.45, material: {type: dielectric, ior: 1.5}}
  - {type: sphere, center: [2, 1.4, -0.4], radius: 0.5, material: {type: metal, albedo: 0.9, fuzz: 0.2}}
  - {type: sphere, center: [1.3, 1.7, 0.2], radius: 0.15, material: {type: emitter, radiance: 60}}
"""


def halves(height):
    return scene(HALVES, sampler="sobol", width=2 * height, height=height, max_depth=8)


def squared_error_of(truth, runs):
    return float(np.mean([truth.squared_error(run.image.radiance, run.stats.spp["mean"]) for run in runs]))


@pytest.mark.slow
def test_rays_go_where_the_error_is():
    # Large and long enough: on 128 x 64 to 2 %, tiles are coarser and pilots a larger part, and 0.8 is left.
    spec = halves(128)
    truth = truth_of(spec, 16384)
    runs = [render(spec, noise=0.01, seed=seed) for seed in range(2)]
    assert math.sqrt(squared_error_of(truth, runs)) == pytest.approx(0.01, rel=0.1)

    # Errors fall as the root of rays, near enough to each other.
    even = [render(spec, spp=round(run.stats.spp["mean"]), seed=700 + seed) for seed, run in enumerate(runs)]
    products = [squared_error_of(truth, of) * np.mean([run.stats.rays for run in of]) for of in (runs, even)]
    assert products[0] <= 0.7 * products[1]


@pytest.mark.slow
def test_adaptive_renders_have_the_mean_of_uniform_ones():
    spec = halves(32)
    seeds = range(64)
    adaptive = [render(spec, noise=0.06, seed=seed) for seed in seeds]
    spp = round(float(np.mean([run.stats.spp["mean"] for run in adaptive])))
    uniform = [render(spec, spp=spp, seed=1000 + seed) for seed in seeds]
    assert max(run.stats.spp["most"] for run in adaptive) > 2 * min(run.stats.spp["fewest"] for run in adaptive)

    def of_tiles(runs):
        pictures = np.stack([run.image.radiance for run in runs])
        return pictures.reshape(len(runs), 2, 16, 4, 16, 3).mean(axis=(2, 4, 5))

    def z(a, b):
        variance = (a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / len(a)
        return (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt(variance)

    a, b = of_tiles(adaptive), of_tiles(uniform)
    assert abs(z(a.mean(axis=(1, 2)), b.mean(axis=(1, 2)))) < 3.3
    # Chi-square of 8 tiles: above 26 in one of 1000.
    assert float(np.sum(z(a, b) ** 2)) < 26.0
