"""The principled material against glTF's formulas, and against materials that it must agree with."""

import numpy as np
import pytest

from raytracer.plugins.materials.principled import Principled
from raytracer.plugins.materials.rough_conductor import RoughConductor
from raytracer.plugins.textures.base.interface import ParameterPacker
from tests.plugins.materials.kernels import UP, emitted, evaluate_many, incoming, mirrored, scatter_many

RNG = np.random.default_rng(23)


def spec(**parameters):
    return Principled.model_validate({"type": "principled", **parameters})


def directions(count, *, both=False):
    """Unit vectors, of the upper hemisphere unless `both`."""
    vectors = RNG.normal(size=(count, 3))
    if not both:
        vectors[:, 2] = np.abs(vectors[:, 2])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def single(alpha, toward, outgoing):
    """D G / (4 cos) of glTF's appendix B, with Smith's height-correlated G, and cos of the half angle.

    D = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2); G / (4 nv nl) = 0.5 / (nl sqrt(a^2 + (1 - a^2) nv^2) + nv sqrt(...)).
    """
    half = toward + outgoing
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    nv, nl, nh = toward[2], outgoing[:, 2], half[:, 2]
    a2 = alpha * alpha
    d = a2 / (np.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    visible = 0.5 / (nl * np.sqrt(a2 + (1.0 - a2) * nv * nv) + nv * np.sqrt(a2 + (1.0 - a2) * nl * nl))
    return d * visible * nl, half @ toward


@pytest.mark.parametrize("degrees", [5.0, 50.0, 85.0])
@pytest.mark.parametrize("roughness", [0.2, 0.6, 1.0])
def test_coat_over_black_is_gltfs_specular_brdf(roughness, degrees):
    direction = incoming(degrees)
    outgoing = directions(200)
    value, _ = evaluate_many(spec(base_color=0.0, roughness=roughness), direction, outgoing)
    shape, cosine = single(roughness**2, -np.array(direction), outgoing)
    fresnel = 0.04 + 0.96 * (1.0 - cosine) ** 5
    np.testing.assert_allclose(value, np.repeat((fresnel * shape)[:, None], 3, axis=1), rtol=1e-9)


@pytest.mark.parametrize("roughness", [0.3, 0.8])
def test_metal_is_a_rough_conductor_with_schlicks_term(roughness):
    color = (1.0, 0.7, 0.3)
    metal = RoughConductor(albedo=color, roughness=roughness)
    for degrees in (0.0, 45.0, 80.0):
        outgoing = directions(200)
        value, _ = evaluate_many(spec(base_color=color, metallic=1.0, roughness=roughness), incoming(degrees), outgoing)
        expected, _ = evaluate_many(metal, incoming(degrees), outgoing)
        np.testing.assert_allclose(value, expected, rtol=1e-10, atol=1e-14)


def test_metallic_mixes_linearly():
    # The specification's mix(dielectric_brdf, metal_brdf, metallic).
    parameters = {"base_color": (0.9, 0.5, 0.2), "roughness": 0.5, "transmission": 0.3}
    outgoing = directions(300, both=True)
    plastic, metal, mixed = (
        evaluate_many(spec(**parameters, metallic=metallic), incoming(60.0), outgoing)[0]
        for metallic in (0.0, 1.0, 0.3)
    )
    np.testing.assert_allclose(mixed, 0.7 * plastic + 0.3 * metal, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize(
    "parameters",
    [
        {"base_color": (0.8, 0.3, 0.1), "roughness": 0.3},
        {"base_color": (0.8, 0.3, 0.1), "roughness": 1.0, "ior": 2.0},
        {"base_color": 1.0, "metallic": 0.6, "roughness": 0.7},
        {"base_color": 0.9, "transmission": 0.7, "roughness": 0.5},
    ],
)
def test_is_reciprocal(parameters):
    # Helmholtz: f(i, o) = f(o, i); of light that goes through, f is that of the flipped side, which is the same.
    material = spec(**parameters)
    a, b = directions(60), directions(60, both=True)
    there, _ = evaluate_many(material, -a, b)
    back, _ = evaluate_many(material, -b, a, normal=np.where(b[:, 2:] > 0.0, 1.0, -1.0) * UP)
    np.testing.assert_allclose(there / np.abs(b[:, 2:]), back / np.abs(a[:, 2:]), rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize(
    "parameters",
    [
        *({"roughness": roughness} for roughness in (0.0, 0.1, 0.5, 1.0)),
        {"roughness": 0.3, "ior": 3.0},
        {"roughness": 0.6, "metallic": 1.0},
        {"roughness": 0.6, "metallic": 0.4},
        {"roughness": 0.8, "transmission": 1.0},
        {"roughness": 0.0, "transmission": 0.5},
        {"roughness": 0.5, "specular": 0.0},
        {"roughness": 0.5, "ior": 1.0},
    ],
    ids=str,
)
def test_white_reflects_all_light(parameters):
    # A white furnace: whatever a white surface is made of, no light is lost.
    count = 100_000
    for degrees in (0.0, 60.0, 85.0, 89.9):
        _, weight, _ = scatter_many(spec(base_color=1.0, **parameters), incoming(degrees), count)
        mean, deviation = weight.mean(axis=0), weight.std(axis=0) / np.sqrt(count)
        assert np.abs(mean - 1.0).max() < 5.0 * deviation.max() + 1e-3, (degrees, mean, deviation)


@pytest.mark.parametrize("roughness", [0.0, 0.3])
@pytest.mark.parametrize(
    "parameters", [{"specular": 0.0}, {"ior": 1.0}, {"metallic": 1.0}, {"transmission": 1.0, "specular": 0.0}], ids=str
)
def test_what_reflects_nothing_ends_paths(parameters, roughness):
    # No lobe has a share then, which the shares of the others would be divided by.  Metal by Schlick's fit still
    # reflects what does not come head on.
    black = spec(base_color=0.0, roughness=roughness, **parameters)
    for degrees in (0.0, 60.0):
        outgoing, weight, pdf = scatter_many(black, incoming(degrees), 1000)
        assert np.isfinite(outgoing).all()
        assert (pdf > 0.0).all()
        if "metallic" in parameters:
            assert (weight >= 0.0).all()
            assert weight.mean() <= 1.0
        else:
            assert not weight.any()


def test_coat_of_no_index_is_lambertian():
    outgoing = directions(100)
    for bare in ({"ior": 1.0}, {"specular": 0.0}):
        value, _ = evaluate_many(spec(base_color=(0.2, 0.5, 0.8), roughness=0.3, **bare), incoming(70.0), outgoing)
        np.testing.assert_allclose(value, outgoing[:, 2:] * np.array([0.2, 0.5, 0.8]) / np.pi, rtol=1e-12)


def test_smooth_coat_mirrors_by_schlick():
    direction = incoming(60.0)
    count = 50_000
    outgoing, weight, pdf = scatter_many(spec(base_color=0.5, roughness=0.0), direction, count)
    sharp = np.isinf(pdf)
    np.testing.assert_allclose(outgoing[sharp], np.tile(mirrored(direction), (sharp.sum(), 1)), atol=1e-14)
    # What the mirrored direction brings on average is Schlick's term.
    expected = 0.04 + 0.96 * 0.5**5
    brought = np.where(sharp, weight[:, 0], 0.0)
    assert brought.mean() == pytest.approx(expected, abs=5.0 * brought.std() / np.sqrt(count))
    # And a light that is aimed at finds the body alone.
    value, _ = evaluate_many(spec(base_color=0.0, roughness=0.0), direction, directions(50))
    assert not value.any()


def test_smooth_glass_lets_light_straight_through():
    direction = incoming(40.0)
    outgoing, weight, _ = scatter_many(
        spec(base_color=(0.5, 1.0, 0.2), transmission=1.0, roughness=0.0), direction, 50_000
    )
    through = outgoing[:, 2] < 0.0
    np.testing.assert_allclose(outgoing[through], np.tile(direction, (through.sum(), 1)), atol=1e-14)
    cosine = np.cos(np.radians(40.0))
    fresnel = 0.04 + 0.96 * (1.0 - cosine) ** 5
    brought = np.where(through[:, None], weight, 0.0)
    deviation = brought.std(axis=0) / np.sqrt(len(brought))
    np.testing.assert_array_less(
        np.abs(brought.mean(axis=0) - (1.0 - fresnel) * np.array([0.5, 1.0, 0.2])), 5 * deviation
    )


@pytest.mark.parametrize(
    ("parameters", "lit"),
    [
        ({}, True),
        ({"base_color": 0.0, "roughness": 0.5}, True),
        ({"base_color": 1.0, "metallic": 1.0, "roughness": 0.1}, True),
        ({"base_color": 1.0, "metallic": 1.0, "roughness": 0.0}, False),
        ({"base_color": 0.0, "roughness": 0.0}, False),
        ({"base_color": 0.0, "specular": 0.0}, False),
        ({"base_color": 0.9, "transmission": 1.0, "roughness": 0.0}, False),
    ],
)
def test_aiming_at_lights_is_for_what_can_be_lit(parameters, lit):
    assert spec(**parameters).has_non_delta_bsdf() == lit


@pytest.mark.parametrize(
    ("parameters", "front", "back", "power"),
    [
        ({}, 0.0, 0.0, 0.0),
        ({"emission": (1, 2, 3)}, 1.0, 0.0, 6.0),
        ({"emission": (1, 2, 3), "two_sided": True}, 1.0, 1.0, 12.0),
    ],
)
def test_emission_by_its_sides(parameters, front, back, power):
    lamp = spec(**parameters)
    np.testing.assert_array_equal(emitted(lamp, True), front * np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(emitted(lamp, False), back * np.array([1.0, 2.0, 3.0]))
    assert lamp.emitted_power(ParameterPacker()) == power
