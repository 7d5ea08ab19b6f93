"""JPEG files: colour without subsampling, and pictures that are too large."""

import numpy as np
import PIL.Image
import pytest

from raytracer.film import Image
from raytracer.util.errors import OutputError


def test_jpeg_keeps_the_colour_of_single_pixels(tmp_path):
    # Red and blue in turns: with subsampled chroma they would become one purple.
    values = np.zeros((16, 16, 3))
    values[:, 0::2, 0] = values[:, 1::2, 2] = 1
    Image(values).save(tmp_path / "a.jpg")
    with PIL.Image.open(tmp_path / "a.jpg") as file:
        shown = np.asarray(file).astype(int)
    assert np.abs(shown - Image(values).display()).max() < 40


def test_an_image_that_the_format_cannot_hold(tmp_path):
    # JPEG counts its pixels in 16 bits.
    with pytest.raises(OutputError, match=r"a.jpg: an image of 70000 x 1 pixels cannot be written as .jpg"):
        Image(np.zeros((1, 70000, 3))).save(tmp_path / "a.jpg")
