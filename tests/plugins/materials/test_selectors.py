"""Materials that choose among others: which one, how often, and what is left out when there is no choice."""

from collections import Counter

import numba
import numpy as np
import pytest

from raytracer.core.geometry import Site
from raytracer.plugins.materials.base.dispatch import select_at, select_for_shadow_ray, selected_emission
from raytracer.plugins.materials.base.interface import PASSTHROUGH, split_random_number
from raytracer.plugins.materials.cutout import Cutout
from raytracer.plugins.materials.emitter import Emitter
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.plugins.materials.mixture import Mixture
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.scene.pack.materials import collect_components, pack_materials, resolve_material
from raytracer.scene.pack.scene import pack
from tests.small_scenes import scene
from tests.vectorised import random_draws, rows, vectorised

HEAD = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0]}
materials:
  clay: {type: lambertian, albedo: 0.5}
  chalk: {type: lambertian, albedo: 0.8}
  lamp: {type: emitter, radiance: [1, 2, 3]}
"""

SITE = Site((0.0, 0.0, 0.0), 0.5, 0.5, 1.0)

COUNT = 40_000


def asked(function, world, reference, front):
    """What a function of the selectors gives for many random numbers."""
    draws = random_draws(COUNT)._replace(sampler=world.sampler)
    return vectorised(function)(world.selectors, world, reference, front, SITE, draws)


# Specks of each selector and of a texture: one type of scene for all.
SPECKS = "".join(
    f"  - {{type: sphere, center: [0, {y}, 0], radius: 1.0e-9, material: {material}}}\n"
    for y, material in (
        (-99, "{type: cutout, material: clay, opacity: {type: checker, even: 0.3, odd: 0.6}}"),
        (-98, "{type: mixture, materials: [clay, lamp]}"),
        (-97, "{type: two_sided, front: clay, back: lamp}"),
    )
)


def packed(material, specks=""):
    """A scene of one sphere of this material, and the material's reference."""
    ball = f"objects:\n  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {material}}}\n"
    one = pack(scene(HEAD + ball + specks, filled=False))
    return one.scene, int(one.scene.primitives[0].material[0])


def shares(material, *, front=True):
    """Count how often each material shows: by albedo or radiance of its red, None for nothing."""
    world, reference = packed(material, SPECKS)
    measured = []
    for choose in (select_at, select_for_shadow_ray):
        result = asked(choose, world, reference, front)
        kinds = len(world.materials) + len(world.selectors.tables)
        counts = Counter(result.tolist())
        measured.append({})
        for chosen, count in counts.items():
            table = world.materials[chosen % kinds] if chosen != PASSTHROUGH else None
            name = None if table is None else float(next(iter(table)).values[chosen // kinds, 0])
            measured[-1][name] = count / COUNT
    for name, share in measured[0].items():
        # A path and a light that is aimed at choose alike, by other numbers.
        assert measured[1][name] == pytest.approx(share, abs=6.0 / np.sqrt(COUNT))
    return measured[0]


SIDES = "{type: two_sided, front: clay, back: chalk}"
NESTED = (
    "{type: mixture, weight: 0.25, materials: [{type: cutout, opacity: 0.4, material: clay}, "
    "{type: two_sided, front: {type: cutout, opacity: 0.5, material: chalk}, back: clay}]}"
)


@pytest.mark.parametrize(
    ("material", "front", "expected"),
    [
        ("{type: mixture, materials: [clay, chalk], weight: 0.2}", True, {0.5: 0.8, 0.8: 0.2}),
        ("{type: cutout, material: clay, opacity: 0.3}", True, {0.5: 0.3, None: 0.7}),
        ("{type: cutout, material: clay, opacity: 0}", True, {None: 1.0}),
        ("{type: cutout, material: clay, opacity: 0.3, threshold: 0.5}", True, {None: 1.0}),
        # What is as opaque as the threshold is there.
        (
            "{type: cutout, material: clay, opacity: {type: checker, even: 0.5, odd: 0.25}, threshold: 0.5}",
            True,
            {0.5: 1},
        ),
        (SIDES, True, {0.5: 1.0}),
        (SIDES, False, {0.8: 1.0}),
        (NESTED, True, {0.5: 0.3, 0.8: 0.125, None: 0.575}),
        (NESTED, False, {0.5: 0.55, None: 0.45}),
    ],
)
def test_each_material_shows_by_its_share(material, front, expected):
    assert shares(material, front=front) == pytest.approx(expected, abs=4.0 * 0.5 / np.sqrt(COUNT))


@pytest.mark.parametrize(
    ("material", "front", "back"),
    [
        ("{type: cutout, material: lamp, opacity: 0.25}", 0.25, 0.0),
        ("{type: mixture, materials: [lamp, clay], weight: 0.25}", 0.75, 0.0),
        ("{type: two_sided, front: clay, back: lamp}", 0.0, 1.0),
        ("{type: two_sided, front: lamp, back: {type: cutout, material: lamp, opacity: 0.5}}", 1.0, 0.5),
    ],
)
def test_a_light_point_gives_the_mean_of_what_may_show(material, front, back):
    # What a light sample brings on average must be what paths find there on average.
    world, reference = packed(material, SPECKS)
    for side, expected in ((True, front), (False, back)):
        result = asked(selected_emission, world, reference, side)
        np.testing.assert_allclose(result.mean(axis=0), np.array([1, 2, 3]) * expected, atol=3 * 2.0 / np.sqrt(COUNT))


@pytest.mark.parametrize(
    "material",
    [
        "{type: mixture, materials: [clay, lamp], weight: 0}",
        "{type: mixture, materials: [lamp, clay], weight: 1}",
        "{type: mixture, materials: [clay, {type: lambertian, albedo: 0.5}]}",
        "{type: cutout, material: clay, opacity: 1}",
        "{type: cutout, material: clay, opacity: 0.6, threshold: 0.6}",
        "{type: two_sided, front: clay, back: clay}",
    ],
)
def test_without_a_choice_there_is_no_selector(material):
    # The very scene, in type and in values, that names the one material that is ever met.
    world, reference = packed(material)
    plain, of_plain = packed("clay")
    assert reference == of_plain
    assert (world.selectors, world.transparency) == (None, None)
    assert numba.typeof(world) == numba.typeof(plain)
    assert np.array_equal(world.materials[0].albedo.values, plain.materials[0].albedo.values)


def test_only_what_has_holes_lets_pass():
    assert packed("{type: mixture, materials: [clay, chalk]}")[0].transparency is None
    assert packed("{type: mixture, materials: [clay, {type: cutout, material: chalk}]}")[0].transparency is not None


def test_relief_of_a_selector_is_its_childrens():
    own = Lambertian(bump="waves", bump_height=0.3)
    mixed = resolve_material(Mixture(materials=("a", own), bump="sand", bump_height=0.1), {"a": Lambertian()})
    children = list(mixed.children().values())
    assert [(child.bump, child.bump_height) for child in children] == [("sand", 0.1), ("waves", 0.3)]


def test_exitance_is_the_weighted_one():
    lamp = Emitter(radiance=(1.0, 2.0, 3.0))
    clay = Lambertian()
    assert Mixture(materials=(clay, lamp), weight=0.25).emitted_power(ParameterPacker()) == pytest.approx(1.5)
    assert Cutout(material=lamp, opacity=0.5).emitted_power(ParameterPacker()) == pytest.approx(3.0)


def test_equal_parts_are_packed_once():
    used = [
        resolve_material(Mixture(materials=(Lambertian(), Emitter(radiance=(1.0, 1.0, 1.0))), weight=0.25), {}),
        resolve_material(Cutout(material=Lambertian(), opacity=0.5), {}),
        Lambertian(),
    ]
    assert len(list(collect_components(used))) == 6
    tables = pack_materials(used, [None] * 3, ParameterPacker()).tables
    assert [len(next(iter(table)).values) for table in tables] == [1, 1]


def test_what_is_left_of_a_number_is_uniform():
    hit, left = vectorised(split_random_number)(rows((np.arange(1000) + 0.5) / 1000), 0.3)
    assert hit.sum() == 300
    for rest in (left[hit], left[~hit]):
        np.testing.assert_allclose(rest, (np.arange(len(rest)) + 0.5) / len(rest), rtol=1e-9)
    hit, left = vectorised(split_random_number)(rows([0.0, *[1.0 - 2.0**-53] * 2]), rows([0.0, 1.0, 0.5]))
    assert hit.tolist() == [False, True, False]
    assert left[2] < 1.0
