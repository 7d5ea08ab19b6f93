"""Facets and their shadows against their definitions."""

import math

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.microfacet import (
    SMOOTH_ALPHA,
    deficit,
    deficits,
    find_cells,
    ggx,
    grazing_albedo,
    half_vector,
    masking,
    mean_deficit,
    multiple_albedo,
    reflection_density,
    sample_deficit,
    sample_visible_normal,
    shadowing,
    stretched,
)
from raytracer.core.vec import dot
from tests.statistics import CYLINDER, chi2_counts, chi2_test, cylinder, directions
from tests.vectorised import rows, vectorised

ALPHAS = (1e-3, 0.04, 0.3, 1.0)


@kernel
def pdf_visible_normal(alpha, toward, half):
    """Compute the density (1/sr) of `sample_visible_normal`: Heitz 2018, JCGT 7(4), eq. 1."""
    return 2.0 * max(0.0, dot(toward, half)) * ggx(alpha, half) / (toward[2] + stretched(alpha, toward[2]))


@kernel
def _lost(table, alpha, side, z):
    return deficit(table.cells, find_cells(table, 0, alpha, side), z)


@kernel
def _drawn(table, alpha, side, u):
    return sample_deficit(table.cells, find_cells(table, 0, alpha, side), u)


def mean_lost(table, alpha, side):
    return mean_deficit(table.cells, find_cells(table, 0, alpha, side))


def _toward(cosine):
    sine = math.sqrt(1.0 - cosine * cosine)
    return (sine * math.cos(0.7), sine * math.sin(0.7), cosine)


def _slopes(alpha):
    """Half vectors and their solid angles, by the part of facets that are steeper, w^2: steep ones are dense."""
    w, phi = np.meshgrid((np.arange(2000) + 0.5) / 2000, 2.0 * np.pi * (np.arange(64) + 0.5) / 64, indexing="ij")
    tan2 = alpha * alpha * (1.0 - w * w) / (w * w)
    cosine = 1.0 / np.sqrt(1.0 + tan2)
    sine = np.sqrt(tan2) * cosine
    # d(tan^2) / dw = 2 alpha^2 / w^3, and solid angle is cos^3 / 2 d(tan^2) d(phi).
    weight = alpha**2 / w**3 * cosine**3 * (2.0 * np.pi / w.size)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], -1).reshape(-1, 3), weight.ravel()


@pytest.mark.parametrize("alpha", ALPHAS)
def test_facets_cover_the_surface(alpha):
    # The integral of D cos is 1 (Walter et al. 2007, eq. 4).
    half, weight = _slopes(alpha)
    density = vectorised(ggx)(alpha, rows(half))
    assert (density * half[:, 2] * weight).sum() == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("alpha", [1.0, 1e-3, 1e-4, 1e-8])
def test_peak_of_narrow_lobes_has_all_its_digits(alpha):
    # Hard case 39: 1 / (pi alpha^2), and a quarter of it where the slope is alpha (but for cos^4).
    assert ggx(alpha, (0.0, 0.0, 1.0)) == pytest.approx(1.0 / (math.pi * alpha**2), rel=1e-14)
    cosine = 1.0 / math.sqrt(1.0 + alpha * alpha)
    half = (alpha * cosine, 0.0, cosine)
    assert ggx(alpha, half) == pytest.approx(0.25 / (math.pi * alpha**2 * cosine**4), rel=1e-13)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.05, 1e-3])
def test_as_many_facets_are_seen_as_fill_the_view(alpha, cosine):
    # The definition of G1 without back-facing facets: the integral of G1 (v.m)+ D is cos (Heitz 2014, eq. 14).
    toward = np.array(_toward(cosine))
    half, weight = _slopes(alpha)
    density = vectorised(ggx)(alpha, rows(half))
    seen = masking(alpha, cosine) * (np.maximum(0.0, half @ toward) * density * weight).sum()
    assert seen == pytest.approx(cosine, rel=5e-4)


def test_shadows_are_smiths():
    # G2 = 1 / (1 + Lambda + Lambda'), with Lambda from the tangent (Heitz 2014, eq. 72 and 99).
    def slope_lambda(alpha, z):
        return 0.5 * (math.sqrt(1.0 + alpha**2 * (1.0 / z**2 - 1.0)) - 1.0)

    for alpha in ALPHAS:
        for a in (1.0, 0.7, 0.02):
            assert masking(alpha, a) == pytest.approx(1.0 / (1.0 + slope_lambda(alpha, a)), rel=1e-12)
            for b in (0.9, 0.2, 1e-3):
                both = 1.0 / (1.0 + slope_lambda(alpha, a) + slope_lambda(alpha, b))
                assert masking(alpha, a) * shadowing(alpha, a, b) == pytest.approx(both, rel=1e-12)
                half = (0.1, 0.2, math.sqrt(0.95))
                expected = ggx(alpha, half) * both / (4.0 * a)
                assert reflection_density(alpha, a, b, half) == pytest.approx(expected, rel=1e-12)
    # Light along the surface that leaves it is in nobody's shadow, and neither limit is 0/0.
    assert shadowing(0.3, 0.0, 0.5) == 1.0
    assert shadowing(0.3, 0.5, 0.0) == masking(0.3, 0.0) == 0.0


@pytest.mark.parametrize("height", [1.0, 1e-9, 1e-150, 1e-300, 0.0])
def test_half_vectors_lie_between(height):
    # Of directions that are opposite along the surface, the half vector is its normal, however low they are.
    along = math.sqrt((1.0 - height) * (1.0 + height))
    assert half_vector((along, 0.0, height), (-along, 0.0, height)) == pytest.approx((0.0, 0.0, 1.0), abs=1e-15)
    assert half_vector((along, 0.0, height), (along, 0.0, height)) == pytest.approx((along, 0.0, height), abs=1e-15)


@pytest.mark.parametrize("alpha", [0.3, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.05])
def test_visible_facets_follow_their_density(alpha, cosine):
    toward = _toward(cosine)
    draws = np.random.default_rng(5).random((200_000, 2))
    half = vectorised(sample_visible_normal)(alpha, toward, *map(rows, draws.T))
    np.testing.assert_allclose(np.linalg.norm(half, axis=1), 1.0, rtol=1e-14)
    assert (half @ toward >= -1e-15).all()

    def pdf(coordinates):
        points = directions(coordinates)
        return np.where(points[:, 2] > 0.0, vectorised(pdf_visible_normal)(alpha, toward, rows(points)), 0.0)

    chi2_test(cylinder(half), pdf, CYLINDER, (40, 24), significance=1e-3, tests=6)


@pytest.mark.parametrize("alpha", [SMOOTH_ALPHA, 1e-2])
@pytest.mark.parametrize("cosine", [1.0, 0.1, 1e-3, 1e-9, 0.0])
def test_visible_facets_of_narrow_lobes_have_the_slopes_that_they_should(alpha, cosine):
    toward = (math.sqrt(1.0 - cosine * cosine), 0.0, cosine)
    draws = np.random.default_rng(6).random((100_000, 2))
    half = vectorised(sample_visible_normal)(alpha, toward, *map(rows, draws.T))
    assert np.isfinite(half).all()
    assert (half[:, 2] >= 0.0).all()
    # Unstretched, facets are points of a half sphere, projected along the stretched direction of view.  Seen head on,
    # that is a disc, where |y| <= 0.404 holds half; from the horizon a half disc, where it does so too.
    unstretched = half * np.array([1.0, 1.0, alpha])
    across = unstretched[:, 1] / np.linalg.norm(unstretched, axis=1)
    assert np.quantile(np.abs(across), 0.5) == pytest.approx(0.4040, abs=0.005)


# ---- Deficits


def test_perfect_mirrors_of_alpha_one_lose_what_the_integral_says():
    # Head on, of D = 1 / pi and G2 = 2 c / (1 + c) is left 1 - ln 2, so ln 2 is lost.
    table = deficits([1.0], [(0.0,)])
    rows = find_cells(table, 0, 1.0, 0)
    assert deficit(table.cells, rows, 1.0) == pytest.approx(math.log(2.0), abs=2e-4)
    assert deficit(table.cells, rows, 0.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("eta", "roughness"), [(0.0, 0.3), (0.0, 1.0), (1.5, 0.6), (1.0 / 1.5, 0.6), (0.0, None)])
def test_directions_follow_the_deficit(eta, roughness):
    alpha = 0.2 if roughness is None else roughness**2
    table = deficits([roughness], [(eta,)])
    edges = np.linspace(0.0, 1.0, 41)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    z = edges[:-1, None] + np.diff(edges)[:, None] * (0.5 + 0.5 * nodes)
    values = vectorised(_lost)(table, alpha, 0, rows(z.ravel()))
    drawn = vectorised(_drawn)(table, alpha, 0, rows(np.random.default_rng(8).random(200_000)))
    mass = (values.reshape(z.shape) * 2.0 * z * 0.5 * weights).sum(axis=1) * np.diff(edges)
    assert mass.sum() == pytest.approx(mean_lost(table, alpha, 0), rel=1e-4)
    observed, _ = np.histogram(drawn, edges)
    chi2_counts(observed, len(drawn) * mass / mass.sum(), 1e-4)


def test_deficits_between_two_alphas_are_close_to_those_between():
    grid = deficits([None], [(1.5, 1.0 / 1.5)])
    z = rows(np.linspace(0.0, 1.0, 100))
    for roughness in (0.1, 0.45, 0.9):
        alpha, single = roughness**2, deficits([roughness], [(1.5, 1.0 / 1.5)])
        for side in (0, 1):
            there, own = (vectorised(_lost)(table, alpha, side, z) for table in (grid, single))
            np.testing.assert_allclose(there, own, rtol=0.0, atol=3e-3)
            assert mean_lost(grid, alpha, side) == pytest.approx(mean_lost(single, alpha, side), rel=0.05, abs=1e-3)


def test_materials_alike_share_their_rows():
    table = deficits([0.5, 0.2, 0.5, 0.01, 0.0], [(0.0,)] * 5)
    np.testing.assert_array_equal(table.first, [0, 1, 0, 2, 2])
    assert table.cells.shape[0] == 3


def test_schlicks_part_of_the_albedo():
    # Smooth facets keep (1 - cos)^5 of it, and rough ones less at grazing angles, as their facets are met head on.
    table = deficits([0.05, 1.0], [(0.0,), (0.0,)])
    narrow, broad = find_cells(table, 0, 0.0025, 0), find_cells(table, 1, 1.0, 0)
    for z in (1.0, 0.7, 0.3):
        assert grazing_albedo(table.cells, narrow, z) == pytest.approx((1.0 - z) ** 5, abs=2e-3)
    assert grazing_albedo(table.cells, broad, 0.05) < 0.5 * grazing_albedo(table.cells, narrow, 0.05)


def test_albedo_of_many_mirrors():
    # Perfect ones give all back; others the geometric series, term by term.
    lost = 0.4
    assert multiple_albedo((1.0, 0.5, 0.0), lost) == (
        pytest.approx(1.0, rel=1e-14),
        pytest.approx(sum(0.5**2 * 0.6 * (0.5 * lost) ** bounce for bounce in range(60)), rel=1e-14),
        0.0,
    )
    assert len(set(multiple_albedo((0.5, 0.5, 0.5), lost))) == 1
