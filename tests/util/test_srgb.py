"""The sRGB transfer function against the values and properties that IEC 61966-2-1 gives it."""

import numpy as np
import pytest

from raytracer.util import srgb


@pytest.mark.parametrize(
    ("linear", "encoded"),
    [
        (0.0, 0.0),
        (1.0, 1.0),
        (0.001, 0.01292),
        (0.0031308, 0.040449936),
        (0.5, 0.7353569830524495),
        (0.18, 0.46135612950),
    ],
)
def test_encode_gives_the_values_of_the_formula(linear, encoded):
    # 12.92 x below 0.0031308, 1.055 x^(1/2.4) - 0.055 above.
    assert srgb.encode(linear) == pytest.approx(encoded, rel=1e-9)


def test_all_codes_survive_the_way_there_and_back():
    codes = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(srgb.to_uint8(srgb.decode(codes / 255)), codes)


def test_to_uint8_changes_code_halfway_between_two():
    halfway = srgb.decode((np.arange(255) + 0.5) / 255)
    np.testing.assert_array_equal(srgb.to_uint8(halfway * (1 - 1e-9)), np.arange(255))
    np.testing.assert_array_equal(srgb.to_uint8(halfway * (1 + 1e-9)), np.arange(1, 256))


def test_to_uint8_clips_and_shows_nan_as_black():
    np.testing.assert_array_equal(srgb.to_uint8([-1, -np.inf, np.nan, 1.5, np.inf, 1]), [0, 0, 0, 255, 255, 255])
