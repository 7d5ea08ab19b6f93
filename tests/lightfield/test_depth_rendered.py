"""Depth, sharp and super-sampled pictures of a rendered array, against AOVs and renders of what they should be."""

import numpy as np
import PIL.Image
import pytest
from scipy import ndimage

import raytracer as rt
from raytracer.lightfield.super_resolution import upsample_cubic
from tests.lightfield.analytic import away

SCENE = """
camera: {type: camera_array, rows: 9, columns: 9, spacing: 20 mm, convergence_distance: 2, look_from: [0, 0, 0],
  look_at: [0, 0, -1], vfov: 35}
film: {width: 160, height: 120}
render: {spp: 64, max_depth: 2}
environment: {type: constant, radiance: [1, 1, 1]}
textures:
  a: {type: image, file: texture.png}
materials:
  wall: {type: lambertian, albedo: a}
objects:
  - {type: quad, corner: [-2, -2, -3.5], edges: [[4, 0, 0], [0, 4, 0]], material: wall}
  - {type: quad, corner: [-2, -0.6, -4], edges: [[4, 0, 0], [0, 0, 4]], material: wall}
  - {type: quad, corner: [-0.8, -0.45, -2.0], edges: [[0.7, 0, -0.5], [0, 0.9, 0]], material: wall}
  - {type: sphere, center: [0.4, 0.1, -1.9], radius: 0.3, material: wall}
"""
ARRAY = "type: camera_array, rows: 9, columns: 9, spacing: 20 mm, convergence_distance: 2,"


def sharpness(picture):
    return float((np.diff(picture, axis=0) ** 2).mean() + (np.diff(picture, axis=1) ** 2).mean())


@pytest.mark.slow
def test_against_renders(tmp_path):
    random = np.random.default_rng(0)
    noise = random.standard_normal((512, 512, 3))
    texture = sum(s * ndimage.gaussian_filter(noise, (s, s, 0), mode="wrap") for s in (1.5, 3.0, 6.0, 12.0, 24.0))
    texture = np.clip(0.5 + 0.22 * texture / texture.std(), 0.02, 0.98)
    PIL.Image.fromarray((255 * texture).astype(np.uint8)).save(tmp_path / "texture.png")
    (tmp_path / "array.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "pinhole.yaml").write_text(SCENE.replace(ARRAY, "type: pinhole,"), encoding="utf-8")

    field = rt.lightfield.of(rt.render(rt.load(tmp_path / "array.yaml"), aovs=("depth",)))
    found = rt.lightfield.depth_map(field)
    exact = np.asarray(field.layers["depth"][4, 4]).squeeze()
    sure = found.confidence >= 0.5
    assert sure.mean() > 0.8
    assert np.sqrt(((found.distance - exact)[sure] ** 2).mean()) < 0.02 * np.ptp(exact)
    assert np.median(np.abs(found.distance - exact)) < 0.004 * np.ptp(exact)

    pinhole = rt.render(rt.load(tmp_path / "pinhole.yaml"), spp=256).radiance
    sharp = rt.lightfield.all_in_focus(field, found)
    assert sharpness(sharp) > 0.95 * sharpness(pinhole)
    assert away(sharp, pinhole) < 0.06

    large = rt.load(tmp_path / "pinhole.yaml", {"film.width": 320, "film.height": 240})
    fine = rt.render(large, spp=256).radiance
    assert away(rt.lightfield.supersampled(field, 2, found), fine) < 0.75 * away(
        upsample_cubic(field.view(4, 4), 2), fine
    )
