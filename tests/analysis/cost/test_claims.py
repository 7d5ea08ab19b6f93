"""What a study of real renders claims, held against what is known by other means.

No clock is read: a ray takes as long as `RAY` says, so that a study measures the same on any machine.
"""

import math
from pathlib import Path

import numpy as np
import pytest

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

SCENES = Path(__file__).parents[3] / "scenes"

RAY = 1e-5
"""Seconds that a ray takes, on one thread; so slow that a minute of measuring is little work."""

# A floor in the light of the sky: one bounce, and nothing but smooth integrands.
FLOOR = """
camera: {{type: pinhole, look_from: [0, 3, 4], look_at: [0, 0, 0], vfov: 30}}
environment: {{type: gradient, horizon: [1, 0.9, 0.8], zenith: [0.2, 0.4, 0.9]}}
materials:
  floor: {{type: lambertian, albedo: {albedo}}}
objects:
  - {{type: quad, corner: [-50, 0, 50], edges: [[100, 0, 0], [0, 0, -100]], material: floor}}
"""


def floor(albedo=0.5):
    return scene(FLOOR.format(albedo=albedo), sampler="sobol", width=48, height=48, max_depth=2)


def bench(ray=RAY):
    def rendered(prepared, windows, spp, seed, threads, keep=()):
        patch = render_tiles(prepared, windows, spp, seed, 2, keep)
        busy = ray * patch.rays
        return patch._replace(busy=busy, seconds=float(busy.sum()) / threads)

    return Bench(compile_scene, rendered, lambda prepared, picture: 0.0)


def test_a_planted_bias_is_found_with_its_size_and_equal_variants_have_none(monkeypatch):
    variants = [
        Variant(REPEAT, "control", "the scene itself", same_mean=True),
        Variant("again", "setting", "the scene itself, packed anew", needs_repacking=True),
        Variant("brighter", "setting", "", spec_variant=lambda spec: floor(albedo=0.51), needs_repacking=True),
    ]
    monkeypatch.setattr(steps, "make_variants", lambda spec, packed: variants)
    found = study(floor(), StudyOptions(seed=3, tiles=9), bench=bench(2.0 * RAY))

    # The floor is all that is seen, and its radiance is in proportion to its albedo.
    picture = render(floor(), spp=4096, seed=5).image.radiance
    size = 0.02 * math.sqrt(float(np.mean(error_weights(picture) * picture**2)))
    rows = {row.name: row for row in found.variants}
    brighter = rows["brighter"]
    assert brighter.bias_resolved
    assert brighter.bias.low <= size <= brighter.bias.high
    assert brighter.bias.value == pytest.approx(size, rel=0.02)
    # All tiles are measured with common random numbers, so nothing is uncertain but the last digits.
    assert brighter.brightness == pytest.approx((0.02, 0.02, 0.02), rel=1e-9)
    assert brighter.target_spp is None
    assert not brighter.time_differs

    for name in (REPEAT, "again"):
        same = rows[name]
        assert not same.time_differs
        assert not same.noise_differs
        assert not same.bias_resolved
        assert same.target_spp is not None


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
        spec = load(SCENES / f"{name}.yaml", {"film.width": width, "film.height": height})
        options = StudyOptions(seed=1, target=target, variants=[])
        foretold = study(spec, options, bench=bench()).prediction.target_spp.value
        # Samples that are needed, from unbroken runs of about as many; the truth's own error is in the difference.
        spp, many = max(8, round(foretold)), 32768
        truth = render(spec, spp=many, seed=4_000_000_000).image.radiance
        pictures = [render(spec, spp=spp, seed=500 + run).image.radiance for run in range(4)]
        mse = np.mean([error_weights(truth) * (picture - truth) ** 2 for picture in pictures]) * many / (many + spp)
        off[name] = foretold / (spp * mse / target**2) - 1.0
    assert sum(abs(error) <= 0.2 for error in off.values()) >= 4, off
