"""Emitters as lights: which there are, how often each is aimed at, and that its density says so."""

import math
from collections import Counter

import numpy as np
import pytest

from raytracer.core.sampling.alias import AliasTable
from raytracer.plugins.lights.base.light_choice import count_lights, light_probability
from raytracer.plugins.lights.emitters import ABSENT
from raytracer.scene.pack.scene import pack
from tests.plugins.lights.kernels import aim, pdf_of
from tests.plugins.shapes.kernels import built, cast
from tests.small_scenes import scene

CAMERA = "camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], vfov: 40}\n"


def packed(objects, *, groups="", **settings):
    return pack(scene(CAMERA + groups + "objects:\n" + objects, **settings)).scene


LAMPS = """
  - {type: sphere, center: [0, 2, 0], radius: 0.5, material: {type: emitter, radiance: [3, 3, 3]}}
  - {type: sphere, center: [3, 2, 0], radius: 1, material: {type: emitter, radiance: [1, 0, 0]}}
  - {type: sphere, center: [-3, 2, 0], radius: 1, material: {type: emitter, radiance: 0}}
  - type: quad
    corner: [-1, 3, -1]
    edges: [[2, 0, 0], [0, 0, 2]]
    material: {type: emitter, radiance: 1, two_sided: true}
  - {type: quad, corner: [-5, -1, 5], edges: [[10, 0, 0], [0, 0, -10]], material: {type: lambertian}}
  - {type: quad, corner: [4, 3, -1], edges: [[1, 0, 0], [0, 0, 1]], material: {type: emitter, radiance: 2}}
"""

# Area times radiance times sides: 4 pi 0.25 * 9, 4 pi * 1, 4 * 3 * 2, 1 * 6.
POWERS = {
    ("Spheres", 0): 9.0 * math.pi,
    ("Spheres", 1): 4.0 * math.pi,
    ("Parallelograms", 0): 24.0,
    ("Parallelograms", 2): 6.0,
}


def aim_at(scene_, point, count):
    """Direction, radiance, pdf, target and gap of light samples."""
    aimed = aim(scene_.lights, scene_, point, count)
    return aimed.direction, aimed.weight * aimed.pdf[:, None], aimed.pdf, aimed.target, aimed.gap


def probabilities(scene_, point):
    """Probability of each emitter's choice for a point, by its table and primitive."""
    (lights,) = scene_.lights.tables
    names = [type(table).__name__ for table in scene_.primitives]
    return {
        (names[table], int(primitive)): light_probability(lights.choice, point, row)
        for row, (table, primitive) in enumerate(zip(lights.table, lights.primitive, strict=True))
    }


def test_emitters_are_chosen_by_power_from_far_away():
    scene_ = packed(LAMPS)
    (lights,) = scene_.lights.tables
    assert count_lights(lights.choice) == 4
    total = sum(POWERS.values())
    chosen = probabilities(scene_, (0.0, 1e9, 0.0))
    assert chosen == {row: pytest.approx(power / total, rel=1e-6) for row, power in POWERS.items()}
    # By primitive: no row for what does not emit.
    assert np.count_nonzero(lights.row != ABSENT) == 4


def test_emitters_near_by_are_chosen_more_often():
    # Over the lone quad at x = 4, which has the least power.
    chosen = probabilities(packed(LAMPS), (4.5, 2.9, -0.5))
    assert max(chosen, key=chosen.__getitem__) == ("Parallelograms", 2)
    assert sum(chosen.values()) == pytest.approx(1.0, rel=1e-12)


def test_emitters_that_move_are_chosen_by_power():
    moving = LAMPS.replace("radius: 0.5,", "radius: 0.5, motion: {velocity: [1, 0, 0]},")
    text = CAMERA.replace("vfov: 40", "vfov: 40, shutter: 1") + "objects:\n" + moving
    (lights,) = pack(scene(text, filled=False)).scene.lights.tables
    assert isinstance(lights.choice, AliasTable)


def test_samples_fall_on_the_lights_as_often_as_they_are_chosen():
    scene_ = packed(LAMPS)
    count = 40_000
    point = (0.3, -0.9, 0.2)
    direction, _, _, target, gap = aim_at(scene_, point, count)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-14)
    way = target - np.array(point)
    np.testing.assert_allclose(way / np.linalg.norm(way, axis=1)[:, None], direction, atol=1e-7)
    assert (gap > 0.0).all()

    # Follow each ray past what may hide its light: the target is on an emitter.
    accel = built(*scene_.primitives)
    start = target - 10.0 * gap[:, None] * direction
    hits = cast(scene_.primitives, start, direction, accel=accel)
    names = [type(table).__name__ for table in scene_.primitives]
    result = Counter(
        (names[table], int(primitive))
        for table, primitive in zip(hits.table, hits.primitive, strict=True)
        if table >= 0
    )
    for row, probability in probabilities(scene_, point).items():
        expected = count * probability
        assert result[row] == pytest.approx(expected, abs=5.0 * math.sqrt(expected) + 1e-3 * count)


def test_density_of_a_sample_is_that_of_the_hit_it_aims_at():
    # Where both ways of finding a light give the same density, MIS weights sum to 1.
    scene_ = packed(LAMPS)
    point = (0.3, -0.9, 0.2)
    direction, _, pdf, target, _ = aim_at(scene_, point, 20_000)
    hits = cast(scene_.primitives, np.tile(point, (len(pdf), 1)), direction, accel=built(*scene_.primitives))
    same = np.linalg.norm(hits.point - target, axis=1) < 1e-5
    assert same.mean() > 0.5
    twin = pdf_of(scene_, hits.table[same], hits.primitive[same], point, hits.point[same], hits.normal[same])
    np.testing.assert_allclose(twin, pdf[same], rtol=1e-5)


def test_samples_of_instances_bring_the_light_of_all_of_them():
    scene_ = packed(
        "  - {type: instance, of: lamp, placements: [[{translate: [0, 2, 0]}], [{translate: [2, 0, 0]}]]}\n"
        "  - {type: quad, corner: [-5, -1, 5], edges: [[10, 0, 0], [0, 0, -10]], material: {type: lambertian}}\n",
        groups="groups: {lamp: [{type: sphere, center: [0, 0, 0], radius: 0.5, "
        "material: {type: emitter, radiance: 3}}]}\n",
        filled=False,
    )
    weight = aim(scene_.lights, scene_, (0.0, 0.0, 0.0), 100).weight
    # Two balls of radius 0.5 at 2 m, each drawn evenly over the cone that it fills.
    np.testing.assert_allclose(weight, 2.0 * 3.0 * 2.0 * math.pi * (1.0 - math.sqrt(1.0 - 0.25**2)), rtol=1e-6)


def test_density_of_what_does_not_emit_is_zero():
    scene_ = packed(LAMPS)
    names = [type(table).__name__ for table in scene_.primitives]
    table = np.array([names.index("Spheres"), names.index("Parallelograms")])
    point = np.array([[-3.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    normal = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    pdf = pdf_of(scene_, table, np.array([2, 1]), (0.0, 0.0, 0.0), point, normal)
    assert (pdf == 0.0).all()


def test_there_are_no_lights_to_choose_where_none_would_be_seen():
    lamp = "  - {type: sphere, center: [0, 2, 0], radius: 0.5, material: {type: emitter, radiance: 3}}\n"
    matte = "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}\n"
    black = "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0}}\n"
    mirror = "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal, fuzz: 0}}\n"
    glass = "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric}}\n"
    dark = "  - {type: sphere, center: [0, 2, 0], radius: 0.5, material: {type: emitter, radiance: 0}}\n"
    assert packed(lamp + matte, filled=False).lights is not None
    for objects in (lamp, matte, lamp + black, lamp + mirror, lamp + glass, dark + matte):
        assert packed(objects, filled=False).lights is None
    # What the camera sees at depth 1 is not lit by anything.
    assert packed(lamp + matte, filled=False, max_depth=1).lights is None


def test_reflected_light_of_a_single_emitter_draws_no_choice():
    # One emitter: probability 1, whatever its power.
    scene_ = packed(
        "  - {type: quad, corner: [0, 2, 0], edges: [[1, 0, 0], [0, 0, 1]], material: {type: emitter, radiance: 7}}\n"
        "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}\n"
    )
    assert len(scene_.lights.tables[0].table) == 1
    _, radiance, pdf, target, _ = aim_at(scene_, (0.5, 0.0, 0.5), 100)
    np.testing.assert_allclose(radiance, 7.0, rtol=1e-15)
    # Density of a square metre seen from 2 m below: d^3 / (2 A).
    distance = np.linalg.norm(target - [0.5, 0.0, 0.5], axis=1)
    np.testing.assert_allclose(pdf, distance**3 / 2.0, rtol=1e-12)


def warped_grid(cells):
    """The square [-1, 1]^2 at y = 3, facing down, as an OBJ mesh of 2 cells^2 triangles of very different sizes."""
    edges = np.linspace(-1.0, 1.0, cells + 1)
    edges = np.sign(edges) * np.abs(edges) ** 3
    lines = [f"v {x} 3 {z}" for x in edges for z in edges]
    for i in range(cells):
        for j in range(cells):
            a = i * (cells + 1) + j + 1
            b, c, d = a + 1, a + cells + 1, a + cells + 2
            lines += [f"f {a} {c} {b}", f"f {b} {c} {d}"]
    return "\n".join(lines)


def test_many_triangles_light_as_the_quad_that_they_make(tmp_path):
    (tmp_path / "grid.obj").write_text(warped_grid(100))
    lamp = "material: {type: emitter, radiance: [1, 2, 3]}}\n"
    floor = "  - {type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 9, material: {type: lambertian}}\n"
    mesh = packed(floor + "  - {type: mesh, file: grid.obj, " + lamp, base=tmp_path)
    quad = packed(floor + "  - {type: quad, corner: [-1, 3, -1], edges: [[2, 0, 0], [0, 0, 2]], " + lamp)
    (lights,) = mesh.lights.tables
    assert len(lights.table) == 20_000
    powers = lights.choice.nodes[len(lights.choice.row) :, 4]
    assert powers.max() > 1e4 * powers[powers > 0.0].min()
    (value, deviation), (other, other_deviation) = (
        (irradiance.mean(axis=0), irradiance.std(axis=0) / math.sqrt(len(irradiance)))
        for each in (mesh, quad)
        for light in [aim(each.lights, each, (0.2, 0.0, -0.1), 40_000)]
        for irradiance in [light.weight * light.direction[:, 1:2]]
    )
    np.testing.assert_array_less(np.abs(value - other), 4.0 * np.hypot(deviation, other_deviation))
    assert (deviation < 0.005 * value).all()
