"""Each material against its own formulas."""

import math

import numpy as np
import pytest

from raytracer.core.fresnel import fresnel_dielectric
from raytracer.plugins.materials.dielectric import Dielectric
from raytracer.plugins.materials.emitter import Emitter
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.plugins.materials.metal import Metal, pdf_fuzz
from raytracer.plugins.materials.thin_dielectric import ThinDielectric, pane_reflectance
from raytracer.plugins.textures.base.interface import ParameterPacker
from tests.plugins.materials.kernels import SITE, evaluate_many, incoming, mirrored, packed_row, scatter_many
from tests.small_scenes import image, mean
from tests.vectorised import rows, vectorised

WHITE = (1.0, 1.0, 1.0)


def test_lambertian_is_albedo_over_pi():
    spec = Lambertian(albedo=(0.2, 0.5, 0.8))
    outgoing = np.random.default_rng(11).normal(size=(100, 3))
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    value, pdf = evaluate_many(spec, incoming(50.0), outgoing)
    cosine = np.maximum(0.0, outgoing[:, 2])
    np.testing.assert_allclose(value, cosine[:, None] * spec.albedo / math.pi, rtol=1e-14)
    np.testing.assert_allclose(pdf, cosine / math.pi, rtol=1e-14)


# ---- Metal


def test_mirror_reflects_by_the_law_of_reflection():
    for degrees in (0.0, 20.0, 60.0, 89.999):
        direction = incoming(degrees)
        outgoing, weight, pdf = scatter_many(Metal(albedo=(0.9, 0.6, 0.3), fuzz=0.0), direction, 4)
        np.testing.assert_allclose(outgoing, np.tile(mirrored(direction), (4, 1)), rtol=0.0, atol=1e-15)
        np.testing.assert_array_equal(weight, np.tile([0.9, 0.6, 0.3], (4, 1)))
        assert np.isinf(pdf).all()


def test_pdf_of_fuzz():
    # Full: normalize(m + u), u uniform on the unit sphere, has the density cos / pi (Shirley 2024, sec. 9.4).
    cosine = np.array([1.0, 0.7, 0.2, 1e-3, -0.1])
    pdf = vectorised(pdf_fuzz)(rows(1.0 - cosine), 1.0)
    np.testing.assert_allclose(pdf, np.maximum(0.0, cosine) / math.pi, rtol=1e-9)
    # The sphere of radius 0.6 round the tip of a unit vector fills a cone of sine 0.6, cosine 0.8.
    outside, rim, middle = vectorised(pdf_fuzz)(rows([0.2001, 0.1999, 0.0]), 0.6)
    assert outside == 0.0 < middle < rim


@pytest.mark.parametrize("fuzz", [0.05, 0.3, 0.9, 1.0])
def test_pdf_of_fuzz_integrates_to_one(fuzz):
    # With c = c0 + (1 - c0) s^2 the pole at the rim c0 = sqrt(1 - fuzz^2) is smoothed away.
    nodes, weights = np.polynomial.legendre.leggauss(400)
    s, cap = 0.5 + 0.5 * nodes, 1.0 - math.sqrt(1.0 - fuzz * fuzz)
    density = vectorised(pdf_fuzz)(rows(cap * (1.0 - s * s)), fuzz)
    assert 2.0 * math.pi * cap * (density * s * weights).sum() == pytest.approx(1.0, abs=2e-6)


@pytest.mark.parametrize("fuzz", [1e-3, 1e-6, 1e-9, 1e-12])
def test_little_fuzz_has_its_digits_and_goes_to_zero_without_a_jump(fuzz):
    # |normalize(m + f u) - m| <= f, and nothing is lost while the lobe is above the surface.
    direction, spec = incoming(60.0), Metal(albedo=WHITE, fuzz=fuzz)
    outgoing, weight, pdf = scatter_many(spec, direction, 10_000)
    assert (np.linalg.norm(outgoing - mirrored(direction), axis=1) <= fuzz * (1.0 + 1e-3) + 1e-15).all()
    assert (weight == 1.0).all()
    # Directions are known to some 2^-52, a fraction of the lobe of which the pdf changes by (half width / distance from
    # the rim)^2: told from cosines, which differ by less than 2^-53 within a lobe of 1e-8, the pdf was off by half.
    _, density = evaluate_many(spec, direction, outgoing)
    half = 1.0 / (2.0 * math.pi * fuzz * fuzz * pdf)
    error = np.abs(density / pdf - 1.0)
    assert (error[half > 0.5] <= 64.0 * 2.0**-53 / fuzz + 1e-12).all()


@pytest.mark.parametrize("fuzz", [0.05, 0.5, 1.0])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 80.0, 89.99999])
def test_metal_loses_what_would_go_below_the_surface(fuzz, degrees):
    # The height m.n + fuzz u.n is uniform in m.n -+ fuzz (Archimedes), so (1 + min(1, cos / fuzz)) / 2 of it is above.
    count = 200_000
    _, weight, _ = scatter_many(Metal(albedo=(1.0, 0.5, 0.25), fuzz=fuzz), incoming(degrees), count)
    above = 0.5 * (1.0 + min(1.0, math.cos(math.radians(degrees)) / fuzz))
    deviation = math.sqrt(above * (1.0 - above) / count)
    np.testing.assert_allclose(weight.mean(axis=0) / [1.0, 0.5, 0.25], above, rtol=0.0, atol=4.5 * deviation + 1e-12)


# ---- Dielectric


@pytest.mark.parametrize(("ior", "front"), [(1.5, True), (1.5, False), (2.4, True), (1.0 / 1.5, True), (1.0, True)])
@pytest.mark.parametrize("degrees", [0.0, 20.0, 41.0, 60.0, 89.9, 90.0])
def test_glass_refracts_by_snells_law_and_reflects_by_fresnels(ior, front, degrees):
    # Hard case 19: equal indices are no object, even at grazing incidence, where Fresnel's formula is 0/0.
    count, direction = 20_000, np.array(incoming(degrees))
    eta = ior if front else 1.0 / ior
    outgoing, weight, pdf = scatter_many(Dielectric(ior=ior), tuple(map(float, direction)), count, front=front)
    assert (weight == 1.0).all()
    assert np.isinf(pdf).all()
    expected = fresnel_dielectric(-direction[2], eta)[0]
    passes = outgoing @ mirrored(direction) < 1.0 - 1e-12 if 0.0 < expected < 1.0 else np.full(count, expected == 0.0)
    np.testing.assert_allclose(outgoing[~passes], np.tile(mirrored(direction), ((~passes).sum(), 1)), atol=1e-14)
    # n1 sin1 = n2 sin2 with the tangential direction kept: eta times the tangential part is what came in.
    np.testing.assert_allclose(eta * outgoing[passes, :2], np.tile(direction[:2], (passes.sum(), 1)), atol=1e-12)
    assert (outgoing[passes, 2] <= 0.0).all()
    deviation = math.sqrt(expected * (1.0 - expected) / count)
    assert (~passes).mean() == pytest.approx(expected, abs=4.5 * deviation + 1e-12)


def test_glass_at_the_critical_angle_gives_numbers():
    # Hard case 18: sin = 1/1.5 from inside, and an ulp to either side.
    critical = math.asin(1.0 / 1.5)
    for angle in (math.nextafter(critical, 0.0), critical, math.nextafter(critical, 2.0)):
        outgoing, _, _ = scatter_many(Dielectric(ior=1.5), (math.sin(angle), 0.0, -math.cos(angle)), 1000, front=False)
        assert (outgoing[:, 2] > -1e-7).all()


# ---- Panes


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
    for distance in (0.0, 0.25, 2.0):
        material = packed_row(glass, SITE._replace(distance=distance))
        inside = np.exp(-np.array([0.0, 1.0, 10.0]) * distance)
        np.testing.assert_allclose(material.transmittance_inside, inside, rtol=1e-15)
        np.testing.assert_allclose(material.transmittance_outside, (math.exp(-3.0 * distance), 1.0, 1.0), rtol=1e-15)


def test_attenuation_has_its_color_after_its_distance():
    glass = Dielectric(attenuation_color=(0.25, 0.5, 1.0), attenuation_distance=0.02)
    for distance, power in ((0.02, 1.0), (0.06, 3.0)):
        material = packed_row(glass, SITE._replace(distance=distance))
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


# ---- Emitters


def test_an_emitter_of_two_sides_has_twice_the_power():
    # By which the light is chosen.
    power = [Emitter(radiance=(1.0, 2.0, 3.0), two_sided=two).emitted_power(ParameterPacker()) for two in (False, True)]
    assert power == [6.0, 12.0]
