"""Meshes with normals of vertices: they lose no light, and light samples agree with the material's."""

import numpy as np
import pytest

from raytracer.core.primitives.triangles import interpolated_normal
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import pack
from tests.kernel.test_path_tracer import icosphere
from tests.small_scenes import assert_mean, image, scene

CAMERA = "camera: {type: pinhole, look_from: [0, 0, 40], look_at: [0, 0, 0], vfov: 15}\n"
SKY = CAMERA + "environment: {type: constant, radiance: 1}\nobjects:\n"

# All of these send on all light that they get; of the last one nobody can tell that it shines.
WHITE = (
    "{type: lambertian, albedo: 1}",
    "{type: rough_conductor, albedo: 1, roughness: 0.5}",
    "{type: dielectric}",
    "{type: rough_dielectric, roughness: 0.4}",
    "{type: emitter, radiance: RADIANCE, two_sided: true}",
)


def balls(tmp_path, subdivisions, *, smooth=True, lamp=0.0, reach=1.0):
    """Smooth meshes of 20 * 4^subdivisions faces, one a white material, too far from each other for much light."""
    icosphere(tmp_path / "ball.obj", subdivisions)
    text = ""
    for number, material in enumerate(WHITE):
        x, y = 4.5 * (number % 3 - 1), 4.5 * (number // 3) - 2.25
        # A lamp that is to be out is out of sight, and brings as good as nothing.
        x, shines = (x, lamp) if lamp else (x if number < 4 else 1e4, 1e-30)
        steps = f"{{rotate: {{axis: [1, 2, 3], angle: {50 * number}}}}}, {{translate: [{reach * x}, {reach * y}, 0]}}"
        given = f"smooth: {str(smooth).lower()}, material: {material.replace('RADIANCE', str(shines))}"
        text += f"  - {{type: mesh, file: ball.obj, {given}, transform: [{steps}]}}\n"
    return text


@pytest.mark.parametrize("subdivisions", [1, 2, 3])
def test_a_white_furnace_hides_smooth_meshes(tmp_path, subdivisions):
    # Every path ends in the same light with the same weight, so there is no noise to hide a loss.  In coarse glass some
    # go round for thousands of segments.
    settings = {"width": 48, "height": 32, "max_depth": 100_000, "rr_depth": 100_000}
    radiance = image(SKY + balls(tmp_path, subdivisions), base=tmp_path, filled=False, **settings).radiance
    np.testing.assert_allclose(radiance, 1.0, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("subdivisions", [0, 2])
def test_smooth_meshes_that_shine_as_a_white_furnace_does_are_hidden_in_it(tmp_path, subdivisions):
    # Light samples of a smooth mesh, and paths that find it, bring together what the sky behind it would.
    text = SKY + balls(tmp_path, subdivisions, lamp=1.0, reach=0.9)
    settings = {"width": 48, "height": 32, "spp": 64, "max_depth": 1000}
    assert_mean(image(text, base=tmp_path, filled=False, **settings), 1.0, relative_noise=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [0, 1, 2])
def test_a_lamp_all_round_hides_smooth_meshes(tmp_path, subdivisions):
    lamp = "  - {type: sphere, center: [0, 0, 0], radius: -60, material: {type: emitter, radiance: 1}}\n"
    text = CAMERA + "objects:\n" + lamp + balls(tmp_path, subdivisions, lamp=1.0)
    picture = image(text, width=48, height=32, spp=256, max_depth=1000, base=tmp_path, filled=False)
    assert_mean(picture, 1.0, relative_noise=5e-4)


@pytest.mark.parametrize("smooth", [False, True])
def test_what_is_smooth_is_told_and_compiled(tmp_path, smooth):
    spec = scene(SKY + balls(tmp_path, 0, smooth=smooth), base=tmp_path, filled=False)
    packed = pack(spec).scene
    assert packed.normal_mapping == ((None, None) if smooth else None)
    effects = effects_of(spec, packed)
    assert effects["smooth_shading"].active is smooth
    assert not effects["relief"].active


def test_normals_of_the_inside_are_not_shaded_with():
    up, down, nothing = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
    east, leaning = (1.0, 0.0, 0.0), (0.6, 0.0, 0.8)
    assert interpolated_normal(leaning, leaning, leaning, 0.2, 0.3, up) == pytest.approx(leaning)
    for corner in (down, east, nothing):
        assert interpolated_normal(corner, corner, corner, 0.25, 0.25, up) == up
