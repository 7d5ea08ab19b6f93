"""A new material is one file: docs/examples/oren_nayar.py, with nothing else touched."""

import numpy as np
import pytest

from tests.plugins.exercise import code_lines, run_with_kind

ROUGHNESS = (0.0, 20.0, 60.0)
INCIDENCE = (10.0, 45.0, 75.0)

CODE = """
import raytracer as rt
from raytracer.scene.load import build
from raytracer.schema.registry import MATERIALS
from tests.plugins.materials.kernels import evaluate_many, incoming, scatter_many

kind = MATERIALS.specs()["oren_nayar"]
directions = np.array([incoming(degrees, azimuth) for degrees in {incidence} for azimuth in (0.0, 1.0, 3.0)])
out["directions"] = -directions
for roughness in {roughness}:
    spec = kind(albedo=(0.9, 0.5, 0.0), roughness=roughness)
    values = [evaluate_many(spec, tuple(direction), -directions) for direction in directions]
    out[f"value {{roughness}}"], out[f"pdf {{roughness}}"] = map(np.array, zip(*values))
    drawn = scatter_many(spec, incoming(60.0), 20_000)
    f_cos, pdf = evaluate_many(spec, incoming(60.0), drawn[0])
    out[f"drawn {{roughness}}"] = np.concatenate([drawn[1], drawn[2][:, None], f_cos, pdf[:, None]], axis=1)

scene = '''
camera: {{type: orthographic, look_from: [0, 0, 3], look_at: [0, 0, 0], height: 2}}
film: {{width: 32, height: 32}}
render: {{spp: 256, max_depth: 2}}
lights:
  - {{type: sun, direction: [0, 0, -1], irradiance: 1, angle: 0}}
materials:
  plaster: {{type: oren_nayar, albedo: 1, roughness: 30}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: plaster}}
'''
out["moon"] = rt.render(build(scene, "exercise.yaml"), threads=1).radiance
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    code = CODE.format(roughness=ROUGHNESS, incidence=INCIDENCE)
    return run_with_kind("materials", "oren_nayar.py", code, tmp_path_factory.mktemp("oren_nayar"))


def formula(light, view, roughness):
    """The paper's equation 30 with angles, for albedo 1: light and view are unit vectors round +z."""
    variance = np.radians(roughness) ** 2
    a, b = 1.0 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)
    theta_i, theta_o = np.arccos(light[2]), np.arccos(view[2])
    azimuth = np.arctan2(light[1], light[0]) - np.arctan2(view[1], view[0])
    slopes = np.sin(max(theta_i, theta_o)) * np.tan(min(theta_i, theta_o))
    return float((a + b * max(0.0, np.cos(azimuth)) * slopes) / np.pi)


def test_it_is_a_short_file():
    assert code_lines("oren_nayar.py") < 130


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
    y, x = (np.indices((32, 32)) - 15.5) / 16.0
    radius = np.hypot(x, y)
    cosine = np.sqrt(np.clip(1.0 - radius**2, 0.0, 1.0))
    inside = radius < 0.8
    ways = [np.array([s, 0.0, c]) for s, c in zip(radius[inside], cosine[inside], strict=True)]
    expected = [formula(way, way, 30.0) * way[2] for way in ways]
    np.testing.assert_allclose(made["moon"][..., 0][inside], expected, rtol=0.02)
