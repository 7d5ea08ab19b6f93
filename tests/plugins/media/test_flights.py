"""Flights through media against integrals of their coefficients, and their phase function."""

import itertools
import math

import numpy as np
import pytest
from pydantic import ValidationError

from raytracer.plugins.media.base.interface import NUMBERS_PER_DISTANCE
from raytracer.plugins.media.base.voxel_traversal import BLOCK
from raytracer.plugins.media.grid import MAX_OPTICAL_THICKNESS, Grid, block_majorants
from raytracer.plugins.media.homogeneous import Homogeneous
from tests.plugins.media.kernels import evaluate_many, fly_many, packed, scatter_many, transmittance_many
from tests.statistics import CYLINDER, chi2_counts, chi2_test, cylinder, directions

COUNT = 200_000

GREY = Homogeneous(extinction=(0.7, 0.7, 0.7), albedo=(0.9, 0.5, 0.0))
COLOURED = Homogeneous(absorption=(0.1, 0.5, 2.0), scattering=(1.5, 0.2, 0.4))
ONE_CLEAR = Homogeneous(absorption=(0.0, 0.3, 0.0), scattering=(0.0, 0.2, 3.0))
HOMOGENEOUS = {"grey": GREY, "coloured": COLOURED, "one channel clear": ONE_CLEAR}

every_homogeneous = pytest.mark.parametrize("spec", HOMOGENEOUS.values(), ids=HOMOGENEOUS)


def coefficients(spec):
    """(extinction, scattering)."""
    absorption, scattering = (np.array(values) for values in spec.coefficients())
    return absorption + scattering, scattering


def assert_means(values, expected):
    """Each column has its mean within 4.5 standard deviations."""
    deviation = values.std(axis=0) / math.sqrt(len(values))
    np.testing.assert_array_less(np.abs(values.mean(axis=0) - expected), 4.5 * deviation + 1e-12)


# ---- Homogeneous


@every_homogeneous
@pytest.mark.parametrize("throughput", [(1.0, 1.0, 1.0), (0.2, 1.0, 0.01)])
@pytest.mark.parametrize("distance", [0.3, 2.0])
def test_a_slab_lets_through_and_scatters_what_beers_law_says(spec, throughput, distance):
    extinction, scattering = coefficients(spec)
    far, weight, _ = fly_many(packed(spec), COUNT, distance=distance, throughput=throughput)
    scattered = np.isfinite(far)
    assert (far[scattered] < distance).all()
    assert_means(weight * ~scattered[:, None], np.exp(-extinction * distance))
    # In each third of the way: the integral of scattering times transmittance.
    edges = np.linspace(0.0, distance, 4)
    for begin, end in itertools.pairwise(edges):
        inside = scattered & (far >= begin) & (far < end)
        loss = np.where(extinction > 0.0, extinction, 1.0)
        expected = scattering * (np.exp(-extinction * begin) - np.exp(-extinction * end)) / loss
        assert_means(weight * inside[:, None], expected)


@every_homogeneous
def test_transmittance_is_exact(spec):
    extinction, _ = coefficients(spec)
    for distance in (0.0, 1.3, 1e5):
        result = transmittance_many(packed(spec), 2, distance=distance)
        np.testing.assert_allclose(result[0], np.exp(-extinction * distance), rtol=1e-14)
    # To infinity, nothing comes through but what nothing is taken from.
    np.testing.assert_array_equal(transmittance_many(packed(spec), 1)[0], extinction == 0.0)


@every_homogeneous
def test_the_sum_of_throughputs_never_grows(spec):
    # By choosing channels by throughput: with an albedo of 1 it stays the same, whatever the extinctions are.
    throughput = np.array([0.2, 1.0, 0.01])
    far, weight, _ = fly_many(packed(spec), 10_000, distance=2.0, throughput=tuple(throughput.tolist()))
    assert ((weight * throughput).sum(axis=1) <= throughput.sum() * (1.0 + 1e-12)).all()
    white = Homogeneous(extinction=(0.5, 3.0, 1.0), albedo=(1.0, 1.0, 1.0))
    far, weight, _ = fly_many(packed(white), 10_000, distance=2.0, throughput=tuple(throughput.tolist()))
    assert 0 < np.isfinite(far).sum() < 10_000
    np.testing.assert_allclose((weight * throughput).sum(axis=1), throughput.sum(), rtol=1e-12)


def test_grey_light_is_scattered_without_loss_of_samples():
    _, weight, _ = fly_many(packed(GREY), 1000, distance=5.0)
    assert set(map(tuple, weight.round(12).tolist())) == {(0.9, 0.5, 0.0), (1.0, 1.0, 1.0)}


def test_what_only_absorbs_needs_no_chance():
    spec = Homogeneous(absorption=(0.0, 0.5, 2.0))
    far, weight, numbers = fly_many(packed(spec), 10, distance=1.5)
    assert np.isinf(far).all()
    assert not numbers.any()
    np.testing.assert_allclose(weight, np.broadcast_to(np.exp([0.0, -0.75, -3.0]), (10, 3)), rtol=1e-14)


@pytest.mark.parametrize("extinction", [1e-30, 1e-10, 1e10, 1e30])
@pytest.mark.parametrize("distance", [0.0, 1e-30, 1.0, math.inf])
def test_extreme_coefficients_make_no_nan(extinction, distance):
    for values in ((extinction,) * 3, (extinction, 1.0, 0.0)):
        spec = Homogeneous(extinction=values, albedo=(1.0, 0.5, 1.0))
        for throughput in ((1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.3, 0.1, 0.0)):
            far, weight, _ = fly_many(packed(spec), 1000, distance=distance, throughput=throughput)
            assert not np.isnan(far).any()
            assert np.isfinite(weight).all()


# ---- Grid


def grid(density, low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0), **settings):
    spec = Grid(file="grid.npy", min=low, max=high, **settings)
    return packed(spec, assets=[{"file": density}])


def thickness(density, start, way, distance, steps=200_000):
    """The integral of the density, in a unit box of voxels, along a ray: by the midpoint rule."""
    from scipy.ndimage import map_coordinates

    t = (np.arange(steps) + 0.5) / steps * distance
    points = np.array(start)[:, None] + np.array(way)[:, None] * t
    inside = ((points >= 0.0) & (points <= 1.0)).all(axis=0)
    voxels = points * np.array(density.shape)[:, None] - 0.5
    values = map_coordinates(density.astype(np.float64), voxels, order=1, mode="nearest")
    return float((values * inside).mean() * distance)


RANDOM = np.random.default_rng(5).random((19, 8, 21)) ** 3
RAYS = {
    "along an axis": ((0.31, 0.62, -1.0), (0.0, 0.0, 1.0)),
    "back along an axis": ((1.5, 0.05, 0.95), (-1.0, 0.0, 0.0)),
    "askew": ((-0.4, -0.2, -0.3), (0.6, 0.48, 0.64)),
    "from within": ((0.4, 0.7, 0.5), (-0.64, -0.6, 0.48)),
    "on a face": ((0.0, 0.3, -0.5), (0.0, 0.0, 1.0)),
    "a miss": ((2.0, 2.0, 2.0), (0.6, 0.48, 0.64)),
    "a parallel miss": ((1.5, 0.5, -1.0), (0.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("ray", RAYS)
def test_a_grids_transmittance_is_that_of_its_integral(ray):
    origin, direction = RAYS[ray]
    table = grid(RANDOM, extinction=4.0, albedo=(0.9, 0.5, 0.1))
    for distance in (0.9, math.inf):
        expected = math.exp(-4.0 * thickness(RANDOM, origin, direction, min(distance, 4.0)))
        result = transmittance_many(table, COUNT, origin=origin, direction=direction, distance=distance)
        assert_means(result, np.full(3, expected))
        far, weight, _ = fly_many(table, COUNT, origin=origin, direction=direction, distance=distance)
        scattered = np.isfinite(far)
        assert_means(1.0 - scattered[:, None], np.full(1, expected))
        np.testing.assert_array_equal(weight[scattered], np.broadcast_to([0.9, 0.5, 0.1], (scattered.sum(), 3)))
        np.testing.assert_array_equal(weight[~scattered], 1.0)
        assert (far[scattered] < distance).all()


def test_a_linear_density_is_interpolated_exactly():
    # Density = z at the middles of voxels: between the outermost ones the integral to z is z^2 / 2, however few blocks.
    n = 30
    ramp = np.broadcast_to((np.arange(n) + 0.5) / n, (2, 2, n))
    for z0, z1 in ((0.1, 0.9), (0.25, 0.3)):
        origin = (0.5, 0.5, z0)
        result = transmittance_many(grid(ramp, extinction=3.0), COUNT, origin=origin, distance=z1 - z0)
        assert_means(result, np.full(3, math.exp(-1.5 * (z1**2 - z0**2))))


def test_flights_end_where_the_density_is():
    # Chi-square of distances against density times transmittance, through several blocks.
    density = np.zeros((1, 1, 5 * BLOCK))
    density[0, 0] = np.random.default_rng(8).random(5 * BLOCK)
    origin, cells = (0.5, 0.5, 0.0), 50
    far, _, _ = fly_many(grid(density, extinction=2.0), COUNT, origin=origin)
    depths = [thickness(density, origin, (0.0, 0.0, 1.0), z, 20_000) for z in np.linspace(0.0, 1.0, cells + 1)]
    passing = np.exp(-2.0 * np.array(depths))
    observed, _ = np.histogram(far[np.isfinite(far)], cells, (0.0, 1.0))
    expected = COUNT * np.append(passing[:-1] - passing[1:], passing[-1])
    chi2_counts(np.append(observed, np.isinf(far).sum()), expected, tests=1)


def test_a_constant_grid_is_homogeneous():
    table = grid(np.full((3, 17, 9), 0.5), (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), extinction=1.4)
    far, _, _ = fly_many(table, COUNT, distance=0.8)
    assert_means(np.isinf(far)[:, None].astype(float), np.full(1, math.exp(-0.7 * 0.8)))
    # All collisions are real, so one number a flight is enough; and ratio tracking knows it at once.
    _, _, numbers = fly_many(table, 1000, distance=0.8)
    assert (numbers == 1).all()
    result = transmittance_many(table, 1000, distance=0.8)
    assert set(np.unique(result).tolist()) <= {0.0, 1.0}


def test_the_box_may_be_anywhere():
    # A box of 2 x 4 x 8 m turned by 90 degrees about y and moved: its z axis lies along the world's x.
    density = np.zeros((2, 2, 2))
    density[:, :, 1] = 1.0
    table = grid(
        density,
        (0.0, 0.0, 0.0),
        (2.0, 4.0, 8.0),
        transform=[{"rotate": {"axis": [0, 1, 0], "angle": 90}}, {"translate": [10, 0, 0]}],
        extinction=0.3,
    )
    # Voxels' middles are at 2 and 6 of its z: none before 12 in x, then a ramp to 16, all of it to 18.
    result = transmittance_many(table, COUNT, origin=(0.0, 1.0, -1.0), direction=(1.0, 0.0, 0.0))
    assert_means(result, np.full(3, math.exp(-0.3 * (0.5 * 4.0 + 2.0))))


def test_blocks_bound_what_is_interpolated_in_them():
    bound = block_majorants(RANDOM)
    assert bound.shape == (3, 1, 3)
    assert bound.dtype == np.float32
    for x, y, z in np.ndindex(*bound.shape):
        part = RANDOM[tuple(slice(max(0, BLOCK * b - 1), BLOCK * (b + 1) + 1) for b in (x, y, z))]
        assert bound[x, y, z] == np.float32(part.max())


def test_grids_stand_one_after_another():
    ones, twos = np.full((2, 3, 4), 1.0), np.full((9, 1, 2), 2.0)
    specs = [Grid(file="a.npy", extinction=0.5), Grid(file="b.npy", extinction=1.0)]
    table = packed(*specs, assets=[{"file": ones}, {"file": twos}])
    for index, expected in ((0, 0.5), (1, 2.0)):
        far, _, _ = fly_many(table, COUNT, index=index, origin=(0.5, 0.5, 0.0))
        assert_means(np.isinf(far)[:, None].astype(float), np.full(1, math.exp(-expected)))


@pytest.mark.parametrize("away", [1e3, 1e9, 1e14])
def test_flights_from_far_away_end(away):
    # Their steps are counted from the box on.  From 1e14 m off, where float64 knows places to 1/64 m, steps of a
    # thousandth of that would not have been any.
    table = grid(np.pad(np.ones((2, 2, 2)), 4), extinction=3000.0)
    far, weight, numbers = fly_many(table, 500, origin=(0.5, 0.5, -away))
    assert (numbers < NUMBERS_PER_DISTANCE).all()
    assert np.isfinite(weight).all()
    # Within a voxel's tenth of where the density begins.
    error = 0.02 + 4.0 * 2.0**-52 * away
    assert (np.abs(far - away - 0.37) < 0.05 + error).all()
    through = transmittance_many(table, 50, origin=(0.5, 0.5, -away))
    assert not through.any()


def test_grids_that_no_flight_would_get_through_are_refused():
    density = np.pad(np.full((2, 2, 2), 2.0), 7)
    for transform, metres in ((None, 1.0), ([{"scale": [1.0, 3.0, 1.0]}], 3.0)):
        # 16 voxels an edge, so the longest edge of one is metres / 16.
        most = MAX_OPTICAL_THICKNESS * 16.0 / (2.0 * metres)
        Grid(file="x", extinction=0.999 * most, transform=transform).check({"file": density})
        with pytest.raises(ValidationError, match="1182 are the most"):
            Grid(file="x", extinction=1.001 * most, transform=transform).check({"file": density})
    # The thickest that is let through needs no more numbers than a flight has, in a block that is empty but for an end.
    table = grid(density, extinction=0.99 * most * metres)
    for origin, direction in (((0.5, 0.5, -1.0), (0.0, 0.0, 1.0)), ((0.3, 0.3, 0.0), (0.0, 0.0, 1.0))):
        _, _, numbers = fly_many(table, 200, origin=origin, direction=direction)
        assert numbers.max() < 2 * NUMBERS_PER_DISTANCE


def test_sobols_numbers_fly_as_independent_ones_do():
    origin, direction = RAYS["askew"]
    expected = math.exp(-4.0 * thickness(RANDOM, origin, direction, 4.0))
    far, _, _ = fly_many(grid(RANDOM, extinction=4.0), 1 << 16, origin=origin, direction=direction, sampler="sobol")
    assert_means(np.isinf(far)[:, None].astype(float), np.full(1, expected))


# ---- Phase function: Henyey and Greenstein's

UP = (0.0, 0.0, 1.0)
ASKEW = (0.48, -0.6, 0.64)

every_g = pytest.mark.parametrize("g", [-0.9, -0.3, -1e-9, 0.0, 1e-9, 0.2, 0.7, 0.95])


def medium(g):
    return packed(Homogeneous(extinction=(1.0, 1.0, 1.0), albedo=(1.0, 1.0, 1.0), g=g))


def numbers(count, seed=1):
    return np.random.default_rng(seed).random((count, 2))


@every_g
def test_directions_follow_the_phase_function(g):
    outgoing, pdf, again = scatter_many(medium(g), UP, numbers(200_000))
    np.testing.assert_allclose(np.linalg.norm(outgoing, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(again, pdf, rtol=1e-9)
    density = lambda x: evaluate_many(medium(g), UP, directions(x))  # noqa: E731
    chi2_test(cylinder(outgoing), density, CYLINDER, [40, 8], order=24, tests=8)


@every_g
def test_the_mean_cosine_is_g(g):
    outgoing, _, _ = scatter_many(medium(g), ASKEW, numbers(200_000))
    cosine = outgoing @ np.array(ASKEW)
    assert abs(cosine.mean() - g) < 4.0 * cosine.std() / math.sqrt(len(cosine))
    # To first order the quantile function is 2u - 1 + 3/2 g (1 - (2u - 1)^2) ... : for g = 0 exactly 2u - 1.
    if g == 0.0:
        np.testing.assert_allclose(np.sort(cosine), np.sort(2.0 * numbers(200_000)[:, 0] - 1.0), atol=1e-12)


@every_g
def test_it_is_the_published_formula(g):
    cosine = np.linspace(-1.0, 1.0, 41)
    toward = directions(np.stack([cosine, np.zeros(41)], axis=1))
    formula = (1.0 - g * g) / (4.0 * math.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
    np.testing.assert_allclose(evaluate_many(medium(g), UP, toward), formula, rtol=1e-12)


@pytest.mark.parametrize("g", [0.999999, -0.999999, 1.0 - 2.0**-53, 2.0**-53 - 1.0, 1.0, -1.0])
def test_narrow_lobes_stay_right_and_no_choice_is_no_density(g):
    ends = np.array([[0.0, 0.0], [1.0 - 2.0**-53, 0.5], [0.5, 0.25]])
    outgoing, pdf, again = scatter_many(medium(g), ASKEW, ends if abs(g) == 1.0 else numbers(10_000))
    np.testing.assert_allclose(outgoing @ np.array(ASKEW), math.copysign(1.0, g), atol=0.01)
    assert (pdf > 0.0).all()
    if abs(g) == 1.0:
        # Hard case 45: g = +-1 makes 0 / 0 of the formula.
        np.testing.assert_array_equal(outgoing, np.broadcast_to(g * np.array(ASKEW), (3, 3)))
        assert np.isinf(pdf).all()
        assert not again.any()
        return
    assert np.isfinite([pdf, again]).all()
    # A cosine that float64 can tell from 1: the quantile function at u = 1/2, 1 - cos = (1 - g)^2 (1 + g/2) ~ 1.5e-12.
    if abs(g) < 1.0 - 1e-9:
        np.testing.assert_allclose(again, pdf, rtol=1e-3)
