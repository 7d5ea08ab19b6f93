"""A new camera and a new material are one file each, of docs/examples, with nothing else touched.

Both stand in one scene, of which cameras look at different places: one path tracer is compiled for all pictures.
"""

import ast
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from tests.repository import ROOT

EXAMPLES = ROOT / "docs" / "examples"
FILES = {"cameras": "axonometric.py", "materials": "oren_nayar.py"}

WIDTH, HEIGHT, SIZE, MOON = 48, 40, 5.0, 32
ROUGHNESS = (0.0, 20.0, 60.0)
INCIDENCE = (10.0, 45.0, 75.0)

CAMERAS = {
    "isometric": "look_from: [4, 4, 4], look_at: [0, 0, 0], height: 5",
    "cabinet": "look_from: [0, 0, 4], height: 5, depth_scale: 0.5, depth_angle: 45",
    "cavalier": "look_from: [0, 0, 4], height: 5, depth_scale: 1, depth_angle: 150 deg",
    "smoky": "look_from: [4, 4, 4], look_at: [0, 0, 0], height: 5, medium: smoke",
}
MOVING = """{type: axonometric, look_from: [4, 4, 4], look_at: [0, 0, 0], height: 5, medium: smoke,
  shutter: 1/8 s, shake: {amplitude: 0 deg, bandwidth: 10 Hz}, motion: {velocity: [1, 0, 0]}}"""

# Two small spheres stand for the ends of an edge along each axis; a box fills the picture.  Aside is the moon, and a
# speck of smoke: what nothing is made of would be another type.
SCENE = """
film: {{width: 48, height: 40}}
render: {{spp: 1, max_depth: 2}}
media:
  smoke: {{type: homogeneous, scattering: 0.001}}
materials:
  plaster: {{type: oren_nayar, albedo: 1, roughness: 30}}
lights:
  - {{type: sun, direction: [0, 0, -1], irradiance: 1, angle: 0}}
objects:
  - {{type: box, min: [-1, -1, -1], max: [1, 1, 1], material: plaster}}
  - {{type: sphere, name: origin, center: [0, 0, 0], radius: 0.1, material: {{type: dielectric, priority: 1}}}}
  - {{type: sphere, name: x, center: [1, 0, 0], radius: 0.1, material: plaster}}
  - {{type: sphere, name: y, center: [0, 1, 0], radius: 0.1, material: plaster}}
  - {{type: sphere, name: z, center: [0, 0, 1], radius: 0.1, material: plaster}}
  - {{type: sphere, center: [0, -9, 0], radius: 0.01, medium: smoke}}
  - {{type: sphere, center: [9, 0, 0], radius: 1, material: plaster}}
environment: {{type: constant, radiance: {environment}}}
camera: {camera}
"""

CODE = """
import importlib
import numpy as np
for family, folder in {paths!r}.items():
    importlib.import_module("raytracer.plugins." + family).__path__.append(folder)
import raytracer as rt
from raytracer.plugins.cameras.base.moving import pack_camera
from raytracer.scene.load import build
from raytracer.schema.registry import MATERIALS
from tests.core.motion.kernels import camera_rays
from tests.plugins.materials.kernels import evaluate_many, incoming, scatter_many

out = {{}}

def scene(camera, environment=1, **keys):
    return build({scene!r}.format(camera=camera, environment=environment), "exercise.yaml", keys)

def explained(name, spec):
    numbers = rt.explain(spec)
    for point in ("origin", "x", "y", "z"):
        place = numbers.objects[point]
        out[name + " " + point] = [place["x_px"], place["y_px"]]
    return numbers

def draw(name, spec):
    image = rt.render(spec, aovs=["position"], threads=1)
    out[name + " position"], out[name + " radiance"] = image.layers["position"], image.radiance

for name, keys in {cameras!r}.items():
    spec = scene("{{type: axonometric, " + keys + "}}")
    draw(name, spec)
    numbers = explained(name, spec)
    if name == "isometric":
        out["effects"] = [effect for effect, state in numbers.effects.items() if state.active]
        out["width"] = numbers.camera["view_width_m"]
moving = scene({moving!r})
explained("moving", moving)
for time in (0.0, 1.0):
    rays = camera_rays(pack_camera(moving.camera, 48, 40), np.array([7.0, 30.0]), np.array([9.0, 20.5]), time)
    out["rays at " + str(time)] = np.concatenate(rays, axis=1)
far = "{{type: axonometric, look_from: [9, 0, 3], look_at: [9, 0, 0], height: 2}}"
draw("moon", scene(far, 1e-30, **{{"film.width": {moon}, "film.height": {moon}, "render.spp": 64}}))

kind = MATERIALS.specs()["oren_nayar"]
directions = np.array([incoming(degrees, azimuth) for degrees in {incidence} for azimuth in (0.0, 1.0, 3.0)])
out["directions"] = -directions
for roughness in {roughness}:
    spec = kind(albedo=(0.9, 0.5, 0.0), roughness=roughness)
    values = [evaluate_many(spec, tuple(direction), -directions) for direction in directions]
    out[f"value {{roughness}}"], out[f"pdf {{roughness}}"] = map(np.array, zip(*values))
    ways, weight, density = scatter_many(spec, incoming(60.0), 20_000)
    f_cos, pdf = evaluate_many(spec, incoming(60.0), ways)
    out[f"drawn {{roughness}}"] = np.concatenate([weight, density[:, None], f_cos, pdf[:, None]], axis=1)
np.savez({result!r}, **out)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Arrays from a process whose families of plugins have the examples' files."""
    folder = tmp_path_factory.mktemp("exercises")
    for family, name in FILES.items():
        (folder / family).mkdir()
        shutil.copy(EXAMPLES / name, folder / family)
    paths = {family: str(folder / family) for family in FILES}
    code = CODE.format(
        paths=paths, result=str(folder / "out.npz"), scene=SCENE, cameras=CAMERAS, moving=MOVING, moon=MOON,
        incidence=INCIDENCE, roughness=ROUGHNESS,
    )  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    with np.load(folder / "out.npz") as arrays:
        return dict(arrays)


@pytest.mark.parametrize(("family", "most"), [("cameras", 80), ("materials", 130)])
def test_they_are_short_files(family, most):
    assert len((EXAMPLES / FILES[family]).read_text(encoding="utf-8").splitlines()) < most


# ---- The camera


def edges(made, name):
    """Pictures (3, 2) of the unit edges along x, y and z, right and up (m), as `project` gives them."""
    ends = np.array([made[f"{name} {axis}"] for axis in "xyz"])
    return (ends - made[f"{name} origin"]) * np.array([1.0, -1.0]) * (SIZE / HEIGHT)


def test_the_camera_imports_the_base_alone():
    tree = ast.parse((EXAMPLES / FILES["cameras"]).read_text())
    modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
    assert not [name for name in modules if name.startswith("raytracer.plugins") and ".base." not in name]


def test_isometric_edges_are_alike_and_120_degrees_apart(made):
    drawn = edges(made, "isometric")
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), np.sqrt(2.0 / 3.0), rtol=1e-6)
    cosines = drawn @ drawn.T / (2.0 / 3.0)
    np.testing.assert_allclose(cosines[np.triu_indices(3, 1)], -0.5, rtol=1e-6)
    # Up is up.
    assert drawn[1, 0] == pytest.approx(0.0, abs=1e-6)
    assert drawn[1, 1] > 0.0


@pytest.mark.parametrize(("name", "size", "degrees"), [("cabinet", 0.5, 45.0), ("cavalier", 1.0, 150.0)])
def test_oblique_edges_along_the_view_have_their_scale_and_angle(made, name, size, degrees):
    drawn = edges(made, name)
    np.testing.assert_allclose(drawn[:2], np.eye(2), atol=1e-6)
    # The edge along z comes towards the camera.
    away = -size * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    np.testing.assert_allclose(drawn[2], away, atol=1e-6)


@pytest.mark.parametrize("name", ["isometric", "cabinet", "cavalier"])
def test_points_land_where_the_formula_says(made, name):
    position = made[f"{name} position"].reshape(HEIGHT, WIDTH, -1)[..., :3]
    hit = np.isfinite(position).all(axis=-1) & (np.abs(position).max(axis=-1) > 0.5)
    assert 100 < hit.sum() < HEIGHT * WIDTH
    drawn = np.array([made[f"{name} origin"]]) + position @ edges(made, name) * np.array([1.0, -1.0]) * (HEIGHT / SIZE)
    y, x = np.indices((HEIGHT, WIDTH))
    # A sample lies in its pixel, the corners of which are whole numbers.
    for result, corner in ((drawn[..., 0], x), (drawn[..., 1], y)):
        inside = (result[hit] > corner[hit] - 1e-3) & (result[hit] < corner[hit] + 1.0 + 1e-3)
        assert inside.all()


def test_the_rest_of_the_program_knows_the_camera(made):
    # Smoke around the camera, which nothing ends, hides the environment and the sun.
    assert made["isometric radiance"].any()
    assert not made["smoky radiance"].any()
    # In the middle of the exposure it stands 1/16 m further along x, which is 1 / sqrt(2) to the right and 1 / sqrt(6)
    # downwards.
    way = np.array([-1.0 / np.sqrt(2.0), -1.0 / np.sqrt(6.0)]) / 16.0 * (HEIGHT / SIZE)
    np.testing.assert_allclose(made["moving origin"] - made["isometric origin"], way, atol=1e-6)
    # Rays go with it, and what they meet is seen where they began.
    opened, closed = made["rays at 0.0"], made["rays at 1.0"]
    np.testing.assert_allclose(closed - opened, [[0.125, *[0.0] * 8]] * 2, atol=1e-12)
    np.testing.assert_allclose(closed[:, 6:8], [[7.0, 9.0], [30.0, 20.5]], atol=1e-9)
    effects = set(made["effects"].tolist())
    assert "projection" in effects
    assert not {"defocus", "real_lens", "flare", "vignetting", "light_field"} & effects
    assert made["width"] == pytest.approx(SIZE * WIDTH / HEIGHT)
    assert all((made[f"{name} radiance"] >= 0.0).all() for name in CAMERAS)


# ---- The material


def formula(light, view, roughness):
    """The paper's equation 30 with angles, for albedo 1: light and view are unit vectors round +z."""
    variance = np.radians(roughness) ** 2
    a, b = 1.0 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)
    theta_i, theta_o = np.arccos(light[2]), np.arccos(view[2])
    azimuth = np.arctan2(light[1], light[0]) - np.arctan2(view[1], view[0])
    slopes = np.sin(max(theta_i, theta_o)) * np.tan(min(theta_i, theta_o))
    return float((a + b * max(0.0, np.cos(azimuth)) * slopes) / np.pi)


@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_it_is_the_formula_of_the_paper(made, roughness):
    directions = made["directions"]
    expected = [[formula(light, view, roughness) * view[2] for view in directions] for light in directions]
    value = made[f"value {roughness}"]
    np.testing.assert_allclose(value[..., 0], 0.9 * np.array(expected), rtol=1e-9)
    np.testing.assert_allclose(value[..., 1], 0.5 * np.array(expected), rtol=1e-9)
    assert not value[..., 2].any()
    np.testing.assert_allclose(made[f"pdf {roughness}"], np.broadcast_to(directions[:, 2] / np.pi, value.shape[:2]))


@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_weights_are_what_is_evaluated_over_the_density(made, roughness):
    weight, pdf, f_cos, density = np.split(made[f"drawn {roughness}"], [3, 4, 7], axis=1)
    np.testing.assert_allclose(density, pdf, rtol=1e-9)
    np.testing.assert_allclose(weight * pdf, f_cos, rtol=1e-9, atol=1e-12)
    # No more light is reflected than arrives.
    assert weight[:, 0].mean() < 0.9 * 1.001


def test_a_full_moon_is_flatter_than_a_lambertian_ball(made):
    # Lit and seen from the front, f cos i = (A + B sin i tan i) cos i / pi.
    y, x = (np.indices((MOON, MOON)) - 15.5) / 16.0
    radius = np.hypot(x, y)
    cosine = np.sqrt(np.clip(1.0 - radius**2, 0.0, 1.0))
    inside = radius < 0.8
    ways = [np.array([s, 0.0, c]) for s, c in zip(radius[inside], cosine[inside], strict=True)]
    expected = [formula(way, way, 30.0) * way[2] for way in ways]
    np.testing.assert_allclose(made["moon radiance"][..., 0][inside], expected, rtol=0.02)
