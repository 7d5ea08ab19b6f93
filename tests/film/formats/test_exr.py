"""OpenEXR files: channels, layers, variance and settings."""

import numpy as np
import OpenEXR

from raytracer.film import Image, load, load_layers, save


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


def test_only_the_layers_that_are_wanted_are_read(image, tmp_path):
    save(image, tmp_path / "a.exr", {"depth": image.radiance[..., 0], "normal": -image.radiance})
    layers, settings = load_layers(tmp_path / "a.exr", {"variance", "depth"})
    assert layers.keys() == {"variance", "depth"}
    assert settings["samples"] == "64"
