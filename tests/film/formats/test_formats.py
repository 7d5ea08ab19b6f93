"""OpenEXR, JPEG, NumPy, PFM and PNG: what each holds, what other programs find in it, and what is none."""

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from raytracer.film import Image, load, load_layers, save
from raytracer.film.formats import pfm
from raytracer.film.image_file import load_encoded
from raytracer.util import srgb
from raytracer.util.errors import InputError, OutputError


def test_exr_holds_float32_variance_and_settings(image, tmp_path):
    save(image, tmp_path / "a.exr", {"depth": image.radiance[..., 0], "normal": -image.radiance})
    layers, settings = load_layers(tmp_path / "a.exr")
    single = image.radiance.astype(np.float32)
    np.testing.assert_array_equal(layers["radiance"], single)
    np.testing.assert_array_equal(layers["variance"], image.variance.astype(np.float32))
    np.testing.assert_array_equal(layers["depth"], single[..., 0])
    np.testing.assert_array_equal(layers["normal"], -single)
    assert layers.keys() == {"radiance", "variance", "depth", "normal"}
    assert settings == {**{key: str(value) for key, value in image.settings.items()}, "samples": "64"}
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), single)


def test_exr_is_what_other_programs_expect(image, tmp_path):
    image.save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert set(file.channels()) == {"R", "G", "B", "variance.R", "variance.G", "variance.B"}
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        # Rec. 709: ITU-R BT.709-6, table 1.
        np.testing.assert_allclose(
            file.header()["chromaticities"], [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329], rtol=1e-6
        )


def test_exr_holds_what_is_not_finite_or_too_large(tmp_path):
    values = np.array([[[np.nan, np.inf, -np.inf], [1e300, -1e300, 0]]])
    Image(values).save(tmp_path / "a.exr")
    expected = [[[np.nan, np.inf, -np.inf], [np.inf, -np.inf, 0]]]
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), expected)


def test_a_grey_exr_has_equal_channels(tmp_path):
    grey = np.random.default_rng(8).random((3, 4)).astype(np.float16)
    OpenEXR.File({}, {"Y": grey}).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(load(tmp_path / "a.exr"), np.repeat(grey[..., None], 3, axis=2))


def test_only_the_layers_that_are_wanted_are_read(image, tmp_path):
    save(image, tmp_path / "a.exr", {"depth": image.radiance[..., 0], "normal": -image.radiance})
    layers, settings = load_layers(tmp_path / "a.exr", {"variance", "depth"})
    assert layers.keys() == {"variance", "depth"}
    assert settings["samples"] == "64"


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


def test_npy_holds_every_bit(image, tmp_path):
    image.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(load(tmp_path / "a.npy"), image.radiance)


@pytest.mark.parametrize("array", [np.zeros(3), np.zeros((3, 4, 4)), np.zeros((3, 4, 3), complex), np.array("x")])
def test_an_npy_file_that_is_no_image(array, tmp_path):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=r"is no array of numbers of the shape|must hold real numbers"):
        load(tmp_path / "a.npy")


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 1)])
def test_an_npy_file_of_one_channel_is_grey(shape, tmp_path):
    values = np.arange(12.0).reshape(shape)
    np.save(tmp_path / "a.npy", values)
    np.testing.assert_array_equal(load(tmp_path / "a.npy"), np.repeat(values.reshape(3, 4, 1), 3, axis=2))


def test_an_npy_file_that_would_run_code(tmp_path):
    np.save(tmp_path / "a.npy", np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(InputError):
        load(tmp_path / "a.npy")


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 3), (1, 1)])
def test_what_is_encoded_is_decoded(shape):
    values = np.random.default_rng(0).normal(size=shape)
    values.flat[0] = np.inf
    assert np.array_equal(pfm.decode(pfm.encode(values)), values.astype(np.float32))


def test_rows_go_from_the_bottom_to_the_top_in_either_order_of_bytes():
    top, bottom = [1.0, 2.0], [3.0, 4.0]
    for order, scale in (("<f4", b"-1.0"), (">f4", b"1.0")):
        data = b"Pf\n2 2\n" + scale + b"\n" + np.array([bottom, top], order).tobytes()
        assert pfm.decode(data).tolist() == [top, bottom]
    assert pfm.encode(np.array([top, bottom])) == b"Pf\n2 2\n-1.0\n" + np.array([bottom, top], "<f4").tobytes()


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "is no .pfm file"),
        (b"P6\n2 2\n255\n", "is no .pfm file"),
        (b"Pf\n2 2\n-1.0\n" + bytes(15), "is truncated"),
        # As many as are claimed are not made room for.
        (b"PF\n999999999 999999999\n-1.0\n", "is truncated"),
        (b"Pf\n0 2\n-1.0\n", "without a size"),
        (b"Pf\n2 2\n0.0\n" + bytes(16), "without a size or a scale"),
        (b"Pf\n2 2\n1e999\n" + bytes(16), "without a size or a scale"),
        (b"Pf\n2 2\n--1\n" + bytes(16), "could not convert"),
    ],
)
def test_what_is_no_map_is_a_value_error(data, sentence):
    with pytest.raises(ValueError, match=sentence):
        pfm.decode(data)


def test_other_shapes_are_not_encoded():
    with pytest.raises(ValueError, match="not"):
        pfm.encode(np.zeros((2, 2, 4)))


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
    with pytest.raises(InputError, match=r"only \.png, \.jpg, \.jpeg, \.tif, \.tiff files hold display values"):
        load_encoded(tmp_path / "a.exr")
