"""Small renders of every scene against references kept from before, judged by the noise of both.

`make references` renders the references anew; see docs/regression.md.
"""

import numpy as np
import pytest

from raytracer.analysis.compare import z_test
from raytracer.analysis.regression.check import CheckOptions, check_reference
from raytracer.analysis.regression.reference_file import load_reference
from raytracer.analysis.regression.render_reference import prepare_reference_scene
from raytracer.rendering.render import render
from raytracer.scene.cache import RenderCache
from tests.rendering.halves import halves
from tests.repository import GENERATED, REFERENCES, SCENES, need_files_of

NAMES = sorted(path.stem for path in REFERENCES.glob("*.npz"))

# What these compile for long, the quick tests know by other scenes, by tests/plugins/materials and by
# tests/kernel/test_nested_dielectrics.py.
LARGE = GENERATED.keys() | {"diamond", "metals", "nested", "next_week", "prism", "studio"}
PICTURES = [pytest.param(name, marks=[pytest.mark.slow] if name in LARGE else []) for name in NAMES]

# Small lamps that paths find by chance: to notice one per cent takes twenty times as many samples.
SPARKLING = {"diamond", "prism"}

# Each takes as long as ten renders of the others, but for the lens.
KEEN = [
    pytest.param(name, marks=[] if name == "lens" else [pytest.mark.slow]) for name in NAMES if name not in SPARKLING
]


def checked(rt_regression, name, **settings):
    need_files_of(name)
    own = REFERENCES / f"{name}.yaml"
    return rt_regression(own if own.exists() else SCENES / f"{name}.yaml", **settings)


def test_references_are_few_and_small():
    # They are kept in the repository, so they have to stay small.
    assert sum(path.stat().st_size for path in REFERENCES.iterdir()) < 1.5e6


@pytest.mark.parametrize(
    "path", sorted([*SCENES.glob("*.yaml"), *REFERENCES.glob("*.yaml")]), ids=lambda path: path.stem
)
def test_every_scene_has_a_reference_that_names_it(path):
    reference = load_reference(REFERENCES / f"{path.stem}.npz")
    assert reference.recipe.scene is not None
    assert (REFERENCES / reference.recipe.scene).samefile(path)
    # Only then does the variance of its samples tell the picture's.
    assert reference.recipe.overrides["render.sampler"] == "independent"


@pytest.mark.parametrize("name", PICTURES)
def test_picture_is_that_of_the_reference(name, rt_regression):
    checked(rt_regression, name, spp=256)


@pytest.mark.parametrize("name", KEEN)
def test_one_per_cent_more_light_is_noticed(name, rt_regression):
    # As an error would make that leaves the noise alone: a wrong pdf, say, or a lamp counted by 1.01.
    found = checked(rt_regression, name)
    assert found.detectable_change < 0.0101
    image, kept = found.image, found.reference
    verdict = z_test(1.01 * image.radiance, 1.01**2 * image.variance, kept.mean, kept.variance)
    assert not verdict.passed
    assert verdict.mean_z.max() > 3.0


def test_two_seeds_differ_by_their_noise_only(rt_regression):
    first, second = (checked(rt_regression, "cover", spp=256, seed=seed).image for seed in (1, 2))
    assert not np.array_equal(first.radiance, second.radiance)
    verdict = z_test(first.radiance, first.variance, second.radiance, second.variance)
    assert verdict.passed, verdict.reason


@pytest.mark.slow
def test_of_two_hundred_other_seeds_hardly_one_fails():
    cache, failed = RenderCache(), []
    for name in ("cornell", "cover", "lens", "zoo"):
        for seed in range(50):
            found = check_reference(REFERENCES / f"{name}.npz", CheckOptions(spp=256, seed=seed), cache=cache)
            failed += [] if found.passed else [found.sentence()]
    # 0.2 are expected, and three with a probability of 0.001.
    assert len(failed) <= 2, failed


@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
def test_samplers_agree_on_the_mean(sampler):
    found, independent = (render(halves(sampler=name), spp=512, seed=7).image for name in (sampler, "independent"))
    verdict = z_test(found.radiance, found.variance, independent.radiance, independent.variance)
    assert verdict.passed, verdict.reason
    # That would show if it were two per cent.
    more = 1.02 * found.radiance, 1.02**2 * found.variance
    assert not z_test(*more, independent.radiance, independent.variance).passed


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
@pytest.mark.parametrize("name", ["cover", "lens"])
def test_samplers_agree_on_the_references(name, sampler):
    # Stratified samples are better than their variance says, so the verdict is all the stricter on the reference.
    path = REFERENCES / f"{name}.npz"
    kept = load_reference(path)
    overrides = {**kept.recipe.overrides, "render.sampler": sampler}
    scene = prepare_reference_scene(REFERENCES / kept.recipe.scene, REFERENCES, overrides, kept.mean.shape[1])
    found = check_reference(path, CheckOptions(spp=256, seed=7), scene=scene)
    assert found.passed, found.reason
