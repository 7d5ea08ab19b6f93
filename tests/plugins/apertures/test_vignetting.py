"""Optical vignetting: the cat's eye is what two circles have in common."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from raytracer.plugins.apertures.base.vignetting import Vignetting
from tests.plugins.apertures.kernels import passed, sampled

COUNT = 1 << 18


def overlap(r, s, distance):
    """Area that two circles have in common.

    References: https://mathworld.wolfram.com/Circle-CircleIntersection.html, eq. 14.
    """
    if distance <= abs(r - s):
        return math.pi * min(r, s) ** 2
    if distance >= r + s:
        return 0.0
    first = r * r * math.acos((distance**2 + r * r - s * s) / (2.0 * distance * r))
    second = s * s * math.acos((distance**2 + s * s - r * r) / (2.0 * distance * s))
    kite = (-distance + r + s) * (distance + r - s) * (distance - r + s) * (distance + r + s)
    return first + second - 0.5 * math.sqrt(kite)


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.3, 0.5, 0.8, 0.901])
@pytest.mark.parametrize("side", [0.0, 2.0])
def test_cats_eye_has_the_area_of_two_overlapping_circles(slope, side):
    # A lens of 40 mm, a rim of 50 mm 50 mm in front of it: rays of the slope t meet it shifted by 50 mm t.
    rim = Vignetting(diameter=50.0, distance=50.0).pack()
    points = 0.02 * sampled(None, np.random.default_rng(2).random((COUNT, 2)))
    weights = passed(rim, points, slope * math.cos(side), slope * math.sin(side))
    expected = overlap(0.02, 0.025, 0.05 * slope) / (math.pi * 0.02**2)
    error = math.sqrt(expected * (1.0 - expected) / COUNT)
    assert weights.mean() == pytest.approx(expected, abs=4.0 * error)
    assert set(np.unique(weights)) <= {0.0, 1.0}
    # What is cut is on the side that the rays come from.
    cut = points[weights == 0.0]
    if 0.0 < len(cut) < COUNT:
        assert (cut @ [math.cos(side), math.sin(side)]).mean() > 0.0


def test_a_rim_smaller_than_the_lens_cuts_the_middle_too():
    points = sampled(None, np.random.default_rng(3).random((COUNT, 2)))
    weights = passed(Vignetting(diameter=1000.0, distance=1.0).pack(), points, 0.0, 0.0)
    np.testing.assert_array_equal(weights, np.hypot(*points.T) <= 0.5)


@pytest.mark.parametrize("keys", [{"diameter": 50}, {"diameter": 0, "distance": 5}, {"diameter": 5, "distance": 0}])
def test_impossible_rims_are_refused(keys):
    with pytest.raises(ValidationError):
        Vignetting.model_validate(keys)
