"""Light that goes straight through surfaces: along paths, along shadow rays, and out of lamps with holes."""

import numpy as np
import pytest

from raytracer.rendering.render import render
from tests.small_scenes import image, mean, scene

# Every scene holds, far below, a speck of each kind that any of them has, so that all share one kernel.
SPECKS = """
  - type: quad
    corner: [0, -97, 0]
    edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]]
    material: {type: emitter, radiance: 1.0e-9}
  - type: quad
    corner: [0, -98, 0]
    edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]]
    material: {type: mixture, materials: [{type: lambertian, albedo: 0}, {type: cutout, material: {type: lambertian}}]}
  - {type: quad, corner: [0, -99, 0], edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]], material: {type: boundary}}
"""

CAMERA = "camera: {type: pinhole, look_from: [-2, 0, 4], look_at: [-0.5, 0, 0], vfov: 4}\n"
SKY = "environment: {type: constant, radiance: 1}\n"
NIGHT = "environment: {type: constant, radiance: 1.0e-12}\n"

FLOOR = "  - {type: quad, corner: [-2, -2, 0], edges: [[4, 0, 0], [0, 4, 0]], material: {type: lambertian}}\n"


def gauze_quad(z: float, material: str) -> str:
    """A large square between the camera and what is behind it; its normal points to the camera."""
    return f"  - {{type: quad, corner: [-50, -50, {z}], edges: [[100, 0, 0], [0, 100, 0]], material: {material}}}\n"


def gauze(opacity: float) -> str:
    return f"{{type: cutout, opacity: {opacity}, material: {{type: lambertian, albedo: 0}}}}"


def lamp(material: str, *, z: float = 2.0, half: float = 0.5) -> str:
    """A square beside the camera's view that looks down on the floor."""
    corner, edges = [1.5 - half, half, z], [[2 * half, 0, 0], [0, -2 * half, 0]]
    return f"  - {{type: quad, corner: {corner}, edges: {edges}, material: {material}}}\n"


def shown(text: str, *, spp: int = 8192, depth: int = 8) -> tuple[float, float]:
    picture = image(text + SPECKS, filled=False, width=8, height=8, spp=spp, max_depth=depth)
    value, deviation = mean(picture)
    return float(value[0]), float(deviation[0])


def assert_equal(a: tuple[float, float], b: tuple[float, float], factor: float = 1.0) -> None:
    """a is b times a factor, within the noise, which is at most a percent."""
    deviation = float(np.hypot(a[1], factor * b[1]))
    assert deviation < 0.01 * a[0]
    assert abs(a[0] - factor * b[0]) < 4.0 * deviation + 1e-6 * a[0], (a, b, factor)


@pytest.mark.parametrize("depth", [pytest.param(1, marks=pytest.mark.slow), 2, 8])
@pytest.mark.parametrize("layers", [1, 3])
def test_half_of_the_light_passes_each_layer(layers: int, depth: int) -> None:
    # Black gauze before a sky of 1: what is seen is 2^-layers, whatever the depth, for passing counts no segment.
    text = CAMERA + SKY + "objects:\n" + "".join(gauze_quad(-k, gauze(0.5)) for k in range(layers))
    value, deviation = shown(text, depth=depth)
    assert abs(value - 0.5**layers) < 4.0 * deviation


def test_full_of_holes_is_not_there() -> None:
    with_gauze = CAMERA + NIGHT + "objects:\n" + FLOOR
    with_gauze += lamp("{type: emitter, radiance: 5}") + gauze_quad(1.0, gauze(0.0))
    without = CAMERA + NIGHT + "objects:\n" + FLOOR + lamp("{type: emitter, radiance: 5}")
    assert_equal(shown(with_gauze), shown(without))


def test_gauze_halves_shadows() -> None:
    # The gauze lies between lamp and floor, and between camera and floor: light passes it twice.
    lit = CAMERA + NIGHT + "objects:\n" + FLOOR + lamp("{type: emitter, radiance: 5}")
    dimmed = shown(lit + gauze_quad(1.0, gauze(0.5)), depth=2)
    assert_equal(dimmed, shown(lit, depth=2), factor=0.25)


@pytest.mark.parametrize("half", [0.1, 1.4])
def test_lamps_with_holes_give_that_much_less(half: float) -> None:
    # A small lamp is found by aiming at it and a large one by paths: with any weights between the two the sum is right.
    full = CAMERA + NIGHT + "objects:\n" + FLOOR + lamp("{type: emitter, radiance: 5}", half=half, z=1.0)
    holes = "{type: cutout, opacity: 0.3, material: {type: emitter, radiance: 5}}"
    mixed = "{type: mixture, weight: 0.7, materials: [{type: emitter, radiance: 5}, {type: lambertian, albedo: 0}]}"
    expected = shown(full, depth=2)
    for material in (holes, mixed):
        text = CAMERA + NIGHT + "objects:\n" + FLOOR + lamp(material, half=half, z=1.0)
        assert_equal(shown(text, depth=2), expected, factor=0.3)


def test_a_lamp_behind_gauze_is_weighted_from_where_the_path_scattered() -> None:
    # A large lamp above the floor, close behind gauze: paths that pass the gauze find it as often as not.
    full = CAMERA + NIGHT + "objects:\n" + FLOOR + lamp("{type: emitter, radiance: 5}", half=1.4, z=0.7)
    text = full + "".join(
        f"  - {{type: quad, corner: [-0.2, -2, {z}], edges: [[4, 0, 0], [0, 4, 0]], material: {gauze(0.5)}}}\n"
        for z in (0.69, 0.6)
    )
    # The camera looks past the gauze, and the lamp is seen through both layers of it.
    assert_equal(shown(text, depth=2), shown(full, depth=2), factor=0.25)


def test_shadow_rays_are_counted_from_surface_to_surface() -> None:
    # A camera ray, a bounce and a shadow ray a sample; the boundary below the lamp cuts every shadow ray in two.
    def rays(below_lamp: str) -> int:
        text = CAMERA + NIGHT + "objects:\n" + FLOOR + lamp("{type: emitter, radiance: 1}") + below_lamp + SPECKS
        return render(scene(text, filled=False, width=8, height=8, max_depth=2), spp=4).stats.rays

    samples = 8 * 8 * 4
    assert rays("") == 3 * samples
    assert rays(lamp("{type: boundary}", z=1.9, half=1.0)) >= 4 * samples
