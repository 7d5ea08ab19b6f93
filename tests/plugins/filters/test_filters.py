"""Pixel filters: weighted offsets follow the filter function."""

import itertools
import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import dblquad, quad
from scipy.stats import norm

from raytracer.plugins.filters.base.interface import sample_filter
from raytracer.plugins.filters.box import Box
from raytracer.plugins.filters.gaussian import Gaussian
from raytracer.plugins.filters.mitchell import Mitchell
from raytracer.schema.registry import FILTERS
from tests.statistics import cell_integrals, chi2_test
from tests.vectorised import rows, vectorised

COUNT = 1 << 18
ENDS = (0.0, 2.0**-33, 0.5, 1.0 - 2.0**-33, np.nextafter(1.0, 0.0))


def box(x, y, spec):
    """1 over the square, normalised."""
    inside = (np.abs(x) <= 0.5 * spec.width) & (np.abs(y) <= 0.5 * spec.width)
    return inside / spec.width**2


def gaussian(x, y, spec):
    """Cut off at the radius and normalised: the integral of exp(-r^2 / 2 s^2) r dr dphi is known in closed form."""
    r2 = x * x + y * y
    total = 2.0 * math.pi * spec.sigma**2 * (1.0 - math.exp(-0.5 * spec.radius**2 / spec.sigma**2))
    return np.where(r2 <= spec.radius**2, np.exp(-0.5 * r2 / spec.sigma**2), 0.0) / total


def mitchell_1d(x, spec):
    """Mitchell and Netravali 1988, eq. 8, as printed."""
    x, b, c = np.abs(x), spec.b, spec.c
    near = (12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + (6 - 2 * b)
    far = (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2 + (-12 * b - 48 * c) * x + (8 * b + 24 * c)
    return np.where(x < 1, near, np.where(x < 2, far, 0.0)) / 6


def mitchell(x, y, spec):
    """Separable."""
    return mitchell_1d(x, spec) * mitchell_1d(y, spec)


CASES = {
    "box": (Box(), box, 0.5),
    "wide box": (Box(width=2.0), box, 1.0),
    "gaussian": (Gaussian(), gaussian, 1.5),
    "narrow gaussian": (Gaussian(sigma=0.3, radius=0.5), gaussian, 0.5),
    "mitchell": (Mitchell(), mitchell, 2.0),
    "catmull-rom": (Mitchell(b=0.0, c=0.5), mitchell, 2.0),
    "b-spline": (Mitchell(b=1.0, c=0.0), mitchell, 2.0),
    "cubic": (Mitchell(b=0.0, c=0.0), mitchell, 2.0),
}
each = pytest.mark.parametrize(("spec", "function", "radius"), CASES.values(), ids=CASES)


def draw(spec, numbers=None):
    """Offsets and weights (n, 3), by default of random numbers."""
    numbers = np.random.default_rng(23).random((COUNT, 2)) if numbers is None else np.array(numbers)
    return vectorised(sample_filter)(spec.pack(), *map(rows, numbers.T))


def bound(tests):
    """Standard deviations that `tests` normal variables stay below with odds of 999 in 1000."""
    return norm.isf(0.5e-3 / tests)


@each
def test_weighted_offsets_follow_the_filter(spec, function, radius):
    # The sum of weights in a cell estimates n times the filter's integral over it, with the variance that the
    # weights tell: for weights of 1 that is Pearson's chi-square, for negative ones the histogram has none.
    drawn = draw(spec)
    bounds, cells = [(-radius, radius)] * 2, [24, 24]
    # A curved edge needs more points than a smooth cell does; Gauss' error there falls no faster than 1 / order.
    order = 64 if function is gaussian else 8
    expected = cell_integrals(lambda x: function(x[:, 0], x[:, 1], spec), bounds, cells, order)
    inside = (np.abs(drawn[:, :2]) <= radius).all(axis=1)
    assert inside.all()
    total, _ = np.histogramdd(drawn[:, :2], bins=cells, range=bounds, weights=drawn[:, 2])
    square, _ = np.histogramdd(drawn[:, :2], bins=cells, range=bounds, weights=drawn[:, 2] ** 2)
    counts, _ = np.histogramdd(drawn[:, :2], bins=cells, range=bounds)
    # The scarce cells count as one; that its variance is estimated too costs the normal tail a few percent.
    enough = counts >= 100
    total, square, expected = (
        np.append(values[enough], values[~enough].sum()) for values in (total, square, COUNT * expected)
    )
    z = (total - expected)[square > 0.0] / np.sqrt(square[square > 0.0])
    assert np.abs(z).max() < 1.1 * bound(len(z))
    assert np.abs(expected[square == 0.0]).max(initial=0.0) < 1e-9 * COUNT


@pytest.mark.parametrize("name", ["gaussian", "narrow gaussian"])
def test_gaussian_filters_pass_chi_square(name):
    spec, _, radius = CASES[name]
    drawn = draw(spec)
    polar = np.stack([np.hypot(drawn[:, 0], drawn[:, 1]), np.arctan2(drawn[:, 1], drawn[:, 0])], axis=1)
    density = lambda x: x[:, 0] * gaussian(x[:, 0], 0.0, spec)  # noqa: E731
    chi2_test(polar, density, [(0.0, radius), (-math.pi, math.pi)], [30, 30], tests=2)


@each
def test_moments_are_those_of_the_filter(spec, function, radius):
    # Mean weight 1, first moments 0, second moments by quadrature; each within its standard error.
    dx, dy, weight = draw(spec).T
    if function is mitchell:
        second = 2.0 * quad(lambda x: x * x * mitchell_1d(x, spec), 0.0, 2.0, points=[1.0])[0]
    elif function is gaussian:
        second = quad(lambda r: math.pi * r**3 * float(gaussian(r, 0.0, spec)), 0.0, radius)[0]
    else:
        second = dblquad(lambda x, y: x * x * float(box(x, y, spec)), -radius, radius, -radius, radius)[0]
    for values, expected in (
        (weight, 1.0),
        (weight * dx, 0.0),
        (weight * dy, 0.0),
        (weight * dx * dx, second),
        (weight * dy * dy, second),
        (weight * dx * dy, 0.0),
    ):
        error = values.std() / math.sqrt(COUNT)
        assert abs(values.mean() - expected) <= bound(6 * len(CASES)) * error + 1e-12


@each
def test_weights_are_as_even_as_can_be(spec, function, radius):
    # No weights have a smaller second moment than those of samples drawn by |f|: the square of the integral of |f|.
    weight = draw(spec)[:, 2]
    if function is not mitchell:
        assert (weight == 1.0).all()
        return
    magnitude = 2.0 * sum(quad(lambda x: abs(mitchell_1d(x, spec)), a, a + 1.0, limit=200)[0] for a in (0.0, 1.0))
    # E[w^2] = (integral of |f|)^4 over both axes; the table's cells where f is near 0 add a little.
    error = (weight**2).std() / math.sqrt(COUNT)
    assert (weight**2).mean() == pytest.approx(magnitude**4, abs=5.0 * error, rel=5e-3)


@pytest.mark.parametrize("b_and_c", [(1.0 / 3.0, 1.0 / 3.0), (0.0, 0.5), (1.0, 0.0), (0.7, 0.15)])
def test_mitchells_cubics_are_a_partition_of_unity(b_and_c):
    # With B = C = 1/3 the outer cubic is -(7/18) (x - 2)^2 (x - 8/7).
    np.testing.assert_allclose(np.polyval(Mitchell().pack().cubics[1], [8.0 / 7.0, 2.0]), 0.0, atol=1e-14)
    # Mitchell and Netravali's first condition: the filters of all pixels together weigh every point by 1.
    packed = Mitchell(b=b_and_c[0], c=b_and_c[1]).pack()
    x = np.linspace(0.0, 1.0, 101)
    total = (
        np.polyval(packed.cubics[0], x)
        + np.polyval(packed.cubics[0], 1.0 - x)
        + np.polyval(packed.cubics[1], 1.0 + x)
        + np.polyval(packed.cubics[1], 2.0 - x)
    )
    assert total == pytest.approx(np.ones(101), abs=1e-14)


@each
def test_the_ends_are_inside(spec, function, radius):
    drawn = draw(spec, list(itertools.product(ENDS, repeat=2)))
    assert np.isfinite(drawn).all()
    assert np.abs(drawn[:, :2]).max() <= radius * (1.0 + 2.0**-51)


def test_a_wide_gaussian_is_a_disc():
    # As sigma grows past the radius the density becomes even: E[r^2] = R^2 / 2.
    dx, dy, _ = draw(Gaussian(sigma=1e4, radius=1.0)).T
    r2 = dx * dx + dy * dy
    assert abs(r2.mean() - 0.5) < 5.0 * r2.std() / math.sqrt(COUNT)
    assert Gaussian(sigma=1e-30, radius=1e30).pack().within == 1.0


@pytest.mark.parametrize("keys", [{"sigma": 0.0}, {"sigma": -1.0}, {"radius": 0.0}])
def test_filters_without_a_size_are_refused(keys):
    with pytest.raises(ValidationError):
        Gaussian(**keys)


def test_every_kind_has_an_example():
    assert {spec.type for spec, *_ in CASES.values()} == set(FILTERS.specs())
