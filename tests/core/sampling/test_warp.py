"""Warps: what they draw follows the density beside them."""

import itertools
import math

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.sampling import warp
from tests.statistics import CYLINDER, chi2_test, cylinder
from tests.vectorised import rows, vectorised

# Densities by area or in solid angle, and in (u, v) of a triangle of area 1/2.
PDF_DISC, PDF_SPHERE, PDF_TRIANGLE = 1.0 / math.pi, 0.25 / math.pi, 2.0

BELOW = np.nextafter(1.0, 0.0)
ENDS = np.array(list(itertools.product((0.0, 2.0**-33, 0.25, 0.5, 0.75, BELOW), repeat=2)))
CONES = (1.0, 0.5, 1e-4)
SQUARE = [(0.0, 1.0), (0.0, 1.0)]


def pdf_hemisphere(cosine):
    return 0.5 / math.pi if cosine >= 0.0 else 0.0


def draw(sample, numbers, *parameters):
    return vectorised(sample)(*map(rows, np.transpose(numbers)), *parameters)


def pdf_cosine(cosine):
    return vectorised(warp.pdf_cosine_hemisphere)(rows(cosine))


def polar(points):
    """In (r, phi) the density by area 1/pi is r/pi."""
    return np.minimum(np.stack([np.hypot(*points.T), np.arctan2(*points.T[::-1])], axis=1), [1.0, math.pi])


def unfolded(points):
    """(u + v, u / (u + v)) takes the triangle to the square; its Jacobian makes the density 2 s of s = u + v."""
    s = points.sum(axis=1)
    return np.stack([s, points[:, 0] / s], axis=1)


@pytest.mark.parametrize(
    ("sample", "parameters", "coordinates", "pdf", "bounds"),
    [
        (warp.sample_disc, (), polar, lambda x: x[:, 0] * PDF_DISC, [(0.0, 1.0), (-math.pi, math.pi)]),
        (warp.sample_sphere, (), cylinder, lambda x: np.full(len(x), PDF_SPHERE), CYLINDER),
        (warp.sample_cone, (1.0,), cylinder, lambda x: np.vectorize(pdf_hemisphere)(x[:, 0]), CYLINDER),
        (warp.sample_cosine_hemisphere, (), cylinder, lambda x: pdf_cosine(x[:, 0]), CYLINDER),
        (warp.sample_triangle, (), unfolded, lambda x: PDF_TRIANGLE * x[:, 0], SQUARE),
    ],
    ids=["disc", "sphere", "hemisphere", "cosine", "triangle"],
)
def test_what_is_drawn_follows_the_density(sample, parameters, coordinates, pdf, bounds):
    drawn = draw(sample, np.random.default_rng(17).random((200_000, 2)), *parameters)
    chi2_test(coordinates(drawn), pdf, bounds, [20, 40], tests=8)


@pytest.mark.parametrize("sin2", CONES)
def test_cone_is_uniform(sin2):
    # In h = (1 - cos) / (1 - cos_max), where the solid angle is (1 - cos_max) dh dphi.
    x, y, z = draw(warp.sample_cone, np.random.default_rng(17).random((50_000, 2)), sin2).T
    height, pdf = vectorised(_cone)(rows([sin2]))[0]
    assert height == pytest.approx(1.0 - math.sqrt(1.0 - sin2), rel=1e-11)
    assert pdf * 2.0 * math.pi * height == pytest.approx(1.0, abs=1e-15)
    h = np.minimum((x**2 + y**2) / (1.0 + z) / height, 1.0)
    points = np.stack([h, np.arctan2(y, x)], axis=1)
    chi2_test(points, lambda x: np.full(len(x), pdf * height), [(0.0, 1.0), (-math.pi, math.pi)], [20, 40], tests=8)


@kernel
def _cone(sin2):
    return warp.one_minus_cosine(sin2), warp.pdf_cone(sin2)


def test_disc_keeps_its_middle_and_its_edge():
    # Hard case 35, and concentric squares that become circles: max(|2 u1 - 1|, |2 u2 - 1|) is the radius.
    u = np.array([(0.5, 0.5), *itertools.product(np.linspace(0.0, 1.0, 21)[:-1], repeat=2)])
    points = draw(warp.sample_disc, u)
    assert points[0].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(np.hypot(*points.T), np.abs(2.0 * u - 1.0).max(axis=1), rtol=0.0, atol=4e-16)


def test_neighbours_stay_neighbours():
    # Across both diagonals of the square, where one formula of the disc takes over from the other; and in the triangle
    # (Heitz), unlike in a parallelogram folded along its diagonal.
    step, u = 2.0**-40, np.array([0.1, 0.3, 0.5001, 0.7, 0.9])
    for sample, v, by in (
        (warp.sample_disc, u, (step, -step)),
        (warp.sample_disc, 1.0 - u, (step, step)),
        (warp.sample_triangle, u, (0.0, step)),
    ):
        here = np.stack([u, v], axis=1)
        assert (np.linalg.norm(draw(sample, here) - draw(sample, here + by), axis=1) < 8.0 * step).all()


def bins(sample, cumulative, *table):
    return lambda u: vectorised(sample)(cumulative, *table, rows(u))


def test_bins_are_drawn_by_their_probability():
    # Of 0.25, 0, 0.75, behind two of another row.
    cumulative = np.array([0.5, 1.0, 0.25, 0.25, 1.0])
    guide = np.concatenate([np.zeros(2, np.int32), warp.guide_table(cumulative[None, 2:])[0]])
    for drawn in (bins(warp.sample_bin, cumulative, 2, 5), bins(warp.sample_guided_bin, cumulative, guide, 2, 5)):
        index, place = drawn([0.0, 0.125, 0.25, 0.625, 0.8125])
        assert (index.tolist(), place.tolist()) == ([2, 2, 4, 4, 4], [0.0, 0.5, 0.0, 0.5, 0.75])


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_a_guide_finds_the_bin_that_a_search_does(count):
    rng = np.random.default_rng(count)
    weights = 10.0 ** rng.uniform(-20.0, 0.0, count) * (rng.random(count) < 0.8)
    weights[rng.integers(count)] = 1.0
    cumulative = np.cumsum(weights)
    cumulative /= cumulative[-1]
    guide = warp.guide_table(cumulative[None])[0]
    edges = np.concatenate([np.arange(count) / count, cumulative[:-1]])
    u = np.concatenate([rng.random(500), edges, np.nextafter(edges, 0.0), np.nextafter(edges, 1.0)])
    u = u[(u >= 0.0) & (u < 1.0)]
    guided, searched = (
        bins(warp.sample_guided_bin, cumulative, guide, 0, count),
        bins(warp.sample_bin, cumulative, 0, count),
    )
    np.testing.assert_array_equal(guided(u), searched(u))


def test_a_narrow_cone_keeps_its_precision():
    # Hard case 10: radius 1 at a distance of 1e4, for which 1 - cos in float32 is 0.  By the series
    # 1 - cos = s^2/2 + s^4/8 + ..., it is 5.0000000125e-9.
    (height, pdf), (_, of_nothing) = vectorised(_cone)(rows([1e-8, 0.0]))
    assert height == pytest.approx(5.0000000125e-9, rel=1e-15)
    assert pdf == pytest.approx(1.0 / (2.0 * math.pi * 5.0000000125e-9), rel=1e-15)
    assert of_nothing == math.inf
    # The sine of directions at the edge is that of the cone, however narrow; sqrt(1 - z^2) would be 0 below 1e-8.
    sine = np.array([1e-4, 1e-8, 1e-12, 1e-150, 0.0])
    x, y, z = vectorised(warp.sample_cone)(BELOW, 0.3, rows(sine * sine)).T
    np.testing.assert_allclose(np.hypot(x, y), sine, rtol=1e-14)
    assert (z <= 1.0).all()
    assert z[-1] == 1.0


@pytest.mark.parametrize(
    ("sample", "parameters", "lowest"),
    [
        (warp.sample_sphere, (), -1.0),
        (warp.sample_cosine_hemisphere, (), 0.0),
        *((warp.sample_cone, (sin2,), 0.0) for sin2 in (*CONES, 0.0)),
    ],
)
def test_directions_are_unit_vectors_up_to_the_ends(sample, parameters, lowest):
    directions = draw(sample, ENDS, *parameters)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=0.0, atol=4e-16)
    assert (directions[:, 2] >= lowest).all()


def test_planes_are_kept_to_up_to_the_ends():
    assert (np.hypot(*draw(warp.sample_disc, ENDS).T) <= 1.0 + 2.0**-52).all()
    triangle = draw(warp.sample_triangle, ENDS)
    assert (triangle >= 0.0).all()
    assert (triangle.sum(axis=1) <= 1.0).all()


def test_cosines_outside_have_no_density():
    assert pdf_cosine([-0.1, 1.0]).tolist() == [0.0, 1.0 / math.pi]


def test_sines_and_cosines_are_right_to_a_rounding():
    angles = np.append(np.random.default_rng(3).uniform(-math.pi / 4, math.pi / 4, 20_000), [0.0, math.pi / 4])
    values = vectorised(warp.sin_cos_octant)(rows(angles))
    exact = np.stack([np.sin(angles.astype(np.longdouble)), np.cos(angles.astype(np.longdouble))], axis=1)
    assert (np.abs(values - exact) <= 0.8 * np.abs(np.spacing(values))).all()


def test_turns_start_in_each_quarter():
    # 2 pi times a rounding of the turn is all that may be wrong beside a rounding of each value.
    turns = np.append(np.random.default_rng(4).random(20_000), [*np.arange(0.0, 1.0, 0.125), BELOW])
    values = vectorised(warp.sin_cos_turn)(rows(turns))
    exact = 8.0 * np.arctan(np.longdouble(1.0)) * turns.astype(np.longdouble)
    np.testing.assert_allclose(values, np.stack([np.sin(exact), np.cos(exact)], axis=1), rtol=0.0, atol=2.0**-52)
