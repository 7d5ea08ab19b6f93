"""The choice of one light sample among those of all tables, and the weights of both ways to find light."""

import math

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.kernel.direct_light import Candidate, keep_one
from raytracer.plugins.lights.base.interface import LightSample, power_heuristic
from raytracer.plugins.materials.base.interface import BLACK
from tests.small_scenes import image, mean
from tests.vectorised import rows, vectorised


@kernel
def candidate(red, green):
    return Candidate(LightSample(BLACK, BLACK, 0.0, BLACK, 0.0), BLACK, 0.0, 0.0, (red, green, 0.0))


@kernel
def choose(reds, greens, u):
    """Keep one of as many candidates as there are numbers; the radiance of that and of all."""
    kept, total = candidate(0.0, 0.0), 0.0
    for index in range(len(reds)):
        kept, total, u = keep_one(kept, total, candidate(reds[index], greens[index]), u)
    return kept.radiance, total


def chosen(*candidates, count=8000):
    # Numbers in order, so no chance is involved.
    return vectorised(choose)(*np.array(candidates, float).T.copy(), rows((np.arange(count) + 0.5) / count))


def test_candidates_are_kept_in_proportion_to_their_radiance_and_stand_for_all():
    items = [(1, 0), (0, 0), (2, 3), (2, 0)]
    kept, total = chosen(*items)
    assert set(total) == {8.0}
    share = [(kept == (*item, 0)).all(axis=1).mean() for item in items]
    np.testing.assert_allclose(share, [0.125, 0.0, 0.625, 0.25], atol=4.0 / 8000)


def test_what_is_not_a_number_is_not_hidden():
    for items in ([(math.nan, 0), (1, 0)], [(1, 0), (math.nan, 0), (1, 0)]):
        assert np.isnan(chosen(*items, count=3)[1]).all()


def test_power_heuristic():
    # p^2 / (p^2 + q^2), whose weights add up to 1; hard case 37: squares must not overflow, nor 0/0 arise; and a
    # direction without choice has all the weight.
    pdf, other, weight = np.array(
        [(3, 4, 9 / 25), (4, 3, 16 / 25), (1e300, 1e300, 0.5), (1e-300, 1e300, 0), (1e-300, 0, 1), (math.inf, 7, 1)]
    ).T
    np.testing.assert_allclose(vectorised(power_heuristic)(rows(pdf), rows(other)), weight, rtol=1e-14)


ROOM = """
camera: {{type: pinhole, look_from: [0, 3, 6], look_at: [0, 0, 0], vfov: 50}}
lights:
  - {{type: point, position: [2, 3, 1], intensity: [0, {point}, {point}]}}
  - {{type: sun, direction: [1, -2, -1], irradiance: [{sun}, {sun}, {sun}], angle: 5}}
materials: {{grey: {{type: lambertian, albedo: 0.5}}, lamp: {{type: emitter, radiance: [{lamp}, 0, {lamp}]}}}}
objects:
  - {{type: quad, corner: [-4, 0, 4], edges: [[8, 0, 0], [0, 0, -8]], material: grey}}
  - {{type: sphere, center: [0.5, 0.6, 0], radius: 0.6, material: grey}}
  - {{type: sphere, center: [-1, 2, 0], radius: 0.3, material: lamp}}
"""


def test_lights_of_several_kinds_add_up():
    # All together bring what each brings where the others are as good as out, shadows and all.
    full = {"point": 5, "sun": 0.3, "lamp": 9}

    def lit(seed, *on):
        given = {name: full[name] if name in on else 1e-12 for name in full}
        return mean(image(ROOM.format(**given), seed=seed, spp=256, max_depth=2))

    together, alone = lit(1, *full), [lit(2 + number, name) for number, name in enumerate(full)]
    value = sum(found for found, _ in alone)
    deviation = np.sqrt(together[1] ** 2 + sum(noise**2 for _, noise in alone))
    np.testing.assert_array_less(np.abs(together[0] - value), 4.0 * deviation)
    assert (deviation < 0.03 * value).all()
    # And each brings some.
    assert all((found > 0.05 * value).any() for found, _ in alone)
