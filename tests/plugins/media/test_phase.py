"""Henyey and Greenstein's phase function: normalised, sampled as it says, with mean cosine g."""

import math

import numpy as np
import pytest

from raytracer.plugins.media.homogeneous import Homogeneous
from tests.plugins.media.kernels import evaluate_many, packed, scatter_many
from tests.statistics import CYLINDER, chi2_test, cylinder, directions

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
