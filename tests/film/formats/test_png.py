"""PNG files: display values and settings, 8 and 16 bits."""

import numpy as np
import PIL.Image
import pytest

from raytracer.film import load, srgb
from raytracer.film.image_file import load_encoded
from raytracer.util.errors import InputError


def test_png_holds_the_display_and_the_settings(image, tmp_path):
    image.save(tmp_path / "a.png")
    with PIL.Image.open(tmp_path / "a.png") as file:
        np.testing.assert_array_equal(np.asarray(file), image.display())
        assert {key: file.text[key] for key in image.settings} == {
            key: str(value) for key, value in image.settings.items()
        }
        assert file.text["samples"] == "64"
    np.testing.assert_array_equal(srgb.to_uint8(load(tmp_path / "a.png")), image.display())


def test_a_grey_png_of_16_bits_is_read_to_its_full_precision(tmp_path):
    codes = np.array([[0, 1, 32768, 65535]], dtype=np.uint16)
    PIL.Image.fromarray(codes).save(tmp_path / "a.png")
    np.testing.assert_allclose(load(tmp_path / "a.png")[..., 1], srgb.decode(codes / 65535), rtol=1e-12)


def test_display_values_are_read_as_they_are_held(tmp_path):
    shades = np.arange(256, dtype=np.uint8).reshape(16, 16)
    PIL.Image.fromarray(np.dstack([shades, shades[::-1], shades.T])).save(tmp_path / "a.png")
    found = load_encoded(tmp_path / "a.png")
    np.testing.assert_array_equal(found[..., 0] * 255, shades)
    np.testing.assert_array_equal(load(tmp_path / "a.png"), srgb.decode(found))
    with pytest.raises(InputError, match=r"only \.png, \.jpg, \.jpeg files hold display values"):
        load_encoded(tmp_path / "a.exr")
