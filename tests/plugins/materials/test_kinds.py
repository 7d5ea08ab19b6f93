"""Each material against its own formulas."""

import math

import numpy as np
import pytest

from raytracer.plugins.materials.dielectric import Dielectric
from raytracer.plugins.materials.emitter import Emitter
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.plugins.materials.metal import Metal, pdf_fuzz
from raytracer.plugins.textures.base.interface import ParameterPacker
from tests.plugins.materials.kernels import emitted, evaluate_many, incoming, mirrored, scatter_many

RNG = np.random.default_rng(11)


def _directions(count):
    """Uniform unit vectors of the upper hemisphere."""
    vectors = RNG.normal(size=(count, 3))
    vectors[:, 2] = np.abs(vectors[:, 2])
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


# ---- Lambertian


def test_lambertian_is_albedo_over_pi():
    spec = Lambertian(albedo=(0.2, 0.5, 0.8))
    outgoing = _directions(100)
    value, pdf = evaluate_many(spec, incoming(50.0), outgoing)
    np.testing.assert_allclose(value, outgoing[:, 2:] * np.array(spec.albedo) / math.pi, rtol=1e-14)
    np.testing.assert_allclose(pdf, outgoing[:, 2] / math.pi, rtol=1e-14)
    below, pdf_below = evaluate_many(spec, incoming(50.0), -outgoing)
    assert not below.any()
    assert not pdf_below.any()


def test_lambertian_is_reciprocal():
    # Helmholtz: f(i, o) = f(o, i).  One Weekend's fuzzy metal is not, by construction: its lobe is a pdf about the
    # mirrored direction, without a division by the cosine; so it is not asked.
    spec = Lambertian(albedo=(0.2, 0.5, 0.8))
    for a, b in zip(_directions(50), _directions(50), strict=True):
        there, _ = evaluate_many(spec, tuple(map(float, -a)), b[None])
        back, _ = evaluate_many(spec, tuple(map(float, -b)), a[None])
        np.testing.assert_allclose(there / b[2], back / a[2], rtol=1e-12)


# ---- Metal


def test_mirror_reflects_by_the_law_of_reflection():
    for degrees in (0.0, 20.0, 60.0, 89.999):
        direction = incoming(degrees)
        outgoing, weight, pdf = scatter_many(Metal(albedo=(0.9, 0.6, 0.3), fuzz=0.0), direction, 4)
        np.testing.assert_allclose(outgoing, np.tile(mirrored(direction), (4, 1)), rtol=0.0, atol=1e-15)
        np.testing.assert_array_equal(weight, np.tile([0.9, 0.6, 0.3], (4, 1)))
        assert np.isinf(pdf).all()


@pytest.mark.parametrize("fuzz", [0.05, 0.3, 0.9, 1.0])
def test_pdf_of_fuzz_integrates_to_one(fuzz):
    # Over the cap that a sphere of radius `fuzz` round the mirrored unit vector fills.  With c = c0 + (1 - c0) s^2 the
    # pole at the rim c0 = sqrt(1 - fuzz^2) is smoothed away.
    nodes, weights = np.polynomial.legendre.leggauss(400)
    s = 0.5 + 0.5 * nodes
    rim = math.sqrt(1.0 - fuzz * fuzz)
    cosine = rim + (1.0 - rim) * s * s
    density = np.array([pdf_fuzz(1.0 - float(value), fuzz) for value in cosine])
    total = 2.0 * math.pi * (density * 2.0 * (1.0 - rim) * s * 0.5 * weights).sum()
    assert total == pytest.approx(1.0, abs=2e-6)


def test_pdf_of_full_fuzz_is_that_of_a_matte_surface_about_the_mirrored_direction():
    # normalize(m + u), u uniform on the unit sphere, has the density cos / pi (Shirley 2024, sec. 9.4).
    for cosine in (1.0, 0.7, 0.2, 1e-3):
        assert pdf_fuzz(1.0 - cosine, 1.0) == pytest.approx(cosine / math.pi, rel=1e-9)
    assert pdf_fuzz(1.1, 1.0) == 0.0


def test_pdf_of_fuzz_vanishes_outside_its_cone():
    # The sphere of radius 0.6 round the tip of a unit vector fills a cone of sine 0.6, cosine 0.8.
    assert pdf_fuzz(0.2001, 0.6) == 0.0
    assert pdf_fuzz(0.1999, 0.6) > pdf_fuzz(0.0, 0.6) > 0.0


@pytest.mark.parametrize("fuzz", [1e-3, 1e-6, 1e-9, 1e-12])
def test_pdf_of_little_fuzz_has_its_digits(fuzz):
    # Directions are known to some 2^-52, a fraction of the lobe of which the pdf changes by (half width / distance from
    # the rim)^2: told from cosines, which differ by less than 2^-53 within a lobe of 1e-8, the pdf was off by half.
    direction = incoming(45.0)
    outgoing, _, pdf = scatter_many(Metal(albedo=(1.0, 1.0, 1.0), fuzz=fuzz), direction, 2000)
    _, density = evaluate_many(Metal(albedo=(1.0, 1.0, 1.0), fuzz=fuzz), direction, outgoing)
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


def test_fuzz_goes_to_zero_without_a_jump():
    # |normalize(m + f u) - m| <= f, and nothing is lost while the lobe is above the surface.
    direction = incoming(60.0)
    for fuzz in (1e-3, 1e-6, 1e-9, 1e-12):
        outgoing, weight, pdf = scatter_many(Metal(albedo=(1.0, 1.0, 1.0), fuzz=fuzz), direction, 10_000)
        assert (np.linalg.norm(outgoing - mirrored(direction), axis=1) <= fuzz * (1.0 + 1e-3) + 1e-15).all()
        assert (weight == 1.0).all()
        assert np.isfinite(pdf).all()


# ---- Dielectric


def test_glass_without_a_boundary_lets_light_pass_straight():
    # Hard case 19: equal indices are no object, even at grazing incidence, where Fresnel's formula is 0/0.
    for degrees in (0.0, 60.0, 89.9999, 90.0):
        direction = incoming(degrees)
        outgoing, weight, _ = scatter_many(Dielectric(ior=1.5, outside_ior=1.5), direction, 1000)
        np.testing.assert_allclose(outgoing, np.tile(direction, (1000, 1)), rtol=0.0, atol=1e-15)
        assert (weight == 1.0).all()


@pytest.mark.parametrize(("ior", "front"), [(1.5, True), (1.5, False), (2.4, True), (1.0 / 1.5, True)])
@pytest.mark.parametrize("degrees", [0.0, 20.0, 41.0, 60.0, 89.9])
def test_glass_refracts_by_snells_law_and_reflects_by_fresnels(ior, front, degrees):
    count = 20_000
    direction = np.array(incoming(degrees))
    eta = ior if front else 1.0 / ior
    outgoing, weight, pdf = scatter_many(Dielectric(ior=ior), tuple(map(float, direction)), count, front=front)
    assert (weight == 1.0).all()
    assert np.isinf(pdf).all()
    up = outgoing[:, 2] > 0.0
    np.testing.assert_allclose(outgoing[up], np.tile(mirrored(tuple(direction)), (up.sum(), 1)), rtol=0.0, atol=1e-14)

    # n1 sin1 = n2 sin2 with the tangential direction kept: eta times the tangential part is what came in.
    np.testing.assert_allclose(eta * outgoing[~up, :2], np.tile(direction[:2], ((~up).sum(), 1)), rtol=0.0, atol=1e-12)

    # Fresnel by angles of incidence and refraction: sin^2(i-t)/sin^2(i+t) and tan^2(i-t)/tan^2(i+t) (Hecht, sec. 4.6).
    sine = math.sin(math.radians(degrees)) / eta
    if sine >= 1.0:
        expected = 1.0
    elif degrees == 0.0:
        expected = ((1.0 - eta) / (1.0 + eta)) ** 2
    else:
        i, t = math.radians(degrees), math.asin(sine)
        expected = 0.5 * (math.sin(i - t) / math.sin(i + t)) ** 2 + 0.5 * (math.tan(i - t) / math.tan(i + t)) ** 2
    deviation = math.sqrt(expected * (1.0 - expected) / count)
    assert up.mean() == pytest.approx(expected, abs=4.5 * deviation + 1e-12)


def test_glass_at_the_critical_angle_gives_numbers():
    # Hard case 18: sin = 1/1.5 from inside, and an ulp to either side.
    critical = math.asin(1.0 / 1.5)
    for angle in (math.nextafter(critical, 0.0), critical, math.nextafter(critical, 2.0)):
        direction = (math.sin(angle), 0.0, -math.cos(angle))
        outgoing, _, _ = scatter_many(Dielectric(ior=1.5), direction, 1000, front=False)
        assert np.isfinite(outgoing).all()
        assert (outgoing[:, 2] > -1e-7).all()


# ---- Emitter


def test_emitter_absorbs():
    _, weight, _ = scatter_many(Emitter(radiance=(1.0, 2.0, 3.0)), incoming(30.0), 10)
    assert not weight.any()


def test_emitter_by_its_sides():
    assert emitted(Emitter(radiance=(1.0, 2.0, 3.0)), True) == (1.0, 2.0, 3.0)
    assert emitted(Emitter(radiance=(1.0, 2.0, 3.0)), False) == (0.0, 0.0, 0.0)
    assert emitted(Emitter(radiance=(1.0, 2.0, 3.0), two_sided=True), False) == (1.0, 2.0, 3.0)
    # Twice the sides, twice the power: how often the light is chosen.
    assert Emitter(radiance=(1.0, 2.0, 3.0), two_sided=True).emitted_power(ParameterPacker()) == 12.0
