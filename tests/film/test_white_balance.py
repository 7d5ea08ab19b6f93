"""White balance: colours of light against those of the CIE, and that balanced light is neutral."""

import numpy as np
import pytest

from raytracer.film.exposure import luminance
from raytracer.film.white_balance import balance_gains, chromaticity, illuminant_rgb
from raytracer.plugins.environments.sky import color_matching

NOTHING = np.zeros((2, 2, 3))


@pytest.mark.parametrize(
    ("temperature", "x", "y"),
    [
        # CIE 15:2018, table T.3: illuminants A (a black body of 2856 K), D50, D55, D65 and D75.
        (2856.0, 0.44758, 0.40745),
        (5003.0, 0.34567, 0.35851),
        (5503.0, 0.33243, 0.34744),
        (6504.0, 0.31272, 0.32903),
        (7504.0, 0.29903, 0.31488),
    ],
)
def test_lights_have_the_chromaticity_of_the_standard(temperature, x, y):
    np.testing.assert_allclose(chromaticity(temperature), (x, y), atol=6e-4)


def black_body(temperature):
    """Linear Rec. 709 of Planck's law, by the CIE's observer, up to a factor."""
    nm = np.arange(380.0, 781.0, 5.0)
    spectrum = nm**-5 / np.expm1(1.438777e7 / (nm * temperature))
    xyz = color_matching(nm) @ spectrum
    # ITU-R BT.709-6: the primaries and the white from which the matrix follows.
    primaries = np.array([[0.64, 0.30, 0.15], [0.33, 0.60, 0.06], [0.03, 0.10, 0.79]])
    white = np.array([0.3127, 0.3290, 0.3583]) / 0.3290
    matrix = primaries * np.linalg.solve(primaries, white)
    return np.asarray(np.linalg.solve(matrix, xyz))


@pytest.mark.parametrize("temperature", [2200.0, 2856.0, 3200.0, 3900.0])
def test_a_black_body_of_that_temperature_becomes_neutral(temperature):
    balanced = balance_gains(temperature, NOTHING) * black_body(temperature)
    # The analytic observer of the test is within 1 %, which the small blue of warm light shows most.
    np.testing.assert_allclose(balanced / balanced[1], 1.0, rtol=0.06)


def test_another_light_does_not():
    balanced = balance_gains(3200.0, NOTHING) * black_body(2200.0)
    assert balanced[0] > 1.3 * balanced[1] > 1.5 * balanced[2]


@pytest.mark.parametrize("temperature", [2000.0, 3999.0, 4000.0, 6504.0, 7000.0, 25000.0])
def test_balanced_light_is_grey_of_the_same_luminance(temperature):
    found = illuminant_rgb(temperature)
    assert (found > 0.0).all()
    assert luminance(found) == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(balance_gains(temperature, NOTHING) * found, 1.0, rtol=1e-12)


def test_the_white_of_the_display_stays_as_it_is():
    # D65, the white of Rec. 709, has 6504 K.
    np.testing.assert_allclose(balance_gains(6504.0, NOTHING), 1.0, atol=1e-3)


def test_a_higher_temperature_makes_the_picture_warmer():
    ratios = [
        balance_gains(float(t), NOTHING)[0] / balance_gains(float(t), NOTHING)[2] for t in range(2000, 25000, 500)
    ]
    assert (np.diff(ratios) > 0.0).all()


def test_auto_makes_the_mean_grey():
    values = np.random.default_rng(5).random((9, 7, 3)) * [1.0, 0.5, 0.1]
    mean = (balance_gains("auto", values) * values).mean(axis=(0, 1))
    np.testing.assert_allclose(mean, luminance(values.mean(axis=(0, 1))), rtol=1e-12)


def test_auto_leaves_what_is_not_there():
    found = balance_gains("auto", np.broadcast_to([1.0, 0.5, 0.0], (2, 2, 3)))
    assert found[2] == 1.0
    assert found[0] == pytest.approx(0.5 * found[1])
    np.testing.assert_array_equal(balance_gains("auto", NOTHING), 1.0)


def test_gains_are_taken_as_they_are():
    np.testing.assert_array_equal(balance_gains((2.0, 1.0, 1.5), NOTHING), [2.0, 1.0, 1.5])
