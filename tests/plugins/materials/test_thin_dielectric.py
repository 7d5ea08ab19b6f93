"""Panes of glass, and glass that absorbs."""

import math

import numpy as np
import pytest

from raytracer.core.fresnel import fresnel_dielectric
from raytracer.core.geometry import Site
from raytracer.plugins.materials.base.interface import row
from raytracer.plugins.materials.dielectric import Dielectric
from raytracer.plugins.materials.thin_dielectric import ThinDielectric, pane_reflectance
from raytracer.plugins.textures.base.interface import ParameterPacker
from tests.plugins.materials.kernels import incoming, mirrored, scatter_many
from tests.small_scenes import image, mean
from tests.vectorised import rows, vectorised


def test_a_pane_reflects_the_sum_over_all_orders():
    # Light that went to and fro k times within leaves with R^k: R + T R T + T R^3 T + ...
    cosine, ior = (values.ravel() for values in np.meshgrid(np.cos(np.radians([0, 45, 80, 89])), [1.33, 1.5, 2.4]))
    single = vectorised(fresnel_dielectric)(rows(cosine), rows(ior))[:, 0]
    orders = single ** (1 + 2 * np.arange(2000)[:, None])
    total = single + (1.0 - single) ** 2 * orders.sum(axis=0)
    np.testing.assert_allclose(vectorised(pane_reflectance)(rows(cosine), rows(ior)), total, rtol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 75.0])
def test_a_pane_mirrors_or_lets_straight_through(degrees):
    count = 50_000
    direction = incoming(degrees)
    outgoing, weight, pdf = scatter_many(ThinDielectric(ior=1.5, color=(0.2, 0.5, 1.0)), direction, count)
    up = outgoing[:, 2] > 0.0
    np.testing.assert_array_equal(outgoing[~up], np.tile(direction, ((~up).sum(), 1)))
    np.testing.assert_allclose(outgoing[up], np.tile(mirrored(direction), (up.sum(), 1)), atol=1e-15)
    assert np.isinf(pdf).all()
    assert (weight[up] == 1.0).all()
    np.testing.assert_array_equal(weight[~up], np.tile([0.2, 0.5, 1.0], ((~up).sum(), 1)))
    expected = pane_reflectance(math.cos(math.radians(degrees)), 1.5)
    assert up.mean() == pytest.approx(expected, abs=5.0 * math.sqrt(expected * (1.0 - expected) / count))


def test_a_pane_of_nothing_is_not_seen():
    outgoing, weight, _ = scatter_many(ThinDielectric(ior=1.0), incoming(89.99), 1000)
    np.testing.assert_array_equal(outgoing, np.tile(incoming(89.99), (1000, 1)))
    assert (weight == 1.0).all()


# ---- Absorption


def test_absorption_is_by_the_way_inside():
    glass = Dielectric(absorption=(0.0, 1.0, 10.0), outside_absorption=(3.0, 0.0, 0.0))
    table = Dielectric.pack([glass], ParameterPacker())
    for distance in (0.0, 0.25, 2.0):
        material = row(table, 0, None, Site((0.0, 0.0, 0.0), 0.0, 0.0, distance))
        np.testing.assert_allclose(
            material.transmittance_inside, np.exp(-np.array([0.0, 1.0, 10.0]) * distance), rtol=1e-15
        )
        np.testing.assert_allclose(material.transmittance_outside, (math.exp(-3.0 * distance), 1.0, 1.0), rtol=1e-15)


def test_attenuation_has_its_color_after_its_distance():
    glass = Dielectric(attenuation_color=(0.25, 0.5, 1.0), attenuation_distance=0.02)
    table = Dielectric.pack([glass], ParameterPacker())
    for distance, power in ((0.02, 1.0), (0.06, 3.0)):
        material = row(table, 0, None, Site((0.0, 0.0, 0.0), 0.0, 0.0, distance))
        np.testing.assert_allclose(material.transmittance_inside, (0.25**power, 0.5**power, 1.0), rtol=1e-14)


def test_clear_glass_has_no_absorption_compiled_in():
    assert Dielectric.pack([Dielectric(), Dielectric(absorption=(0.0, 0.0, 0.0))], ParameterPacker()).absorption is None


@pytest.mark.slow
def test_a_slab_in_white_light_shows_beers_law():
    # Seen head on before a uniform sky: R + (1 - R)^2 t (1 + R t + R^2 t^2 + ...), where t = exp(-sigma d) and every
    # order leaves on one side or the other.
    text = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 0.2}
environment: {type: constant, radiance: 1}
objects:
  - type: box
    min: [-5, -5, -0.5]
    max: [5, 5, 0]
    material: {type: dielectric, ior: 1.8, absorption: [0, 1, 6]}
"""
    picture = image(text, filled=False, width=8, height=8, spp=512)
    value, deviation = mean(picture)
    reflectance = (0.8 / 2.8) ** 2
    for channel, sigma in enumerate((0.0, 1.0, 6.0)):
        kept = math.exp(-0.5 * sigma)
        expected = reflectance + (1.0 - reflectance) ** 2 * kept / (1.0 - reflectance * kept)
        assert value[channel] == pytest.approx(expected, abs=5.0 * deviation[channel] + 1e-5)
        assert deviation[channel] < 0.005
