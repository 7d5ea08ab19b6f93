"""Light that goes straight through surfaces: along paths, along shadow rays, and out of lamps with holes."""

import numpy as np
import pytest

from raytracer.rendering.render import render
from tests.small_scenes import image, mean, scene

# Far below, a speck of each kind that any of these scenes has, so that all share one kernel.
SPECKS = """
  - type: quad
    corner: [0, -97, 0]
    edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]]
    material: {type: mixture, materials: [{type: lambertian, albedo: 0}, {type: cutout, material: {type: lambertian}}]}
  - {type: quad, corner: [0, -98, 0], edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]], material: {type: boundary}}
"""

CAMERA = "camera: {type: pinhole, look_from: [-2, 0, 4], look_at: [-0.5, 0, 0], vfov: 4}\n"
FLOOR = "  - {type: quad, corner: [-2, -2, 0], edges: [[4, 0, 0], [0, 4, 0]], material: {type: lambertian}}\n"
DARK = CAMERA + "objects:\n" + FLOOR


def gauze(z, opacity, corner=(-50, -50), edges=(100, 100)):
    """A black square between the camera and what is behind it; its normal points to the camera."""
    material = f"{{type: cutout, opacity: {opacity}, material: {{type: lambertian, albedo: 0}}}}"
    (x, y), (dx, dy) = corner, edges
    return f"  - {{type: quad, corner: [{x}, {y}, {z}], edges: [[{dx}, 0, 0], [0, {dy}, 0]], material: {material}}}\n"


def lamp(material="{type: emitter, radiance: 5}", *, z=2.0, half=0.5):
    """A square beside the camera's view that looks down on the floor."""
    corner, edges = [1.5 - half, half, z], [[2 * half, 0, 0], [0, -2 * half, 0]]
    return f"  - {{type: quad, corner: {corner}, edges: {edges}, material: {material}}}\n"


def shown(text, *, spp=4096, depth=2):
    value, deviation = mean(image(text + SPECKS, lit=True, width=8, height=8, spp=spp, max_depth=depth))
    return value[0], deviation[0]


def assert_equal(a, b, factor=1.0):
    """a is b times a factor, within the noise, which is at most a percent."""
    deviation = np.hypot(a[1], factor * b[1])
    assert deviation < 0.01 * a[0]
    assert abs(a[0] - factor * b[0]) < 4.0 * deviation + 1e-6 * a[0], (a, b, factor)


@pytest.mark.parametrize("depth", [pytest.param(1, marks=pytest.mark.slow), 2, 8])
@pytest.mark.parametrize("layers", [1, 3])
def test_half_of_the_light_passes_each_layer(layers, depth):
    # Black gauze before a sky of 1: what is seen is 2^-layers, whatever the depth, for passing counts no segment.
    text = CAMERA + "environment: {type: constant, radiance: 1}\nobjects:\n"
    value, deviation = shown(text + "".join(gauze(-k, 0.5) for k in range(layers)), depth=depth)
    assert abs(value - 0.5**layers) < 4.0 * deviation


def test_full_of_holes_is_not_there():
    assert_equal(shown(DARK + lamp() + gauze(1.0, 0.0), depth=8), shown(DARK + lamp(), depth=8))


def test_glass_of_the_same_index_is_not_there():
    # Hard case 19: through a boundary of equal indices rays go straight, so what is behind has the same bits, but for
    # the rounding of points on the way.
    stripes = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}\nobjects:\n"
    for number in range(8):
        shines = f"{{type: emitter, radiance: [{number}, 2, {number % 3}]}}"
        corner = [0.5 * number - 2.0, -3, -2]
        stripes += f"  - {{type: quad, corner: {corner}, edges: [[0.5, 0, 0], [0, 6, 0]], material: {shines}}}\n"
    balls = """
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: 1}}
  - {type: box, min: [1.1, -1, -1], max: [1.5, 1, 1], material: {type: dielectric, ior: 1.5, outside_ior: 1.5}}
"""
    without, with_balls = (image(stripes + more + SPECKS, lit=True).radiance for more in ("", balls))
    assert without.std() > 1.0
    np.testing.assert_allclose(with_balls, without, rtol=1e-12)


def test_gauze_halves_shadows():
    # The gauze lies between lamp and floor, and between camera and floor: light passes it twice.
    assert_equal(shown(DARK + lamp() + gauze(1.0, 0.5)), shown(DARK + lamp()), factor=0.25)


@pytest.mark.parametrize("half", [0.1, 1.4])
def test_lamps_with_holes_give_that_much_less(half):
    # A small lamp is found by aiming at it and a large one by paths: with any weights between the two the sum is right.
    expected = shown(DARK + lamp(half=half, z=1.0))
    holes = "{type: cutout, opacity: 0.3, material: {type: emitter, radiance: 5}}"
    mixed = "{type: mixture, weight: 0.7, materials: [{type: emitter, radiance: 5}, {type: lambertian, albedo: 0}]}"
    for material in (holes, mixed):
        assert_equal(shown(DARK + lamp(material, half=half, z=1.0)), expected, factor=0.3)


def test_a_lamp_behind_gauze_is_weighted_from_where_the_path_scattered():
    # A large lamp above the floor, close behind gauze: paths that pass the gauze find it as often as not.
    full = DARK + lamp(half=1.4, z=0.7)
    layers = "".join(gauze(z, 0.5, corner=(-0.2, -2), edges=(4, 4)) for z in (0.69, 0.6))
    # The camera looks past the gauze, and the lamp is seen through both layers of it.
    assert_equal(shown(full + layers), shown(full), factor=0.25)


def test_shadow_rays_are_counted_from_surface_to_surface():
    # A camera ray, a bounce and a shadow ray a sample; the boundary below the lamp cuts every shadow ray in two.
    def rays(below_lamp):
        spec = scene(DARK + lamp() + below_lamp + SPECKS, lit=True, width=8, height=8, max_depth=2)
        return render(spec, spp=4).stats.rays

    samples = 8 * 8 * 4
    assert rays("") == 3 * samples
    assert rays(lamp("{type: boundary}", z=1.9, half=1.0)) >= 4 * samples
