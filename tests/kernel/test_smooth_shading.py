"""Meshes with normals of vertices: they lose no light, and light samples agree with the material's."""

from pathlib import Path

import numpy as np
import pytest

from raytracer.core.primitives.triangles import interpolated_normal
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import pack
from tests.kernel.test_path_tracer import icosphere
from tests.small_scenes import assert_mean, rendered, scene

CAMERA = "camera: {type: pinhole, look_from: [0, 0, 40], look_at: [0, 0, 0], vfov: 15}\n"

# All of these send on all light that they get.
WHITE = (
    "{type: lambertian, albedo: 1}",
    "{type: rough_conductor, albedo: 1, roughness: 0.5}",
    "{type: dielectric}",
    "{type: rough_dielectric, roughness: 0.4}",
)


def balls(tmp_path: Path, subdivisions: int, *, smooth: bool = True) -> str:
    """Smooth meshes of 20 * 4^subdivisions faces, one a white material, too far from each other for much light."""
    icosphere(tmp_path / "ball.obj", subdivisions)
    return "".join(
        f"  - {{type: mesh, file: ball.obj, smooth: {str(smooth).lower()}, material: {material}, "
        f"transform: [{{rotate: {{axis: [1, 2, 3], angle: {50 * number}}}}}, "
        f"{{translate: [{4.5 * (number % 3 - 1)}, {4.5 * (number // 3) - 2.25}, 0]}}]}}\n"
        for number, material in enumerate(WHITE)
    )


@pytest.mark.parametrize("subdivisions", [1, 2, 3])
def test_a_white_furnace_hides_smooth_meshes(tmp_path: Path, subdivisions: int) -> None:
    # Every path ends in the same light with the same weight, so there is no noise to hide a loss.  In coarse glass some
    # go round for thousands of segments.
    text = CAMERA + "environment: {type: constant, radiance: 1}\nobjects:\n" + balls(tmp_path, subdivisions)
    settings = {"width": 48, "height": 32, "max_depth": 100_000, "rr_depth": 100_000}
    radiance = rendered(text, base=tmp_path, filled=False, **settings).image.radiance
    np.testing.assert_allclose(radiance, 1.0, rtol=0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [0, 1, 2])
def test_a_lamp_all_round_hides_smooth_meshes(tmp_path: Path, subdivisions: int) -> None:
    lamp = "  - {type: sphere, center: [0, 0, 0], radius: -60, material: {type: emitter, radiance: 1}}\n"
    text = CAMERA + "objects:\n" + lamp + balls(tmp_path, subdivisions)
    picture = rendered(text, width=48, height=32, spp=256, max_depth=1000, base=tmp_path, filled=False).image
    assert_mean(picture, 1.0, relative_noise=5e-4)


def test_what_is_smooth_is_told_and_compiled(tmp_path: Path) -> None:
    text = CAMERA + "environment: {type: constant, radiance: 1}\nobjects:\n"
    packed = {
        smooth: pack(scene(text + balls(tmp_path, 0, smooth=smooth), base=tmp_path, filled=False)).scene
        for smooth in (False, True)
    }
    assert packed[False].normal_mapping is None
    assert packed[True].normal_mapping == (None, None)
    for smooth, of_scene in packed.items():
        spec = scene(text + balls(tmp_path, 0, smooth=smooth), base=tmp_path, filled=False)
        effects = effects_of(spec, of_scene)
        assert effects["smooth_shading"].active is smooth
        assert not effects["relief"].active


def test_normals_of_the_inside_are_not_shaded_with() -> None:
    up, down, nothing = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
    east, leaning = (1.0, 0.0, 0.0), (0.6, 0.0, 0.8)
    assert interpolated_normal(leaning, leaning, leaning, 0.2, 0.3, up) == pytest.approx(leaning)
    for corner in (down, east, nothing):
        assert interpolated_normal(corner, corner, corner, 0.25, 0.25, up) == up
