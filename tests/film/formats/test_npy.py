"""NumPy files: every bit of the radiance, and arrays that are no image."""

import numpy as np
import pytest

from raytracer.film import load
from raytracer.util.errors import InputError


def test_npy_holds_every_bit(image, tmp_path):
    image.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(load(tmp_path / "a.npy"), image.radiance)


@pytest.mark.parametrize("array", [np.zeros((3, 4)), np.zeros((3, 4, 4)), np.zeros((3, 4, 3), complex), np.array("x")])
def test_an_npy_file_that_is_no_image(array, tmp_path):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=r"is no array of numbers of the shape|must hold real numbers"):
        load(tmp_path / "a.npy")


def test_an_npy_file_that_would_run_code(tmp_path):
    np.save(tmp_path / "a.npy", np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(InputError):
        load(tmp_path / "a.npy")
