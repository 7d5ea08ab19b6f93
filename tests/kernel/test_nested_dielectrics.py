"""Solids and liquids that overlap: the one with the highest priority is there, and its surface alone is seen.

References: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2).
"""

import itertools
import math

import numpy as np
import pytest

from raytracer.kernel.path_state import workspace
from raytracer.rendering.render import render
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.nested_dielectrics import MAX_SOLIDS
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import InputError
from tests.nested import SPECKS, picture
from tests.small_scenes import mean, scene

SKY = "environment: {type: constant, radiance: 1}\n"
NIGHT = "environment: {type: constant, radiance: 1.0e-12}\n"


def camera(z, vfov=0.1):
    """On the axis, looking down along -z."""
    return f"camera: {{type: pinhole, look_from: [0, 0, {z}], look_at: [0, 0, {z - 1}], vfov: {vfov}}}\n"


def slab(low, high, material):
    """Hundred metres wide."""
    return f"  - {{type: box, min: [-50, -50, {low}], max: [50, 50, {high}], material: {material}}}\n"


def clear(ior, priority=None, absorption=0.0, **more):
    given = {"type": "dielectric", "ior": ior, "absorption": absorption, **more}
    if priority is not None:
        given["priority"] = priority
    return "{" + ", ".join(f"{key}: {value}" for key, value in given.items()) + "}"


EMITTER = "material: {type: emitter, radiance: 1}"
LAMP = f"  - {{type: quad, corner: [-50, -50, -20], edges: [[100, 0, 0], [0, 100, 0]], {EMITTER}}}\n"


def assert_value(text, expected, *, rounding=1e-6, **settings):
    """The picture's mean, within four of its standard deviations, which are at most 1 % of it, and a rounding."""
    value, deviation = mean(picture(text, **settings))
    assert np.all(deviation < 0.01 * expected)
    assert np.all(np.abs(value - expected) < 4.0 * deviation + rounding * expected), (value, expected, deviation)


def transmittance(*indices):
    """Compute the transmittance of clear layers at normal incidence with all reflections: 1/T - 1 = sum of R / (1 - R).

    References: Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates".
    """
    reflected = [((a - b) / (a + b)) ** 2 for a, b in itertools.pairwise(indices)]
    return 1.0 / (1.0 + sum(r / (1.0 - r) for r in reflected))


AIR, WATER, GLASS, GEM = 1.0, 1.33, 1.5, 2.4


@pytest.mark.parametrize(
    ("layers", "indices"),
    [
        # Glass, water and diamond that overlap by a tenth, in any order of priorities.
        ([(0, 1, GLASS, 2), (0.9, 2, WATER, 1), (1.9, 3, GEM, 3)], (AIR, GLASS, WATER, GEM, AIR)),
        ([(0, 1, GLASS, 2), (0.9, 2, WATER, 5), (1.9, 3, GEM, 2)], (AIR, GLASS, WATER, GEM, AIR)),
        # Diamond in water: it is there with the higher priority, and hidden with the lower one.
        ([(0, 3, WATER, 1), (1, 2, GEM, 2)], (AIR, WATER, GEM, WATER, AIR)),
        ([(0, 3, WATER, 2), (1, 2, GEM, 1)], (AIR, WATER, AIR)),
        # Of equal priorities the first one of the scene is there.
        ([(0, 3, WATER, 1), (1, 2, GEM, 1)], (AIR, WATER, AIR)),
        ([(1, 2, GEM, 1), (0, 3, WATER, 1)], (AIR, WATER, GEM, WATER, AIR)),
        # Two pieces of the same material are one.
        ([(0, 2, GLASS, 1), (1, 3, GLASS, 1)], (AIR, GLASS, AIR)),
        # Where the index does not change there is no boundary; and a bubble of air is a boundary of its own.
        ([(0, 3, WATER, 1), (1, 2, WATER, 2)], (AIR, WATER, AIR)),
        ([(0, 3, GLASS, 1), (1, 2, AIR, 2)], (AIR, GLASS, AIR, GLASS, AIR)),
    ],
)
def test_overlapping_slabs_transmit_as_layers(layers, indices):
    objects = "".join(slab(low, high, clear(ior, priority)) for low, high, ior, priority in layers)
    assert_value(camera(10.0) + NIGHT + "objects:\n" + LAMP + objects, transmittance(*indices))


@pytest.mark.parametrize(
    ("z", "before", "behind"),
    [
        (1.5, (1.33, 1.5, 1.0), (1.33, 1.0)),
        (0.95, (1.5, 1.0), (1.5, 1.33, 1.0)),
        (0.5, (1.5, 1.0), (1.5, 1.33, 1.0)),
        (-1.0, (1.0,), (1.0, 1.5, 1.33, 1.0)),
    ],
)
def test_a_camera_may_stand_in_anything(z, before, behind):
    # Glass under water, with which it overlaps from 0.9 to 1.  What the layers before the camera let through goes to
    # and fro between them and those behind it: T / (1 - R R').
    objects = slab(0.0, 1.0, clear(1.5, 2)) + slab(0.9, 2.0, clear(1.33, 1))
    through = transmittance(*before)
    expected = through / (1.0 - (1.0 - through) * (1.0 - transmittance(*behind)))
    assert_value(camera(z) + NIGHT + "objects:\n" + LAMP + objects, expected)


def test_light_is_absorbed_by_what_it_is_in():
    # The camera is under water, the lamp too, and 1 m of tinted glass of the same index between them.
    water, glass = clear(1.5, 1, 0.1), clear(1.5, 2, 0.7)
    text = camera(0.0) + NIGHT + "objects:\n" + LAMP + slab(-30.0, 50.0, water) + slab(-2.0, -1.0, glass)
    value, _ = mean(picture(text, spp=8))
    # Behind each surface a ray goes on off it, by 4 ulps of what a corner and two edges reach, and loses nothing there.
    offset = 4.0 * 2.0**-23 * 250.0
    np.testing.assert_allclose(-np.log(value), 0.1 * 19.0 + 0.7 * 1.0, rtol=0.0, atol=1.01 * (0.1 + 0.7) * offset)


@pytest.mark.parametrize("priority", [None, 1])
def test_a_camera_in_tinted_glass(priority):
    # 2 m to the nearer face; what that reflects comes back by way of the other one, 4 m up and 4 m down.
    reflected, transmitted = 0.04, math.exp(-0.3)
    expected = transmitted**2 * (1.0 - reflected) / (1.0 - reflected**2 * transmitted**8)
    glass = slab(-2.0, 2.0, clear(1.5, priority, 0.3))
    assert_value(camera(0.0) + NIGHT + "objects:\n" + LAMP + glass, expected)


def test_shadow_rays_pass_hidden_surfaces_and_are_absorbed():
    # A matte floor and a small lamp under water; between them glass that water hides, and some that has its index, and
    # takes more light.
    bright = "material: {type: emitter, radiance: 1.0e4}"
    lamp = f"  - {{type: quad, corner: [0.49, 0.01, 1], edges: [[0.02, 0, 0], [0, -0.02, 0]], {bright}}}\n"
    floor = "  - {type: quad, corner: [-9, -9, 0], edges: [[18, 0, 0], [0, 18, 0]], material: {type: lambertian}}\n"
    dry = camera(2.0) + NIGHT + "objects:\n" + lamp + floor
    hidden = (
        slab(-1, 60, clear(1.33, 3, 0.2)) + slab(0.2, 0.4, clear(2.4, 2, 9.0)) + slab(0.5, 0.6, clear(1.33, 4, 0.9))
    )
    (value, *_), (deviation, *_) = mean(picture(dry, max_depth=2))
    # The lamp is 0.02 m across: its points are 1.118 m from the floor's middle, within 4e-5 of it on average.
    expected = value * math.exp(-0.2 * (2.0 + math.hypot(1.0, 0.5)) - 0.07 * (1.0 + math.hypot(1.0, 0.5)))
    (color, *_), (other, *_) = mean(picture(dry + hidden, max_depth=2))
    assert deviation < 0.01 * value
    assert abs(color - expected) < 4.0 * math.hypot(other, deviation * expected / value) + 1e-4 * expected


def assert_alike(a, b):
    """No tile of 4 x 4 pixels differs by more than 4.5 standard deviations: of 192 numbers, one in 700 times."""
    shape = (8, 4, 8, 4, 3)
    difference = (a.radiance - b.radiance).reshape(shape).mean(axis=(1, 3))
    noise = np.sqrt((a.variance + b.variance).reshape(shape).sum(axis=(1, 3))) / 16
    assert np.abs(difference / np.maximum(noise, 1e-12)).max() < 4.5
    assert noise.max() < 0.05


@pytest.mark.parametrize(
    ("kind", "tint"),
    [
        ("dielectric", "[2, 0.5, 0.1]"),
        # Another type of scene, and so another kernel.
        pytest.param("rough_dielectric, roughness: 0.3", "0", marks=pytest.mark.slow),
    ],
)
def test_a_glass_of_water_is_what_outside_ior_makes_of_it(kind, tint):
    # A ball of water in a thick ball of glass; by priorities, the water reaches into the glass.
    view = "camera: {type: pinhole, look_from: [0, 0, 6], look_at: [0, 0.3, 0], vfov: 24}\n" + SKY + "objects:\n"
    ground = "  - {type: sphere, center: [0, -1001, 0], radius: 1000, material: {type: lambertian, albedo: 0.5}}\n"
    back = "  - {type: quad, corner: [-9, -9, -3], edges: [[18, 0, 0], [0, 9.3, 0]], material: {type: lambertian}}\n"

    def balls(*radii):
        return "".join(f"  - {{type: sphere, center: [0, 0, 0], radius: {r}, material: {m}}}\n" for r, m in radii)

    glass = f"{{type: {kind}, ior: 1.5, priority: 2}}"
    water = f"{{type: dielectric, ior: 1.33, priority: 1, absorption: {tint}}}"
    inner = f"{{type: {kind}, ior: 1.33, outside_ior: 1.5{'' if tint == '0' else f', absorption: {tint}'}}}"
    settings = {"width": 32, "height": 32, "spp": 256}
    nested = picture(view + ground + back + balls((1.0, glass), (-0.7, glass), (0.8, water)), **settings)
    explicit = picture(
        view + ground + back + balls((1.0, f"{{type: {kind}, ior: 1.5}}"), (0.7, inner)), **settings, seed=2
    )
    assert_alike(nested, explicit)


# Each of them a boundary to air: light inside is nearer to the normal by 1.5^60 than outside; and more ranks than there
# are bits in a word.
NESTED = {
    "without priorities": [clear(1.5)] * 60,
    "with priorities": [clear(1.3 + 0.1 * (k % 2), k) for k in range(40)],
}


@pytest.mark.parametrize("name", NESTED)
def test_what_is_nested_deep_loses_no_light(name):
    text = camera(4.0, 29.0) + SKY + "objects:\n"
    for number, material in enumerate(NESTED[name]):
        text += f"  - {{type: sphere, center: [0, 0, 0], radius: {1.0 - 0.01 * number}, material: {material}}}\n"
    np.testing.assert_allclose(picture(text, spp=16, max_depth=4000).radiance, 1.0, rtol=1e-9)


@pytest.mark.parametrize(("eye", "part"), [(30.0, 1.0), (5.0, 0.25), (15.005, 1.0)], ids=["path", "shadow", "camera"])
def test_what_meets_too_many_surfaces_is_dropped_and_counted(eye, part):
    # Of 1200 surfaces that are nothing, over a floor and under a lamp: light from one to the other is no more black
    # without a word.  A camera among more than it looks past does not know what it is in.
    edge, count = (50.0, 1200) if 9.0 < eye < 20.0 else (1.2, 600)
    films = "".join(
        f"  - {{type: box, min: [{-edge}, {-edge}, {z}], max: [{edge}, {edge}, {z + 0.005}], material: {clear(1.0)}}}\n"
        for z in (9.0 + 0.01 * np.arange(count)).tolist()
    )
    lamp = LAMP.replace("[-50, -50, -20]", "[-1, 1, 25]").replace("[100, 0, 0], [0, 100, 0]", "[2, 0, 0], [0, -2, 0]")
    text = camera(eye) + NIGHT + "objects:\n" + slab(-1.0, 0.0, "{type: lambertian}") + films + lamp * (eye < 25.0)
    settings = {"width": 8, "height": 8, "spp": 8, "max_depth": 2}
    result = render(scene(text.rstrip() + SPECKS, filled=False, **settings), seed=1, threads=1)
    assert result.stats.nan_samples >= part * 8 * 8 * 8


# ---- What is packed


VIEW = "camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0]}\n"


def packed(text):
    return pack(scene(text, filled=False)).scene


def ball(x, material):
    return f"  - {{type: sphere, center: [{x}, 0, 0], radius: 1, material: {material}}}\n"


WIDE = "thin_lens, aperture: "


@pytest.mark.parametrize(
    ("kind", "looks"),
    [
        ("pinhole", False),
        # A lens of 17 m has rays that begin in the ball; one of 15 m does not, but for the corners of three blades of
        # that area, 11.7 m away.
        (WIDE + "17000", True),
        (WIDE + "15000", False),
        (WIDE + "15000, aperture_shape: {type: polygon, blades: 3}", True),
        # An array reaches as far as its views stand from its middle: 8.2 m, and 7.8 m.
        ("camera_array, rows: 1, columns: 2, spacing: 16.4", True),
        ("camera_array, rows: 1, columns: 2, spacing: 15.6", False),
        ("pinhole, shutter: 1, motion: {velocity: [0, 0, -9]}", True),
        ("orthographic, height: 2", True),
    ],
)
def test_a_camera_far_from_all_solids_does_not_look_around(kind, looks):
    text = VIEW.replace("pinhole", kind) + "objects:\n" + ball(0, clear(1.5, 1))
    assert (packed(text).nested_dielectrics.camera is not None) == looks
    assert packed(text.replace("[0, 0, 9]", "[0, 0, 0.5]")).nested_dielectrics.camera is not None
    # Without a priority there is nothing of it.
    plain = packed(text.replace(", priority: 1", ""))
    assert (plain.nested_dielectrics, plain.transparency) == (None, None)
    works = [workspace(tables) for tables in (packed(text), plain)]
    found = [[part.inside_counts is not None for part in (work.paths, work.shadows)] for work in works]
    assert found == [[True, True], [False, False]]


def test_explained():
    spec = scene(VIEW + "objects:\n" + ball(0, clear(1.5, 2)), filled=False)
    effect = effects_of(spec, pack(spec).scene)["nested_dielectrics"]
    assert effect.active
    assert "1 material" in effect.why


def test_materials_that_select_fill_with_one_thing():
    frosted = f"{{type: mixture, materials: [{clear(1.5, 2)}, {{type: rough_dielectric, ior: 1.5, priority: 2}}]}}"
    tables = packed(VIEW + "objects:\n" + ball(0, frosted) + ball(1, clear(1.33, 1)))
    assert len(tables.nested_dielectrics.surface) == 2
    # Both of the mixture's materials are boundaries of their own to water.
    dielectrics, rough = tables.materials
    assert 1.5 / 1.33 in dielectrics.eta
    assert 1.5 / 1.33 in rough.eta
    differing = frosted.replace("priority: 2}]", "priority: 3}]")
    with pytest.raises(InputError, match=r"objects\[0\]\.material.*different things"):
        packed(VIEW + "objects:\n" + ball(0, differing))


def test_there_are_only_so_many():
    many = "".join(ball(3 * k, clear(1.5, k)) for k in range(MAX_SOLIDS))
    assert len(packed(VIEW + "objects:\n" + many).nested_dielectrics.surface) == MAX_SOLIDS
    with pytest.raises(InputError, match=f"one of {MAX_SOLIDS + 1} materials with a priority"):
        packed(VIEW + "objects:\n" + many + ball(-3, clear(1.5, 1000)))


@pytest.mark.parametrize(
    ("material", "is_there"),
    [
        ("{type: dielectric, ior: 1}", False),
        ("{type: dielectric, ior: 1.33, outside_ior: 1.33}", False),
        ("{type: rough_dielectric, ior: 1, roughness: 0.7}", False),
        ("{type: thin_dielectric, ior: 1}", False),
        ("{type: principled, ior: 1, transmission: 1, base_color: 1, roughness: 0.4}", False),
        ("{type: mixture, materials: [{type: dielectric, ior: 1}, {type: rough_dielectric, ior: 1}]}", False),
        ("{type: dielectric, ior: 1, absorption: 1}", True),
        ("{type: thin_dielectric, ior: 1, color: 0.5}", True),
        ("{type: principled, ior: 1, transmission: 1, base_color: 0.5}", True),
        ("{type: principled, ior: 1, transmission: 1, base_color: 1, emission: 1}", True),
    ],
)
def test_no_change_of_index_is_no_object_unless_it_takes_or_gives_light(material, is_there):
    tables = packed(VIEW + "objects:\n" + ball(0, material))
    found = [type(table).__name__ for table in tables.selectors.tables] if tables.selectors else []
    assert found == ([] if is_there else ["BoundaryTable"])
    assert (tables.transparency is None) == is_there


# ---- With other effects, each with a kernel of its own


@pytest.mark.slow
@pytest.mark.parametrize("moves", ["object", "instance"])
def test_a_tint_that_moves_past_the_camera(moves):
    # 2 m of ink of the index of air, which the camera stands in; in the shutter's second it moves 1 m back, so that the
    # way in it is 2 - t: the mean of exp(-s (2 - t)) is exp(-2 s) (exp(s) - 1) / s.
    ink = "{type: dielectric, ior: 1, priority: 1, absorption: 0.7}"
    motion = "motion: {velocity: [0, 0, 1]}"
    head = camera(0.0).replace("pinhole,", "pinhole, shutter: 1,") + NIGHT
    if moves == "instance":
        head += "groups:\n  slab:\n" + slab(-2, 0.0, ink)
        moving = f"  - {{type: instance, of: slab, {motion}}}\n"
    else:
        moving = slab(-2, 0.0, ink).replace("box,", f"box, {motion},")
    assert_value(head + "objects:\n" + LAMP + moving, math.exp(-1.4) * (math.exp(0.7) - 1.0) / 0.7)


@pytest.mark.slow
@pytest.mark.parametrize("z", [1.0, -2.0])
@pytest.mark.parametrize("priority", [1, 3])
def test_a_medium_fills_what_no_higher_priority_does(z, priority):
    # 10 m of ink from 0 down, and 1 m of something clear in it, which is there if its priority is above 2.  The camera
    # is above the ink, or in it.
    text = camera(z) + "media: {ink: {type: homogeneous, absorption: 0.1}}\n" + NIGHT + "objects:\n" + LAMP
    text += slab(-10.0, 0.0, "{type: dielectric, ior: 1, priority: 2}, medium: ink") + slab(
        -6, -5, clear(1.0, priority)
    )
    # Behind each of three surfaces a ray goes on a little off it, as above.
    lost = 3.0 * 0.1 * 4.0 * 2.0**-23 * 250.0
    assert_value(text, math.exp(-0.1 * (min(10.0, 10.0 + z) - (priority > 2))), spp=64, rounding=lost)
