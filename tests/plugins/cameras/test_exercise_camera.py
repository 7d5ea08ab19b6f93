"""A new camera is one file: docs/examples/axonometric.py, with nothing else touched."""

import ast

import numpy as np
import pytest

from tests.plugins.exercise import EXAMPLES, code_lines, run_with_kind

WIDTH, HEIGHT, SIZE = 48, 40, 5.0

CAMERAS = {
    "isometric": "{type: axonometric, look_from: [4, 4, 4], look_at: [0, 0, 0], height: 5}",
    "cabinet": "{type: axonometric, look_from: [0, 0, 4], height: 5, depth_scale: 0.5, depth_angle: 45}",
    "cavalier": "{type: axonometric, look_from: [0, 0, 4], height: 5, depth_scale: 1, depth_angle: 150 deg}",
    "moving": "{type: axonometric, look_from: [4, 4, 4], look_at: [0, 0, 0], height: 5, medium: smoke, "
    "shutter: 1/8 s, shake: {amplitude: 0 deg, bandwidth: 10 Hz}, motion: {velocity: [1, 0, 0]}}",
}

# Two small spheres stand for the ends of an edge along each axis; a floor fills the picture.
SCENE = """
film: {{width: 48, height: 40}}
render: {{spp: 1, max_depth: 2}}
media:
  smoke: {{type: homogeneous, scattering: 0.001}}
objects:
  - {{type: box, min: [-1, -1, -1], max: [1, 1, 1], material: {{type: lambertian}}}}
  - {{type: sphere, name: origin, center: [0, 0, 0], radius: 0.1, material: {{type: dielectric, priority: 1}}}}
  - {{type: sphere, name: x, center: [1, 0, 0], radius: 0.1, material: {{type: lambertian}}}}
  - {{type: sphere, name: y, center: [0, 1, 0], radius: 0.1, material: {{type: lambertian}}}}
  - {{type: sphere, name: z, center: [0, 0, 1], radius: 0.1, material: {{type: lambertian}}}}
environment: {{type: constant, radiance: 1}}
camera: {camera}
"""

CODE = """
import raytracer as rt
from raytracer.scene.load import build
cameras, scene = {cameras!r}, {scene!r}
for name, camera in cameras.items():
    spec = build(scene.format(camera=camera), "exercise.yaml")
    image = rt.render(spec, aovs=["position"], threads=1)
    out[name + " position"] = image.layers["position"]
    out[name + " radiance"] = image.radiance
    explained = rt.explain(spec)
    for point in ("origin", "x", "y", "z"):
        numbers = explained.objects[point]
        out[name + " " + point] = [numbers["x_px"], numbers["y_px"]]
    if name == "isometric":
        out["effects"] = [effect for effect, state in explained.effects.items() if state.active]
        out["width"] = explained.camera["view_width_m"]
"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    code = CODE.format(cameras=CAMERAS, scene=SCENE)
    return run_with_kind("cameras", "axonometric.py", code, tmp_path_factory.mktemp("axonometric"))


def edges(seen, name):
    """Pictures (3, 2) of the unit edges along x, y and z, right and up (m), as `project` gives them."""
    ends = np.array([seen[f"{name} {axis}"] for axis in "xyz"])
    return (ends - seen[f"{name} origin"]) * np.array([1.0, -1.0]) * (SIZE / HEIGHT)


def test_it_is_a_file_of_less_than_80_lines_that_imports_the_base_alone():
    assert code_lines("axonometric.py") < 80
    tree = ast.parse((EXAMPLES / "axonometric.py").read_text())
    modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
    assert not [name for name in modules if name.startswith("raytracer.plugins") and ".base." not in name]


def test_isometric_edges_are_alike_and_120_degrees_apart(seen):
    drawn = edges(seen, "isometric")
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), np.sqrt(2.0 / 3.0), rtol=1e-6)
    cosines = drawn @ drawn.T / (2.0 / 3.0)
    np.testing.assert_allclose(cosines[np.triu_indices(3, 1)], -0.5, rtol=1e-6)
    # Up is up.
    assert drawn[1, 0] == pytest.approx(0.0, abs=1e-6)
    assert drawn[1, 1] > 0.0


@pytest.mark.parametrize(("name", "size", "degrees"), [("cabinet", 0.5, 45.0), ("cavalier", 1.0, 150.0)])
def test_oblique_edges_along_the_view_have_their_scale_and_angle(seen, name, size, degrees):
    drawn = edges(seen, name)
    np.testing.assert_allclose(drawn[:2], np.eye(2), atol=1e-6)
    # The edge along z comes towards the camera.
    away = -size * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    np.testing.assert_allclose(drawn[2], away, atol=1e-6)


@pytest.mark.parametrize("name", ["isometric", "cabinet", "cavalier"])
def test_points_land_where_the_formula_says(seen, name):
    position = seen[f"{name} position"].reshape(HEIGHT, WIDTH, -1)[..., :3]
    hit = np.isfinite(position).all(axis=-1) & (np.abs(position).max(axis=-1) > 0.5)
    assert 100 < hit.sum() < HEIGHT * WIDTH
    drawn = np.array([seen[f"{name} origin"]]) + position @ edges(seen, name) * np.array([1.0, -1.0]) * (HEIGHT / SIZE)
    y, x = np.indices((HEIGHT, WIDTH))
    # A sample lies in its pixel, the corners of which are whole numbers.
    for result, corner in ((drawn[..., 0], x), (drawn[..., 1], y)):
        inside = (result[hit] > corner[hit] - 1e-3) & (result[hit] < corner[hit] + 1.0 + 1e-3)
        assert inside.all()


def test_the_rest_of_the_program_knows_it(seen):
    # Smoke around the camera, which nothing ends, hides the environment.
    assert seen["isometric radiance"].any()
    assert not seen["moving radiance"].any()
    # In the middle of the exposure it stands 1/16 m further along x, which is 1 / sqrt(2) to the right and 1 / sqrt(6)
    # downwards.
    way = np.array([-1.0 / np.sqrt(2.0), -1.0 / np.sqrt(6.0)]) / 16.0 * (HEIGHT / SIZE)
    np.testing.assert_allclose(seen["moving origin"] - seen["isometric origin"], way, atol=1e-6)
    effects = set(seen["effects"].tolist())
    assert "projection" in effects
    assert not {"defocus", "real_lens", "flare", "vignetting", "light_field"} & effects
    assert seen["width"] == pytest.approx(SIZE * WIDTH / HEIGHT)
    assert all((seen[f"{name} radiance"] >= 0.0).all() for name in CAMERAS)
