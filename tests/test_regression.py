"""Small renders of every scene against references kept from before, judged by the noise of both.

`make references` renders the references anew.
"""

import numpy as np
import pytest

from raytracer.comparison import Reference, load_reference, z_test
from raytracer.film.image import Image
from raytracer.rendering import render
from tests.make_references import FOLDER, GENERATED, REFERENCES, ROOT, SEED, spec_of

# What these compile for long, the quick tests know by other scenes, and by tests/test_nesting.py.
LARGE = GENERATED.keys() | {"nested", "next_week", "studio"}
NAMES = [pytest.param(name, marks=[pytest.mark.slow] if name in LARGE else []) for name in REFERENCES]

# Each takes as long as ten renders of the others.
KEEN = [pytest.param(name, marks=[] if name in ("cornell", "lens") else [pytest.mark.slow]) for name in REFERENCES]


def rendered(name: str, *, seed: int = SEED + 1, spp: int = 256) -> Image:
    if name in GENERATED and not (ROOT / "scenes" / "generated" / GENERATED[name]).exists():
        pytest.skip(f"make scenes has not made what {name}.yaml is made of")
    result = render(spec_of(name), seed=seed, spp=spp)
    assert result.stats.nan_samples == 0
    return result.image


def reference(name: str) -> Reference:
    return load_reference(FOLDER / f"{name}.npz")


def test_references_are_those_of_the_list() -> None:
    assert {path.stem for path in FOLDER.glob("*.npz")} == set(REFERENCES)
    # They are kept in the repository, so they have to stay small.
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 1.5e6


@pytest.mark.parametrize("path", sorted((ROOT / "scenes").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_scene_of_the_repository_has_a_reference(path: object) -> None:
    assert getattr(path, "stem", None) in REFERENCES


@pytest.mark.parametrize("name", NAMES)
def test_picture_is_that_of_the_reference(name: str) -> None:
    image, kept = rendered(name), reference(name)
    verdict = z_test(image.radiance, image.variance, kept.mean, kept.variance)
    assert verdict.passed, verdict.reason


@pytest.mark.parametrize("name", KEEN)
def test_one_per_cent_more_light_is_noticed(name: str) -> None:
    # As an error would make that leaves the noise alone: a wrong pdf, say, or a lamp counted by 1.01.
    image, kept = rendered(name, spp=2048), reference(name)
    assert image.variance is not None
    verdict = z_test(1.01 * image.radiance, 1.01**2 * image.variance, kept.mean, kept.variance)
    assert not verdict.passed
    assert verdict.mean_z.max() > 3.0


def test_a_change_in_one_tile_is_noticed() -> None:
    # Half the light in a corner of 8 by 8 pixels, which hardly moves the mean of the picture.
    image, kept = rendered("cornell"), reference("cornell")
    changed = image.radiance.copy()
    changed[24:32, 8:16] *= 0.5
    verdict = z_test(changed, image.variance, kept.mean, kept.variance)
    assert not verdict.passed


def test_two_seeds_differ_by_their_noise_only() -> None:
    first, second = rendered("cover", seed=1), rendered("cover", seed=2)
    assert not np.array_equal(first.radiance, second.radiance)
    verdict = z_test(first.radiance, first.variance, second.radiance, second.variance)
    assert verdict.passed, verdict.reason


@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
@pytest.mark.parametrize("name", ["cornell", "lens"])
def test_samplers_agree_on_the_mean(name: str, sampler: str) -> None:
    # Stratified samples are better than their variance says, so the verdict is all the stricter on the reference.
    kept = reference(name)
    image = render(spec_of(name, **{"render.sampler": sampler}), seed=7, spp=256).image
    verdict = z_test(image.radiance, image.variance, kept.mean, kept.variance)
    assert verdict.passed, verdict.reason


@pytest.mark.parametrize("accuracy", ["fast", "robust"])
def test_accuracy_does_not_change_the_picture(accuracy: str) -> None:
    kept = reference("cornell")
    image = render(spec_of("cornell", **{"render.accuracy": accuracy}), seed=7, spp=256).image
    verdict = z_test(image.radiance, image.variance, kept.mean, kept.variance)
    assert verdict.passed, verdict.reason
