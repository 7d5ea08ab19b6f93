"""The choice of one light sample among those of all tables."""

import math

import numpy as np
import pytest

from raytracer.kernel.direct_light import Candidate, keep_one
from raytracer.plugins.lights.base.interface import LightSample
from raytracer.plugins.materials.base.interface import BLACK
from tests.small_scenes import image, mean


def candidate(red: float, green: float = 0.0) -> Candidate:
    return Candidate(LightSample(BLACK, BLACK, 0.0, BLACK, 0.0), BLACK, 0.0, 0.0, (red, green, 0.0))


def choose(candidates, u: float):
    kept, total = candidate(0.0), 0.0
    for item in candidates:
        kept, total, u = keep_one(kept, total, item, u)
    return kept, total


def test_candidates_are_kept_in_proportion_to_their_radiance() -> None:
    items = [candidate(1.0), candidate(0.0), candidate(2.0, 3.0), candidate(2.0)]
    count = 8000
    # Numbers in order, so no chance is involved.
    kept = [choose(items, (index + 0.5) / count) for index in range(count)]
    assert {total for _, total in kept} == {8.0}
    share = [sum(one == item for one, _ in kept) / count for item in items]
    np.testing.assert_allclose(share, [0.125, 0.0, 0.625, 0.25], atol=4.0 / count)


def test_the_kept_one_stands_for_all() -> None:
    # Radiance over probability has the sum of all as its mean.
    items = [candidate(0.5), candidate(3.0), candidate(0.01)]
    count = 40_000
    kept = [choose(items, (index + 0.5) / count) for index in range(count)]
    assert np.mean([total for _, total in kept]) == pytest.approx(3.51, rel=1e-12)


def test_what_is_not_a_number_is_not_hidden() -> None:
    for items in ([candidate(math.nan), candidate(1.0)], [candidate(1.0), candidate(math.nan), candidate(1.0)]):
        assert math.isnan(choose(items, 0.3)[1])


ROOM = """
camera: {type: pinhole, look_from: [0, 3, 6], look_at: [0, 0, 0], vfov: 50}
materials: {grey: {type: lambertian, albedo: 0.5}, lamp: {type: emitter, radiance: [9, 0, 3]}}
objects:
  - {type: quad, corner: [-4, 0, 4], edges: [[8, 0, 0], [0, 0, -8]], material: grey}
  - {type: sphere, center: [0.5, 0.6, 0], radius: 0.6, material: grey}
"""
LAMP = "  - {type: sphere, center: [-1, 2, 0], radius: 0.3, material: lamp}\n"
LIGHTS = {
    "point": "  - {type: point, position: [2, 3, 1], intensity: [0, 5, 1]}\n",
    "sun": "  - {type: sun, direction: [1, -2, -1], irradiance: [0.4, 0.2, 0.1], angle: 5}\n",
}


def lit(lights: str) -> str:
    return "lights:\n" + lights + ROOM


def test_lights_of_several_kinds_add_up() -> None:
    # All together bring what each brings alone, shadows and all.
    settings = {"spp": 256, "max_depth": 2, "sampler": "independent"}
    together = mean(image(lit("".join(LIGHTS.values())) + LAMP, **settings))
    alone = [mean(image(ROOM + LAMP, **settings, seed=2))]
    alone += [mean(image(lit(light), **settings, seed=3)) for light in LIGHTS.values()]
    value = sum(found for found, _ in alone)
    deviation = np.sqrt(together[1] ** 2 + sum(noise**2 for _, noise in alone))
    np.testing.assert_array_less(np.abs(together[0] - value), 4.0 * deviation)
    assert (deviation < 0.03 * value).all()
