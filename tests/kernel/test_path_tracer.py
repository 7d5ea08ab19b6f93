"""The path tracer against scenes that have an answer in closed form.

Exact answers are asserted to rounding; estimates by their own standard deviation.  `a` is an albedo throughout.
"""

import functools
import math
from itertools import pairwise

import numpy as np
import pytest
import trimesh.creation
from scipy.spatial.transform import Rotation

from tests import small_scenes
from tests.repository import REFERENCES
from tests.small_scenes import assert_mean, mean

# All scenes here are of one type, but those whose settings make another.
image, rendered = (functools.partial(call, lit=True) for call in (small_scenes.image, small_scenes.rendered))

BLACK = 1e-20
"""More than all that the lights bring which only fill a scene up."""

SKY = "environment: {type: constant, radiance: 1}\nobjects:\n"


def pinhole(look_from, look_at, vfov, up=(0, 1, 0)):
    where = f"look_from: {list(look_from)}, look_at: {list(look_at)}, up: {list(up)}, vfov: {vfov}"
    return f"camera: {{type: pinhole, {where}}}\n"


LOOK = pinhole((0, 0, 4), (0, 0, 0), 40)


def test_max_depth_counts_the_segment_of_a_shadow_ray_too():
    # By way of a mirror it is two segments to the disc, and three to the lamp.  One packet alone, so that paths that go
    # on too long spoil no others.
    text = f"""{pinhole((0, 0.5, 0), (1, 0.5, 0), 1)}objects:
  - {{type: quad, corner: [3, -9, -9], edges: [[0, 18, 0], [0, 0, 18]], material: {{type: metal, albedo: 0.5}}}}
  - {{type: disc, center: [-2, 0.5, 0], normal: [1, 0, 0], radius: 2, material: {{type: lambertian, albedo: 0.8}}}}
  - {{type: sphere, center: [0, 3, 0], radius: 0.5, {LAMP}
"""
    two, three = (image(text, max_depth=depth, width=1, height=1, spp=8).radiance for depth in (2, 3))
    assert two.max() < BLACK
    assert three.min() > 0.01


# ---- Furnaces: everything is as bright as the environment, or as what reflects it


@pytest.mark.parametrize("albedo", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("shape", ["sphere, center: [0, 0, 0], radius: 3", "box, min: [-3, -3, -3], max: [3, 3, 3]"])
def test_convex_body_in_a_uniform_environment_shows_its_albedo_without_noise(albedo, shape):
    # All paths leave after one bounce with throughput a, into radiance 1: L = a (furnace test, Nori test-furnace.xml).
    body = f"  - {{type: {shape}, material: {{type: lambertian, albedo: {albedo}}}}}\n"
    picture = image(pinhole((0, 0, 9), (0, 0, 0), 10) + SKY + body, spp=16)
    np.testing.assert_allclose(picture.radiance, albedo, rtol=1e-12, atol=BLACK)
    np.testing.assert_allclose(picture.variance, 0.0, atol=1e-24)


def test_white_room_with_furniture_in_a_uniform_environment_of_one_is_one():
    # Hard case 41: with a = 1 nothing is lost, so all radiance is 1, up to paths longer than max_depth.
    text = """
materials:
  white: {type: lambertian, albedo: 1}
  mirror: {type: metal, albedo: 1}
  glass: {type: dielectric, ior: 1.5}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, -100.5, 0], radius: 100, material: white}
  - {type: sphere, center: [-1.1, 0, 0], radius: 0.5, material: mirror}
  - {type: sphere, center: [0, 0, 0], radius: 0.5, material: glass}
  - {type: sphere, center: [0, 0, 0], radius: -0.4, material: glass}
  - {type: box, min: [0.7, -0.499, -0.4], max: [1.4, 0.3, 0.3], material: glass}
  - {type: disc, center: [0, 1, -1], normal: [0, -1, 1], radius: 0.7, material: white}
  - {type: triangle, vertices: [[-2, -0.5, -2], [2, -0.5, -2], [0, 2, -2]], material: white}
"""
    picture = image(pinhole((0, 1, 4), (0, 0, 0), 60) + text, max_depth=4000, width=32, height=32, spp=32)
    np.testing.assert_allclose(picture.radiance, 1.0, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("ior", "accuracy"), [(1.5, "fast"), (1.5, "robust"), *((ior, "exact") for ior in (1.33, 1.5, 2.4, 1.0 / 1.5))]
)
def test_glass_sphere_in_a_uniform_environment_is_invisible(ior, accuracy):
    # Hard case 22: each path picks reflection or refraction with weight 1 and ends in radiance 1.
    glass = f"  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: dielectric, ior: {ior}}}}}\n"
    picture = image(LOOK + SKY + glass, max_depth=100000, accuracy=accuracy)
    np.testing.assert_allclose(picture.radiance, 1.0, rtol=0.0, atol=1e-12)


def _concentric(albedo, ratio, segments):
    """Radiance of the wall of a sphere of radius 1, albedo a, round a black sphere of radius `ratio` and radiance 1.

    From any point of the wall, the view factor of the small sphere is F = ratio^2, and that of the wall 1 - F (Howell,
    catalogue of view factors, C-139); both are the same for all points, so the radiance after n segments is the sum
    of a F [a (1 - F)]^k for k = 0 .. n - 2.
    """
    seen = ratio * ratio
    onwards = albedo * (1.0 - seen)
    return albedo * seen * (1.0 - onwards ** (segments - 1)) / (1.0 - onwards)


def concentric(albedo, ratio, *, scale=1.0, at=(0.0, 0.0, 0.0), side=1):
    x, y, z = at
    camera = pinhole((x, y + 0.5 * scale, z + 0.8 * scale), (x, y + 3.0 * scale, z + 0.8 * scale), 20, (0, 0, 1))
    wall, lamp = f"{{type: lambertian, albedo: {albedo}}}", "{type: emitter, radiance: 1}"
    return f"""{camera}objects:
  - {{type: sphere, center: {list(at)}, radius: {side * scale}, material: {wall}}}
  - {{type: sphere, center: {list(at)}, radius: {ratio * scale}, material: {lamp}}}
"""


@pytest.mark.parametrize("side", [1, -1], ids=["outside out", "outside in"])
@pytest.mark.parametrize(("depth", "albedo", "ratio"), [(2, 0.8, 0.3), (3, 0.8, 0.3), (6, 0.8, 0.3), (200, 0.9, 0.4)])
def test_light_in_the_middle_of_a_sphere(side, depth, albedo, ratio):
    # Lambertian walls reflect on both sides, so the sign of the radius must not matter.
    picture = image(concentric(albedo, ratio, side=side), max_depth=depth, spp=256)
    assert_mean(picture, _concentric(albedo, ratio, depth))


@pytest.mark.parametrize("depth", [1, 2, 3, 4, 8])
def test_half_and_half_furnace(depth):
    # Hard case 41 has a surface that emits 0.5 and reflects 0.5: 1 - 0.5^(n+1).  Here no material does both, so the
    # wall of the unit sphere reflects half, and the emitter of radiance 1 takes half of its view: F = 1/2, a = 1.
    # L = sum over k = 0 .. n - 2 of 0.5 * 0.5^k = 1 - 0.5^(n - 1), n counting the camera's segment.
    picture = image(concentric(1.0, math.sqrt(0.5)), max_depth=depth, spp=256)
    if depth == 1:
        assert picture.radiance.max() < BLACK
    else:
        assert_mean(picture, 1.0 - 0.5 ** (depth - 1))


# ---- max_depth


def test_max_depth_of_one_shows_emitters_and_environment_only():
    text = """
environment: {type: constant, radiance: [0.1, 0.2, 0.3]}
objects:
  - {type: quad, corner: [-9, -9, 0], edges: [[9, 0, 0], [0, 18, 0]], material: {type: emitter, radiance: [7, 8, 9]}}
  - {type: quad, corner: [0, -9, 0], edges: [[2, 0, 0], [0, 18, 0]], material: {type: lambertian, albedo: 1}}
"""
    # Of 16 pixels, 8 are left of x = 0; 2 m at a distance of 4 m are 4 pixels; the rest is the environment.
    expected = np.zeros((16, 16, 3))
    expected[:, :8] = [7, 8, 9]
    expected[:, 12:] = [0.1, 0.2, 0.3]
    picture = image(pinhole((0, 0, 4), (0, 0, 0), 90) + text, max_depth=1, spp=8)
    np.testing.assert_allclose(picture.radiance, expected, rtol=1e-14)


def corridor(bounces):
    """A ray that climbs 1 m a crossing between mirrors 1 m apart, and meets a lamp after so many of them."""
    top = bounces + 0.5
    return f"""{pinhole((0.5, 0.5, 0), (1, 1, 0), 0.1, (0, 0, 1))}
materials:
  mirror: {{type: metal, albedo: [0.7, 0.5, 1]}}
  lamp: {{type: emitter, radiance: [2, 4, 1], two_sided: true}}
objects:
  - {{type: quad, corner: [0, 0, -1], edges: [[0, {top}, 0], [0, 0, 2]], material: mirror}}
  - {{type: quad, corner: [1, 0, -1], edges: [[0, {top}, 0], [0, 0, 2]], material: mirror}}
  - {{type: quad, corner: [0, {top}, -1], edges: [[0, 0, 2], [1, 0, 0]], material: lamp}}
"""


@pytest.mark.parametrize("bounces", [1, 2, 5])
def test_parallel_mirrors_lose_the_albedo_at_every_bounce(bounces):
    # a^bounces Le, and black when the path may not be that long.
    expected = np.array([2.0 * 0.7**bounces, 4.0 * 0.5**bounces, 1.0])
    for depth in (bounces + 1, 50):
        picture = image(corridor(bounces), max_depth=depth, spp=16).radiance
        np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), rtol=1e-12)
    assert image(corridor(bounces), max_depth=bounces, spp=16).radiance.max() < BLACK


# ---- Glass in layers


@pytest.mark.parametrize(("ior", "slabs"), [(1.5, 1), (1.5, 3), (2.4, 1)])
def test_slabs_of_glass_at_normal_incidence(ior, slabs):
    # N lossless interfaces with R = ((n-1)/(n+1))^2, all orders of reflection: T = (1-R) / (1+(N-1)R) (Stokes 1862).
    single = ((ior - 1.0) / (ior + 1.0)) ** 2
    expected = (1.0 - single) / (1.0 + (2 * slabs - 1) * single)
    glass = f"material: {{type: dielectric, ior: {ior}}}"
    text = pinhole((0, 0, 4), (0, 0, 0), 0.01) + "objects:\n"
    text += "  - {type: quad, corner: [-9, -9, -20], edges: [[18, 0, 0], [0, 18, 0]], material: {type: emitter}}\n"
    for i in range(slabs):
        text += f"  - {{type: box, min: [-50, -50, {-1 - 2 * i}], max: [50, 50, {-2 * i}], {glass}}}\n"
    assert_mean(
        image(text.replace("{type: emitter}", "{type: emitter, radiance: 1}"), spp=512, max_depth=1000), expected
    )


def test_snells_window():
    # From inside a pool of n = 1.5, the sky fills a cone with the sine 1/1.5 (41.81 deg); outside it, all is reflected.
    surface = "  - {type: quad, corner: [-9, 0, 9], edges: [[18, 0, 0], [0, 0, -18]], material: {type: dielectric}}\n"
    ground = "  - {type: sphere, center: [0, -502, 0], radius: 500, material: {type: emitter, radiance: 0}}\n"
    pool = SKY + surface + ground
    picture = image(pinhole((0, -1, 0), (0, 0, 0), 120, (0, 0, 1)) + pool, width=65, height=65, spp=64)
    column, row = np.meshgrid(np.arange(65) - 32, np.arange(65) - 32)
    half = math.tan(math.radians(60.0)) / 32.5
    tangent = np.hypot(column, row) * half
    edge = math.tan(math.asin(1.0 / 1.5))
    assert picture.radiance[tangent > edge + half].max() < BLACK
    # At 0.8 of the edge's tangent, Fresnel's equations let 0.93 through; 64 samples know that to 0.03.
    assert (picture.radiance[tangent < 0.8 * edge] > 0.75).all()
    # In the middle, 1 - R with R = 0.04, in units that refraction leaves alone (L / n^2).
    assert_mean(image(pinhole((0, -1, 0), (0, 0, 0), 0.1, (0, 0, 1)) + pool), 0.96)


# ---- Lights


def floor_under(*lamps, distance, at=(0.0, 0.0)):
    """A white floor `distance` below the origin, seen from the side in a spot round (x, z) = `at`."""
    (x, z), size = at, 20.0 * distance
    camera = pinhole((x, -0.5 * distance, z + 3 * distance), (x, -distance, z), 0.001)
    return f"""{camera}objects:
  - type: quad
    corner: [{-size}, {-distance}, {size}]
    edges: [[{2 * size}, 0, 0], [0, 0, {-2 * size}]]
    material: {{type: lambertian, albedo: 1}}
""" + "".join(f"  - {lamp}\n" for lamp in lamps)


LAMP = "material: {type: emitter, radiance: 5, two_sided: true}}"


def sphere_lamp(radius, x=0.0, material=LAMP):
    return f"{{type: sphere, center: [{x}, 0, 0], radius: {radius}, {material}"


def sphere_irradiance(radius, distance, aside=0.0):
    """E / (pi L) of a sphere wholly above the horizon, of Howell C-21: (r / d)^2 cos(theta), at any distance."""
    squared = distance**2 + aside**2
    return radius**2 / squared * distance / math.sqrt(squared)


def lambert_irradiance(point, *faces):
    """E / (pi L) on a floor at a point, of polygons wholly above it.

    References: Lambert 1760, "Photometria"; Baum et al. 1989, "Improving Radiosity Solutions Through the Use of
    Analytically Determined Form-Factors", eq. 7: E = 1/2 sum of the edges' angles times (edge normal . n).
    """
    found = 0.0
    for corners in faces:
        total = 0.0
        for a, b in pairwise(np.array([*corners, corners[0]], float) - point):
            across = np.cross(a, b)
            total += math.atan2(np.linalg.norm(across), np.dot(a, b)) * across[1] / np.linalg.norm(across)
        found += 0.5 * abs(total) / math.pi
    return found


def lit_floors():
    """Lamps, the distance and the place of the floor's point that is seen, and its E / (pi L)."""
    # Lamps lie at the origin, where their own coordinates are far smaller than the distance that float32 rounds.
    for radius, distance in ((1, 2), (1, 10), (0.1, 3), (0.01, 100), (1, 1e4), (1e-3, 1e-2), (0.05, 1e3)):
        yield sphere_lamp(radius), distance, (0, 0), sphere_irradiance(radius, distance)
    yield sphere_lamp(0.5), 2, (1.5, 0), sphere_irradiance(0.5, 2, 1.5)
    for radius, distance in ((1, 1), (0.5, 2), (0.01, 100), (10, 1e3)):
        # Howell B-12 in the limit of a small receiver, for a parallel disc, on its axis.
        lamp = f"{{type: disc, center: [0, 0, 0], normal: [0, -1, 0], radius: {radius}, {LAMP}"
        yield lamp, distance, (0, 0), radius**2 / (radius**2 + distance**2)
    for distance, at in ((1.5, (0, 0)), (1.5, (2, -1)), (100, (3, 0))):
        point = np.array([at[0], -distance, at[1]])
        triangle = [[-1, 0, 0], [1, 0, 0.5], [0, 1, 2]]
        yield f"{{type: triangle, vertices: {triangle}, {LAMP}", distance, at, lambert_irradiance(point, triangle)
        for corner, *edges in (
            ([-1, 0, -0.5], [2, 0, 0], [0, 0, 1]),
            ([-0.3, 0, 0], [0.6, 0.3, 0], [0, 0.2, 1]),
            ([0, 0, 0], [1e-3, 0, 0], [0, 0, 1e-3]),
        ):
            c, u, v = map(np.array, (corner, *edges))
            lamp = f"{{type: quad, corner: {corner}, edges: {edges}, {LAMP}"
            yield lamp, distance, at, lambert_irradiance(point, [c, c + u, c + u + v, c + v])
    # From (2, -1.5, 0), the faces x = 0.5 and y = -0.2 of a box are in view.
    bottom = [[-0.5, -0.2, -0.3], [0.5, -0.2, -0.3], [0.5, -0.2, 0.3], [-0.5, -0.2, 0.3]]
    side = [[0.5, -0.2, -0.3], [0.5, 0.2, -0.3], [0.5, 0.2, 0.3], [0.5, -0.2, 0.3]]
    for lamp in (LAMP, LAMP.replace("true", "false")):
        box = f"{{type: box, min: [-0.5, -0.2, -0.3], max: [0.5, 0.2, 0.3], {lamp}"
        yield box, 1.5, (2, 0), lambert_irradiance([2.0, -1.5, 0.0], bottom, side)


@pytest.mark.parametrize(("lamp", "distance", "at", "expected"), list(lit_floors()))
def test_a_floor_is_lit_by_a_lamp_as_much_as_its_formula_says(lamp, distance, at, expected):
    # Of a box most samples are on faces that are turned away.
    spp = 2048 if "box" in lamp else 256
    assert_mean(image(floor_under(lamp, distance=distance, at=at), max_depth=2, spp=spp), 5.0 * expected)


def test_two_lights_add_up():
    # Choosing one of them by power must not change the sum.
    other = sphere_lamp(0.1, 1.5, "material: {type: emitter, radiance: 100}}")
    expected = 5.0 * sphere_irradiance(0.2, 2.0) + 100.0 * sphere_irradiance(0.1, 2.0, 1.5)
    assert_mean(image(floor_under(sphere_lamp(0.2), other, distance=2.0), max_depth=2, spp=1024), expected)


def test_shadow_of_a_disc_is_exactly_black():
    # Straight below a disc of radius 1 between a lamp of radius 0.1 and the floor, no part of the lamp is in view.
    shade = "{type: disc, center: [0, -1, 0], normal: [0, 1, 0], radius: 1, material: {type: lambertian, albedo: 0}}"
    assert image(floor_under(sphere_lamp(0.1), shade, distance=2.0), max_depth=2).radiance.max() < BLACK


# ---- Sides of emitters


FLIPPED, UPRIGHT = "transform: [{scale: [-1, 1, 1]}]", "transform: [{scale: [1, -1, 1]}]"
SIDES = [
    ("sphere, center: [0, 0, 0], radius: 1", True),
    ("sphere, center: [0, 0, 0], radius: -1", False),
    ("quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]]", True),
    ("quad, corner: [-1, -1, 0], edges: [[0, 2, 0], [2, 0, 0]]", False),
    ("disc, center: [0, 0, 0], normal: [0, 0, 2], radius: 1", True),
    ("disc, center: [0, 0, 0], normal: [0, 0, -2], radius: 1", False),
    ("triangle, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]", True),
    ("triangle, vertices: [[-1, -1, 0], [0, 1, 0], [1, -1, 0]]", False),
    ("box, min: [-1, -1, -1], max: [1, 1, 1]", True),
    (f"quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]], {FLIPPED}", True),
    (f"box, min: [-1, -1, -1], max: [1, 1, 1], {UPRIGHT}", True),
    (f"triangle, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], {FLIPPED}", True),
    (f"disc, center: [0, 0, 0], normal: [0, 0, 1], radius: 1, {FLIPPED}", True),
]


@pytest.mark.parametrize(("shape", "faces_camera"), SIDES)
@pytest.mark.parametrize("sided", ["false", "true"])
def test_emitter_radiates_to_the_side_of_its_normal(shape, faces_camera, sided):
    # To the eye, and to a white floor in front of it (max_depth 2, so nothing else can light the floor).
    emitter = f"objects:\n  - {{type: {shape}, material: {{type: emitter, radiance: 3, two_sided: {sided}}}}}\n"
    shines = faces_camera or sided == "true"
    seen = image(pinhole((0, 0, 4), (0, 0, 0), 5) + emitter, max_depth=2, spp=8).radiance
    np.testing.assert_allclose(seen, 3.0 * shines, atol=BLACK)
    floor = "  - {type: quad, corner: [-3, -3, 4], edges: [[6, 0, 0], [0, 6, 0]], material: {type: lambertian}}\n"
    lit = image(pinhole((0, 0, 2.5), (0, 0, 4), 5) + emitter + floor, max_depth=2).radiance
    assert (lit.min() > 0.01) if shines else lit.max() < BLACK


@pytest.mark.parametrize("wall", ["radius: -2, SIDED: false", "radius: 2, SIDED: true"])
def test_inside_of_an_emitting_sphere(wall):
    # A point anywhere inside a sphere that radiates inwards sees radiance 1 from everywhere: a floor shows a Le.
    wall = wall.replace("SIDED", "material: {type: emitter, radiance: 1, two_sided") + "}"
    text = f"""{pinhole((0, 1, 0), (0.3, 0, 0), 20)}objects:
  - {{type: sphere, center: [0, 0, 0], {wall}}}
  - {{type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 1, material: {{type: lambertian, albedo: 0.6}}}}
"""
    assert_mean(image(text, max_depth=2, spp=256), 0.6)


def test_distant_one_sided_sphere_light_has_no_dark_limb():
    # Every hit on a sphere from outside is on its outside, however grazing; float32 distances must not turn it round.
    lamp = "  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: emitter, radiance: 1}}\n"
    picture = image(pinhole((0, 0, 10000), (0, 0, 0), 0.0115) + SKY + lamp, width=64, height=64, spp=256, max_depth=2)
    np.testing.assert_array_equal(picture.radiance, 1.0)


# ---- Multiple importance sampling


EMITTERS = {
    "sphere": "{type: sphere, center: [0, 1.2, -1], radius: 0.5, ",
    "quad": "{type: quad, corner: [-0.5, 1, -1.5], edges: [[1, 0, 0], [0, 0.2, 1]], ",
    "disc": "{type: disc, center: [0, 1, -1], normal: [0.2, -1, 0], radius: 0.6, ",
    "box": "{type: box, min: [-0.4, 0.8, -1.4], max: [0.4, 1.2, -0.6], ",
    "triangle": "{type: triangle, vertices: [[-0.7, 1, -1.4], [0.7, 1, -1.4], [0, 1.1, -0.4]], ",
    "touching box": "{type: box, min: [-0.4, 0, -1.4], max: [0.4, 0.6, -0.6], ",
    "touching sphere": "{type: sphere, center: [0, 0.4, -1], radius: 0.4, ",
    "mesh": "{type: mesh, file: octahedron.obj, transform: [{scale: 0.5}, {translate: [0, 1.1, -1]}], ",
}
RECEIVERS = ("{type: lambertian, albedo: 0.8}", "{type: metal, albedo: 0.8, fuzz: 0.3}")


def assert_both_ways(objects, vfov=30, **settings):
    """A picture with light sampling has the mean of one by sampling of the material alone."""
    text = pinhole((0, 1, 3), (0, 0, -0.5), vfov) + "objects:\n" + objects
    settings |= {"spp": 512, "base": REFERENCES}
    a, deviation_a = mean(image(text, **settings))
    b, deviation_b = mean(image(text, seed=2, light_sampling="paths", **settings))
    deviation = np.hypot(deviation_a, deviation_b)
    assert np.all(deviation < 0.02 * b), "too noisy to tell"
    assert np.all(np.abs(a - b) < 4.0 * deviation), (a, b, (a - b) / deviation)


@pytest.mark.parametrize("emitter", EMITTERS)
@pytest.mark.parametrize("receiver", RECEIVERS)
def test_light_sampling_leaves_the_mean_alone(emitter, receiver):
    lamp = f"  - {EMITTERS[emitter]}material: {{type: emitter, radiance: 4, two_sided: true}}}}\n"
    floor = f"  - {{type: quad, corner: [-2, 0, 2], edges: [[4, 0, 0], [0, 0, -4]], material: {receiver}}}\n"
    assert_both_ways(lamp + floor, max_depth=3)


def test_light_sampling_with_several_lights_leaves_the_mean_alone():
    objects = "".join(
        f"  - {shape.replace('[0, 1', '[0.7, 1') if number % 2 else shape}"
        f"material: {{type: emitter, radiance: {number + 1}}}}}\n"
        for number, shape in enumerate(EMITTERS.values())
    )
    objects += """
  - {type: quad, corner: [-2, 0, 2], edges: [[4, 0, 0], [0, 0, -4]], material: {type: lambertian, albedo: 0.7}}
  - {type: sphere, center: [-0.9, 0.3, 0], radius: 0.3, material: {type: metal, albedo: 0.7, fuzz: 0.4}}
"""
    assert_both_ways(objects, vfov=40, max_depth=5)


@pytest.mark.parametrize("start", [0, 1, 5])
def test_russian_roulette_leaves_the_mean_alone(start):
    picture = image(concentric(0.9, 0.4), max_depth=200, rr_depth=start, spp=256)
    assert_mean(picture, _concentric(0.9, 0.4, 200))


# ---- Light leaks


_BOX, _CORNER = "{type: box, min: [-0.7, -0.7, -0.7], max: [0.9, 1.1, 1.3]", np.array([0.9, 1.1, 1.3])
_TURN = "{rotate: {axis: [3, 1, -2], angle: 71}}"
_TURNED = Rotation.from_rotvec(math.radians(71.0) * np.array([3.0, 1.0, -2.0]) / math.sqrt(14.0)).apply(_CORNER)
_VERTEX = trimesh.creation.icosphere(0, 2.0).vertices[0]

# What is round the camera, and where a corner of it is.
ROOMS = {
    "box": (_BOX, _CORNER),
    "turned box": (f"{_BOX}, transform: [{_TURN}]", _TURNED),
    "large box": (f"{_BOX}, transform: [{_TURN}, {{scale: 1000}}]", 1000.0 * _TURNED),
    "sphere": ("{type: sphere, center: [0.1, 0, 0], radius: 2", [1, 0.9, 0.8]),
    "large sphere": ("{type: sphere, center: [0, -900, 0], radius: 1000", [1, 0.9, 0.8]),
    "mesh": ("{type: mesh, file: icosphere.obj", _VERTEX),
    "large mesh": ("{type: mesh, file: icosphere.obj, transform: [{scale: 1000}]", 1000.0 * _VERTEX),
}


def icosphere(path, subdivisions=3):
    """Write a closed mesh of 20 * 4^subdivisions triangles round the origin, with its vertices at a distance of 2."""
    mesh = trimesh.creation.icosphere(subdivisions, 2.0)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist())]))


@pytest.mark.parametrize("room", ROOMS)
def test_no_light_leaks_into_a_closed_room(tmp_path, room):
    # Of millions of rays not one may pass an edge or a corner, or start from beyond one: paths start all over the
    # walls, beside edges, and so close to a corner that what float32 rounds is larger.
    icosphere(tmp_path / "icosphere.obj")
    shape, corner = ROOMS[room]
    rays = 0
    for vfov in (140, 0.1, 1e-5):
        text = pinhole((0.1, 0.05, 0.3), np.array(corner).tolist(), vfov) + SKY
        text += f"  - {shape}, material: {{type: lambertian, albedo: 1}}}}\n"
        result = rendered(text, width=32, height=32, spp=20, max_depth=20, base=tmp_path)
        assert result.image.radiance.max() < BLACK
        rays += result.stats.rays
    assert rays > 1.7e6


# ---- Scale, place and accuracy


@pytest.mark.parametrize("scale", [1e-3, 1e3, 1e6])
def test_picture_does_not_depend_on_the_unit_of_length(scale):
    # Radiance has no length in it: a scene built in millimetres or megametres has the same picture, but for noise.
    text = floor_under(sphere_lamp(0.5 * scale), distance=2.0 * scale)
    assert_mean(image(text, max_depth=3, spp=128), 5.0 * 0.25**2)
    assert_mean(image(concentric(0.8, 0.3, scale=scale), max_depth=50, spp=128), _concentric(0.8, 0.3, 50))


def test_picture_does_not_depend_on_the_place_in_the_world():
    # At 1e3, Embree's float32 knows places to 6e-5; what it finds is solved again in float64.
    picture = image(concentric(0.8, 0.3, at=(1e3, 0.0, 1e3)), max_depth=50, spp=256)
    assert_mean(picture, _concentric(0.8, 0.3, 50))


@pytest.mark.parametrize("accuracy", ["fast", "robust"])
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e4])
def test_less_accuracy_has_the_same_mean(accuracy, scale):
    # Without float64 hits there is no self-shadowing either: that would darken by per cents.  The spot lies off the
    # floor's diagonal, along which Embree lets some rays through when it is not asked to be robust (hard case 11).
    distance, at = 3.0 * scale, (0.75 * scale, -0.25 * scale)
    quad = f"{{type: quad, corner: [0, 0, 0], edges: [[{scale}, 0, 0], [0, 0, {scale}]], {LAMP}"
    corners = scale * np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], float)
    for lamp, expected in (
        (sphere_lamp(0.1 * scale), sphere_irradiance(0.1 * scale, distance, math.hypot(*at))),
        (quad, lambert_irradiance([at[0], -distance, at[1]], corners)),
    ):
        picture = image(floor_under(lamp, distance=distance, at=at), max_depth=2, spp=256, accuracy=accuracy)
        assert_mean(picture, 5.0 * expected)
    picture = image(concentric(0.8, 0.3, scale=scale), max_depth=50, spp=256, accuracy=accuracy)
    assert_mean(picture, _concentric(0.8, 0.3, 50))


# ---- Keeping count


def test_rays_are_counted():
    # Between mirrors no shadow rays.
    result = rendered(corridor(2), spp=16, max_depth=9)
    assert result.stats.samples == 16 * 16 * 16
    assert result.stats.rays == 3 * result.stats.samples
    # A matte floor under one lamp: the camera's ray, one to the lamp, one that goes on to whatever there is.
    result = rendered(floor_under(sphere_lamp(0.1), distance=1.0), spp=16, max_depth=2)
    assert result.stats.rays == 3 * result.stats.samples
    # Russian roulette ends paths.
    rays = [rendered(concentric(0.5, 0.4), max_depth=100, rr_depth=start).stats.rays for start in (1, 1000)]
    assert rays[0] < 0.7 * rays[1]
