"""The package from Python, as README shows it."""

import numpy as np

import raytracer as rt

SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
film: {width: 24, height: 16}
render: {spp: 4, max_depth: 5}
environment: {type: constant, radiance: 0.5}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
"""


def test_load_render_save(tmp_path):
    assert not hasattr(rt, "nonsense")
    path = tmp_path / "ball.yaml"
    path.write_text(SCENE)
    scene = rt.load(path, {"film.width": 12})
    image = rt.render(scene, spp=8)
    assert image.radiance.shape == (16, 12, 3)
    assert image.radiance.dtype == np.float64
    assert image.samples == 8
    # The corner sees the environment alone.
    np.testing.assert_array_equal(image.radiance[0, 0], 0.5)
    image.save(tmp_path / "ball.png")
    assert (tmp_path / "ball.png").read_bytes() == image._repr_png_()
