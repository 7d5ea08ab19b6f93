"""Snell and Fresnel against other forms of the same laws."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytracer.core.fresnel import fresnel_dielectric, refract

angles = st.floats(1e-3, math.pi / 2 - 1e-3)
indices = st.floats(0.3, 4.0).filter(lambda eta: abs(eta - 1.0) > 1e-3)


def _by_angles(angle, eta):
    """Unpolarised reflectance by angles: sin^2(i-t)/sin^2(i+t) and tan^2(i-t)/tan^2(i+t) (Hecht, "Optics", 4.6)."""
    t = math.asin(math.sin(angle) / eta)
    return (
        0.5 * (math.sin(angle - t) / math.sin(angle + t)) ** 2 + 0.5 * (math.tan(angle - t) / math.tan(angle + t)) ** 2
    )


@given(angles, indices)
def test_reflectance_is_that_of_the_angles(angle, eta):
    reflectance, cos_t = fresnel_dielectric(math.cos(angle), eta)
    sine = math.sin(angle) / eta
    if sine > 1.0 - 1e-9:
        assert reflectance == pytest.approx(1.0, abs=1e-3)
        return
    assert reflectance == pytest.approx(_by_angles(angle, eta), rel=1e-8, abs=1e-12)
    assert cos_t == pytest.approx(math.sqrt(1.0 - sine * sine), abs=1e-9)


@pytest.mark.parametrize(
    ("eta", "expected"), [(1.5, 0.04), (1.33, (0.33 / 2.33) ** 2), (2.4, (1.4 / 3.4) ** 2), (1.0 / 1.5, 0.04)]
)
def test_normal_incidence(eta, expected):
    # ((n - 1) / (n + 1))^2, from either side.
    assert fresnel_dielectric(1.0, eta) == (pytest.approx(expected, rel=1e-14), 1.0)


@pytest.mark.parametrize("n", [1.33, 1.5, 2.4])
def test_brewsters_angle(n):
    # At tan i = n nothing parallel is reflected, and ((n^2 - 1) / (n^2 + 1))^2 of what is perpendicular.
    reflectance, _ = fresnel_dielectric(1.0 / math.hypot(1.0, n), n)
    assert reflectance == pytest.approx(0.5 * ((n * n - 1.0) / (n * n + 1.0)) ** 2, rel=1e-12)


def test_grazing_incidence_reflects_all():
    assert fresnel_dielectric(0.0, 1.5)[0] == 1.0
    assert fresnel_dielectric(1e-12, 1.5)[0] == pytest.approx(1.0, abs=1e-10)


def test_total_internal_reflection_at_the_critical_angle():
    # Hard case 18: from 1.5 into 1, cos = sqrt(5)/3 = 0.745356; an ulp inside, 1 - R goes with the root of an ulp.
    critical = math.sqrt(5.0) / 3.0
    assert critical == pytest.approx(0.745356, abs=1e-6)
    eta = 1.0 / 1.5
    for cos_i in (math.nextafter(critical, 0.0), 0.745, 0.3, 0.0):
        assert fresnel_dielectric(cos_i, eta) == (1.0, 0.0)
    reflectance, cos_t = fresnel_dielectric(critical + 1e-15, eta)
    assert reflectance == pytest.approx(1.0, abs=1e-6)
    assert 0.0 <= cos_t < 1e-6


@pytest.mark.parametrize("cos_i", [1.0, 0.5, 1e-9, 0.0])
def test_equal_indices_are_no_boundary(cos_i):
    # Hard case 19: the formula is 0/0 at cos = 0.
    assert fresnel_dielectric(cos_i, 1.0) == (0.0, cos_i)


def test_exact_fresnel_is_not_schlicks_fit():
    # Hard case 20: inside glass at cos = 0.7454 the fit by the cosine of incidence says 0.041, the truth is 0.932.
    assert fresnel_dielectric(0.7454, 1.0 / 1.5)[0] == pytest.approx(0.932, abs=2e-3)


@given(angles, indices)
def test_both_ways_through_a_boundary_reflect_the_same(angle, eta):
    # Stokes' relations: R of i into t equals R of t into i.
    reflectance, cos_t = fresnel_dielectric(math.cos(angle), eta)
    if reflectance < 1.0 - 1e-6:
        assert fresnel_dielectric(cos_t, 1.0 / eta)[0] == pytest.approx(reflectance, rel=1e-6, abs=1e-12)


@given(angles, indices, st.floats(0.0, 2.0 * math.pi))
def test_refraction_obeys_snell_in_the_plane_of_incidence(angle, eta, azimuth):
    sine, cosine = math.sin(angle), math.cos(angle)
    direction = (sine * math.cos(azimuth), sine * math.sin(azimuth), -cosine)
    reflectance, cos_t = fresnel_dielectric(cosine, eta)
    if reflectance == 1.0:
        return
    out = np.array(refract(direction, (0.0, 0.0, 1.0), cosine, cos_t, eta))
    # eta sin_t = sin_i with the direction of the tangential part kept; and through to the other side.
    np.testing.assert_allclose(eta * out[:2], direction[:2], rtol=0.0, atol=1e-12)
    assert out[2] == pytest.approx(-cos_t, abs=1e-12)
    # Just inside the critical angle cos_t is the root of a rounding error, so its square is what can be relied on.
    assert np.linalg.norm(out) == pytest.approx(1.0, abs=1e-12)


@given(angles, indices)
def test_a_slab_gives_back_the_direction(angle, eta):
    direction = (math.sin(angle), 0.0, -math.cos(angle))
    reflectance, cos_t = fresnel_dielectric(math.cos(angle), eta)
    if reflectance > 1.0 - 1e-6:
        return
    inside = refract(direction, (0.0, 0.0, 1.0), math.cos(angle), cos_t, eta)
    _, cos_out = fresnel_dielectric(-inside[2], 1.0 / eta)
    np.testing.assert_allclose(
        refract(inside, (0.0, 0.0, 1.0), -inside[2], cos_out, 1.0 / eta), direction, rtol=0.0, atol=1e-9
    )
