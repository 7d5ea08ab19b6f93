"""The error measure: relative, the same for any exposure, and defined for black pictures."""

import math

import numpy as np
import pytest

from raytracer.analysis.compare import relmse
from raytracer.core.error_estimate.metric import FLOOR, error_weights, mean_scale, relative_error

RNG = np.random.default_rng(1)
PICTURE = RNG.random((12, 9, 3)) ** 3
NOISY = PICTURE + 0.05 * RNG.standard_normal(PICTURE.shape)


def test_is_the_root_of_relmse_of_pictures_over_the_mean_of_the_reference():
    m = PICTURE.mean()
    assert relative_error(NOISY, PICTURE) == pytest.approx(math.sqrt(relmse(NOISY / m, PICTURE / m)), rel=1e-12)


@pytest.mark.parametrize("exposure", [1e-5, 3.0, 1e6])
def test_does_not_depend_on_exposure(exposure):
    assert relative_error(exposure * NOISY, exposure * PICTURE) == pytest.approx(relative_error(NOISY, PICTURE))


def test_an_even_excess_is_its_own_error_but_for_the_floor():
    grey = np.full((4, 4, 3), 0.3)
    assert relative_error(1.02 * grey, grey) == pytest.approx(0.02 / math.sqrt(1.0 + FLOOR**2), rel=1e-12)


def test_black_pictures_have_no_error_and_others_are_infinitely_far_from_black():
    black = np.zeros((2, 2, 3))
    assert relative_error(black, black) == 0.0
    assert relative_error(PICTURE[:2, :2], black) == math.inf
    assert not error_weights(black).any()


def test_a_black_pixel_counts_as_a_tenth_of_the_mean():
    picture = np.array([[[0.0, 0.0, 0.0], [2.0, 2.0, 2.0]]])
    np.testing.assert_allclose(error_weights(picture)[0, :, 0], [100.0, 1.0 / 4.01])


def test_the_scale_may_come_from_elsewhere():
    np.testing.assert_allclose(error_weights(PICTURE, mean_scale(PICTURE)), error_weights(PICTURE))
    np.testing.assert_allclose(error_weights(PICTURE, 2.0), 1.0 / (PICTURE**2 + 0.04))
    assert mean_scale(-PICTURE) == mean_scale(PICTURE) > 0.0
