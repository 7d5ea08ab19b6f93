"""What a study, a render with a noise target and a render's own error claim, held against what is known by other means.

No clock is read: a ray takes as long as `RAY` says, so that a study measures the same on any machine.
"""

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.analysis.cost import study as steps
from raytracer.analysis.cost.bench import Bench
from raytracer.analysis.cost.study import study
from raytracer.analysis.cost.study_options import StudyOptions
from raytracer.analysis.cost.variants import REPEAT, Variant
from raytracer.core.error_estimate.metric import error_weights
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.render import render
from raytracer.rendering.tile_renderer import render_tiles
from raytracer.scene.load import load
from tests.small_scenes import scene

Array = NDArray[np.float64]

SCENES = Path(__file__).parents[3] / "scenes"

RAY = 1e-5
"""Seconds that a ray takes, on one thread; so slow that a minute of measuring is little work."""

REFERENCE = 65536
"""Samples of a picture that others are compared with."""

SEEDS = 40
HELD = 34
"""An interval of 95 % holds the truth in 34 to 40 of 40: fewer have odds of 1 in 300."""
# A floor in the light of the sky: one bounce, and nothing but smooth integrands.
FLOOR = """
camera: {{type: pinhole, look_from: [0, 3, 4], look_at: [0, 0, 0], vfov: 30}}
environment: {{type: gradient, horizon: [1, 0.9, 0.8], zenith: [0.2, 0.4, 0.9]}}
materials:
  floor: {{type: lambertian, albedo: {albedo}}}
objects:
  - {{type: quad, corner: [-50, 0, 50], edges: [[100, 0, 0], [0, 0, -100]], material: floor}}
"""


def floor(albedo=0.5, sampler="sobol", size=48):
    return scene(FLOOR.format(albedo=albedo), sampler=sampler, width=size, height=size, max_depth=2)


def bench(ray=RAY):
    """Pictures as they are, and times by the number of rays."""

    def rendered(prepared, windows, spp, seed, threads, keep=()):
        patch = render_tiles(prepared, windows, spp, seed, 2, keep)
        busy = ray * patch.rays
        return patch._replace(busy=busy, seconds=float(busy.sum()) / threads)

    return Bench(compile_scene, rendered, lambda prepared, picture: 0.0)


def planted(monkeypatch, *others):
    """Make scenes the variants that the next study has, besides two controls; the names of those."""
    control = Variant(REPEAT, "control", "the scene itself", same_mean=True)
    again = Variant("again", "setting", "the scene itself, packed anew", needs_repacking=True)
    rest = [
        Variant(
            f"planted {i}", "setting", "another scene", spec_variant=lambda _, other=other: other, needs_repacking=True
        )
        for i, other in enumerate(others)
    ]
    monkeypatch.setattr(steps, "make_variants", lambda spec, packed: [control, again, *rest])
    return [variant.name for variant in rest]


class Truth(NamedTuple):
    """A picture of many samples, and the weights of errors against it."""

    picture: Array
    weight: Array
    spp: int

    def squared_error(self, picture, spp):
        """Of a picture of `spp` samples, with other random numbers.

        The truth's own error is in the difference: as much as falls as 1 / spp from one to the other.
        """
        return float(np.mean(self.weight * (picture - self.picture) ** 2)) * self.spp / (self.spp + spp)


def truth_of(spec, spp=REFERENCE):
    picture = render(spec, spp=spp, seed=4_000_000_000).image.radiance
    return Truth(picture, error_weights(picture), spp)


def variant_of(found, name):
    return next(variant for variant in found.variants if variant.name == name)


def small(name, width, height):
    return load(SCENES / f"{name}.yaml", {"film.width": width, "film.height": height})


@cache
def truth_of_small(name, width, height):
    return truth_of(small(name, width, height))


# ---- Biases


def test_a_planted_bias_is_found_with_its_size_and_equal_variants_have_none(monkeypatch):
    planted(monkeypatch, floor(albedo=0.51))
    found = study(floor(), StudyOptions(seed=3, tiles=9), bench=bench())

    # The floor is all that is seen, and its radiance is in proportion to its albedo.
    picture = render(floor(), spp=4096, seed=5).image.radiance
    size = 0.02 * math.sqrt(float(np.mean(error_weights(picture) * picture**2)))
    brighter = variant_of(found, "planted 0")
    assert brighter.brightness is not None
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
    spec, brighter = small("cornell", 48, 48), small("cornell", 48, 48)
    materials = dict(brighter.materials)
    for name in ("red", "white", "green"):
        albedo = tuple(1.02 * value for value in materials[name].albedo)
        materials[name] = materials[name].model_copy(update={"albedo": albedo})
    brighter = brighter.model_copy(update={"materials": materials})
    planted(monkeypatch, brighter)
    first, second = truth_of(spec, 8192), truth_of(brighter, 16384)
    size = math.sqrt(float(np.mean(first.weight * (first.picture - second.picture) ** 2)))

    found = [study(spec, StudyOptions(seed=seed, tiles=9), bench=bench(RAY / 4)) for seed in range(SEEDS)]
    false = sum(variant_of(one, REPEAT).bias_resolved for one in found)
    variants = [variant_of(one, "planted 0") for one in found]
    assert false <= SEEDS - HELD
    assert all(variant.bias_resolved for variant in variants)
    assert sum(variant.bias.low <= size <= variant.bias.high for variant in variants) >= HELD


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
    held = [one.points[-1].error for one in found]
    assert sum(error.low <= math.sqrt(mse) <= error.high for error in held) >= HELD

    # The samples that are needed, by renders with about as many.
    needed = samples_needed(spec, truth, 0.01, float(np.median([one.target_spp.value for one in found])))
    assert sum(one.target_spp.low <= needed <= one.target_spp.high for one in found) >= HELD


def mean_squared_error(spec, truth, spp, runs=4):
    """Of unbroken runs."""
    pictures = [render(spec, spp=spp, seed=500 + run).image.radiance for run in range(runs)]
    return float(np.mean([truth.squared_error(picture, spp) for picture in pictures]))


def samples_needed(spec, truth, target, guess):
    """Samples per pixel that reach a relative error, from unbroken runs of about as many."""
    spp = max(8, round(guess))
    return spp * mean_squared_error(spec, truth, spp) / target**2


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
        options = StudyOptions(seed=1, target=target, variants=[])
        foretold = study(spec, options, bench=bench()).prediction.target_spp.value
        off[name] = foretold / samples_needed(spec, truth_of(spec, 32768), target, foretold) - 1.0
    assert sum(abs(error) <= 0.2 for error in off.values()) >= 4, off


# ---- What a render says of its own error
