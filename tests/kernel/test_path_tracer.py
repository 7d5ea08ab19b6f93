"""The path tracer against scenes that have an answer in closed form.

Exact answers are asserted to rounding; estimates by their own standard deviation.  `a` is an albedo throughout.
"""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raytracer.rendering.render
from raytracer.core.compiler.dispatch import entry
from raytracer.kernel.path_state import workspace
from raytracer.kernel.pixel_accumulator import FilmView, accumulate
from raytracer.plugins.lights.base.interface import power_heuristic
from raytracer.scene.load import build
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.spec import SceneSpec
from tests.repository import REFERENCES
from tests.small_scenes import assert_mean, image, mean, rendered, scene

LOOK = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}\n"
CONSTANT = "environment: {type: constant, radiance: 1}\n"


# ---- Furnaces: everything is as bright as the environment, or as what reflects it


@pytest.mark.parametrize("albedo", [0.0, 0.3, 1.0])
def test_convex_body_in_a_uniform_environment_shows_its_albedo_without_noise(albedo: float) -> None:
    # All paths leave after one bounce with throughput a, into radiance 1: L = a (furnace test, Nori test-furnace.xml).
    for shape in ("{type: sphere, center: [0, 0, 0], radius: 3", "{type: box, min: [-3, -3, -3], max: [3, 3, 3]"):
        picture = image(
            f"""
camera: {{type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], vfov: 10}}
{CONSTANT}
objects:
  - {shape}, material: {{type: lambertian, albedo: {albedo}}}}}
""",
            spp=16,
        )
        np.testing.assert_allclose(picture.radiance, albedo, rtol=1e-12, atol=0.0)
        assert picture.variance is not None
        np.testing.assert_allclose(picture.variance, 0.0, atol=1e-24)


def test_white_room_with_furniture_in_a_uniform_environment_of_one_is_one() -> None:
    # Hard case 41: with a = 1 nothing is lost, so all radiance is 1, up to paths longer than max_depth.
    picture = image(
        f"""
camera: {{type: pinhole, look_from: [0, 1, 4], look_at: [0, 0, 0], vfov: 60}}
{CONSTANT}
materials:
  white: {{type: lambertian, albedo: 1}}
  mirror: {{type: metal, albedo: 1}}
  glass: {{type: dielectric, ior: 1.5}}
objects:
  - {{type: sphere, center: [0, -100.5, 0], radius: 100, material: white}}
  - {{type: sphere, center: [-1.1, 0, 0], radius: 0.5, material: mirror}}
  - {{type: sphere, center: [0, 0, 0], radius: 0.5, material: glass}}
  - {{type: sphere, center: [0, 0, 0], radius: -0.4, material: glass}}
  - {{type: box, min: [0.7, -0.499, -0.4], max: [1.4, 0.3, 0.3], material: glass}}
  - {{type: disc, center: [0, 1, -1], normal: [0, -1, 1], radius: 0.7, material: white}}
  - {{type: triangle, vertices: [[-2, -0.5, -2], [2, -0.5, -2], [0, 2, -2]], material: white}}
""",
        max_depth=4000,
        width=32,
        height=32,
        spp=32,
    )
    np.testing.assert_allclose(picture.radiance, 1.0, rtol=0.0, atol=1e-6)
    assert picture.variance is not None
    np.testing.assert_allclose(picture.variance, 0.0, atol=1e-12)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5, 2.4, 1.0 / 1.5])
def test_glass_sphere_in_a_uniform_environment_is_invisible(ior: float) -> None:
    # Hard case 22: each path picks reflection or refraction with weight 1 and ends in radiance 1.  The environment is
    # of the kind of the next test's, so that both compile one kernel.
    picture = image(
        f"""
{LOOK}
environment: {{type: gradient, horizon: 1, zenith: 1}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: dielectric, ior: {ior}}}}}
""",
        max_depth=100000,
    )
    np.testing.assert_allclose(picture.radiance, 1.0, rtol=0.0, atol=1e-12)


def test_glass_of_the_same_index_is_not_there() -> None:
    # Hard case 19: through a boundary of equal indices rays go straight, so the sky behind has the same bits, but for
    # the rounding of points on the way.
    sky = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: gradient, horizon: [1, 0, 2], zenith: [0, 5, 0]}
objects:
"""
    balls = """
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: 1}}
  - {type: box, min: [1.1, -1, -1], max: [1.5, 1, 1], material: {type: dielectric, ior: 1.5, outside_ior: 1.5}}
"""
    away = "  - {type: sphere, center: [0, 0, 9], radius: 1, material: {type: dielectric, ior: 1}}\n"
    np.testing.assert_allclose(image(sky + balls).radiance, image(sky + away).radiance, rtol=1e-12)


def _concentric(albedo: float, ratio: float, segments: float) -> float:
    """Radiance of the wall of a sphere of radius 1, albedo a, round a black sphere of radius `ratio` and radiance 1.

    From any point of the wall, the view factor of the small sphere is F = ratio^2, and that of the wall 1 - F (Howell,
    catalogue of view factors, C-139); both are the same for all points, so the radiance after n segments is the sum
    of a F [a (1 - F)]^k for k = 0 .. n - 2.
    """
    seen = ratio * ratio
    onwards = albedo * (1.0 - seen)
    return albedo * seen * (1.0 - onwards ** (segments - 1)) / (1.0 - onwards)


CONCENTRIC = """
camera: {{type: pinhole, look_from: [0, 0.5, 0.8], look_at: [0, 3, 0.8], up: [0, 0, 1], vfov: 20}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: {wall}, material: {{type: lambertian, albedo: {albedo}}}}}
  - {{type: sphere, center: [0, 0, 0], radius: {ratio}, material: {{type: emitter, radiance: 1}}}}
"""


@pytest.mark.parametrize("wall", [1.0, -1.0], ids=["outside out", "outside in"])
@pytest.mark.parametrize(("depth", "albedo", "ratio"), [(2, 0.8, 0.3), (3, 0.8, 0.3), (6, 0.8, 0.3), (200, 0.9, 0.4)])
def test_light_in_the_middle_of_a_sphere(wall: float, depth: int, albedo: float, ratio: float) -> None:
    # Lambertian walls reflect on both sides, so the sign of the radius must not matter.
    picture = image(CONCENTRIC.format(wall=wall, albedo=albedo, ratio=ratio), max_depth=depth, spp=256)
    assert_mean(picture, _concentric(albedo, ratio, depth))


def test_half_and_half_furnace() -> None:
    # Hard case 41 has a surface that emits 0.5 and reflects 0.5: 1 - 0.5^(n+1).  Here no material does both, so the
    # wall of the unit sphere reflects half, and the emitter of radiance 1 takes half of its view: F = 1/2, a = 1.
    # L = sum over k = 0 .. n - 2 of 0.5 * 0.5^k = 1 - 0.5^(n - 1), n counting the camera's segment.
    ratio = math.sqrt(0.5)
    text = CONCENTRIC.format(wall=1.0, albedo=1.0, ratio=ratio)
    for depth in (1, 2, 3, 4, 8):
        assert _concentric(1.0, ratio, depth) == pytest.approx(1.0 - 0.5 ** (depth - 1), rel=1e-12)
        picture = image(text, max_depth=depth, spp=256)
        if depth == 1:
            assert not picture.radiance.any()
        else:
            assert_mean(picture, 1.0 - 0.5 ** (depth - 1))


# ---- max_depth


MIRRORS = """
camera: {type: pinhole, look_from: [0, 0.5, 0], look_at: [1, 0.5, 0], vfov: 1}
objects:
  - {type: quad, corner: [3, -9, -9], edges: [[0, 18, 0], [0, 0, 18]], material: {type: metal, albedo: [0.5, 0.25, 1]}}
  - {type: disc, center: [-2, 0.5, 0], normal: [1, 0, 0], radius: 2, material: {type: emitter, radiance: [1, 2, 3]}}
"""


def test_max_depth_counts_segments() -> None:
    # Segment 1 ends on the mirror, segment 2 on the emitter behind the camera: L = a Le exactly, from depth 2 on.
    assert not image(MIRRORS, max_depth=1).radiance.any()
    for depth in (2, 3, 50):
        np.testing.assert_allclose(
            image(MIRRORS, max_depth=depth).radiance, np.broadcast_to([0.5, 0.5, 3.0], (16, 16, 3)), rtol=1e-12
        )


def test_max_depth_of_one_shows_emitters_and_environment_only() -> None:
    text = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 90}
environment: {type: constant, radiance: [0.1, 0.2, 0.3]}
objects:
  - {type: quad, corner: [-9, -9, 0], edges: [[9, 0, 0], [0, 18, 0]], material: {type: emitter, radiance: [7, 8, 9]}}
  - {type: quad, corner: [0, -9, 0], edges: [[2, 0, 0], [0, 18, 0]], material: {type: lambertian, albedo: 1}}
"""
    # Of 16 pixels, 8 are left of x = 0; 2 m at a distance of 4 m are 4 pixels; the rest is the environment.
    expected = np.zeros((16, 16, 3))
    expected[:, :8] = [7, 8, 9]
    expected[:, 12:] = [0.1, 0.2, 0.3]
    np.testing.assert_allclose(image(text, max_depth=1, spp=8).radiance, expected, rtol=1e-14)


@pytest.mark.parametrize("bounces", [1, 2, 5])
def test_parallel_mirrors_lose_the_albedo_at_every_bounce(bounces: int) -> None:
    # A ray that climbs 1 m a crossing between mirrors 1 m apart meets the lamp after `bounces` of them: a^bounces Le,
    # and black when the path may not be that long.
    text = f"""
camera: {{type: pinhole, look_from: [0.5, 0.5, 0], look_at: [1, 1, 0], up: [0, 0, 1], vfov: 0.1}}
materials:
  mirror: {{type: metal, albedo: 0.7}}
  lamp: {{type: emitter, radiance: 2, two_sided: true}}
objects:
  - {{type: quad, corner: [0, 0, -1], edges: [[0, {bounces + 0.5}, 0], [0, 0, 2]], material: mirror}}
  - {{type: quad, corner: [1, 0, -1], edges: [[0, {bounces + 0.5}, 0], [0, 0, 2]], material: mirror}}
  - {{type: quad, corner: [0, {bounces + 0.5}, -1], edges: [[0, 0, 2], [1, 0, 0]], material: lamp}}
"""
    np.testing.assert_allclose(image(text, max_depth=bounces + 1).radiance, 2.0 * 0.7**bounces, rtol=1e-12)
    assert not image(text, max_depth=bounces).radiance.any()


# ---- Glass in layers


@pytest.mark.parametrize(("ior", "transmitted"), [(1.5, 12.0 / 13.0), (2.4, None)])
@pytest.mark.parametrize("slabs", [1, 3])
def test_slabs_of_glass_at_normal_incidence(ior: float, transmitted: float | None, slabs: int) -> None:
    # N lossless interfaces with R = ((n-1)/(n+1))^2, all orders of reflection: T = (1-R) / (1+(N-1)R) (Stokes 1862);
    # a slab of 1.5 lets 0.923077 through.
    single = ((ior - 1.0) / (ior + 1.0)) ** 2
    interfaces = 2 * slabs
    expected = (1.0 - single) / (1.0 + (interfaces - 1) * single)
    if transmitted is not None and slabs == 1:
        assert expected == pytest.approx(transmitted, rel=1e-12)
    boxes = "\n".join(
        f"  - {{type: box, min: [-50, -50, {-1 - 2 * i}], max: [50, 50, {-2 * i}], material: glass}}"
        for i in range(slabs)
    )
    picture = image(
        f"""
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 0.01}}
materials:
  glass: {{type: dielectric, ior: {ior}}}
objects:
{boxes}
  - {{type: quad, corner: [-9, -9, -20], edges: [[18, 0, 0], [0, 18, 0]], material: {{type: emitter, radiance: 1}}}}
""",
        spp=512,
        max_depth=1000,
    )
    assert_mean(picture, expected)


def test_water_in_glass_refracts_by_the_ratio_of_indices() -> None:
    # At normal incidence R depends on n1/n2 alone: 1.33 in 1.5 reflects ((1.33-1.5)/(1.33+1.5))^2 = 0.003608.
    single = ((1.33 - 1.5) / (1.33 + 1.5)) ** 2
    picture = image(
        """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 0.01}
objects:
  - type: quad
    corner: [-9, -9, 0]
    edges: [[18, 0, 0], [0, 18, 0]]
    material: {type: dielectric, ior: 1.33, outside_ior: 1.5}
  - {type: disc, center: [0, 0, 5], normal: [0, 0, -1], radius: 3, material: {type: emitter, radiance: 1}}
""",
        spp=2048,
        width=32,
        height=32,
    )
    assert_mean(picture, single, relative_noise=0.02)


def test_snells_window() -> None:
    # From inside a pool of n = 1.5, the sky fills a cone with the sine 1/1.5 (41.81 deg); outside it, all is reflected.
    picture = image(
        f"""
camera: {{type: pinhole, look_from: [0, -1, 0], look_at: [0, 0, 0], up: [0, 0, 1], vfov: 120}}
{CONSTANT}
objects:
  - {{type: quad, corner: [-9, 0, 9], edges: [[18, 0, 0], [0, 0, -18]], material: {{type: dielectric, ior: 1.5}}}}
  - {{type: sphere, center: [0, -502, 0], radius: 500, material: {{type: emitter, radiance: 0}}}}
""",
        width=65,
        height=65,
        spp=64,
    )
    column, row = np.meshgrid(np.arange(65) - 32, np.arange(65) - 32)
    half = math.tan(math.radians(60.0)) / 32.5
    tangent = np.hypot(column, row) * half
    edge = math.tan(math.asin(1.0 / 1.5))
    assert not picture.radiance[tangent > edge + half].any()
    # At 0.8 of the edge's tangent, Fresnel's equations let 0.93 through; 64 samples know that to 0.03.
    assert (picture.radiance[tangent < 0.8 * edge] > 0.75).all()
    # In the middle, 1 - R with R = 0.04, in units that refraction leaves alone (L / n^2).
    assert_mean(
        image(
            f"""
camera: {{type: pinhole, look_from: [0, -1, 0], look_at: [0, 0, 0], up: [0, 0, 1], vfov: 0.1}}
{CONSTANT}
objects:
  - {{type: quad, corner: [-9, 0, 9], edges: [[18, 0, 0], [0, 0, -18]], material: {{type: dielectric, ior: 1.5}}}}
  - {{type: sphere, center: [0, -502, 0], radius: 500, material: {{type: emitter, radiance: 0}}}}
"""
        ),
        0.96,
    )


# ---- Lights


def floor_under(lamp: str, *, distance: float, albedo: float = 1.0, at: tuple[float, float] = (0.0, 0.0)) -> str:
    """A floor `distance` below the origin, seen from the side in a spot round (x, z) = `at`."""
    x, z = at
    spot = f"{x}, {-distance}, {z}"
    size = 20.0 * distance
    return f"""
camera: {{type: pinhole, look_from: [{x}, {-0.5 * distance}, {z + 3 * distance}], look_at: [{spot}], vfov: 0.001}}
objects:
  - {lamp}
  - type: quad
    corner: [{-size}, {-distance}, {size}]
    edges: [[{2 * size}, 0, 0], [0, 0, {-2 * size}]]
    material: {{type: lambertian, albedo: {albedo}}}
"""


LAMP = "material: {type: emitter, radiance: 5, two_sided: true}}"


@pytest.mark.parametrize(
    ("distance", "radius"),
    [(2.0, 1.0), (10.0, 1.0), (3.0, 0.1), (100.0, 0.01), (1e4, 1.0), (1e-2, 1e-3), (1e3, 0.05)],
)
def test_sphere_light_lights_by_the_inverse_square(distance: float, radius: float) -> None:
    # Irradiance of a sphere straight above: E = pi L (r/d)^2 at any distance (Howell C-21), so L_o = a L (r/d)^2.
    # The lamp lies at the origin, where its own coordinates are far smaller than the distance that float32 rounds.
    lamp = f"{{type: sphere, center: [0, 0, 0], radius: {radius}, {LAMP}"
    picture = image(floor_under(lamp, distance=distance), max_depth=2, spp=256)
    assert_mean(picture, 5.0 * (radius / distance) ** 2)


def test_sphere_light_off_axis() -> None:
    # A sphere wholly above the horizon gives E = pi L sin^2(alpha) cos(theta): d^2 = 2^2 + 1.5^2, cos = 2/d.
    lamp = f"{{type: sphere, center: [0, 0, 0], radius: 0.5, {LAMP}"
    squared = 2.0**2 + 1.5**2
    picture = image(floor_under(lamp, distance=2.0, at=(1.5, 0.0)), max_depth=2, spp=256)
    assert_mean(picture, 5.0 * 0.25 / squared * 2.0 / math.sqrt(squared))


@pytest.mark.parametrize(("distance", "radius"), [(1.0, 1.0), (2.0, 0.5), (100.0, 0.01), (1e3, 10.0)])
def test_disc_light_on_its_axis(distance: float, radius: float) -> None:
    # E = pi L r^2 / (r^2 + d^2) for a parallel disc, on its axis (Howell B-12 in the limit of a small receiver).
    lamp = f"{{type: disc, center: [0, 0, 0], normal: [0, -1, 0], radius: {radius}, {LAMP}"
    picture = image(floor_under(lamp, distance=distance), max_depth=2, spp=256)
    assert_mean(picture, 5.0 * radius**2 / (radius**2 + distance**2))


def lambert_irradiance(corners: NDArray[np.float64], normal: NDArray[np.float64]) -> float:
    """Irradiance at the origin, of a polygon of radiance 1 wholly above the plane of `normal`.

    References: Lambert 1760, "Photometria"; Baum et al. 1989, "Improving Radiosity Solutions Through the Use of
    Analytically Determined Form-Factors", eq. 7: E = 1/2 sum of the edges' angles times (edge normal . n).
    """
    total = 0.0
    for a, b in pairwise([*corners, corners[0]]):
        across = np.cross(a, b)
        angle = math.atan2(float(np.linalg.norm(across)), float(np.dot(a, b)))
        total += angle * float(np.dot(across / np.linalg.norm(across), normal))
    return 0.5 * abs(total)


POLYGONS = {
    "quad": (
        "{type: quad, corner: [-1, 0, -0.5], edges: [[2, 0, 0], [0, 0, 1]], ",
        [[-1, 0, -0.5], [1, 0, -0.5], [1, 0, 0.5], [-1, 0, 0.5]],
    ),
    "tilted quad": (
        "{type: quad, corner: [-0.3, 0, 0], edges: [[0.6, 0.3, 0], [0, 0.2, 1]], ",
        [[-0.3, 0, 0], [0.3, 0.3, 0], [0.3, 0.5, 1], [-0.3, 0.2, 1]],
    ),
    "triangle": (
        "{type: triangle, vertices: [[-1, 0, 0], [1, 0, 0.5], [0, 1, 2]], ",
        [[-1, 0, 0], [1, 0, 0.5], [0, 1, 2]],
    ),
    "small quad": (
        "{type: quad, corner: [0, 0, 0], edges: [[0.001, 0, 0], [0, 0, 0.001]], ",
        [[0, 0, 0], [0.001, 0, 0], [0.001, 0, 0.001], [0, 0, 0.001]],
    ),
}


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize(("distance", "at"), [(1.5, (0.0, 0.0)), (1.5, (2.0, -1.0)), (100.0, (3.0, 0.0))])
def test_polygon_light_against_lamberts_formula(name: str, distance: float, at: tuple[float, float]) -> None:
    text, corners = POLYGONS[name]
    point = np.array([at[0], -distance, at[1]])
    expected = 5.0 * lambert_irradiance(np.array(corners, dtype=float) - point, np.array([0.0, 1.0, 0.0])) / math.pi
    picture = image(floor_under(text + LAMP, distance=distance, at=at), max_depth=2, spp=256)
    assert_mean(picture, expected)


def test_box_light_is_the_sum_of_the_faces_in_view() -> None:
    # From (2, -1.5, 0), the faces x = 0.5 and y = -0.2 of the box are in view; Lambert's formula for each.
    point = np.array([2.0, -1.5, 0.0])
    bottom = np.array([[-0.5, -0.2, -0.3], [0.5, -0.2, -0.3], [0.5, -0.2, 0.3], [-0.5, -0.2, 0.3]])
    side = np.array([[0.5, -0.2, -0.3], [0.5, 0.2, -0.3], [0.5, 0.2, 0.3], [0.5, -0.2, 0.3]])
    up = np.array([0.0, 1.0, 0.0])
    expected = 5.0 * sum(lambert_irradiance(face - point, up) for face in (bottom, side)) / math.pi
    for sided in ("true", "false"):
        material = f"{{type: emitter, radiance: 5, two_sided: {sided}}}"
        lamp = f"{{type: box, min: [-0.5, -0.2, -0.3], max: [0.5, 0.2, 0.3], material: {material}}}"
        assert_mean(image(floor_under(lamp, distance=1.5, at=(2.0, 0.0)), max_depth=2, spp=1024), expected)


def test_shadow_of_a_disc_is_exactly_black() -> None:
    # Straight below a disc of radius 1 between a lamp of radius 0.1 and the floor, no part of the lamp is in view.
    lamp = f"{{type: sphere, center: [0, 0, 0], radius: 0.1, {LAMP}"
    shade = (
        "\n  - {type: disc, center: [0, -1, 0], normal: [0, 1, 0], radius: 1, material: {type: lambertian, albedo: 0}}"
    )
    assert not image(floor_under(lamp + shade, distance=2.0), max_depth=2).radiance.any()


def test_two_lights_add_up() -> None:
    # Two sphere lights straight above one another's axis: choosing one of them by power must not change the sum.
    lamps = f"""{{type: sphere, center: [0, 0, 0], radius: 0.2, {LAMP}
  - {{type: sphere, center: [1.5, 0, 0], radius: 0.1, material: {{type: emitter, radiance: 100}}}}"""
    squared = 2.0**2 + 1.5**2
    expected = 5.0 * 0.04 / 4.0 + 100.0 * 0.01 / squared * 2.0 / math.sqrt(squared)
    assert_mean(image(floor_under(lamps, distance=2.0), max_depth=2, spp=1024), expected)


# ---- Sides of emitters


SIDES = [
    ("{type: sphere, center: [0, 0, 0], radius: 1", True),
    ("{type: sphere, center: [0, 0, 0], radius: -1", False),
    ("{type: quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]]", True),
    ("{type: quad, corner: [-1, -1, 0], edges: [[0, 2, 0], [2, 0, 0]]", False),
    ("{type: disc, center: [0, 0, 0], normal: [0, 0, 2], radius: 1", True),
    ("{type: disc, center: [0, 0, 0], normal: [0, 0, -2], radius: 1", False),
    ("{type: triangle, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]", True),
    ("{type: triangle, vertices: [[-1, -1, 0], [0, 1, 0], [1, -1, 0]]", False),
    ("{type: box, min: [-1, -1, -1], max: [1, 1, 1]", True),
    ("{type: quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]], transform: [{scale: [-1, 1, 1]}]", True),
    ("{type: box, min: [-1, -1, -1], max: [1, 1, 1], transform: [{scale: [1, -1, 1]}]", True),
    ("{type: triangle, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], transform: [{scale: [-1, 1, 1]}]", True),
    ("{type: disc, center: [0, 0, 0], normal: [0, 0, 1], radius: 1, transform: [{scale: [-1, 1, 1]}]", True),
]


@pytest.mark.parametrize(("shape", "faces_camera"), SIDES)
@pytest.mark.parametrize("two_sided", [False, True])
def test_emitter_radiates_to_the_side_of_its_normal(shape: str, faces_camera: bool, two_sided: bool) -> None:
    # To the eye, and to a white floor in front of it (max_depth 2, so nothing else can light the floor).
    emitter = f"{shape}, material: {{type: emitter, radiance: 3, two_sided: {str(two_sided).lower()}}}}}"
    eye = f"""
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 5}}
objects:
  - {emitter}
"""
    expected = 3.0 if faces_camera or two_sided else 0.0
    np.testing.assert_array_equal(image(eye, max_depth=1, spp=8).radiance, expected)
    floor = f"""
camera: {{type: pinhole, look_from: [0, 0, 2.5], look_at: [0, 0, 4], vfov: 5}}
objects:
  - {emitter}
  - {{type: quad, corner: [-3, -3, 4], edges: [[6, 0, 0], [0, 6, 0]], material: {{type: lambertian, albedo: 1}}}}
"""
    lit = image(floor, max_depth=2).radiance
    assert (lit.min() > 0.01) if expected else not lit.any()


def test_inside_of_an_emitting_sphere() -> None:
    # A point anywhere inside a sphere that radiates inwards sees radiance 1 from everywhere: a floor shows a Le.
    for sphere in (
        "radius: -2, material: {type: emitter, radiance: 1}",
        "radius: 2, material: {type: emitter, radiance: 1, two_sided: true}",
    ):
        picture = image(
            f"""
camera: {{type: pinhole, look_from: [0, 1, 0], look_at: [0.3, 0, 0], vfov: 20}}
objects:
  - {{type: sphere, center: [0, 0, 0], {sphere}}}
  - {{type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 1, material: {{type: lambertian, albedo: 0.6}}}}
""",
            max_depth=2,
            spp=256,
        )
        assert_mean(picture, 0.6)


def test_distant_one_sided_sphere_light_has_no_dark_limb() -> None:
    # Every hit on a sphere from outside is on its outside, however grazing; float32 distances must not turn it round.
    picture = image(
        """
camera: {type: pinhole, look_from: [0, 0, 10000], look_at: [0, 0, 0], vfov: 0.0115}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: emitter, radiance: 1}}
""",
        width=64,
        height=64,
        spp=256,
        max_depth=1,
    )
    np.testing.assert_array_equal(picture.radiance, 1.0)


# ---- Multiple importance sampling


RECEIVERS = {
    "lambertian": "{type: lambertian, albedo: 0.8}",
    "rough metal": "{type: metal, albedo: 0.8, fuzz: 1}",
    "metal": "{type: metal, albedo: 0.8, fuzz: 0.3}",
}

EMITTERS = {
    "sphere": "{type: sphere, center: [0, 1.2, -1], radius: 0.5, ",
    "quad": "{type: quad, corner: [-0.5, 1, -1.5], edges: [[1, 0, 0], [0, 0.2, 1]], ",
    "disc": "{type: disc, center: [0, 1, -1], normal: [0.2, -1, 0], radius: 0.6, ",
    "box": "{type: box, min: [-0.4, 0.8, -1.4], max: [0.4, 1.2, -0.6], ",
    "triangle": "{type: triangle, vertices: [[-0.7, 1, -1.4], [0.7, 1, -1.4], [0, 1.1, -0.4]], ",
    "touching box": "{type: box, min: [-0.4, 0, -1.4], max: [0.4, 0.6, -0.6], ",
    "touching sphere": "{type: sphere, center: [0, 0.4, -1], radius: 0.4, ",
    "mesh": "{type: mesh, file: octahedron.obj, transform: [{scale: 0.5}, {translate: [0, 1.1, -1]}], ",
    "smooth mesh": "{type: mesh, file: octahedron.obj, smooth: true, transform: [{translate: [0, 1.5, -1]}], ",
}


def both_ways(monkeypatch: pytest.MonkeyPatch, text: str, **settings: object) -> None:
    """Render a picture with light sampling, and by sampling of the material alone."""
    with_lights = image(text, **settings)
    assert pack(scene(text, **settings)).scene.lights is not None

    def without_lights(spec: SceneSpec, **settings: Any) -> PackedScene:
        packed = pack(spec, **settings)
        return packed._replace(scene=packed.scene._replace(lights=None))

    monkeypatch.setattr(raytracer.rendering.render, "pack", without_lights)
    plain = image(text, seed=2, **settings)
    monkeypatch.undo()
    a, deviation_a = mean(with_lights)
    b, deviation_b = mean(plain)
    deviation = np.hypot(deviation_a, deviation_b)
    assert np.all(deviation < 0.02 * b), "too noisy to tell"
    assert np.all(np.abs(a - b) < 4.0 * deviation), (a, b, (a - b) / deviation)


@pytest.mark.parametrize("emitter", EMITTERS)
@pytest.mark.parametrize("receiver", RECEIVERS)
def test_light_sampling_leaves_the_mean_alone(monkeypatch: pytest.MonkeyPatch, emitter: str, receiver: str) -> None:
    both_ways(
        monkeypatch,
        f"""
camera: {{type: pinhole, look_from: [0, 1, 3], look_at: [0, 0, -0.5], vfov: 30}}
objects:
  - {EMITTERS[emitter]}material: {{type: emitter, radiance: 4, two_sided: true}}}}
  - {{type: quad, corner: [-2, 0, 2], edges: [[4, 0, 0], [0, 0, -4]], material: {RECEIVERS[receiver]}}}
""",
        spp=512,
        max_depth=3,
        base=REFERENCES,
    )


def test_light_sampling_with_several_lights_leaves_the_mean_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    lamps = "\n".join(
        f"  - {shape}material: {{type: emitter, radiance: {number + 1}}}}}"
        for number, shape in enumerate(
            shape.replace("[0, 1", "[0.7, 1") if number % 2 else shape
            for number, (name, shape) in enumerate(EMITTERS.items())
            if "mesh" not in name
        )
    )
    both_ways(
        monkeypatch,
        f"""
camera: {{type: pinhole, look_from: [0, 1, 3], look_at: [0, 0, -0.5], vfov: 40}}
objects:
{lamps}
  - {{type: quad, corner: [-2, 0, 2], edges: [[4, 0, 0], [0, 0, -4]], material: {{type: lambertian, albedo: 0.7}}}}
  - {{type: sphere, center: [-0.9, 0.3, 0], radius: 0.3, material: {{type: metal, albedo: 0.7, fuzz: 0.4}}}}
""",
        spp=512,
        max_depth=5,
    )


def test_russian_roulette_leaves_the_mean_alone() -> None:
    text = CONCENTRIC.format(wall=1.0, albedo=0.9, ratio=0.4)
    for start in (0, 1, 5):
        assert_mean(image(text, max_depth=200, rr_depth=start, spp=512), _concentric(0.9, 0.4, 200))


def test_russian_roulette_ends_paths() -> None:
    text = CONCENTRIC.format(wall=1.0, albedo=0.5, ratio=0.4)
    rays = {start: rendered(text, max_depth=100, rr_depth=start).stats.rays for start in (1, 1000)}
    assert rays[1] < 0.7 * rays[1000]


# ---- Light leaks


_TURN = "{rotate: {axis: [3, 1, -2], angle: 71}}"

ROOMS = {
    "box": "{type: box, min: [-0.7, -0.7, -0.7], max: [0.9, 1.1, 1.3]",
    "turned box": "{type: box, min: [-1, -1.1, -1.2], max: [1.3, 1.4, 1.5], transform: [" + _TURN + "]",
    "large box": "{type: box, min: [-0.7, -0.7, -0.7], max: [0.9, 1.1, 1.3], transform: [" + _TURN + ", {scale: 1000}]",
    "sphere": "{type: sphere, center: [0.1, 0, 0], radius: 2",
    "large sphere": "{type: sphere, center: [0, -900, 0], radius: 1000",
    "mesh": "{type: mesh, file: icosphere.obj",
    "large mesh": "{type: mesh, file: icosphere.obj, transform: [{scale: 1000}]",
}


def icosphere(path: Path, subdivisions: int = 3) -> None:
    """Write a closed mesh of 20 * 4^subdivisions triangles round the origin, with its vertices at a distance of 2."""
    from trimesh.creation import icosphere as make

    mesh = make(subdivisions, 2.0)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist())]))


@pytest.mark.parametrize("box", ROOMS)
def test_no_light_leaks_into_a_closed_room(tmp_path: Path, box: str) -> None:
    # Of 5 million rays not one may pass an edge or a corner, or start from beyond one.
    icosphere(tmp_path / "icosphere.obj")
    text = f"""
camera: {{type: pinhole, look_from: [0.1, 0.05, 0.3], look_at: [1, 0.9, 0.8], vfov: 140}}
environment: {{type: constant, radiance: 1}}
objects:
  - {ROOMS[box]}, material: {{type: lambertian, albedo: 1}}}}
"""
    result = rendered(text, width=64, height=64, spp=64, max_depth=20, base=tmp_path)
    assert result.stats.rays > 5e6
    assert not result.image.radiance.any()


# ---- Scale and place


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e6])
def test_picture_does_not_depend_on_the_unit_of_length(scale: float) -> None:
    # Radiance has no length in it: a scene built in millimetres or megametres has the same picture, but for noise.
    text = floor_under(f"{{type: sphere, center: [0, 0, 0], radius: {0.5 * scale}, {LAMP}", distance=2.0 * scale)
    assert_mean(image(text, max_depth=3, spp=128), 5.0 * 0.25**2)
    closed = CONCENTRIC.format(wall=scale, albedo=0.8, ratio=0.3 * scale).replace(
        "[0, 0.5, 0.8], look_at: [0, 3, 0.8]",
        f"[0, {0.5 * scale}, {0.8 * scale}], look_at: [0, {3 * scale}, {0.8 * scale}]",
    )
    assert_mean(image(closed, max_depth=50, spp=128), _concentric(0.8, 0.3, 50))


@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_picture_does_not_depend_on_the_place_in_the_world(shift: float) -> None:
    # At 1e3, Embree's float32 knows places to 6e-5; what it finds is solved again in float64.
    eye, at = [shift, 0.5, shift + 0.8], [shift, 3.0, shift + 0.8]
    text = f"""
camera: {{type: pinhole, look_from: {eye}, look_at: {at}, up: [0, 0, 1], vfov: 20}}
objects:
  - {{type: sphere, center: [{shift}, 0, {shift}], radius: 1, material: {{type: lambertian, albedo: 0.8}}}}
  - {{type: sphere, center: [{shift}, 0, {shift}], radius: 0.3, material: {{type: emitter, radiance: 1}}}}
"""
    assert_mean(image(text, max_depth=50, spp=256), _concentric(0.8, 0.3, 50))


# ---- Accuracy


@pytest.mark.parametrize("accuracy", ["fast", "robust"])
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e4])
def test_less_accuracy_has_the_same_mean(accuracy: str, scale: float) -> None:
    # Without float64 hits there is no self-shadowing either: that would darken by per cents.  The spot lies off the
    # floor's diagonal, along which Embree lets some rays through when it is not asked to be robust (hard case 11).
    distance, at = 3.0 * scale, (0.75 * scale, -0.25 * scale)
    lamp = f"{{type: sphere, center: [0, 0, 0], radius: {0.1 * scale}, {LAMP}"
    squared = 3.0**2 + 0.75**2 + 0.25**2
    picture = image(floor_under(lamp, distance=distance, at=at), max_depth=3, spp=256, accuracy=accuracy)
    assert_mean(picture, 5.0 * 0.01 / squared * 3.0 / math.sqrt(squared))
    quad = f"{{type: quad, corner: [0, 0, 0], edges: [[{scale}, 0, 0], [0, 0, {scale}]], {LAMP}"
    corners = scale * np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], float)
    irradiance = lambert_irradiance(corners - [at[0], -distance, at[1]], np.array([0.0, 1.0, 0.0]))
    picture = image(floor_under(quad, distance=distance, at=at), max_depth=2, spp=256, accuracy=accuracy)
    assert_mean(picture, 5.0 * irradiance / math.pi)
    eye, to = [0.0, 0.5 * scale, 0.8 * scale], [0.0, 3.0 * scale, 0.8 * scale]
    closed = f"""
camera: {{type: pinhole, look_from: {eye}, look_at: {to}, up: [0, 0, 1], vfov: 20}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: {scale}, material: {{type: lambertian, albedo: 0.8}}}}
  - {{type: sphere, center: [0, 0, 0], radius: {0.3 * scale}, material: {{type: emitter, radiance: 1}}}}
"""
    assert_mean(image(closed, max_depth=50, spp=256, accuracy=accuracy), _concentric(0.8, 0.3, 50))


@pytest.mark.parametrize("accuracy", ["fast", "robust"])
def test_less_accuracy_keeps_glass_invisible(accuracy: str) -> None:
    picture = image(
        f"""
{LOOK}{CONSTANT}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: dielectric, ior: 1.5}}}}
""",
        max_depth=100000,
        accuracy=accuracy,
    )
    np.testing.assert_allclose(picture.radiance, 1.0, rtol=0.0, atol=1e-12)


# ---- Keeping count


@entry
def _accumulate(film, work, values, size):
    for first in range(0, len(values), size):
        count = min(size, len(values) - first)
        for lane in range(count):
            for channel in range(3):
                work.radiance[lane, channel] = values[first + lane, channel]
            work.weight[lane] = 1.0
        accumulate(None, None, film, work, 0, 0, 0, count)


@entry
def _power_heuristic(pdf, other):
    return power_heuristic(pdf, other)


def _film(values: NDArray[np.float64], size: int) -> FilmView:
    film = FilmView(
        *(np.zeros((1, 1, 3)) for _ in range(2)), *(np.zeros((1, 1), np.int64) for _ in range(2)), 0, 0, None
    )
    _accumulate(film, workspace(), values, size)
    return film


@pytest.mark.parametrize("size", [1, 3, 8])
def test_running_mean_and_variance_do_not_cancel(size: int) -> None:
    # Hard case 42: for 100 + 0.01 U, E[x^2] - E[x]^2 in float32 says -134 where the variance is 8.3e-6.
    values = 100.0 + 0.01 * np.random.default_rng(1).random((1001, 3))
    film = _film(values, size)
    assert film.count[0, 0] == 1001
    np.testing.assert_allclose(film.mean[0, 0], values.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(film.m2[0, 0], ((values - values.mean(axis=0)) ** 2).sum(axis=0), rtol=1e-9)


def test_samples_that_are_not_numbers_are_dropped_and_counted() -> None:
    # Hard case 46: one NaN would blacken its pixel for good.
    values = np.ones((20, 3))
    values[3, 1] = np.nan
    values[9, 0] = np.inf
    values[16:18] = -np.inf
    film = _film(values, 8)
    assert (film.count[0, 0], film.bad[0, 0]) == (16, 4)
    np.testing.assert_array_equal(film.mean[0, 0], 1.0)
    np.testing.assert_array_equal(film.m2[0, 0], 0.0)
    assert _film(np.full((8, 3), np.nan), 8).bad[0, 0] == 8


def test_power_heuristic() -> None:
    # p^2 / (p^2 + q^2), whose weights add up to 1; hard case 37: squares must not overflow, nor 0/0 arise.
    assert _power_heuristic(3.0, 4.0) == pytest.approx(9.0 / 25.0)
    assert _power_heuristic(3.0, 4.0) + _power_heuristic(4.0, 3.0) == pytest.approx(1.0)
    assert _power_heuristic(1e300, 1e300) == 0.5
    assert _power_heuristic(1e-300, 1e300) == 0.0
    assert _power_heuristic(1e-300, 0.0) == 1.0
    # A direction without choice has all the weight.
    assert _power_heuristic(math.inf, 7.0) == 1.0


def test_rays_are_counted() -> None:
    # The mirrors' paths have two segments each, and no shadow rays.
    result = rendered(MIRRORS, spp=16, max_depth=9)
    assert result.stats.samples == 16 * 16 * 16
    assert result.stats.rays == 2 * result.stats.samples
    # A matte floor under one lamp: the camera's ray, one to the lamp, one that goes on to whatever there is.
    lamp = f"{{type: sphere, center: [0, 0, 0], radius: 0.1, {LAMP}"
    result = rendered(floor_under(lamp, distance=1.0), spp=16, max_depth=2)
    assert result.stats.rays == 3 * result.stats.samples


# ---- No scene at all


def test_scene_without_a_hit_is_its_environment() -> None:
    spec = build(
        """
film: {width: 4, height: 4}
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 9], vfov: 40}
environment: {type: constant, radiance: [1, 2, 3]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1}
""",
        "test.yaml",
    )
    picture = raytracer.rendering.render.render(spec, spp=1).image
    np.testing.assert_array_equal(picture.radiance, np.broadcast_to([1.0, 2.0, 3.0], (4, 4, 3)))
