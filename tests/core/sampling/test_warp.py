"""Warps: what they draw follows the density beside them."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

from raytracer.core.sampling import warp
from tests.statistics import CYLINDER, cell_integrals, chi2_test, cylinder

# Densities by area or in solid angle, and in (u, v) of a triangle of area 1/2.
PDF_DISC, PDF_SPHERE, PDF_TRIANGLE = 1.0 / math.pi, 0.25 / math.pi, 2.0

ENDS = (0.0, 2.0**-33, 0.25, 0.5, 0.75, np.nextafter(1.0, 0.0))
CONES = (1.0, 0.5, 1e-4)


def pdf_hemisphere(cosine):
    return 0.5 / math.pi if cosine >= 0.0 else 0.0


@pytest.fixture(scope="module")
def numbers():
    return np.random.default_rng(17).random((200_000, 2)).tolist()


def draw(sample, numbers, *parameters):
    return np.array([sample(u1, u2, *parameters) for u1, u2 in numbers])


def test_disc_is_uniform(numbers):
    # In polar coordinates (r, phi) the density by area 1/pi is r/pi.
    points = draw(warp.sample_disc, numbers)
    polar = np.stack([np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])], axis=1)
    bounds = [(0.0, 1.0), (-math.pi, math.pi)]
    chi2_test(np.minimum(polar, [1.0, math.pi]), lambda x: x[:, 0] * PDF_DISC, bounds, [20, 40], tests=6)


def test_disc_keeps_its_middle_and_its_edge():
    # Hard case 35, and concentric squares that become circles: max(|2 u1 - 1|, |2 u2 - 1|) is the radius.
    assert warp.sample_disc(0.5, 0.5) == (0.0, 0.0)
    for u1, u2 in itertools.product(np.linspace(0.0, 1.0, 21)[:-1], repeat=2):
        x, y = warp.sample_disc(u1, u2)
        assert math.hypot(x, y) == pytest.approx(max(abs(2.0 * u1 - 1.0), abs(2.0 * u2 - 1.0)), abs=4e-16)


def test_disc_is_continuous():
    # Across both diagonals of the square, where one formula takes over from the other.
    step = 2.0**-40
    for u in (0.1, 0.3, 0.7, 0.9):
        for v, sign in ((u, 1.0), (1.0 - u, -1.0)):
            here, there = warp.sample_disc(u, v), warp.sample_disc(u + step, v - sign * step)
            assert math.dist(here, there) < 8.0 * step


def test_bins_are_drawn_by_their_probability():
    # Of 0.25, 0, 0.75, behind two of another row.
    cumulative = np.array([0.5, 1.0, 0.25, 0.25, 1.0])
    expected = {0.0: (2, 0.0), 0.125: (2, 0.5), 0.25: (4, 0.0), 0.625: (4, 0.5), 0.8125: (4, 0.75)}
    assert {u: warp.sample_bin(cumulative, 2, 5, u) for u in expected} == expected
    guide = np.concatenate([np.zeros(2, np.int32), warp.guide_table(cumulative[None, 2:])[0]])
    assert {u: warp.sample_guided_bin(cumulative, guide, 2, 5, u) for u in expected} == expected


@pytest.mark.parametrize("bins", [1, 2, 7, 1000])
def test_a_guide_finds_the_bin_that_a_search_does(bins):
    rng = np.random.default_rng(bins)
    weights = 10.0 ** rng.uniform(-20.0, 0.0, bins) * (rng.random(bins) < 0.8)
    weights[rng.integers(bins)] = 1.0
    cumulative = np.cumsum(weights)
    cumulative /= cumulative[-1]
    guide = warp.guide_table(cumulative[None])[0]
    edges = np.concatenate([np.arange(bins) / bins, cumulative[:-1]])
    numbers = np.concatenate([rng.random(500), edges, np.nextafter(edges, 0.0), np.nextafter(edges, 1.0)])
    for u in numbers[(numbers >= 0.0) & (numbers < 1.0)].tolist():
        assert warp.sample_guided_bin(cumulative, guide, 0, bins, u) == warp.sample_bin(cumulative, 0, bins, u)


def test_sphere_is_uniform(numbers):
    directions = draw(warp.sample_sphere, numbers)
    chi2_test(cylinder(directions), lambda x: np.full(len(x), PDF_SPHERE), CYLINDER, [20, 40], tests=6)


def test_hemisphere_is_uniform(numbers):
    directions = draw(warp.sample_cone, numbers, 1.0)
    density = np.vectorize(pdf_hemisphere)
    chi2_test(cylinder(directions), lambda x: density(x[:, 0]), CYLINDER, [20, 40], tests=6)


def test_cosine_hemisphere_follows_the_cosine(numbers):
    directions = draw(warp.sample_cosine_hemisphere, numbers)
    density = np.vectorize(warp.pdf_cosine_hemisphere)
    chi2_test(cylinder(directions), lambda x: density(x[:, 0]), CYLINDER, [20, 40], tests=6)


def test_triangle_is_uniform(numbers):
    # u, v -> (u + v, u / (u + v)) takes the triangle to the square; its Jacobian makes the density 2 s of s = u + v.
    points = draw(warp.sample_triangle, numbers)
    s = points.sum(axis=1)
    square = np.stack([s, points[:, 0] / s], axis=1)
    chi2_test(square, lambda x: PDF_TRIANGLE * x[:, 0], [(0.0, 1.0)] * 2, [20, 20], tests=6)


@pytest.mark.parametrize("sin2", CONES)
def test_cone_is_uniform(numbers, sin2):
    # In h = (1 - cos) / (1 - cos_max), where the solid angle is (1 - cos_max) dh dphi.
    height = 1.0 - math.sqrt(1.0 - sin2)
    directions = draw(warp.sample_cone, numbers[:50_000], sin2)
    sine2 = directions[:, 0] ** 2 + directions[:, 1] ** 2
    h = sine2 / (1.0 + directions[:, 2]) / warp.one_minus_cosine(sin2)
    phi = np.arctan2(directions[:, 1], directions[:, 0])
    density = warp.pdf_cone(sin2) * warp.one_minus_cosine(sin2)
    assert warp.one_minus_cosine(sin2) == pytest.approx(height, rel=1e-11)
    chi2_test(
        np.stack([np.minimum(h, 1.0), phi], axis=1),
        lambda x: np.full(len(x), density),
        [(0.0, 1.0), (-math.pi, math.pi)],
        [20, 40],
        tests=6,
    )


def test_densities_in_solid_angle_integrate_to_one():
    for pdf in (np.vectorize(pdf_hemisphere), np.vectorize(warp.pdf_cosine_hemisphere)):
        assert cell_integrals(lambda x, pdf=pdf: pdf(x[:, 0]), CYLINDER, [2, 1]).sum() == pytest.approx(1.0, abs=1e-14)
    assert PDF_SPHERE * 4.0 * math.pi == pytest.approx(1.0, abs=1e-15)
    assert quad(lambda r: PDF_DISC * 2.0 * math.pi * r, 0.0, 1.0)[0] == pytest.approx(1.0, abs=1e-14)
    for sin2 in CONES:
        solid_angle = 2.0 * math.pi * warp.one_minus_cosine(sin2)
        assert warp.pdf_cone(sin2) * solid_angle == pytest.approx(1.0, abs=1e-15)


def test_a_narrow_cone_keeps_its_precision():
    # Hard case 10: radius 1 at a distance of 1e4, for which 1 - cos in float32 is 0.  By the series
    # 1 - cos = s^2/2 + s^4/8 + ..., it is 5.0000000125e-9.
    assert warp.one_minus_cosine(1e-8) == pytest.approx(5.0000000125e-9, rel=1e-15)
    assert warp.pdf_cone(1e-8) == pytest.approx(1.0 / (2.0 * math.pi * 5.0000000125e-9), rel=1e-15)
    # The sine of directions at the edge is that of the cone, however narrow; sqrt(1 - z^2) would be 0 below 1e-8.
    for sine in (1e-4, 1e-8, 1e-12, 1e-150):
        x, y, z = warp.sample_cone(np.nextafter(1.0, 0.0), 0.3, sine * sine)
        assert math.hypot(x, y) == pytest.approx(sine, rel=1e-14)
        assert z <= 1.0
    assert warp.pdf_cone(0.0) == math.inf
    assert warp.sample_cone(0.5, 0.5, 0.0)[2] == 1.0


@pytest.mark.parametrize(
    ("sample", "parameters"),
    [
        (warp.sample_sphere, ()),
        (warp.sample_cone, (1.0,)),
        (warp.sample_cosine_hemisphere, ()),
        *((warp.sample_cone, (sin2,)) for sin2 in (*CONES, 0.0)),
    ],
)
def test_directions_are_unit_vectors_up_to_the_ends(sample, parameters):
    for u1, u2 in itertools.product(ENDS, repeat=2):
        x, y, z = sample(u1, u2, *parameters)
        assert math.hypot(x, y, z) == pytest.approx(1.0, abs=4e-16)
        assert z >= 0.0 or sample is warp.sample_sphere


def test_planes_are_kept_to_up_to_the_ends():
    for u1, u2 in itertools.product(ENDS, repeat=2):
        x, y = warp.sample_disc(u1, u2)
        assert math.hypot(x, y) <= 1.0 + 2.0**-52
        u, v = warp.sample_triangle(u1, u2)
        assert u >= 0.0
        assert v >= 0.0
        assert u + v <= 1.0


def test_cosines_outside_have_no_density():
    assert warp.pdf_cosine_hemisphere(-0.1) == 0.0
    assert pdf_hemisphere(-0.1) == 0.0
    assert warp.pdf_cosine_hemisphere(1.0) == 1.0 / math.pi


def test_triangle_maps_neighbours_to_neighbours():
    # Heitz: continuous over the whole square, unlike a parallelogram folded along its diagonal.
    step = 2.0**-40
    for u in (0.1, 0.5, 0.9):
        here, there = warp.sample_triangle(u, u), warp.sample_triangle(u, u + step)
        assert math.dist(here, there) < 4.0 * step


def test_sines_and_cosines_are_right_to_a_rounding():
    angles = np.append(np.random.default_rng(3).uniform(-math.pi / 4, math.pi / 4, 20_000), [0.0, math.pi / 4])
    values = np.array([warp.sin_cos_octant(angle) for angle in angles])
    exact = np.stack([np.sin(angles.astype(np.longdouble)), np.cos(angles.astype(np.longdouble))], axis=1)
    assert (np.abs(values - exact) <= 0.8 * np.abs(np.spacing(values))).all()


def test_turns_start_in_each_quarter():
    # 2 pi times a rounding of the turn is all that may be wrong beside a rounding of each value.
    turns = np.append(np.random.default_rng(4).random(20_000), [*np.arange(0.0, 1.0, 0.125), np.nextafter(1.0, 0.0)])
    values = np.array([warp.sin_cos_turn(turn) for turn in turns])
    exact = 8.0 * np.arctan(np.longdouble(1.0)) * turns.astype(np.longdouble)
    np.testing.assert_allclose(values, np.stack([np.sin(exact), np.cos(exact)], axis=1), rtol=0.0, atol=2.0**-52)
