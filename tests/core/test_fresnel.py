"""Snell and Fresnel against other forms of the same laws."""

import math

import numpy as np

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.fresnel import fresnel_dielectric, refract
from tests.vectorised import rows, vectorised

fresnel = vectorised(fresnel_dielectric)

RNG = np.random.default_rng(1)
ANGLES, AZIMUTHS = RNG.uniform(1e-3, math.pi / 2 - 1e-3, 2000), RNG.uniform(0.0, 2.0 * math.pi, 2000)
INDICES = np.where(RNG.random(2000) < 0.5, RNG.uniform(0.3, 0.999, 2000), RNG.uniform(1.001, 4.0, 2000))


def test_reflectance_is_that_of_the_angles():
    # Unpolarised, by angles: sin^2(i-t)/sin^2(i+t) and tan^2(i-t)/tan^2(i+t) (Hecht, "Optics", sec. 4.6).
    reflectance, cos_t = fresnel(rows(np.cos(ANGLES)), rows(INDICES)).T
    sine = np.sin(ANGLES) / INDICES
    total = sine > 1.0
    assert (reflectance[total] == 1.0).all()
    assert (cos_t[total] == 0.0).all()
    i, t = ANGLES[~total], np.arcsin(sine[~total])
    expected = 0.5 * (np.sin(i - t) / np.sin(i + t)) ** 2 + 0.5 * (np.tan(i - t) / np.tan(i + t)) ** 2
    np.testing.assert_allclose(reflectance[~total], expected, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(cos_t[~total], np.cos(t), atol=1e-9)
    # Stokes' relations: R of i into t equals R of t into i.
    back = fresnel(rows(cos_t[~total]), rows(1.0 / INDICES[~total]))[:, 0]
    np.testing.assert_allclose(back, reflectance[~total], rtol=1e-6, atol=1e-12)


def test_incidence_head_on_by_brewsters_angle_and_grazing():
    n = np.array([1.5, 1.33, 2.4, 1.0 / 1.5])
    # ((n - 1) / (n + 1))^2, from either side.
    np.testing.assert_allclose(fresnel(1.0, rows(n)).T, [((n - 1.0) / (n + 1.0)) ** 2, np.ones(4)], rtol=1e-14)
    # At tan i = n nothing parallel is reflected, and ((n^2 - 1) / (n^2 + 1))^2 of what is perpendicular.
    brewster = fresnel(rows(1.0 / np.hypot(1.0, n)), rows(n))[:, 0]
    np.testing.assert_allclose(brewster, 0.5 * ((n * n - 1.0) / (n * n + 1.0)) ** 2, rtol=1e-12)
    np.testing.assert_allclose(fresnel(rows([0.0, 1e-12]), 1.5)[:, 0], [1.0, 1.0], rtol=0.0, atol=1e-10)
    # Hard case 20: inside glass at cos = 0.7454 Schlick's fit by the cosine of incidence says 0.041.
    assert abs(fresnel(rows([0.7454]), 1.0 / 1.5)[0, 0] - 0.932) < 2e-3


def test_total_internal_reflection_at_the_critical_angle():
    # Hard case 18: from 1.5 into 1, cos = sqrt(5)/3 = 0.745356; an ulp inside, 1 - R goes with the root of an ulp.
    critical = math.sqrt(5.0) / 3.0
    inside, eta = fresnel(rows([math.nextafter(critical, 0.0), 0.745, 0.3, 0.0]), 1.0 / 1.5), 1.0 / 1.5
    assert (inside == (1.0, 0.0)).all()
    reflectance, cos_t = fresnel(rows([critical + 1e-15]), eta)[0]
    assert abs(reflectance - 1.0) < 1e-6
    assert 0.0 <= cos_t < 1e-6


def test_equal_indices_are_no_boundary():
    # Hard case 19: the formula is 0/0 at cos = 0.
    cosines = np.array([1.0, 0.5, 1e-9, 0.0])
    np.testing.assert_array_equal(fresnel(rows(cosines), 1.0).T, [np.zeros(4), cosines])


@kernel
def _through(direction, eta):
    normal = (0.0, 0.0, 1.0)
    reflectance, cos_t = fresnel_dielectric(-direction[2], eta)
    inside = refract(direction, normal, -direction[2], cos_t, eta)
    _, cos_out = fresnel_dielectric(-inside[2], 1.0 / eta)
    return reflectance, cos_t, inside, refract(inside, normal, -inside[2], cos_out, 1.0 / eta)


def test_refraction_obeys_snell_in_the_plane_of_incidence_and_a_slab_gives_back_the_direction():
    sine = np.sin(ANGLES)
    direction = np.stack([sine * np.cos(AZIMUTHS), sine * np.sin(AZIMUTHS), -np.cos(ANGLES)], axis=1)
    reflectance, cos_t, inside, out = vectorised(_through)(rows(direction), rows(INDICES))
    # Just inside the critical angle cos_t is the root of a rounding error.
    goes = reflectance < 1.0 - 1e-6
    # eta sin_t = sin_i with the direction of the tangential part kept; and through to the other side.
    np.testing.assert_allclose(INDICES[goes, None] * inside[goes, :2], direction[goes, :2], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(inside[goes, 2], -cos_t[goes], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(inside[goes], axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(out[goes], direction[goes], rtol=0.0, atol=1e-9)
