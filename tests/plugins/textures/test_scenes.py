"""Textures in whole pictures."""

import numpy as np
import pytest

from tests.small_scenes import image, mean

CAMERA = "camera: {type: pinhole, look_from: [0, 4, 4], look_at: [0, 0, 0], vfov: 40}\nobjects:\n"
FLOOR = "  - {type: quad, corner: [-3, 0, 3], edges: [[6, 0, 0], [0, 0, -6]], material: {type: lambertian}}\n"


def lamp(x, z, size, material):
    return (
        f"  - {{type: quad, corner: [{x}, 1, {z}], edges: [[{size}, 0, 0], [0, 0, {size}]], "
        f"material: {{type: emitter, radiance: {material}}}}}\n"
    )


@pytest.mark.slow
def test_a_lamp_with_a_texture_is_as_its_parts():
    # A checker of 2 x 2 cells, two of them black, and four lamps of one colour each.
    checker = "{type: checker, space: uv, scale: 0.5, even: [0, 0, 0], odd: [8, 4, 2]}"
    whole = image(CAMERA + FLOOR + lamp(-1, -1, 2, checker), spp=1024, filled=False)
    bright = lamp(0, -1, 1, "[8, 4, 2]") + lamp(-1, 0, 1, "[8, 4, 2]")
    parts = image(CAMERA + FLOOR + bright + lamp(-1, -1, 1, "0") + lamp(0, 0, 1, "0"), spp=1024, filled=False)
    (a, deviation_a), (b, deviation_b) = mean(whole), mean(parts)
    assert (np.abs(a - b) < 4.0 * np.hypot(deviation_a, deviation_b)).all()
    assert (np.hypot(deviation_a, deviation_b) < 0.005 * b).all()


@pytest.mark.slow
def test_solid_textures_and_relief_go_with_an_instance():
    # A ball placed by an instance and turned, seen by a camera that went along, is the ball itself; a mirror draws no
    # directions, which would not turn along.
    material = (
        "{type: metal, albedo: {type: noise, scale: 3, octaves: 2}, "
        "bump: {type: noise, scale: 5, seed: 1}, bump_height: 0.2}"
    )
    ball = f"{{type: sphere, center: [0.1, 0.2, 0.3], radius: 1, material: {material}}}"
    still = (
        "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}\n"
        "environment: {type: gradient, horizon: [1, 1, 1], zenith: [0, 0, 0]}\n"
    )
    # Turned by 90 degrees about y and shifted by 5 upwards: z becomes x.
    moved = still.replace("[0, 0, 4], look_at: [0, 0, 0]", "[4, 5, 0], look_at: [0, 5, 0]")
    pose = "transform: [{rotate: {axis: [0, 1, 0], angle: 90}}, {translate: [0, 5, 0]}]"
    a = image(still + f"objects:\n  - {ball}\n", spp=16, filled=False)
    b = image(
        moved + f"groups:\n  balls: [{ball}]\nobjects:\n  - {{type: instance, of: balls, {pose}}}\n",
        spp=16,
        filled=False,
    )
    # The same samples, up to rounding.
    assert np.quantile(np.abs(a.radiance - b.radiance), 0.98) < 1e-5
    assert np.ptp(a.radiance) > 0.3
